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
    told = read_study("turntable", study, overrides or ())
    output.spare(told.files)
    read_s = time.perf_counter() - clock
    with reading(output, "sampling") as progress:
        found = system.sensitivity(told, bool(output.targets), output.say_now, progress)
    analysed = found.evidence
    if analysed.note:
        output.say(analysed.note)

    def maps(path: Path) -> None:
        from inercal.turntable.sensitivity.maps import write_maps

        write_maps(analysed, path)

    estimate = read_in(found.estimate, read_s)
    return hand_over(estimate, found.view.tables(), found.view.page, output, "maps", maps)
