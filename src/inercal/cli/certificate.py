"""``inercal certificate``."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from inercal.cli.options import FileOutput, StoreOption
from inercal.cli.outcome import tell
from inercal.foundation.errors import InputError
from inercal.foundation.results.shown import aligned

if TYPE_CHECKING:
    from inercal.laboratory.certificate.reading import Certificate


def certificate(
    results: Annotated[
        list[str] | None,
        Parameter(
            help="Results of one instrument: files that commands wrote to --out, or results of the store."
        ),
    ] = None,
    /,
    *,
    lab: Annotated[
        Path | None, Parameter(help="What the laboratory states (TOML); `inercal new lab` writes one.")
    ] = None,
    number: Annotated[str | None, Parameter(help="Number of the certificate.")] = None,
    supersedes: Annotated[
        str | None, Parameter(help="Number of the certificate that this one replaces.")
    ] = None,
    page: Annotated[
        list[Path] | None,
        Parameter(help="Report of a result, put inside; may be repeated, in the order of the results."),
    ] = None,
    html: Annotated[Path | None, Parameter(help="Write the certificate as a readable page.")] = None,
    read: Annotated[Path | None, Parameter(help="Read this certificate, of anybody, and print it.")] = None,
    store: StoreOption = None,
    output: FileOutput = FileOutput(),
) -> None:
    """Write a digital calibration certificate, or read one."""
    if html is not None and html.suffix.lower() not in (".html", ".htm"):
        raise InputError(html, f"found the suffix {html.suffix!r} for --html, expected .html")
    if read is not None:
        for option, given in (
            ("--lab", lab),
            ("--number", number),
            ("--out", output.out),
            ("RESULTS", results),
        ):
            if given:
                raise InputError(option, "found with --read, expected without it")
        output.check(())
        _read(read, html, output)
        return
    for option, value in (("RESULTS", results), ("--lab", lab), ("--number", number), ("--out", output.out)):
        if not value:
            raise InputError(option, "missing, expected it, or --read")
    assert results is not None
    assert lab is not None
    assert number is not None
    if page is not None and len(page) > len(results):
        raise InputError(
            "--page", f"found {len(page)} of {len(results)} results, expected one of each at most"
        )
    output.check((".xml",), [*map(Path, results), lab, *(page or [])])
    _write(results, lab, number, supersedes, page or [], html, store, output)


def _write(
    results: list[str],
    lab: Path,
    number: str,
    supersedes: str | None,
    pages: list[Path],
    html: Path | None,
    store: str | None,
    output: FileOutput,
) -> None:
    """Write the certificate and its page, whole or not at all, and enter it into the store."""
    from inercal.foundation.records.places import counted
    from inercal.foundation.records.read import source_of
    from inercal.laboratory.issue import issue

    assert output.out is not None
    estimates, where = issue(results, lab, number, output.out, html, supersedes, pages, store)
    if html is not None:
        output.say(f"page: {html}")
    count = sum(len(estimate.names) for estimate in estimates)
    of = f"{counted(count, 'coefficient')} of {counted(len(results), 'result')}"
    words = f"certificate {number}: {of} in {output.out}"
    words += f", entered in {where}" if where else "; no store keeps it or its number"
    data = {"number": number, "out": str(output.out), "html": None if html is None else str(html)}
    sources = tuple(source_of(path) for path in (*map(Path, results), lab, *pages) if path.is_file())
    tell(output, "certificate", words, data, sources)


def _read(path: Path, html: Path | None, output: FileOutput) -> None:
    """Print what a certificate states, and write it as a page where that is asked for."""
    from inercal.foundation._files import write_text
    from inercal.foundation.records.read import source_of
    from inercal.laboratory.certificate.page import page
    from inercal.laboratory.certificate.reading import read_certificate

    found = read_certificate(path)
    if html is not None:
        write_text(html, page(found))
        output.say(f"page: {html}")
    checked = "valid by its schema" if found.validated else "not validated"
    words = (
        f"certificate {found.number} of {found.laboratory} for {found.item}, DCC {found.version}, {checked}"
    )
    if found.signed:
        words += ", signed (the signature was not verified)"
    result = {
        "number": found.number,
        "laboratory": found.laboratory,
        "item": found.item,
        "version": found.version,
        "validated": found.validated,
        "signed": found.signed,
        "results": [
            {
                "name": each.name,
                "quantities": [vars(quantity) for quantity in each.quantities],
                "covariance": None if each.region is None else vars(each.region),
            }
            for each in found.results
        ],
    }
    text = "\n".join([*_table(found), "", words])
    tell(output, "certificate", words, result, (source_of(path),), text)


def _table(found: Certificate) -> list[str]:
    """All numbers of a certificate, aligned, to the last digit."""
    rows = [("", "value", "U", "k", "unit")]
    for each in found.results:
        for q in each.quantities:
            U, k = ("" if math.isnan(number) else repr(number) for number in (q.U, q.k))
            rows.append((q.label or q.name, repr(q.value), U, k, q.unit))
    return aligned(rows, (0, 4))
