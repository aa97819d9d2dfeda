"""A turntable in Python: calibration of what stands on it, sensitivity to its errors, positions, simulation."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from inercal.faces.python.result import Result, View, of_coefficients
from inercal.faces.python.study import Progress, Study, designed_by, of_runs
from inercal.foundation.computing.executors import Executor
from inercal.foundation.records.record import Record
from inercal.foundation.results.result import Estimate, without_coefficients
from inercal.systems.turntable import task

if TYPE_CHECKING:
    from inercal.faces.report.html import Picture


def calibrate(
    records: Sequence[Record], study: Study, compare: bool = False, progress: Progress = lambda _: None
) -> Result:
    """Calibrate an instrument that was taken through positions, or gyros by a rate test, from one run or several.

    Parameters and errors are those of `inercal.calibrate`; there is nothing to ``compare``. Of repeat runs
    ``evidence`` has a calibration for each.
    """
    title = "Repeat runs on a turntable"
    return of_runs(records, study, progress, task.calibrate, _one, title, _displayed)


def _displayed(estimate: Estimate, first: Any) -> Estimate:
    """The estimate of repeat runs in the unit of the first."""
    from inercal.systems.turntable.display import displayed

    return displayed(estimate, first.readings.unit)


def _one(calibration: Any) -> Result:
    """The result of one run."""

    def page() -> str:
        from inercal.systems.turntable import figures

        return figures.page(calibration)

    def more() -> list[str]:
        from inercal.systems.turntable.display import tolerances

        return [tolerances(calibration.estimate)]

    return Result(calibration.estimate, of_coefficients(calibration.shown, page, more), calibration)


def simulate(study: Study, rng: np.random.Generator) -> Record:
    """A simulated record of the positions or the rate test of the study."""
    with study.at_fault():
        return task.simulate(study.settings, rng)


def design(study: Study, progress: Progress = lambda _: None, executor: Executor | None = None) -> Result:
    """Find the positions that calibrate best.

    ``evidence`` is the `inercal.systems.turntable.positions.planning.DesignedPositions`.
    """
    from inercal.systems.turntable.positions.planning import REFERENCES
    from inercal.systems.turntable.positions.planning import design as planned

    designed, result = designed_by(
        "design positions", study, lambda: planned(study.settings, progress, executor), REFERENCES
    )

    def page() -> str:
        from inercal.systems.turntable.figures.design import page as of_page

        return of_page(designed, study.settings, result)

    def picture() -> Picture:
        from inercal.systems.turntable.figures.design import main

        return main(designed, study.settings)

    words = f"{len(designed.plan)} positions, by direction of gravity on the instrument"
    return Result(result, View(result, words, lambda: [designed.table()], page, picture), designed)


def design_tolerances(study: Study, progress: Progress = lambda _: None) -> Result:
    """Find the cheapest tolerances that reach the goals of the study.

    ``evidence`` is the `inercal.systems.turntable.positions.tolerance_design.ToleranceDesign`.
    """
    from inercal.foundation.records.read import source_of
    from inercal.systems.turntable.positions.tolerance_design import REFERENCES
    from inercal.systems.turntable.positions.tolerance_design import design_tolerances as searched
    from inercal.systems.turntable.positions.tolerance_result import result as as_result
    from inercal.systems.turntable.positions.tolerance_result import table

    clock = time.perf_counter()
    with study.at_fault():
        designed = searched(study.settings, progress)
    timing = {"solve": time.perf_counter() - clock}
    made = as_result(designed, study.settings)
    estimate = without_coefficients(
        "design tolerances",
        designed.message,
        made,
        map(source_of, study.files),
        designed.findings,
        timing,
        study.keys,
        references=REFERENCES,
    )

    def page() -> str:
        from inercal.systems.turntable.figures.tolerances import page as of_tolerances

        return of_tolerances(designed, study.settings, estimate)

    def picture() -> Picture:
        from inercal.systems.turntable.figures.tolerances import main

        return main(made)

    words = f"a cost of {designed.best.cost:.4g}, {designed.present_cost:.4g} as they are"
    return Result(
        estimate, View(estimate, words, lambda: [table(made, study.settings)], page, picture), designed
    )


def sensitivity(
    study: Study,
    maps: bool = True,
    say: Progress = lambda _: None,
    progress: Callable[[int, int], None] | None = None,
    executor: Executor | None = None,
) -> Result:
    """Influence of each error of the table; ``evidence`` is the
    `inercal.systems.turntable.sensitivity.Analysed`.

    Without ``maps`` indices of each position may be left out; ``say`` takes messages about long steps.
    """
    from inercal.foundation.records.read import source_of
    from inercal.systems.turntable.sensitivity import analyse, result, table

    with study.at_fault():
        analysed = analyse(study.settings, maps, say, progress, executor)
    estimate = without_coefficients(
        "sensitivity",
        analysed.message,
        result(analysed),
        map(source_of, study.files),
        timing={"solve": analysed.solve},
        settings=study.keys,
        references=analysed.references,
    )

    def page() -> str:
        from inercal.systems.turntable.figures.sensitivity import page as of_sensitivity

        return of_sensitivity(analysed, study.settings, estimate)

    def picture() -> Picture:
        from inercal.systems.turntable.figures.sensitivity import ranking

        return ranking(analysed.indices, analysed.aggregate)

    largest = int(np.nanargmax(np.nan_to_num(analysed.aggregate.total)))
    words = f"largest: {analysed.indices.factors[largest]}, {analysed.what[largest]}"
    view = View(estimate, words, lambda: [table(analysed)], page, picture)
    return Result(estimate, view, analysed)


def loaded(estimate: Estimate) -> Result:
    """A result that was saved, in the unit of the outputs."""
    from inercal.faces.python.result import loaded as plain
    from inercal.foundation.units import parse_unit
    from inercal.systems.turntable.display import displayed

    if "output_unit" not in estimate.conditions:
        return plain(estimate)
    return plain(estimate, displayed(estimate, parse_unit(estimate.conditions["output_unit"])))
