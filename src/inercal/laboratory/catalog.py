"""Contents of a store: instruments, results, one result whole; and a result that takes the place of another."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import func, insert, select

from inercal.foundation.addresses import without_secrets
from inercal.foundation.errors import InputError
from inercal.foundation.results.files import from_json
from inercal.foundation.results.result import Estimate
from inercal.laboratory.database import (
    Certified,
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
    writing,
)
from inercal.laboratory.keep import Item
from inercal.laboratory.store import Store, digest_of, happened, now

SHORT = 10
"""Digits of an identity that are shown."""


_OWN = ("id", "command", "status", "message", "made", "measured", "operator", "version")
"""Columns of a result that a list has."""


@dataclass(frozen=True)
class Listed:
    """A result in a list: its row, instrument, and the identity of the one that supersedes it."""

    id: str
    command: str
    status: str
    message: str
    made: str
    measured: str
    operator: str
    version: str
    instrument: Item | None
    superseded_by: str | None

    @property
    def date(self) -> str:
        """The day of the measurement, or of the keeping where the study states none."""
        return str(self.measured or self.made)[:10]


@dataclass(frozen=True)
class ShownResult:
    """A result whole: its row, estimate, files with their places, reason where it is superseded, certificates."""

    listed: Listed
    estimate: Estimate
    object: str
    report: str | None
    program: str
    files: tuple[tuple[str, str, str | None], ...]
    references: tuple[str, ...]
    reason: str
    certificates: tuple[str, ...]


def instruments(store: Store) -> list[dict[str, Any]]:
    """All instruments, with the number of their results and the date of the last."""
    last = func.max(StoredResult.made)
    query = (
        select(StoredInstrument, func.count(StoredResult.id).label("results"), last.label("last"))
        .outerjoin(StoredResult, StoredResult.instrument_id == StoredInstrument.id)
        .group_by(StoredInstrument.id)
        .order_by(StoredInstrument.maker, StoredInstrument.model, StoredInstrument.serial)
    )
    with reading(store.engine, store.where) as connection:
        return [dict(row) for row in connection.execute(query).mappings()]


def results(
    store: Store,
    instrument: str | None = None,
    since: str | None = None,
    status: str | None = None,
) -> list[Listed]:
    """Results in the order of their dates.

    Parameters
    ----------
    store : Store
    instrument : str, optional
        Serial number, or maker, model and serial number in words.
    since : str, optional
        First day, ISO 8601.
    status : str, optional

    Raises
    ------
    InputError
        No instrument of that name, or several.
    """
    query = _listed()
    if instrument is not None:
        query = query.where(StoredResult.instrument_id.in_(numbers_of(store, instrument)))
    if status is not None:
        query = query.where(StoredResult.status == status)
    with reading(store.engine, store.where) as connection:
        found = [_row(row, store.where) for row in connection.execute(query).mappings()]
    found = [each for each in found if since is None or each.date >= since]
    return sorted(found, key=lambda each: (each.date, each.made, each.id))


def _listed() -> Any:
    """The query of all results."""
    return (
        select(
            *(StoredResult.__table__.c[name] for name in _OWN),
            *(StoredInstrument.__table__.c[name] for name in ("maker", "model", "serial", "owner", "kind")),
            Supersession.by_id,
        )
        .outerjoin(StoredInstrument, StoredInstrument.id == StoredResult.instrument_id)
        .outerjoin(Supersession, Supersession.result_id == StoredResult.id)
    )


def _row(row: Any, where: str) -> Listed:
    """A row of that query; raises `InputError` for one that no store writes."""
    item = (
        None
        if row["serial"] is None
        else Item(row["maker"], row["model"], row["serial"], row["owner"], row["kind"])
    )
    if any(row[key] is None for key in _OWN):
        raise InputError(
            where,
            "a row of the results was damaged, expected one as it was written: see `inercal store check`",
        )
    return Listed(**{key: row[key] for key in _OWN}, instrument=item, superseded_by=row["by_id"])


def numbers_of(store: Store, name: str) -> list[int]:
    """The rows of the instrument of that serial number, or of that maker, model and serial number.

    Raises `InputError` where there is none, or several share the serial number.
    """
    words = name.replace(",", " ").split()
    query = select(
        StoredInstrument.id, StoredInstrument.maker, StoredInstrument.model, StoredInstrument.serial
    )
    with reading(store.engine, store.where) as connection:
        rows = connection.execute(query).all()
    named = {
        row.id: str(Item(row.maker, row.model, row.serial))
        for row in rows
        if row.serial == name or f"{row.maker} {row.model} {row.serial}".split() == words
    }
    if not named:
        some = ", ".join(sorted({row.serial for row in rows})[:4])
        raise InputError(
            name,
            f"no such instrument in {store.where}, expected a serial number such as {some or 'none yet'}",
        )
    if len(named) > 1:
        raise InputError(
            name, f"found {' and '.join(sorted(named.values()))}, expected maker, model and serial number"
        )
    return list(named)


def find(store: Store, identity: str) -> str:
    """The whole identity of a result of which the beginning is given; raises `InputError` where none or several are."""
    with reading(store.engine, store.where) as connection:
        query = (
            select(StoredResult.id)
            .where(StoredResult.id.startswith(identity.lower(), autoescape=True))
            .limit(3)
        )
        found: Sequence[str] = connection.execute(query).scalars().all()
    if len(found) == 1 and len(identity) >= 4:
        return found[0]
    what = "several results begin so" if len(found) > 1 else f"no such result in {store.where}"
    if len(identity) < 4:
        what = "found fewer than 4 digits"
    raise InputError(identity, f"{what}, expected the identity of one, as `inercal results` lists them")


def show(store: Store, identity: str) -> ShownResult:
    """A result whole; raises `InputError` where there is none, or its object is missing or was changed."""
    identity = find(store, identity)
    with reading(store.engine, store.where) as connection:
        listed = _row(
            connection.execute(_listed().where(StoredResult.id == identity)).mappings().one(), store.where
        )
        row = connection.execute(select(StoredResult).where(StoredResult.id == identity)).mappings().one()
        files = connection.execute(
            select(SourceOf.path, SourceOf.sha256, StoredFile.place)
            .join(StoredFile, StoredFile.sha256 == SourceOf.sha256)
            .where(SourceOf.result_id == identity)
            .order_by(SourceOf.position)
        ).all()
        references = connection.execute(
            select(StoredReference.name, StoredReference.serial, StoredReference.certificate)
            .join(Used, Used.reference_id == StoredReference.id)
            .where(Used.result_id == identity)
        ).all()
        reason = connection.execute(
            select(Supersession.reason).where(Supersession.result_id == identity)
        ).scalar()
        certificates = connection.execute(
            select(Certified.number).where(Certified.result_id == identity).order_by(Certified.number)
        ).scalars()
        numbers = tuple(certificates)
    return ShownResult(
        listed,
        estimate_in(store, row["object"]),
        row["object"],
        row["report"],
        row["program"],
        tuple((path, sha256, place) for path, sha256, place in files),
        tuple(", ".join(filter(None, row)) for row in references),
        reason or "",
        numbers,
    )


def certificates(store: Store, instrument: str | None = None) -> list[dict[str, Any]]:
    """The certificates of all results, or of an instrument's as of `results`, in the order in which they were issued.

    Of each its number, when it was issued, the number that it supersedes, and the objects of its XML and page.
    """
    query = select(IssuedCertificate.__table__).order_by(IssuedCertificate.issued, IssuedCertificate.number)
    if instrument is not None:
        of = select(Certified.number).join(StoredResult, StoredResult.id == Certified.result_id)
        query = query.where(
            IssuedCertificate.number.in_(
                of.where(StoredResult.instrument_id.in_(numbers_of(store, instrument)))
            )
        )
    with reading(store.engine, store.where) as connection:
        return [dict(row) for row in connection.execute(query).mappings()]


def estimate_in(store: Store, sha256: str) -> Estimate:
    """The estimate of an object; raises `InputError`."""
    return from_json(json.loads(store.objects.read(sha256)))


def values_of(store: Store, instrument: str) -> list[dict[str, Any]]:
    """All coefficients of an instrument's results that nothing supersedes, a row each, in the order of dates."""
    query = (
        select(
            *(StoredResult.__table__.c[name] for name in ("id", "command", "status", "made", "measured")),
            *(column for column in StoredCoefficient.__table__.c if column.name != "result_id"),
        )
        .join(StoredCoefficient, StoredCoefficient.result_id == StoredResult.id)
        .outerjoin(Supersession, Supersession.result_id == StoredResult.id)
        .where(StoredResult.instrument_id.in_(numbers_of(store, instrument)), Supersession.by_id.is_(None))
    )
    with reading(store.engine, store.where) as connection:
        rows = [dict(row) for row in connection.execute(query).mappings()]
    return sorted(rows, key=lambda row: (row["measured"] or row["made"], row["id"], row["position"]))


