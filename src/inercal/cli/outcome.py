"""An estimate going out of a command: file, report, words, and the exit code."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from inercal.cli import EXIT_BAD_VERDICT
from inercal.cli.options import ReportOutput

if TYPE_CHECKING:
    from inercal.estimate.result import Estimate


def hand_over(
    estimate: Estimate,
    tables: Iterable[str],
    page: Callable[[], str],
    output: ReportOutput,
    what: str = "calibration",
    write: Callable[[Path], None] | None = None,
) -> int:
    """Write what was asked for, say the verdict, and give the exit code.

    People see the ``tables`` that are not empty; ``what`` the file is, in a word. ``write`` writes it where its
    suffix is neither .json nor .toml.
    """
    from inercal._files import write_text
    from inercal.estimate.exchange import save, to_json
    from inercal.estimate.status import Status

    if output.out is not None:
        if write is not None and output.out.suffix.lower() not in (".json", ".toml"):
            write(output.out)
        else:
            save(estimate, output.out)
    if output.report is not None:
        write_text(output.report, page())
    output.say_findings(estimate.findings)
    for written, path in ((what, output.out), ("report", output.report)):
        if path is not None:
            output.say(f"{written}: {path}")
    text = "".join(f"{table}\n\n" for table in tables if table)
    output.emit(to_json(estimate), f"{text}{estimate.status.value}: {estimate.message}")
    return 0 if estimate.status is Status.OK else EXIT_BAD_VERDICT


def printed(estimate: Estimate) -> str:
    """The table of the coefficients; nothing where there are none."""
    return estimate.table() if estimate.names else ""
