"""A turntable in Python: calibration of what stands on it, sensitivity to its errors, positions, simulation."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from inercal.face.imu import of_coefficients
from inercal.face.result import Result, View
from inercal.face.runs import Progress, calibrations, one_run, without_coefficients
from inercal.face.study import Study
from inercal.records.record import Record
from inercal.report import answers
from inercal.rigs.outputs import gravity_reference
from inercal.turntable import task

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def calibrate(
    records: Sequence[Record], study: Study, compare: bool = False, progress: Progress = lambda _: None
) -> Result:
    """Calibrate an instrument that was taken through positions, or gyros by a rate test.

    Parameters and errors are those of `inercal.calibrate`; there is nothing to ``compare``.
    """
    record = one_run(records, "calibrate each by itself")
    found: Any = calibrations([record], study, progress, task.calibrate)[0]

    def page() -> str:
        from inercal.report.html import render
        from inercal.turntable.figures import pictures, rate_pictures

        drawn = pictures(found) if isinstance(found, task.Calibration) else rate_pictures(found)
        return render(found.shown, drawn, "Calibration on a turntable")

    def more() -> list[str]:
        from inercal.turntable.display import tolerances

        return [tolerances(found.estimate)]

    return Result(found.estimate, of_coefficients(found.shown, page, more), found)


def simulate(study: Study, rng: np.random.Generator) -> Record:
    """A simulated record of the positions or the rate test of the study."""
    with study.at_fault():
        return task.simulate(study.settings, rng)


def design(study: Study, progress: Progress = lambda _: None) -> Result:
    """Find the positions that calibrate best; ``evidence`` is the `inercal.turntable.planning.Designed`."""
    from inercal.turntable.planning import REFERENCES

    clock = time.perf_counter()
    with study.at_fault():
        designed = task.design(study.settings, progress)
    timing = {"solve": time.perf_counter() - clock}
    result = without_coefficients(
        "design positions", designed.message, designed.result, study, designed.findings, timing, REFERENCES
    )

    def page() -> str:
        from inercal.turntable.figures import design_page

        return design_page(designed, study.settings, result)

    def draw(figure: Figure) -> None:
        attitude = study.settings.chain.attitude(designed.plan.angles)
        answers.directions(figure, gravity_reference() @ attitude)

    words = f"{len(designed.plan)} positions, by direction of gravity on the instrument"
    return Result(result, View(result, words, lambda: [designed.table()], page, draw), designed)


def sensitivity(
    study: Study,
    maps: bool = True,
    say: Progress = lambda _: None,
    progress: Callable[[int, int], None] | None = None,
) -> Result:
    """Which error of the table matters; ``evidence`` is the `inercal.turntable.analysis.Analysed`.

    Without ``maps`` indices of each position may be left out; ``say`` is told of what takes long.
    """
    from inercal.turntable.analysis import analyse, result, table

    with study.at_fault():
        analysed = analyse(study.settings, maps, say, progress)
    estimate = without_coefficients(
        "sensitivity",
        analysed.message,
        result(analysed),
        study,
        timing={"solve": analysed.solve},
        references=analysed.references,
    )

    def page() -> str:
        from inercal.turntable.figures import sensitivity_page

        return sensitivity_page(analysed, study.settings, estimate)

    def draw(figure: Figure) -> None:
        whole = analysed.aggregate
        parts = {"total order ST": whole.total, "first order S": whole.first}
        answers.bars(figure, analysed.indices.factors, parts, "index over all outputs and positions")

    largest = int(np.nanargmax(np.nan_to_num(analysed.aggregate.total)))
    words = f"largest: {analysed.indices.factors[largest]}, {analysed.what[largest]}"
    view = View(estimate, words, lambda: [table(analysed)], page, draw)
    return Result(estimate, view, analysed)
