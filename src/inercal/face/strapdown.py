"""A strapdown unit in Python: calibrated from rests and coarse turns, and its simulation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from inercal.errors import InputError
from inercal.face.result import Result, of_coefficients
from inercal.face.study import Progress, Study, calibrations, with_span
from inercal.records.record import Record
from inercal.strapdown import task


def prepare(study: Study, compare: bool = False) -> None:
    """Load, or compile, the kernels of `calibrate`, so that they do not count in its time; there is nothing to
    ``compare``."""
    if compare:
        raise InputError("compare", "found with a study of kind strapdown, expected one of selfcal or aoa")
    with study.at_fault():
        task.load_kernels(study.settings)


def calibrate(
    records: Sequence[Record], study: Study, compare: bool = False, progress: Progress = lambda _: None
) -> Result:
    """Calibrate a strapdown unit from one run, or from repeat runs together; ``evidence`` has a calibration for each.

    Parameters and errors are those of `inercal.calibrate`; there is nothing to ``compare``.
    """
    from inercal.estimate.repeat import combine_runs

    calibrated = calibrations(records, study, progress, task.calibrate)
    runs = [each.estimate for each in calibrated]
    estimate = runs[0] if len(runs) == 1 else with_span(combine_runs(runs), records[0])
    shown = estimate.shown()

    def page() -> str:
        from inercal.report.coefficients import repeats
        from inercal.report.html import render
        from inercal.strapdown import figures

        if len(calibrated) == 1:
            return figures.page(calibrated[0])
        return render(shown, repeats(shown), "Calibration of a strapdown unit, repeat runs")

    evidence = calibrated[0] if len(calibrated) == 1 else tuple(calibrated)
    return Result(estimate, of_coefficients(shown, page), evidence)


def simulate(study: Study, rng: np.random.Generator) -> Record:
    """A simulated record of a strapdown unit that rests and turns as the study plans."""
    from inercal.strapdown.coefficients import array_of
    from inercal.strapdown.simulate import simulated, to_record

    settings = study.settings
    with study.at_fault():
        return to_record(simulated(settings, array_of(settings.truth, settings.frame), rng))
