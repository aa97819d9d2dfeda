"""Secrets taken out of a store that inercal 0.2.0 or earlier wrote passwords into, with an event that says so.

What held one is written anew with ``***`` in its place: results, pages and certificates among the objects, texts in
rows, the address of the objects. The hash of the chain before, its old head, is the subject of the event `SCRUB`: one
that was noted elsewhere is still found in the store.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection, Table, Text, delete, select, update

from inercal.foundation.addresses import holds_secret, without_login, without_secrets
from inercal.foundation.errors import InputError
from inercal.foundation.results.files import plain_objects
from inercal.laboratory.check import check, digests_of
from inercal.laboratory.database import (
    NAMES,
    Event,
    IssuedCertificate,
    Setting,
    StoredFile,
    StoredReference,
    StoredResult,
    Tables,
    Used,
    vacuum,
    writing,
)
from inercal.laboratory.migrations.append_only import suspended
from inercal.laboratory.objects import Objects
from inercal.laboratory.store import BEGIN, SCRUB, Store, digest_of, happened, hash_of

_APPEND_ONLY = (
    "recording",
    "result",
    "source",
    "used",
    "coefficient",
    "supersession",
    "event",
    "certificate",
    "certified",
)


_SMALL = 1 << 20
"""Bytes from which on a file is taken for a recording, which holds no address."""


@dataclass(frozen=True)
class Scrubbed:
    """Parts of a store that were written anew: subjects of events by kind, objects, texts in rows.

    ``files``: SHA-256 of those that hold a secret and stay, for results rest on them. ``before``: the old head."""

    subjects: Mapping[str, tuple[str, ...]]
    objects: int
    texts: int
    files: tuple[str, ...]
    before: str
    head: str


def scrub(store: Store) -> Scrubbed:
    """Take the secrets of all addresses out of a store, and say so in its chain; nothing is done where there are none.

    Raises `InputError` where the store is not as it was written, or its objects cannot be reached without the secret in
    their address.
    """
    faults = check(store).faults
    if faults:
        raise InputError(store.where, f"{faults[0]}, expected a store as it was written")
    place = _place_of_objects(store)
    with writing(store.engine, store.where) as connection, suspended(connection, _APPEND_ONLY):
        told = digests_of(connection)
        replaced = dict(_replaced(connection, store.objects))
        texts = _clean_rows(connection)
        if place is not None:
            connection.execute(update(Setting).where(Setting.key == "objects").values(value=place))
            texts += 1
        before, events = _clean_chain(connection)
        texts += events
        now = digests_of(connection)
        subjects = {
            kind: tuple(sorted(subject for subject in now[kind] if now[kind][subject] != told[kind][subject]))
            for kind in now
        }
        for kind, changed in subjects.items():
            for subject in changed:
                happened(connection, f"{SCRUB} {kind}", subject, now[kind][subject])
        if replaced or texts:
            happened(connection, SCRUB, before, digest_of([sorted(replaced.items()), texts]))
        loose, files = _others(connection, store.objects)
        head = connection.execute(select(Event.hash).order_by(Event.number.desc())).scalars().first() or BEGIN
    objects = store.objects if place is None else Objects(place)
    for sha256 in {*replaced, *loose} - {*replaced.values(), *files}:
        objects.remove(sha256)
    vacuum(store.engine, store.where)  # always: one before may have been cut short of it
    return Scrubbed(subjects, len(replaced), texts, tuple(files), before, head)


def _place_of_objects(store: Store) -> str | None:
    """The address of the objects without its secret, None without a secret; raises `InputError` out of reach."""
    if not holds_secret(store.objects.where):
        return None
    place = without_login(store.objects.where)
    try:
        there = Objects(place).names()
    except Exception as error:  # each file system has errors of its own
        raise InputError(place, f"cannot be reached ({type(error).__name__}), {_ELSEWHERE}") from error
    if there != store.objects.names():
        raise InputError(place, f"holds other objects than with the secret in its address, {_ELSEWHERE}")
    return place


_ELSEWHERE = (
    "expected the secret of the objects in the environment (AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, "
    "FSSPEC_S3_KEY and FSSPEC_S3_SECRET)"
)


def _replaced(connection: Connection, objects: Objects) -> Iterator[tuple[str, str]]:
    """Write objects with a secret anew, and let rows point to the new ones: old and new SHA-256."""
    for table, column, cleaned in (
        (StoredResult, "object", _result),
        (StoredResult, "report", _page),
        (IssuedCertificate, "object", _certificate),
        (IssuedCertificate, "page", _page),
    ):
        own = table.__table__.columns[column]
        for sha256 in set(connection.execute(select(own).where(own.is_not(None))).scalars()):
            content = objects.read(sha256)
            clean = cleaned(content)
            if clean != content:
                new = objects.add(clean)
                connection.execute(update(table).where(own == sha256).values({column: new}))
                yield sha256, new


def _result(content: bytes) -> bytes:
    """The JSON of a result without secrets."""
    data = json.loads(content)
    clean = plain_objects(data)
    if clean == data:
        return content
    return (json.dumps(clean, indent=1, ensure_ascii=False) + "\n").encode()


def _page(content: bytes) -> bytes:
    """A page without secrets."""
    return without_secrets(content.decode(errors="surrogateescape")).encode(errors="surrogateescape")


def _certificate(content: bytes) -> bytes:
    """A certificate without secrets in its texts and in the files inside it."""
    from lxml import etree

    from inercal.laboratory.certificate.elements import DCC, tree_of

    root, changed = tree_of(content, "certificate"), False
    for element in root.iter(f"{{{DCC}}}*"):
        old = element.text or ""
        if element.tag == f"{{{DCC}}}uniqueIdentifier":
            continue  # its number, the key of its row
        if element.tag == f"{{{DCC}}}dataBase64":
            inner = base64.b64decode(old)
            clean = _result(inner) if inner[:1] == b"{" else _page(inner)
            new = base64.b64encode(clean).decode() if clean != inner else old
        else:
            new = without_secrets(old)
        if new != old:
            element.text, changed = new, True
    if not changed:
        return content
    made: bytes = etree.tostring(root, xml_declaration=True, encoding="UTF-8")
    return made + b"\n"


def _clean_rows(connection: Connection) -> int:
    """Write the texts in rows without secrets; how many there were."""
    count = 0
    for table in Tables.metadata.sorted_tables:
        key = table.primary_key.columns.values()
        columns = [
            column
            for column in table.columns
            if isinstance(column.type, Text) and column not in key and not column.foreign_keys
        ]
        if table.name in (Event.__tablename__, Setting.__tablename__) or not columns:
            continue
        for row in connection.execute(select(*key, *columns)).mappings():
            clean = {
                column.name: without_secrets(row[column.name])
                for column in columns
                if row[column.name] is not None and without_secrets(row[column.name]) != row[column.name]
            }
            if clean:
                same = [column == row[column.name] for column in key]
                if not _joined(connection, table, {**row, **clean}):
                    connection.execute(update(table).where(*same).values(clean))
                count += len(clean)
    return count


def _joined(connection: Connection, table: Table, row: Mapping[str, Any]) -> bool:
    """True for a row of instruments or references that is there already without secrets; results point to it then."""
    if table.name not in _POINTERS:
        return False
    pointer = _POINTERS[table.name]
    same = [table.c[name] == row[name] for name in NAMES[table.name]]
    there = connection.execute(select(table.c.id).where(*same, table.c.id != row["id"])).scalar()
    if there is None:
        return False
    if table.name == StoredReference.__tablename__:  # a result that used both has it once
        twice = select(Used.result_id).where(Used.reference_id == there)
        connection.execute(delete(Used).where(Used.reference_id == row["id"], Used.result_id.in_(twice)))
    connection.execute(update(pointer.table).where(pointer == row["id"]).values({pointer.name: there}))
    connection.execute(delete(table).where(table.c.id == row["id"]))
    return True


_POINTERS: Mapping[str, Any] = {
    "instrument": StoredResult.__table__.c.instrument_id,
    "reference": Used.__table__.c.reference_id,
}
"""The column that points to rows of a table."""


_KEYED = ("keep", "supersede", "certificate")
"""Kinds of events whose subject is the key of a row."""


def _clean_chain(connection: Connection) -> tuple[str, int]:
    """The old head of the chain, which is written anew from the first event on that holds a secret; how many do."""
    previous, old, count = BEGIN, BEGIN, 0
    for row in map(dict, connection.execute(select(Event).order_by(Event.number)).mappings().all()):
        old = row["hash"]
        subject = row["subject"] if row["kind"].split()[-1] in _KEYED else without_secrets(row["subject"])
        clean = {**row, "subject": subject, "previous": previous}
        clean["hash"] = previous = hash_of(clean)
        count += clean["subject"] != row["subject"]
        if clean != row:
            connection.execute(update(Event).where(Event.number == row["number"]).values(clean))
    return old, count


def _others(connection: Connection, objects: Objects) -> tuple[list[str], list[str]]:
    """Objects with a secret in them that were not replaced: those that no row points to, left by a command that was cut
    short, and small files that results rest on."""
    pointed = {
        sha256
        for column in (
            StoredResult.object,
            StoredResult.report,
            IssuedCertificate.object,
            IssuedCertificate.page,
        )
        for sha256 in connection.execute(select(column)).scalars()
    }
    query = select(StoredFile.sha256, StoredFile.bytes).where(StoredFile.place.is_(None))
    sizes = {row.sha256: row.bytes for row in connection.execute(query)}
    loose: list[str] = []
    files: list[str] = []
    for sha256 in sorted(objects.names() - pointed):
        if sizes.get(sha256, 0) < _SMALL and _page(content := objects.read(sha256)) != content:
            (files if sha256 in sizes else loose).append(sha256)
    return loose, files
