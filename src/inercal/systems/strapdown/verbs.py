"""A strapdown unit in Python: calibrated from rests and coarse turns, its simulation, and the design of its test."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from inercal.faces.python.result import Result, View, of_coefficients
from inercal.faces.python.study import Progress, Study, designed_by, of_runs
from inercal.foundation.records.record import Record
from inercal.systems.strapdown import task

if TYPE_CHECKING:
    from inercal.faces.report.html import Picture


def prepare(study: Study, compare: bool = False) -> None:
    """Load, or compile, the kernels of `calibrate`, so that they do not count in its time; there is nothing to
    ``compare``."""
    with study.at_fault():
        task.load_kernels(study.settings)


def calibrate(
    records: Sequence[Record], study: Study, compare: bool = False, progress: Progress = lambda _: None
) -> Result:
    """Calibrate a strapdown unit from one run, or from repeat runs together; ``evidence`` has a calibration for each.

    Parameters and errors are those of `inercal.calibrate`; there is nothing to ``compare``.
    """
    title = "Calibration of a strapdown unit, repeat runs"
    return of_runs(records, study, progress, task.calibrate, _one, title)


def _one(calibration: task.StrapdownCalibration) -> Result:
    """The result of one run."""

    def page() -> str:
        from inercal.systems.strapdown import figures

        return figures.page(calibration)

    return Result(calibration.estimate, of_coefficients(calibration.estimate.shown(), page), calibration)


def prepare_design(study: Study) -> None:
    """Load, or compile, the kernels of `design`."""
    from inercal.systems.strapdown.before.bounds import Pieces, bounds
    from inercal.systems.strapdown.settings import TurnPlan

    with study.at_fault():
        bounds(Pieces(study.settings), TurnPlan(((0, 1.0),)))


def design(study: Study, progress: Callable[[int, int], None] | None = None) -> Result:
    """Judge a plan, and search for a better one; ``evidence`` is the
    `inercal.systems.strapdown.before.design.DesignedTurns`."""
    from inercal.systems.strapdown.before.design import REFERENCES
    from inercal.systems.strapdown.before.design import design as search

    by = () if progress is None else (progress,)
    designed, result = designed_by("design strapdown", study, lambda: search(study.settings, *by), REFERENCES)

    def page() -> str:
        from inercal.systems.strapdown import figures

        return figures.design_page(designed, result)

    def picture() -> Picture:
        from inercal.systems.strapdown import figures

        return figures.progress(designed)

    def tables() -> list[str]:
        return [f"{table.title}\n{table.text()}" for table in designed.tables()]

    return Result(result, View(result, designed.message, tables, page, picture), designed)


def simulate(study: Study, rng: np.random.Generator) -> Record:
    """A simulated record of a strapdown unit that rests and turns as the study plans."""
    from inercal.systems.strapdown.model.coefficients import array_of
    from inercal.systems.strapdown.simulate import simulated, to_record

    settings = study.settings
    with study.at_fault():
        return to_record(simulated(settings, array_of(settings.truth, settings.frame), rng))
