"""``inercal allan``."""

from __future__ import annotations

import time
from pathlib import Path

from inercal.cli.options import Files, MapFile, ReportOutput, Span, read_record, working
from inercal.cli.outcome import WHOLE, hand_over, read_in


def allan(
    files: Files,
    /,
    *,
    map_file: MapFile = None,
    span: Span = Span(),  # noqa: B008  (frozen)
    output: ReportOutput = ReportOutput(),  # noqa: B008  (frozen)
) -> int:
    """Tell the noise of an instrument at rest."""
    from inercal._files import write_text
    from inercal.face.noise import allan as noise_of
    from inercal.report.allan import curves_csv

    output.check((*WHOLE, ".csv"), (*files, map_file))
    clock = time.perf_counter()
    record = read_record(files, map_file, output, span)
    read_s = time.perf_counter() - clock
    with working(output) as progress:
        progress("noise")
        result = noise_of(record)

    def curves(path: Path) -> None:
        write_text(path, curves_csv(result.evidence))

    estimate = read_in(result.estimate, read_s)
    return hand_over(estimate, result.view.tables(), result.view.page, output, "noise", curves)
