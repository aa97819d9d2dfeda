"""``inercal sensitivity``."""

from __future__ import annotations

import time
from pathlib import Path

from inercal.cli.options import Overrides, ReportOutput, Study, reading
from inercal.cli.outcome import WHOLE, hand_over, read_in


def sensitivity(
    study: Study,
    /,
    *,
    overrides: Overrides = None,
    output: ReportOutput = ReportOutput(),  # noqa: B008  (frozen)
) -> int:
    """Say which error of a turntable matters."""
    from inercal.face import turntable as system
    from inercal.face.study import read_study

    output.check((*WHOLE, ".nc", ".npz"), (study,))
    clock = time.perf_counter()
    the_study = read_study("turntable", study, overrides or ())
    output.spare(the_study.files)
    read_s = time.perf_counter() - clock
    with reading(output, "sampling") as progress:
        result = system.sensitivity(the_study, bool(output.targets), output.say_now, progress)
    analysed = result.evidence
    if analysed.note:
        output.say(analysed.note)

    def maps(path: Path) -> None:
        from inercal.turntable.sensitivity.maps import write_maps

        write_maps(analysed, path)

    estimate = read_in(result.estimate, read_s)
    return hand_over(estimate, result.view.tables(), result.view.page, output, "maps", maps)
