"""``inercal sensitivity``."""

from __future__ import annotations

import time

from inercal.cli.options import Overrides, ReportOutput, Study, envelope, of_study, reading


def sensitivity(
    study: Study,
    /,
    *,
    overrides: Overrides = None,
    output: ReportOutput = ReportOutput(),  # noqa: B008  (frozen)
) -> None:
    """Say which error of a turntable matters."""
    from inercal.records.read import source_of
    from inercal.study.load import files_of, load_turntable_study
    from inercal.turntable.analysis import analyse, result, table

    output.check((".nc", ".npz"), (study,))
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
    if output.out is not None:
        from inercal.turntable.maps import write_maps

        write_maps(analysed, output.out)
        output.say(f"maps: {output.out}")
    if output.report is not None:
        from inercal._files import write_text
        from inercal.turntable.figures import sensitivity_page

        write_text(output.report, sensitivity_page(analysed, settings))
        output.say(f"report: {output.report}")
    timing = {"read": read_s, "solve": analysed.solve}
    data = envelope("sensitivity", analysed.message, result(analysed), map(source_of, inputs), timing=timing)
    output.emit(data, f"{table(analysed)}\n\n{analysed.message}")
