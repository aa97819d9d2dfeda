"""A model on a sting in Python: its angle of attack over time, and its simulation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from inercal.faces.python.result import Result, View
from inercal.faces.python.study import Progress, Study, calibrations, designed_by, one_run
from inercal.foundation.records.read import source_of
from inercal.foundation.records.record import Record
from inercal.foundation.results.result import Estimate
from inercal.systems.aoa import task
from inercal.systems.aoa.result.points import Joined, read_balance
from inercal.systems.aoa.result.points import join as joining

if TYPE_CHECKING:
    from inercal.faces.report.html import Picture
    from inercal.systems.aoa.settings import AoaSettings

ONE_RUN = (
    "measure them one after the other, each with the result of the one before (--out run1.json) as its prior "
    "(--set estimator.prior=run1.json)"
)


def prepare(study: Study, compare: bool = False) -> None:
    """Load, or compile, the kernels of `calibrate`, so that they do not count in its time."""
    with study.at_fault():
        task.load_kernels(study.settings, compare)


def calibrate(
    records: Sequence[Record],
    study: Study,
    compare: bool = False,
    progress: Progress = lambda _: None,
    by_point: bool = False,
    join: str | Path | None = None,
) -> Result:
    """Measure the angle of attack; ``evidence`` is the `inercal.systems.aoa.task.Measurement`.

    Parameters and errors are those of `inercal.calibrate`. ``by_point`` asks for a row for
    each point in the place of one for each sample, with the columns of the table ``join`` beside.
    """
    record = one_run(records, ONE_RUN)

    def run(given: Record, settings: AoaSettings, say: Progress) -> task.Measurement:
        return task.measure(given, settings, compare, say)

    other = None if join is None else read_balance(join)
    (measurement,) = calibrations([record], study, progress, run)
    if other is None:
        return _result(measurement, by_point)
    joined = joining(other, measurement.points, measurement.recording, measurement.angles)
    estimate = measurement.estimate
    result = {**estimate.result, "joined": {name: each.tolist() for name, each in joined.columns.items()}}
    estimate = replace(
        estimate,
        findings=(*estimate.findings, *joined.findings),
        inputs=(*estimate.inputs, other.source),
        result=result,
    )
    return _result(replace(measurement, estimate=estimate), by_point, joined)


def runs(
    path: str | Path,
    study: Study,
    read: Callable[[Path], Record],
    compare: bool = False,
    progress: Progress = lambda _: None,
) -> Result:
    """Measure the runs that a table lists; ``evidence`` is the `inercal.systems.aoa.runs.series.Series`.

    ``read`` gives the record of a file; the other parameters and errors are those of `inercal.runs`.
    """
    from inercal.systems.aoa.runs import outcome, series
    from inercal.systems.aoa.runs.run_table import read_runs_table

    table = read_runs_table(path)
    with study.at_fault():
        done = series.measure_runs(table, lambda run: read(run.path), study.settings, compare, progress)
    estimate = replace(done.estimate, inputs=(*done.estimate.inputs, *map(source_of, study.files)))
    done = replace(done, estimate=estimate)

    def page() -> str:
        from inercal.systems.aoa.figures.series import page as of_page

        return of_page(done)

    def picture() -> Picture:
        from inercal.systems.aoa.figures.series import main

        return main(done)

    def tables() -> list[str]:
        return [f"{table.title}\n{table.text()}" for table in outcome.tables(estimate)]

    view = View(
        estimate, estimate.message, tables, page, picture, lambda: series.points_of(done, study.settings)
    )
    return Result(estimate, view, done)


def _result(measurement: task.Measurement, by_point: bool, joined: Joined | None = None) -> Result:
    """A measurement as a result, with what was ``joined`` to its points."""
    from inercal.systems.aoa.result.columns import angles_record, beside, points_record
    from inercal.systems.aoa.result.tables import (
        answer,
        delays,
        displayed,
        on_terminal,
        rest_of_fit,
        use_of_fit,
    )

    estimate, angles = measurement.estimate, measurement.angles

    def tables() -> list[str]:
        listed = [
            *answer(estimate, measurement.points if by_point else (), measurement.settings),
            *on_terminal(estimate),
        ]
        words = [rest_of_fit(estimate), delays(estimate), use_of_fit(estimate)]
        return [*(f"{table.title}\n{table.text()}" for table in listed), *words]

    def page() -> str:
        from inercal.systems.aoa import figures

        return figures.page(measurement)

    def rows() -> Record:
        if by_point:
            own = points_record(measurement.points, measurement.recording, measurement.settings)
            return own if joined is None else beside(own, joined)
        return angles_record(measurement.recording, angles, measurement.settings)

    def picture() -> Picture:
        from inercal.systems.aoa import figures

        return figures.main(measurement)

    view = View(displayed(estimate), _answer(estimate.result), tables, page, picture, rows)
    return Result(estimate, view, measurement)


def prepare_design(study: Study) -> None:
    """Load, or compile, the kernels of `design`."""
    with study.at_fault():
        task.load_kernels(study.settings)


def design(study: Study, progress: Progress = lambda _: None) -> Result:
    """Say what the stated layout of the sensors, and those beside it, can tell of the angle.

    ``evidence`` is the `inercal.systems.aoa.design.ComparedLayouts`.
    """
    from inercal.systems.aoa.design import REFERENCES, compare

    compared, result = designed_by("design aoa", study, lambda: compare(study.settings, progress), REFERENCES)

    def page() -> str:
        from inercal.faces.report.html import render
        from inercal.systems.aoa.figures import layouts

        drawn = layouts.pictures(compared, study.settings)
        return render(result, drawn, "Sensors of a wind-tunnel model", (), compared.tables())

    def picture() -> Picture:
        from inercal.systems.aoa.figures import layouts

        return layouts.main(compared, study.settings)

    def tables() -> list[str]:
        return [f"{table.title}\n{table.text()}" for table in compared.tables()]

    return Result(result, View(result, compared.message, tables, page, picture), compared)


def _answer(result: dict[str, Any] | Any) -> str:
    """The range of the angle and its uncertainty, in a line."""
    ends, u = result["angle"]["range"], result["angle"]["u"]["median"]
    if ends is None:
        return "no angles"
    low, high = np.degrees(ends)
    u_words = "" if u is None else f", u {np.degrees(u):.2g} deg (median)"
    return f"theta from {low:.4g} to {high:.4g} deg{u_words}, by {result['method']}"


def simulate(study: Study, rng: np.random.Generator) -> Record:
    """A simulated record of a model that moves as the study plans."""
    from inercal.systems.aoa.simulate import simulate as simulate_run
    from inercal.systems.aoa.simulate import to_record

    with study.at_fault():
        return to_record(simulate_run(study.settings, rng).recording, study.settings)


def loaded(estimate: Estimate) -> Result:
    """A result that was saved, in the units of the command line; its angles are in files of their own."""
    from inercal.faces.python.result import loaded as plain
    from inercal.systems.aoa.result.tables import displayed

    whole, shown = plain(estimate), displayed(estimate)
    return replace(whole, view=replace(plain(shown).view, answer=_answer(estimate.result)))
