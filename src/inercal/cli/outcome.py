"""Output of a command: file, report, words, and the exit code."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from inercal.cli import EXIT_BAD_VERDICT, command_line, process_age
from inercal.cli.options import OutputOptions, ReportOutput, ResultOutput

if TYPE_CHECKING:
    from inercal.faces.python.result import Result
    from inercal.foundation.findings import Finding
    from inercal.foundation.inputs import Source
    from inercal.foundation.results.result import Estimate

WHOLE = (".json", ".toml")
"""Suffixes of a file that holds the whole result."""

_SHOWN = 3
"""Findings told one by one beside a result, those that harm most; more would hide the verdict below them."""


def say_findings(findings: Iterable[Finding], output: OutputOptions) -> None:
    """The findings that harm most, one a line with its action, and how many more there are.

    A single one more is told itself, in the place of the line that would count it.
    """
    from inercal.foundation.findings import most_harmful

    ordered = most_harmful(findings)
    told = len(ordered) if len(ordered) <= _SHOWN + 1 else _SHOWN
    for finding in ordered[:told]:
        output.say_finding(finding)
    if len(ordered) > told:
        whole = "--report and --json have all" if isinstance(output, ReportOutput) else "--json has all"
        output.say(f"{len(ordered) - told} more findings: {'in the JSON' if output.json else whole}")


def emit(estimate: Estimate, text: str, output: OutputOptions) -> None:
    """The result on standard output: the JSON object with the time of the whole process, or the text for people."""
    from inercal.foundation.results.files import to_json

    output.emit(to_json(timed(estimate)) if output.json else {}, text)


def tell(
    output: OutputOptions,
    command: str,
    words: str,
    data: Mapping[str, Any],
    sources: Iterable[Source] = (),
    text: str | None = None,
    **stated: Any,
) -> None:
    """The outcome of a command that estimates nothing: ``words``, or ``text`` for people, and the JSON of all.

    ``stated`` as of `inercal.foundation.results.result.without_coefficients`.
    """
    from inercal.foundation.results.result import without_coefficients

    emit(
        without_coefficients(command, words, data, sources, **stated), words if text is None else text, output
    )


def hand_over(
    estimate: Estimate,
    tables: Iterable[str],
    page: Callable[[], str],
    output: ReportOutput,
    what: str = "calibration",
    write: Callable[[Path], object] | None = None,
    whole: tuple[str, ...] = WHOLE,
) -> int:
    """Write what was asked for, say the verdict, and give the exit code.

    People see the ``tables`` that are not empty; ``what`` the file is, in a word. ``write`` writes it where its
    suffix is not one of ``whole``.
    """
    from inercal.foundation._files import write_text
    from inercal.foundation.findings import Status
    from inercal.foundation.results.files import save

    estimate = timed(estimate)
    estimate = replace(estimate, provenance={**estimate.provenance, "arguments": command_line()})
    report = None if output.report is None else page()
    kept = keep(estimate, report, output) if isinstance(output, ResultOutput) and output.keep else ()
    if output.out is not None:
        if write is not None and output.out.suffix.lower() not in whole:
            write(output.out)
        else:
            save(estimate, output.out)
    if output.report is not None and report is not None:
        write_text(output.report, report)
    say_findings(estimate.findings, output)
    for written, path in ((what, output.out), ("report", output.report)):
        if path is not None:
            output.say(f"{written}: {path}")
    for words in kept:
        output.say(words)
    text = "".join(f"{table}\n\n" for table in tables if table)
    emit(estimate, f"{text}{estimate.status.value}: {estimate.message}", output)
    return 0 if estimate.status is Status.OK else EXIT_BAD_VERDICT


def give(
    result: Result,
    output: ReportOutput,
    read_s: float,
    what: str = "calibration",
    write: Callable[[Path], object] | None = None,
    whole: tuple[str, ...] = WHOLE,
) -> int:
    """Hand over a result of the face, which took ``read_s`` [s] to read; the others as in `hand_over`."""
    if write is None and result.view.rows is not None:
        write = result.save
    estimate = replace(result.estimate, timing={"read": read_s, **result.estimate.timing})
    return hand_over(estimate, result.view.tables(), result.view.page, output, what, write, whole)


def keep(estimate: Estimate, report: str | None, output: ResultOutput) -> list[str]:
    """Keep a result in the store, and say so; raises `InputError`."""
    from inercal.laboratory.catalog import SHORT
    from inercal.laboratory.keep import item_of
    from inercal.laboratory.keep import keep as kept
    from inercal.laboratory.store import open_store

    store = open_store(output.store)
    page = None if report is None else report.encode()
    done = kept(store, estimate, item_of(estimate, output.instrument), page)
    there = "kept" if done.new else "was kept before, nothing added"
    return [f"result: {done.id[:SHORT]} {there} in {store.where}", *done.notes]


def timed(estimate: Estimate) -> Estimate:
    """The estimate with the time of the process until now."""
    return replace(estimate, timing={**estimate.timing, "total": process_age()})
