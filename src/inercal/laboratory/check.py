"""A store checked to be as it was written: chain, rows, objects, foreign keys."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection, select, text

from inercal.foundation.errors import InputError
from inercal.laboratory.catalog import SHORT
from inercal.laboratory.database import (
    Certified,
    Event,
    IssuedCertificate,
    SourceOf,
    StoredCoefficient,
    StoredFile,
    StoredInstrument,
    StoredReference,
    StoredResult,
    Supersession,
    Used,
    reading,
)
from inercal.laboratory.keep import StoredRows, id_of
from inercal.laboratory.store import BEGIN, Store, digest_of, hash_of, scrubbed, told


@dataclass(frozen=True)
class Checked:
    """Findings of a check: ``faults``, a sentence each, and ``notes`` that are no faults; the ``head`` of the chain."""

    faults: tuple[str, ...]
    notes: tuple[str, ...]
    events: int
    results: int
    objects: int
    head: str


_NAMES = {"keep": "result", "supersede": "supersession of", "certificate": "certificate"}
"""The rows that an event of each kind tells of, in words."""


def check(store: Store, progress: Callable[[int, int], None] | None = None) -> Checked:
    """Walk chain, rows, objects and foreign keys, and name what was changed, missing or added."""
    faults: list[str] = []
    with reading(store.engine, store.where) as connection:
        events = [dict(row) for row in connection.execute(select(Event).order_by(Event.number)).mappings()]
        faults += _chain(events)
        results = _results(connection)
        for kind, digests in digests_of(connection).items():
            faults += _told(kind, digests, events)
        recordings = connection.execute(select(StoredFile)).mappings().all()
        pages = [
            sha256
            for row in connection.execute(select(IssuedCertificate.object, IssuedCertificate.page))
            for sha256 in row
            if sha256 is not None
        ]
        faults += _foreign_keys(connection)
    wanted = {row["sha256"]: f"file {row['sha256'][:SHORT]}" for row in recordings if row["place"] is None}
    wanted |= {sha256: f"certificate {sha256[:SHORT]}" for sha256 in pages}
    for identity, rows in results.items():
        if rows.result["report"] is not None:
            wanted[rows.result["report"]] = f"report of {identity[:SHORT]}"
    total = len(wanted) + len(results)
    for done, (sha256, what) in enumerate(wanted.items()):
        faults += _object(store, sha256, what)
        if progress is not None:
            progress(done + 1, total)
    freed = scrubbed(events)
    for done, (identity, rows) in enumerate(results.items()):
        faults += _result_object(store, identity, rows.result["object"], ("keep", identity) in freed)
        if progress is not None:
            progress(len(wanted) + done + 1, total)
    there = store.objects.names()
    loose = there - wanted.keys() - {rows.result["object"] for rows in results.values()}
    notes = [
        f"object {sha256[:SHORT]}: no result has it, as a keep that was cut short leaves one"
        for sha256 in sorted(loose)
    ]
    notes += [
        f"{_NAMES[kind]} {subject[:SHORT]}: secrets were taken out on {day}"
        for (kind, subject), day in freed.items()
    ]
    head = events[-1]["hash"] if events else BEGIN
    return Checked(tuple(faults), tuple(notes), len(events), len(results), len(there), head)


def _chain(events: list[dict[str, Any]]) -> list[str]:
    """Faults of the chain itself."""
    faults, previous = [], BEGIN
    for expected, row in enumerate(events, start=1):
        if row["number"] != expected:
            faults.append(f"event {expected}: missing, the next is {row['number']}")
            return faults
        if hash_of(row) != row["hash"]:
            faults.append(f"event {expected} ({row['kind']} {str(row['subject'])[:SHORT]}): was changed")
        elif row["previous"] != previous:
            faults.append(f"event {expected}: does not follow the one before, which was changed")
        previous = row["hash"]
    return faults


def digests_of(connection: Connection) -> dict[str, dict[str, str]]:
    """Digests of all rows that an event tells of, by its kind and subject."""
    superseded = connection.execute(select(Supersession)).mappings()
    return {
        "keep": {identity: rows.digest for identity, rows in _results(connection).items()},
        "supersede": {row["result_id"]: digest_of(dict(row)) for row in superseded},
        "certificate": _certificates(connection),
    }


def _results(connection: Connection) -> dict[str, StoredRows]:
    """The rows of all results."""
    names = {
        row["id"]: (row["maker"], row["model"], row["serial"])
        for row in connection.execute(select(StoredInstrument)).mappings()
    }
    sources: dict[str, list[tuple[str, str]]] = {}
    for row in connection.execute(select(SourceOf).order_by(SourceOf.position)).mappings():
        sources.setdefault(row["result_id"], []).append((row["sha256"], row["path"]))
    coefficients: dict[str, list[dict[str, Any]]] = {}
    for row in connection.execute(select(StoredCoefficient).order_by(StoredCoefficient.position)).mappings():
        own = {key: value for key, value in row.items() if key not in ("result_id", "position")}
        coefficients.setdefault(row["result_id"], []).append(own)
    used: dict[str, list[dict[str, str]]] = {}
    query = select(
        Used.result_id,
        StoredReference.name,
        StoredReference.serial,
        StoredReference.certificate,
        StoredReference.valid_until,
    )
    for row in connection.execute(
        query.join(StoredReference, StoredReference.id == Used.reference_id)
    ).mappings():
        used.setdefault(row["result_id"], []).append({k: v for k, v in row.items() if k != "result_id"})
    found = {}
    for row in connection.execute(select(StoredResult)).mappings():
        identity = row["id"]
        own = {key: value for key, value in row.items() if key != "instrument_id"}
        instrument = () if row["instrument_id"] is None else names.get(row["instrument_id"], ("",))
        found[identity] = StoredRows(
            own,
            instrument,
            tuple(sources.get(identity, ())),
            tuple(coefficients.get(identity, ())),
            tuple(sorted(used.get(identity, ()), key=lambda row: tuple(row.values()))),
        )
    return found


def _certificates(connection: Connection) -> dict[str, str]:
    """Digests of the rows of certificates, by number."""
    stated: dict[str, list[str]] = {}
    for row in connection.execute(select(Certified).order_by(Certified.result_id)).mappings():
        stated.setdefault(row["number"], []).append(row["result_id"])
    return {
        row["number"]: digest_of([dict(row), stated.get(row["number"], [])])
        for row in connection.execute(select(IssuedCertificate)).mappings()
    }


def _told(kind: str, digests: dict[str, str], events: list[dict[str, Any]]) -> list[str]:
    """Faults of rows whose event is missing, or says something else, and of events whose rows are missing."""
    what = _NAMES[kind]
    known = {subject: digest for (of, subject), digest in told(events).items() if of == kind}
    faults = [
        f"{what} {str(subject)[:SHORT]}: missing, an event tells of it"
        for subject in known.keys() - digests.keys()
    ]
    for subject, digest in digests.items():
        if subject not in known:
            faults.append(f"{what} {str(subject)[:SHORT]}: added by hand, no event tells of it")
        elif known[subject] != digest:
            faults.append(f"{what} {str(subject)[:SHORT]}: its rows were changed")
    return sorted(faults)


def _object(store: Store, sha256: str, what: str) -> list[str]:
    """The fault of an object, if it has one."""
    try:
        for _ in store.objects.pieces(sha256):
            pass
    except InputError as error:
        return [f"{what}: {error}"]
    return []


def _result_object(store: Store, identity: str, sha256: str, freed: bool) -> list[str]:
    """The fault of the JSON of a result, if it has one; ``freed`` of a secret, it may say less than its identity."""
    try:
        data = json.loads(store.objects.read(sha256))
    except InputError as error:
        return [f"result {identity[:SHORT]}: {error}"]
    except ValueError:
        return [f"result {identity[:SHORT]}: its object is no JSON"]
    if id_of(data) != identity and not freed:
        return [f"result {identity[:SHORT]}: its object says something else"]
    return []


def _foreign_keys(connection: Connection) -> list[str]:
    """Rows that point to none; PostgreSQL never lets one in."""
    if connection.dialect.name != "sqlite":
        return []
    rows = connection.execute(text("PRAGMA foreign_key_check")).all()
    return [f"table {row[0]}: row {row[1]} points to a missing row of {row[2]}" for row in rows]
