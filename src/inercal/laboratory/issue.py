"""Certificates issued: written of results, each number once, in the chain of events."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from datetime import UTC, datetime
from pathlib import Path

from sqlalchemy import insert, select

from inercal.foundation._files import input_bytes, write_bytes, write_text
from inercal.foundation.errors import InputError
from inercal.foundation.results.files import load
from inercal.foundation.results.result import Estimate
from inercal.laboratory.catalog import SHORT, find, show
from inercal.laboratory.database import Certified, IssuedCertificate, Supersession, writing
from inercal.laboratory.keep import item_of, keep, kept_already, saved_in
from inercal.laboratory.store import VARIABLE, Store, digest_of, happened, now, open_store, place_of


def issue(
    results: Sequence[str],
    lab: Path,
    number: str,
    out: Path,
    html: Path | None = None,
    supersedes: str | None = None,
    pages: Sequence[Path] = (),
    store: str | None = None,
) -> tuple[list[Estimate], str]:
    """Write a certificate of results and its page, whole or not at all, and enter it into the store if there is one.

    Parameters
    ----------
    results : sequence of str
        Files, or results of the store by the beginning of their identity.
    lab : Path
        What the laboratory states.
    number : str
    out, html : Path
        The certificate as XML, and as a page.
    supersedes : str, optional
        Number of the certificate that it replaces.
    pages : sequence of Path
        Reports of the first results, in their order.
    store : str, optional
        As of `inercal.laboratory.store.open_store`; the user's own only where it is there.

    Returns
    -------
    list of Estimate
        The results.
    str
        The store that it was entered into, empty for none.

    Raises
    ------
    InputError
        A result, report or statement that cannot be used, or as `issuing`.
    """
    from inercal.laboratory.certificate.lab import read_lab
    from inercal.laboratory.certificate.page import page
    from inercal.laboratory.certificate.reading import certificate_of
    from inercal.laboratory.certificate.written import certificate

    stated, opened = read_lab(lab), _store(store)
    given: list[bytes | None] = [input_bytes(path, "a report") for path in pages]
    given += [None] * (len(results) - len(given))
    found = [_result(result, opened, report) for result, report in zip(results, given, strict=True)]
    estimates, reports = [estimate for estimate, _ in found], [report for _, report in found]
    made = certificate(estimates, stated, number, datetime.now(UTC).date(), reports, supersedes, lab)
    readable = page(certificate_of(made, out))
    entering: AbstractContextManager[None] = nullcontext()
    if opened is not None:
        kept = [_kept(opened, result, *one) for result, one in zip(results, found, strict=True)]
        entering = issuing(opened, number, made, readable.encode(), kept, supersedes)
    with entering:
        write_bytes(out, made)
        if html is not None:
            write_text(html, readable)
    return estimates, "" if opened is None else opened.where


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


def _store(given: str | None) -> Store | None:
    """The store that is named, by option or environment, or the user's own where there is one."""
    folder = place_of(given).folder
    if (
        given is None
        and VARIABLE not in os.environ
        and (folder is None or not (folder / "store.db").is_file())
    ):
        return None
    return open_store(given)


def _result(given: str, store: Store | None, report: bytes | None) -> tuple[Estimate, bytes | None]:
    """A result of a file or of the store, and its report."""
    if Path(given).is_file() or store is None:
        return load(given), report
    shown = show(store, given)
    kept = None if shown.report is None else store.objects.read(shown.report)
    return shown.estimate, kept if report is None else report


def _kept(store: Store, given: str, estimate: Estimate, report: bytes | None) -> str:
    """Identity of a result in the store, where it is kept first if it came as a file."""
    if not Path(given).is_file():
        return find(store, given)
    saved, item = saved_in(Path(given), estimate), item_of(estimate)
    known = kept_already(store, estimate, saved)
    if known is None and item is None and estimate.names:
        raise InputError(
            given,
            "found no instrument in it, expected [item] in its study, or that it is kept already, as by: inercal keep "
            f'{given} --instrument "maker, model, serial"',
        )
    return keep(store, estimate, item, report, saved).id if known is None else known
