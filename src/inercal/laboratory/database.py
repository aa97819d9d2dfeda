"""The database of a store: its tables, in SQLite in a folder or in PostgreSQL by its URL.

Times are UTC, ISO 8601 texts. Values are in the units of the result (SI). Objects are named by the SHA-256 of their
bytes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from sqlalchemy import (
    REAL,
    BigInteger,
    Connection,
    Double,
    Engine,
    ForeignKey,
    Integer,
    Text,
    UniqueConstraint,
    create_engine,
    event,
    insert,
    select,
    text,
)
from sqlalchemy.engine import make_url
from sqlalchemy.exc import ArgumentError, DBAPIError, SQLAlchemyError
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column
from sqlalchemy.pool import NullPool

from inercal.foundation.addresses import hidden_in
from inercal.foundation.errors import InputError, MissingExtraError

if TYPE_CHECKING:
    from sqlalchemy import URL


MaybeNumber = Annotated[float | None, mapped_column(Double().with_variant(REAL(), "sqlite"))]
Words = Annotated[str, mapped_column(Text)]
MaybeWords = Annotated[str | None, mapped_column(Text)]


class Tables(DeclarativeBase):
    """The tables."""

    __table_args__: object = {"sqlite_strict": True}


class Setting(Tables):
    """A setting of the store itself: ``objects``, where they are."""

    __tablename__ = "setting"
    key: Mapped[Words] = mapped_column(primary_key=True)
    value: Mapped[Words]


NAMES = {
    "instrument": ("maker", "model", "serial"),
    "reference": ("name", "serial", "certificate", "valid_until"),
}
"""Columns by which the rows of a table are told apart."""


class StoredInstrument(Tables):
    """An instrument that is calibrated."""

    __tablename__ = "instrument"
    __table_args__ = (UniqueConstraint(*NAMES["instrument"]), {"sqlite_strict": True})
    id: Mapped[int] = mapped_column(primary_key=True)
    maker: Mapped[Words]
    model: Mapped[Words]
    serial: Mapped[Words]
    kind: Mapped[Words]
    owner: Mapped[Words]
    notes: Mapped[Words]


class StoredReference(Tables):
    """A standard, table or rig that a calibration used: its certificate, and until when that is valid."""

    __tablename__ = "reference"
    __table_args__ = (
        UniqueConstraint(*NAMES["reference"]),
        {"sqlite_strict": True},
    )
    id: Mapped[int] = mapped_column(primary_key=True)
    name: Mapped[Words]
    serial: Mapped[Words]
    certificate: Mapped[Words]
    valid_until: Mapped[Words]


class StoredFile(Tables):
    """A file that results rest on, a recording, map or study: ``place`` is its path where it is kept by reference."""

    __tablename__ = "recording"
    sha256: Mapped[Words] = mapped_column(primary_key=True)
    bytes: Mapped[int | None] = mapped_column(BigInteger().with_variant(Integer(), "sqlite"))
    place: Mapped[MaybeWords]


class StoredResult(Tables):
    """A result: ``id`` is the SHA-256 of what it says, times of computing and the command line apart.

    ``object`` is its JSON, ``report`` its page; ``program`` the SHA-256 of the sources that made it, where known.
    """

    __tablename__ = "result"
    id: Mapped[Words] = mapped_column(primary_key=True)
    object: Mapped[Words]
    report: Mapped[MaybeWords]
    command: Mapped[Words]
    version: Mapped[Words]
    program: Mapped[Words]
    instrument_id: Mapped[int | None] = mapped_column(ForeignKey("instrument.id"), index=True)
    made: Mapped[Words]
    measured: Mapped[Words]
    operator: Mapped[Words]
    status: Mapped[Words]
    message: Mapped[Words]


class SourceOf(Tables):
    """A file that a result rests on, under the path by which the command knew it."""

    __tablename__ = "source"
    result_id: Mapped[Words] = mapped_column(ForeignKey("result.id"), primary_key=True)
    position: Mapped[int] = mapped_column(primary_key=True)
    sha256: Mapped[Words] = mapped_column(ForeignKey("recording.sha256"), index=True)
    path: Mapped[Words]


class Used(Tables):
    """A reference that a result used."""

    __tablename__ = "used"
    result_id: Mapped[Words] = mapped_column(ForeignKey("result.id"), primary_key=True)
    reference_id: Mapped[int] = mapped_column(ForeignKey("reference.id"), primary_key=True)


class StoredCoefficient(Tables):
    """A coefficient of a result: value, standard and expanded uncertainty, coverage factor; ``dof`` None is infinite.

    ``common`` is the part of u that repeat runs have in common, where the result tells it apart.
    """

    __tablename__ = "coefficient"
    result_id: Mapped[Words] = mapped_column(ForeignKey("result.id"), primary_key=True)
    position: Mapped[int] = mapped_column(primary_key=True)
    name: Mapped[Words] = mapped_column(index=True)
    value: Mapped[MaybeNumber]
    u: Mapped[MaybeNumber]
    expanded: Mapped[MaybeNumber]
    k: Mapped[MaybeNumber]
    dof: Mapped[MaybeNumber]
    unit: Mapped[Words]
    common: Mapped[MaybeNumber]


class Supersession(Tables):
    """A result that another takes the place of, and why."""

    __tablename__ = "supersession"
    result_id: Mapped[Words] = mapped_column(ForeignKey("result.id"), primary_key=True)
    by_id: Mapped[Words] = mapped_column(ForeignKey("result.id"))
    reason: Mapped[Words]
    made: Mapped[Words]


class Event(Tables):
    """Something that was done to the store, in order; ``hash`` covers the row and the hash of the row before."""

    __tablename__ = "event"
    number: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    made: Mapped[Words]
    kind: Mapped[Words]
    subject: Mapped[Words]
    digest: Mapped[Words]
    previous: Mapped[Words]
    hash: Mapped[Words]


class IssuedCertificate(Tables):
    """A certificate that was issued: its XML, its page, and the number of the one that it supersedes."""

    __tablename__ = "certificate"
    number: Mapped[Words] = mapped_column(primary_key=True)
    object: Mapped[Words]
    page: Mapped[MaybeWords]
    issued: Mapped[Words]
    supersedes: Mapped[str | None] = mapped_column(Text, ForeignKey("certificate.number"))


class Certified(Tables):
    """A result that a certificate states."""

    __tablename__ = "certified"
    number: Mapped[Words] = mapped_column(ForeignKey("certificate.number"), primary_key=True)
    result_id: Mapped[Words] = mapped_column(ForeignKey("result.id"), primary_key=True)


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


def migrate(engine: Engine, where: str) -> None:
    """Bring the tables to a version, all steps or none; raises `InputError`."""
    from alembic import command
    from alembic.config import Config

    config = Config()
    config.set_main_option("script_location", str(Path(__file__).parent / "migrations"))
    with writing(engine, where) as connection:
        config.attributes["connection"] = connection
        command.upgrade(config, VERSION)


def numbered(
    connection: Connection, table: type[StoredInstrument | StoredReference], row: Mapping[str, Any]
) -> int:
    """The primary key of an instrument or a reference with the names of ``row``; a new one is added."""
    columns = table.__table__.columns
    same = [columns[key] == row[key] for key in NAMES[table.__tablename__]]
    number: int | None = connection.execute(select(columns["id"]).where(*same)).scalar()
    if number is None:
        own = {key: value for key, value in row.items() if key != "id"}
        number = connection.execute(insert(table).values(**own).returning(columns["id"])).scalar_one()
    return number
