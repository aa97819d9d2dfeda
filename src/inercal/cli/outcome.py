"""An estimate going out of a command: file, report, words, and the exit code."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from inercal.cli import EXIT_BAD_VERDICT
from inercal.cli.options import ReportOutput

if TYPE_CHECKING:
    from inercal.estimate.result import Estimate


def hand_over(
    estimate: Estimate,
    shown: Estimate,
    page: Callable[[], str],
    output: ReportOutput,
    advice: str = "",
    table: str = "",
    what: str = "calibration",
) -> int:
    """Write what was asked for, say the verdict, and give the exit code.

    People see ``shown`` and the ``table`` below it, and with a bad verdict the ``advice``, where the message does not
    hold it itself; ``what`` the file is, in a word.
    """
    from inercal.estimate.exchange import save, to_json
    from inercal.estimate.status import Status

    output.say_findings(estimate.findings)
    if output.out is not None:
        save(estimate, output.out)
        output.say(f"{what}: {output.out}")
    if output.report is not None:
        from inercal._files import write_text

        write_text(output.report, page())
        output.say(f"report: {output.report}")
    text = "".join(f"{part}\n\n" for part in (shown.table() if shown.names else "", table) if part)
    verdict = f"{estimate.status.value}: {estimate.message}"
    if estimate.status is not Status.OK and advice:
        verdict += f"\n{advice}"
    output.emit(to_json(estimate), text + verdict)
    return 0 if estimate.status is Status.OK else EXIT_BAD_VERDICT
