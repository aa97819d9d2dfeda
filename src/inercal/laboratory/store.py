"""A store: made, opened, brought to the version of today.

It lies in a folder with ``store.db`` and ``objects``, or in a database by its URL. Its events are a chain of hashes, so
that whoever changes a row later is found out.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import sqlite3
from collections.abc import Iterable, Mapping
from contextlib import closing
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, Engine, func, insert, select

from inercal.foundation._files import make_folder
from inercal.foundation.addresses import holds_secret, shown_address
from inercal.foundation.errors import InputError
from inercal.laboratory.database import (
    VERSION,
    Event,
    Setting,
    check_version,
    engine_of,
    migrate,
    reading,
    version_of,
    writing,
)
from inercal.laboratory.objects import Objects

BEGIN = "0" * 64
"""Hash before the first event."""


def now() -> str:
    """The time, as a store writes it."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def digest_of(rows: Any) -> str:
    """SHA-256 of rows, as JSON in one spelling."""
    text = json.dumps(rows, ensure_ascii=False, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def hash_of(row: Mapping[str, Any]) -> str:
    """Hash of an event: of all its fields but the hash itself, the hash of the event before among them."""
    return digest_of({key: row[key] for key in ("number", "made", "kind", "subject", "digest", "previous")})


SCRUB = "scrub"
"""Kind of the event that says that secrets were taken out; ``scrub KIND`` says so of the subject of another event."""


def told(events: Iterable[Mapping[str, Any]]) -> dict[tuple[str, str], str]:
    """The digest of each kind and subject, as the last event tells it that added the rows or took a secret out."""
    return {(row["kind"].removeprefix(f"{SCRUB} "), row["subject"]): row["digest"] for row in events}


def scrubbed(events: Iterable[Mapping[str, Any]]) -> dict[tuple[str, str], str]:
    """The day on which secrets were taken out of the rows of each kind and subject."""
    return {
        (row["kind"].removeprefix(f"{SCRUB} "), row["subject"]): row["made"][:10]
        for row in events
        if row["kind"].startswith(f"{SCRUB} ")
    }


def happened(connection: Connection, kind: str, subject: str, digest: str) -> None:
    """Add an event, in a transaction that writes."""
    number = connection.execute(select(func.max(Event.number))).scalar() or 0
    previous = connection.execute(select(Event.hash).where(Event.number == number)).scalar() or BEGIN
    row = {
        "number": number + 1,
        "made": now(),
        "kind": kind,
        "subject": subject,
        "digest": digest,
        "previous": previous,
    }
    connection.execute(insert(Event).values(**row, hash=hash_of(row)))


VARIABLE = "INERCAL_STORE"
"""Variable of the environment that says where the store is."""


@dataclass(frozen=True)
class Place:
    """A store as it may be ``shown``, without secrets, and the URL of its database; ``folder`` where it is one."""

    shown: str
    url: str = field(repr=False)
    folder: Path | None

    @property
    def given(self) -> str:
        """The text by which another process finds the same place; it may hold a secret, and is shown nowhere."""
        return self.url if self.folder is None else str(self.folder.absolute())


def place_of(given: str | None, environment: Mapping[str, str] = os.environ) -> Place:
    """The place that is given, else that of the environment, else ``store`` in the user's data folder.

    Raises `InputError` for an empty text.
    """
    text = given if given is not None else environment.get(VARIABLE)
    if text is None:
        from platformdirs import user_data_path

        text = str(user_data_path("inercal", appauthor=False) / "store")
    if not text.strip() or "\0" in text:
        raise InputError("--store", f"found {text!r}, expected a folder or the URL of a database")
    if "://" in text:
        return Place(shown_address(text), text, None)
    if re.match(r"[A-Za-z][\w+.-]+:", text) and "@" in text:
        raise InputError(
            "--store", "found an address without ://, expected one such as postgresql://host/database"
        )
    folder = Path(text).expanduser()
    return Place(str(folder), f"sqlite:///{folder.absolute() / 'store.db'}", folder)


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
        A folder, or the URL of an empty PostgreSQL database; as in `inercal.laboratory.store.place_of` if absent.
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
        make_folder(place.folder)
        try:
            with closing(sqlite3.connect(place.folder / "store.db")) as database:
                database.execute("PRAGMA journal_mode=WAL")  # readers beside a writer
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
