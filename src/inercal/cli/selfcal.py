"""``inercal selfcal``."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from inercal.cli.options import MapFile, Overrides, ReportOutput, StudyFile, of_study, read_repeats, working
from inercal.cli.outcome import WHOLE, hand_over, printed
from inercal.cli.streaming import Every, StreamOptions, interval_of, recorded, run_stream, streamed
from inercal.errors import InputError

if TYPE_CHECKING:
    from inercal.selfcal.settings import SelfcalSettings
    from inercal.selfcal.task import Calibration
    from inercal.stream.lines import Lines

Kind = Literal["error-state", "mukf", "svd-qukf", "gimbal-ukf", "map", "lm"]


def selfcal(
    files: Annotated[
        list[Path] | None,
        Parameter(
            help="Recordings; files with distinct channels are one record, with the same ones repeat runs."
        ),
    ] = None,
    /,
    *,
    study: StudyFile,
    kind: Annotated[
        Kind | None, Parameter(name="--filter", help="Estimator, in the place of that of the study.")
    ] = None,
    compare: Annotated[bool, Parameter(help="Run all estimators, and set them side by side.")] = False,
    stream: Annotated[
        bool, Parameter(help="Lines in, from standard input or one FILE, and coefficients out, live.")
    ] = False,
    every: Every = None,
    map_file: MapFile = None,
    overrides: Overrides = None,
    streaming: StreamOptions = StreamOptions(),  # noqa: B008  (frozen)
    output: ReportOutput = ReportOutput(),  # noqa: B008  (frozen)
) -> int:
    """Calibrate a gimbaled platform while it turns."""
    keys = [*(overrides or ()), *([f"filter.kind={kind}"] if kind is not None else [])]
    if stream:
        if compare:
            raise InputError("--compare", "found with a stream, expected one estimator")
        _live(streamed(files), study, map_file, keys, interval_of(every), streaming, output)
        return 0
    paths = recorded("selfcal", files, streaming, every)

    from inercal._jit import compiling
    from inercal.records.read import source_of
    from inercal.records.write import SUFFIXES
    from inercal.selfcal.task import calibrate, load_kernels
    from inercal.studies.load import load_selfcal_study

    output.check((*WHOLE, *SUFFIXES), (*paths, map_file, study))
    settings = load_selfcal_study(study, keys)
    clock = time.perf_counter()
    records = read_repeats(paths, map_file, output)
    read_s = time.perf_counter() - clock
    if len(records) > 1 and compare:
        raise InputError("--compare", f"found {len(records)} runs, expected one")
    if len(records) > 1 and output.out is not None and output.out.suffix.lower() in SUFFIXES:
        raise InputError(output.out, f"found {len(records)} runs, expected one for a history, or .json")
    of_all = " all" if compare else f" {settings.filter.kind}"
    with of_study(study), compiling(f"selfcal{of_all}", output.say):
        load_kernels(settings, compare)
    runs = []
    with of_study(study), working(output) as progress:
        for number, record in enumerate(records, start=1):
            of_run = f"run {number} of {len(records)}: " if len(records) > 1 else ""
            found = calibrate(record, settings, compare, lambda text, of_run=of_run: progress(of_run + text))  # type: ignore[misc]
            timing = {"read": read_s, "solve": found.estimate.timing["solve"]}
            inputs = (*found.estimate.inputs, source_of(study))
            runs.append(replace(found, estimate=replace(found.estimate, timing=timing, inputs=inputs)))
    return _one(runs[0], settings, output) if len(runs) == 1 else _repeated(runs, output)


def _one(found: Calibration, settings: SelfcalSettings, output: ReportOutput) -> int:
    """Hand over the calibration of one run."""
    from inercal.selfcal.task import compared

    def page() -> str:
        from inercal.selfcal.figures import calibration_page

        return calibration_page(found, settings)

    def histories(path: Path) -> None:
        from inercal.records.write import write_record
        from inercal.selfcal.result.columns import history_record

        write_record(history_record(found.filtered, found.recording, found.problem.world), path)

    tables = [printed(found.estimate.shown()), *(f"{t.title}\n{t.text()}" for t in compared(found))]
    return hand_over(found.estimate, tables, page, output, "calibration", histories)


def _repeated(runs: Sequence[Calibration], output: ReportOutput) -> int:
    """Hand over what repeat runs say together."""
    from inercal.estimate.repeat import combine_runs

    of_runs = [found.estimate for found in runs]
    estimate, shown = combine_runs(of_runs), combine_runs(of_runs).shown()
    solve = sum(each.timing["solve"] for each in of_runs)
    estimate = replace(estimate, timing={**of_runs[-1].timing, "solve": solve})

    def page() -> str:
        from inercal.report.figures import repeats
        from inercal.report.html import render

        return render(shown, repeats(shown), "Self-calibration of a platform, repeat runs")

    return hand_over(estimate, [printed(shown)], page, output)


def _live(
    file: Path | None,
    study: Path,
    map_file: Path | None,
    keys: list[str],
    interval: float,
    streaming: StreamOptions,
    output: ReportOutput,
) -> None:
    """Calibrate row by row."""
    from inercal._jit import compiling
    from inercal.selfcal.filters.filter_result import problem
    from inercal.selfcal.find_base import stated_well
    from inercal.stream.selfcal import Selfcal, filter_of, load_kernels
    from inercal.studies.load import load_selfcal_study

    streaming.check(output, (file, map_file, study))
    settings = load_selfcal_study(study, keys)
    with of_study(study):
        stated_well(settings, "a stream")
        told = problem(settings)
        filter_of(told)
        with compiling(f"selfcal stream {told.filter.kind}", output.say):
            load_kernels(told)

    def calibration(lines: Lines) -> Selfcal:
        with of_study(study):
            return Selfcal(lines, told, interval, output.say_finding)

    run_stream(calibration, file, map_file, output, streaming)
