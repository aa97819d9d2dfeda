"""Certificates that were issued: each number once, in the chain of events."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from sqlalchemy import insert, select

from inercal.foundation.errors import InputError
from inercal.laboratory.catalog import SHORT
from inercal.laboratory.chain import digest_of, happened, now
from inercal.laboratory.database import writing
from inercal.laboratory.store import Store
from inercal.laboratory.tables import Certificate, Certified, Supersession


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
            for each in connection.execute(select(Certificate.number, Certificate.supersedes))
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
        connection.execute(insert(Certificate).values(**row))
        connection.execute(insert(Certified), [{"number": number, "result_id": each} for each in identities])
        happened(connection, "certificate", number, digest_of([row, identities]))
        yield
