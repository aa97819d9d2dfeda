"""Stores carried elsewhere: a copy as a folder, and the results of such a folder added to another store."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, Table, insert, select

from inercal.foundation._files import umask
from inercal.foundation.errors import InputError
from inercal.laboratory.check import check
from inercal.laboratory.database import (
    Certified,
    IssuedCertificate,
    Setting,
    SourceOf,
    StoredCoefficient,
    StoredFile,
    StoredInstrument,
    StoredReference,
    StoredResult,
    Supersession,
    Tables,
    Used,
    engine_of,
    migrate,
    numbered,
    reading,
    writing,
)
from inercal.laboratory.objects import Objects
from inercal.laboratory.store import SCRUB, Store, digest_of, happened, open_store, place_of, scrubbed, told

Progress = Callable[[int, int], None] | None


def export_store(store: Store, folder: Path, progress: Progress = None) -> Store:
    """Copy a store into a folder that is new or empty, which is a store itself: rows, chain and objects as they are.

    Raises `InputError` where the folder holds something, or cannot be made.
    """
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        if folder.exists() and any(folder.iterdir()):
            raise InputError(folder, "holds something, expected a new or empty folder")
        made = Path(tempfile.mkdtemp(dir=folder.parent, prefix=f".{folder.name}."))
    except OSError as error:
        raise InputError(folder, f"cannot be made ({error.strerror})") from error
    try:
        _copy(store, made, progress)
        made.chmod(0o777 & ~umask())
        made.replace(folder)
    except OSError as error:
        raise InputError(folder, f"cannot be made ({error.strerror})") from error
    finally:
        shutil.rmtree(made, ignore_errors=True)
    return open_store(str(folder))


def _copy(store: Store, folder: Path, progress: Progress) -> None:
    """Rows and objects into a folder."""
    engine = engine_of(place_of(str(folder)).url, str(folder))
    migrate(engine, str(folder))
    # the lock of a writer, so that all tables are of one moment
    with writing(store.engine, store.where) as source, writing(engine, str(folder)) as target:
        for table in Tables.metadata.sorted_tables:
            rows = _rows(source, table)
            if table.name == Setting.__tablename__:
                rows = [row for row in rows if row["key"] != "objects"]
            if rows:
                target.execute(insert(table), rows)
    engine.dispose()
    _copy_objects(store.objects, Objects(str(folder / "objects")), store.objects.names(), progress)


def _copy_objects(source: Objects, target: Objects, names: set[str], progress: Progress) -> None:
    """Copy objects from one store to another."""
    for done, sha256 in enumerate(sorted(names), start=1):
        target.add(source.read(sha256))
        if progress is not None:
            progress(done, len(names))


@dataclass(frozen=True)
class Imported:
    """Numbers of results, supersessions and certificates that an import added, and of results that were there."""

    results: int
    supersessions: int
    certificates: int
    there: int


def import_store(store: Store, folder: Path, progress: Progress = None) -> Imported:
    """Add what the store in a folder has and this one lacks; its chain must be whole.

    Raises `InputError` where the folder is no store, or was changed.
    """
    other = open_store(str(folder))
    checked = check(other)
    if checked.faults:
        raise InputError(folder, f"{checked.faults[0]}, expected a store as it was written")
    _copy_objects(other.objects, store.objects, other.objects.names(), progress)
    with reading(other.engine, other.where) as source:
        theirs = {table.name: _rows(source, table) for table in Tables.metadata.sorted_tables}
    with writing(store.engine, store.where) as target:
        return _merged(target, theirs, checked.head)


def _rows(connection: Connection, table: Table) -> list[dict[str, Any]]:
    """All rows of a table."""
    return [dict(row) for row in connection.execute(select(table)).mappings()]


def _merged(target: Connection, theirs: dict[str, list[dict[str, Any]]], head: str) -> Imported:
    """The rows of another store that are new, added with an event each."""
    numbers = {row["id"]: numbered(target, StoredInstrument, row) for row in theirs["instrument"]}
    references = {row["id"]: numbered(target, StoredReference, row) for row in theirs["reference"]}
    files = set(target.execute(select(StoredFile.sha256)).scalars())
    _insert(target, StoredFile, [row for row in theirs["recording"] if row["sha256"] not in files])
    there = set(target.execute(select(StoredResult.id)).scalars())
    new = [row for row in theirs["result"] if row["id"] not in there]
    _insert(
        target, StoredResult, [{**row, "instrument_id": numbers.get(row["instrument_id"])} for row in new]
    )
    names = {row["id"] for row in new}
    for table in (SourceOf, StoredCoefficient):
        _insert(target, table, [row for row in theirs[table.__tablename__] if row["result_id"] in names])
    used = [{**row, "reference_id": references[row["reference_id"]]} for row in theirs["used"]]
    _insert(target, Used, [row for row in used if row["result_id"] in names])
    events = sorted(theirs["event"], key=lambda row: row["number"])
    tells, freed = told(events), scrubbed(events)

    def happened_there(kind: str, subject: str) -> None:
        happened(target, kind, subject, tells[kind, subject])
        if (kind, subject) in freed:
            happened(target, f"{SCRUB} {kind}", subject, tells[kind, subject])

    for row in new:
        happened_there("keep", row["id"])
    superseded = set(target.execute(select(Supersession.result_id)).scalars())
    later = [row for row in theirs["supersession"] if row["result_id"] not in superseded]
    _insert(target, Supersession, later)
    for row in later:
        happened_there("supersede", row["result_id"])
    issued = set(target.execute(select(IssuedCertificate.number)).scalars())
    certificates = [row for row in theirs["certificate"] if row["number"] not in issued]
    certificates.sort(key=lambda row: row["issued"])
    _insert(target, IssuedCertificate, certificates)
    fresh = {row["number"] for row in certificates}
    _insert(target, Certified, [row for row in theirs["certified"] if row["number"] in fresh])
    for row in certificates:
        happened_there("certificate", row["number"])
    happened(target, "import", head, digest_of([len(new), len(later), len(certificates)]))
    return Imported(len(new), len(later), len(certificates), len(theirs["result"]) - len(new))


def _insert(connection: Connection, table: type[Tables], rows: list[dict[str, Any]]) -> None:
    """Insert rows into a table."""
    if rows:
        connection.execute(insert(table), rows)
