"""``inercal sensitivity``."""

from __future__ import annotations

import time
from pathlib import Path

from inercal.cli.options import Overrides, ReportOutput, Study, of_study, reading
from inercal.cli.outcome import WHOLE, hand_over, told


def sensitivity(
    study: Study,
    /,
    *,
    overrides: Overrides = None,
    output: ReportOutput = ReportOutput(),  # noqa: B008  (frozen)
) -> int:
    """Say which error of a turntable matters."""
    from inercal.records.read import source_of
    from inercal.studies.load import files_of, load_turntable_study
    from inercal.turntable.sensitivity.analysis import analyse, result, table

    output.check((*WHOLE, ".nc", ".npz"), (study,))
    clock = time.perf_counter()
    settings = load_turntable_study(study, overrides or ())
    inputs = files_of(study, settings.given)
    output.spare(inputs)
    read_s = time.perf_counter() - clock
    maps_wanted = bool(output.targets)
    with of_study(study), reading(output, "sampling") as progress:
        analysed = analyse(settings, maps_wanted, output.say_now, progress)
    if analysed.note:
        output.say(analysed.note)
    estimate = told(
        "sensitivity",
        analysed.message,
        result(analysed),
        map(source_of, inputs),
        timing={"read": read_s, "solve": analysed.solve},
        settings=settings.given,
        references=analysed.references,
    )

    def page() -> str:
        from inercal.turntable.figures.sensitivity import page as sensitivity_page

        return sensitivity_page(analysed, settings, estimate)

    def maps(path: Path) -> None:
        from inercal.turntable.sensitivity.maps import write_maps

        write_maps(analysed, path)

    return hand_over(estimate, [table(analysed)], page, output, "maps", maps)
