"""Supersession: a newer result takes the place of an older one."""

from __future__ import annotations

from sqlalchemy import insert, select

from inercal.foundation.addresses import without_secrets
from inercal.foundation.errors import InputError
from inercal.laboratory.catalog import SHORT, find
from inercal.laboratory.chain import digest_of, happened, now
from inercal.laboratory.database import writing
from inercal.laboratory.store import Store
from inercal.laboratory.tables import Result, Supersession


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
            connection.execute(select(Result.instrument_id).where(Result.id == each)).scalar()
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
