"""A platform in gimbals in Python: its self-calibration, simulation, and the path on which it calibrates best."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from inercal.faces.python.result import Result, View, of_coefficients
from inercal.faces.python.study import Progress, Study, designed_by, of_files, of_runs
from inercal.foundation.computing.executors import Executor
from inercal.foundation.errors import InputError
from inercal.foundation.records.record import Record
from inercal.systems.selfcal import task

if TYPE_CHECKING:
    from inercal.faces.report.html import Picture
    from inercal.systems.selfcal.settings import SelfcalSettings


def prepare(study: Study, compare: bool = False) -> None:
    """Load, or compile, the kernels of `calibrate`, so that they do not count in its time."""
    with study.at_fault():
        task.load_kernels(study.settings, compare)


def calibrate(
    records: Sequence[Record],
    study: Study,
    compare: bool = False,
    progress: Progress = lambda _: None,
    courses: bool = True,
) -> Result:
    """Calibrate a platform from one run, from records on bases of their own, or from repeat runs together; ``evidence``
    has a calibration for each.

    Parameters and errors are those of `inercal.calibrate`; ``courses`` as of `inercal.systems.selfcal.task.calibrate`.
    """
    if len(records) > 1 and compare:
        raise InputError("compare", f"found {len(records)} runs, expected one")

    if study.settings.placed:
        return _together(records, study, progress)

    def run(record: Record, settings: SelfcalSettings, say: Progress) -> task.Calibration:
        return task.calibrate(record, settings, compare, say, courses)

    title = "Self-calibration of a platform, repeat runs"
    return of_runs(records, study, progress, run, lambda calibration: _one(calibration, courses), title)


def _one(calibration: task.Calibration, courses: bool) -> Result:
    """The result of one run."""
    from inercal.systems.selfcal.result.columns import history_record

    def page() -> str:
        from inercal.systems.selfcal import figures

        return figures.page(calibration)

    def more() -> list[str]:
        return [f"{table.title}\n{table.text()}" for table in task.compared(calibration)]

    def rows() -> Record:
        return history_record(calibration.filtered, calibration.recording, calibration.problem.world)

    kept = calibration.filtered.history is not None
    view = of_coefficients(calibration.estimate.shown(), page, more)
    return Result(calibration.estimate, replace(view, rows=rows if kept and courses else None), calibration)


def _together(records: Sequence[Record], study: Study, progress: Progress) -> Result:
    """The result of records that are fitted together."""
    from inercal.systems.selfcal.several import calibrate_together

    fitted = of_files(records, study, progress, calibrate_together)
    shown = fitted.estimate.shown()

    def page() -> str:
        from inercal.faces.report.coefficients import budget, values
        from inercal.faces.report.html import render

        return render(
            shown, [values(shown), budget(shown)], "Self-calibration of a platform, several records"
        )

    return Result(fitted.estimate, of_coefficients(shown, page), fitted.each)


def simulate(study: Study, rng: np.random.Generator) -> Record:
    """A simulated record of a platform that turns through the plan of the study."""
    from inercal.systems.selfcal.simulate import experiment, to_record
    from inercal.systems.selfcal.simulate import simulate as simulate_run

    with study.at_fault():
        made = simulate_run(experiment(study.settings), rng)
        temperature = study.settings.simulated_temperature(len(made.recording.t))
        return to_record(made.recording, made.attitude, temperature)


def prepare_design(study: Study) -> None:
    """Load, or compile, the kernels of `design`."""
    from inercal.systems.selfcal.before.bounds import bounds
    from inercal.systems.selfcal.before.path_search import shifts, unmodelled
    from inercal.systems.selfcal.filters.problem import problem
    from inercal.systems.selfcal.platform.plan import PlatformPlan, Rest, motion

    settings = study.settings
    with study.at_fault():
        resting, of = motion(PlatformPlan((Rest(0.2),)), settings.world), problem(settings)
        bounds(resting, of)
        shifts(resting, of, unmodelled(settings))


def design(
    study: Study, progress: Callable[[int, int], None] | None = None, executor: Executor | None = None
) -> Result:
    """Find the path that calibrates best; ``evidence`` is the
    `inercal.systems.selfcal.before.path_design.DesignedPath`."""
    from inercal.systems.selfcal.before.path_design import REFERENCES
    from inercal.systems.selfcal.before.path_design import design as search

    say = progress or (lambda done, total: None)
    designed, result = designed_by(
        "design selfcal", study, lambda: search(study.settings, say, executor), REFERENCES
    )

    def page() -> str:
        from inercal.systems.selfcal.figures.design import page as of_page

        return of_page(designed, study.settings, result)

    def picture() -> Picture:
        from inercal.systems.selfcal.figures.design import main

        return main(designed)

    view = View(result, designed.plan.words(), lambda: [designed.table()], page, picture)
    return Result(result, view, designed)
