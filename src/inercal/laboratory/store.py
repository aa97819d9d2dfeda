"""A store: made, opened, brought to the version of today."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from dataclasses import dataclass, field

from sqlalchemy import Engine, insert, select

from inercal.foundation.addresses import holds_secret
from inercal.foundation.errors import InputError
from inercal.laboratory.chain import digest_of, happened
from inercal.laboratory.database import (
    VERSION,
    check_version,
    engine_of,
    migrate,
    reading,
    version_of,
    writing,
)
from inercal.laboratory.objects import Objects
from inercal.laboratory.place import Place, place_of
from inercal.laboratory.tables import Setting


@dataclass(frozen=True)
class Store:
    """An open store: its place, the engine of its database, and its objects."""

    place: Place
    engine: Engine = field(repr=False)
    objects: Objects

    @property
    def where(self) -> str:
        """The store in words."""
        return self.place.shown


def make_store(given: str | None = None, objects: str | None = None) -> Store:
    """Make an empty store.

    Parameters
    ----------
    given : str, optional
        A folder, or the URL of an empty PostgreSQL database; as in `inercal.laboratory.place.place_of` if absent.
    objects : str, optional
        Folder or URL of the objects; within the folder if absent. A database needs it, and it is written there.

    Raises
    ------
    InputError
        There is a store already, the folder cannot be made, or the place of objects is missing or holds a secret,
        which would be kept with it.
    """
    place = place_of(given)
    if objects is not None and holds_secret(objects):
        raise InputError(
            "--objects",
            f"found a secret in {objects}, which the store would keep, expected an address without, and the secret in "
            "the environment (AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, FSSPEC_S3_KEY and FSSPEC_S3_SECRET)",
        )
    if place.folder is None and objects is None:
        raise InputError("--objects", f"missing, expected the folder or URL for the objects of {place.shown}")
    if place.folder is not None:
        try:
            place.folder.mkdir(parents=True, exist_ok=True)
            with closing(sqlite3.connect(place.folder / "store.db")) as database:
                database.execute("PRAGMA journal_mode=WAL")  # readers beside a writer
        except OSError as error:
            raise InputError(place.folder, f"cannot be made ({error.strerror})") from error
        except sqlite3.Error as error:
            raise InputError(place.folder, f"cannot hold a store ({error})") from error
    engine = engine_of(place.url, place.shown)
    if version_of(engine, place.shown) is not None:
        raise InputError(place.shown, "holds a store already, expected a new place")
    migrate(engine, place.shown)
    with writing(engine, place.shown) as connection:
        if objects is not None:
            connection.execute(insert(Setting).values(key="objects", value=objects))
        happened(connection, "init", place.shown, digest_of([objects]))
    return _opened(place, engine)


def open_store(given: str | None = None) -> Store:
    """Open a store; parameters as of `make_store`.

    Raises `InputError` where there is none, its version is another, or the database cannot be reached.
    """
    place, engine = _found(given)
    check_version(engine, place.shown)
    return _opened(place, engine)


def upgrade_store(given: str | None = None) -> tuple[Store, str, str]:
    """Bring a store to the version of today: the store, its version before, and now.

    Raises `InputError` as `open_store`, also for a store of a newer inercal.
    """
    place, engine = _found(given)
    before = version_of(engine, place.shown)
    if before is None or before >= VERSION:
        check_version(engine, place.shown)
        return _opened(place, engine), VERSION, VERSION
    migrate(engine, place.shown)
    with writing(engine, place.shown) as connection:
        happened(connection, "upgrade", VERSION, digest_of([before, VERSION]))
    return _opened(place, engine), before, VERSION


def _found(given: str | None) -> tuple[Place, Engine]:
    """The place and engine of a store; raises `InputError` for a folder without one."""
    place = place_of(given)
    if place.folder is not None and not (place.folder / "store.db").is_file():
        raise InputError(place.shown, "holds no store, expected one: `inercal store init` makes it")
    return place, engine_of(place.url, place.shown)


def _opened(place: Place, engine: Engine) -> Store:
    """The store, with the objects at the address in its settings."""
    with reading(engine, place.shown) as connection:
        objects = connection.execute(select(Setting.value).where(Setting.key == "objects")).scalar()
    if objects is None:
        if place.folder is None:
            raise InputError(
                place.shown, "does not say where its objects are, expected the setting 'objects'"
            )
        objects = str(place.folder / "objects")
    return Store(place, engine, Objects(objects))
