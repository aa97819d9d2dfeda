"""Certificates that were issued: each number once, in the chain of events.

A newer result takes the place of an older one by supersession.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from sqlalchemy import insert, select

from inercal.foundation.addresses import without_secrets
from inercal.foundation.errors import InputError
from inercal.laboratory.catalog import SHORT, find
from inercal.laboratory.database import Certified, IssuedCertificate, StoredResult, Supersession, writing
from inercal.laboratory.store import Store, digest_of, happened, now


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


@contextmanager
def issuing(
    store: Store,
    number: str,
    made: bytes,
    page: bytes | None,
    results: Sequence[str],
    supersedes: str | None = None,
) -> Iterator[None]:
    """Enter a certificate of results into the store when the block ends without error.

    Parameters
    ----------
    store : Store
    number : str
    made, page : bytes
        Its XML, and its readable page.
    results : sequence of str
        Identities, whole, of the results that it states.
    supersedes : str, optional
        Number of the certificate of this store that it replaces.

    Raises
    ------
    InputError
        The number was used before, the certificate that is replaced is not there or was replaced already, or a result
        is superseded.
    """
    row = {
        "number": number,
        "object": store.objects.add(made),
        "page": None if page is None else store.objects.add(page),
        "issued": now(),
        "supersedes": supersedes,
    }
    with writing(store.engine, store.where) as connection:
        numbers = {
            each.number: each.supersedes
            for each in connection.execute(select(IssuedCertificate.number, IssuedCertificate.supersedes))
        }
        if number in numbers:
            raise InputError(
                "--number", f"found {number!r}, which {store.where} has already, expected a new one"
            )
        if supersedes is not None and supersedes not in numbers:
            raise InputError(
                "--supersedes", f"found {supersedes!r}, expected the number of a certificate in {store.where}"
            )
        if supersedes is not None and supersedes in numbers.values():
            raise InputError(
                "--supersedes", f"found {supersedes!r}, which another certificate replaces already"
            )
        for identity in results:
            query = select(Supersession.by_id).where(Supersession.result_id == identity)
            by = connection.execute(query).scalar()
            if by is not None:
                raise InputError(
                    identity[:SHORT], f"is superseded by {by[:SHORT]}, expected a result that is not"
                )
        identities = sorted(set(results))
        connection.execute(insert(IssuedCertificate).values(**row))
        connection.execute(insert(Certified), [{"number": number, "result_id": each} for each in identities])
        happened(connection, "certificate", number, digest_of([row, identities]))
        yield