def supersede(store: Store, identity: str, by: str, reason: str) -> tuple[str, str]:
    """Say that a result takes the place of another, and why; both identities, whole.

    Raises
    ------
    InputError
        No such results, they are one and the same, of different instruments, the first is superseded already or would
        supersede itself by way of others, or the reason is empty.
    """
    old, new, reason = find(store, identity), find(store, by), without_secrets(reason)
    if not reason.strip():
        raise InputError("--reason", "found an empty text, expected why the result is superseded")
    if old == new:
        raise InputError(by, "is the same result, expected the one that takes its place")
    with writing(store.engine, store.where) as connection:
        numbers = {
            connection.execute(select(StoredResult.instrument_id).where(StoredResult.id == each)).scalar()
            for each in (old, new)
        }
        if len(numbers) > 1:
            raise InputError(by, f"is of another instrument than {old[:SHORT]}, expected one of the same")
        after: dict[str, str] = {
            row.result_id: row.by_id
            for row in connection.execute(select(Supersession.result_id, Supersession.by_id))
        }
        if old in after:
            raise InputError(
                identity, f"is superseded by {after[old][:SHORT]} already, expected a result that is not"
            )
        last = new
        while last in after:
            last = after[last]
        if last == old:
            raise InputError(by, f"is superseded by {old[:SHORT]} itself, expected a result that is not")
        row = {"result_id": old, "by_id": new, "reason": reason, "made": now()}
        connection.execute(insert(Supersession).values(**row))
        happened(connection, "supersede", old, digest_of(row))
    return old, new
