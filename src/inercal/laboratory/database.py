"""Opening the database of a store: SQLite in a folder, or PostgreSQL by its URL."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sqlalchemy import Connection, Engine, create_engine, event, text
from sqlalchemy.engine import make_url
from sqlalchemy.exc import ArgumentError, DBAPIError, SQLAlchemyError
from sqlalchemy.pool import NullPool

from inercal.foundation.addresses import hidden_in
from inercal.foundation.errors import InputError, MissingExtraError

if TYPE_CHECKING:
    from sqlalchemy import URL

VERSION = "0002"
"""Version of the tables that this program reads and writes: the last of ``migrations/versions``."""

_WAIT = 300.0
"""Time [s] that a writer waits for others."""

_LOCK = 0x696E657263616C
"""Key of the lock that a writer to PostgreSQL holds until its transaction ends: one chain, one writer at a time."""


def engine_of(url: str, where: str) -> Engine:
    """The engine of a database; raises `InputError`, naming ``where``, for a URL of another kind."""
    parsed = _parsed(url, where)
    options: dict[str, Any] = {"poolclass": NullPool}  # a connection for each transaction: none is left open
    if parsed.get_backend_name() == "sqlite":
        options["connect_args"] = {"timeout": _WAIT}
    try:
        engine = create_engine(parsed, **options)
    except ModuleNotFoundError as error:
        raise MissingExtraError("a store in PostgreSQL", "postgresql") from error
    if engine.dialect.name == "sqlite":
        event.listen(engine, "connect", _settle)
        event.listen(engine, "begin", _begin)
    return engine


def _parsed(url: str, where: str) -> URL:
    """A URL of SQLite or PostgreSQL, by psycopg."""
    try:
        parsed = make_url(url)
        kind = parsed.get_backend_name()
    except (ArgumentError, SQLAlchemyError, ValueError) as error:
        raise InputError(
            where, "is not the URL of a database, expected postgresql://... or a folder"
        ) from error
    if kind == "sqlite" and (
        parsed.drivername != "sqlite" or parsed.username or parsed.password or parsed.host
    ):
        raise InputError(
            where, "found a driver, login or host of SQLite, expected a folder or postgresql://..."
        )
    if kind not in ("sqlite", "postgresql"):
        raise InputError(where, f"found a database {kind!r}, expected postgresql://... or a folder")
    return parsed.set(drivername="postgresql+psycopg") if kind == "postgresql" else parsed


def _settle(connection: Any, _: object) -> None:
    """Readers beside a writer, foreign keys, and transactions begun by `_begin` alone."""
    connection.isolation_level = None
    for pragma in ("foreign_keys=ON", "synchronous=FULL", "secure_delete=ON"):
        connection.execute(f"PRAGMA {pragma}")


def _begin(connection: Connection) -> None:
    """Begin a transaction; a writer takes the lock at once, so that what it has read is still true."""
    writing = connection.get_execution_options().get("writing", False)
    connection.exec_driver_sql("BEGIN IMMEDIATE" if writing else "BEGIN")


@contextmanager
def reading(engine: Engine, where: str) -> Iterator[Connection]:
    """A transaction that reads; raises `InputError` where the database cannot be reached or read."""
    with _refusing(engine, where), engine.connect() as connection:
        yield connection


@contextmanager
def writing(engine: Engine, where: str) -> Iterator[Connection]:
    """A transaction that writes, one at a time over all processes: whole or absent.

    Raises `InputError` where the database cannot be reached or written.
    """
    with _refusing(engine, where), engine.execution_options(writing=True).begin() as connection:
        if engine.dialect.name == "postgresql":
            connection.execute(text("SELECT pg_advisory_xact_lock(:key)"), {"key": _LOCK})
        yield connection


@contextmanager
def _refusing(engine: Engine, where: str) -> Iterator[None]:
    """Turn an error of the database into one sentence without the secrets of its address."""
    try:
        yield
    except DBAPIError as error:
        address = engine.url.render_as_string(hide_password=False)
        said = " ".join(hidden_in(str(error.orig), address).split())
        raise InputError(where, f"the database says: {said[:300]}") from error
    except UnicodeDecodeError as error:
        raise InputError(where, "the database holds text that is not UTF-8: its file was damaged") from error


def vacuum(engine: Engine, where: str) -> None:
    """Let nothing that was deleted stay in the files of the database; raises `InputError` where it refuses."""
    connection = engine.raw_connection()
    try:
        with _refusing(engine, where):
            if engine.dialect.name == "postgresql":
                connection.driver_connection.autocommit = True  # type: ignore[union-attr]
            cursor = connection.cursor()
            for statement in _VACUUM[engine.dialect.name]:
                cursor.execute(statement)
            cursor.close()
    finally:
        connection.close()


_VACUUM = {
    "sqlite": ("VACUUM", "PRAGMA wal_checkpoint(TRUNCATE)"),
    "postgresql": ("VACUUM FULL",),
}


def version_of(engine: Engine, where: str) -> str | None:
    """The version of the tables; None where there are none of inercal's."""
    with reading(engine, where) as connection:
        if not engine.dialect.has_table(connection, "alembic_version"):
            return None
        found = connection.execute(text("SELECT version_num FROM alembic_version")).scalar()
    return None if found is None else str(found)


def check_version(engine: Engine, where: str) -> None:
    """Refuse a database of another version; raises `InputError`, which says what to do."""
    found = version_of(engine, where)
    if found is None:
        raise InputError(where, "holds no store, expected one that `inercal store init` made")
    if found < VERSION:
        raise InputError(
            where,
            f"is a store of version {found}, expected {VERSION}: `inercal store upgrade` brings it there",
        )
    if found > VERSION:
        raise InputError(
            where, f"is a store of version {found}, made by a newer inercal, expected at most {VERSION}"
        )


def migrate(engine: Engine, where: str, version: str = VERSION) -> None:
    """Bring the tables to a version, all steps or none; raises `InputError`."""
    from alembic import command
    from alembic.config import Config

    config = Config()
    config.set_main_option("script_location", str(Path(__file__).parent / "migrations"))
    with writing(engine, where) as connection:
        config.attributes["connection"] = connection
        command.upgrade(config, version)
