"""An IMU in Python: calibrated by any method, from one or several runs, and over temperature."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from inercal.faces.python.result import Result, of_coefficients
from inercal.faces.python.study import Study
from inercal.foundation.records.record import Record
from inercal.systems.imu.task import calibrate as calibrate_run

if TYPE_CHECKING:
    from inercal.systems.imu.temperature.model import TemperatureModel


def calibrate(
    records: Sequence[Record],
    study: Study,
    compare: bool = False,
    progress: Callable[[str], None] = lambda _: None,
) -> Result:
    """Calibrate an IMU from one run, or from repeat runs together; ``evidence`` has a calibration for each.

    Parameters and errors are those of `inercal.calibrate`; there is nothing to ``compare``.
    """
    from inercal.faces.python.study import calibrations, of_files, with_span
    from inercal.foundation.results.repeat import combine_runs
    from inercal.systems.imu.task import calibrate_files, in_order

    if in_order(study.settings):
        calibrated = [of_files(records, study, progress, calibrate_files)]
    else:
        calibrated = calibrations(records, study, progress, calibrate_run)
    runs = [each.estimate for each in calibrated]
    estimate = runs[0] if len(runs) == 1 else with_span(combine_runs(runs), records[0])
    shown = estimate.shown()

    def page() -> str:
        from inercal.faces.report.coefficients import repeats
        from inercal.faces.report.html import render
        from inercal.systems.imu import figures

        if len(calibrated) == 1:
            return figures.page(calibrated[0])
        return render(shown, repeats(shown), "Calibration of an inertial measurement unit")

    return Result(
        estimate, of_coefficients(shown, page), calibrated[0] if len(calibrated) == 1 else tuple(calibrated)
    )


def simulate(study: Study, rng: np.random.Generator) -> Record:
    """A simulated record of an IMU in the poses, positions or rests of the study."""
    from inercal.systems.imu import task

    with study.at_fault():
        return task.simulate(study.settings, rng)


def of_temperature(model: TemperatureModel) -> Result:
    """The temperature model of a sensor as a result."""
    from inercal.faces.report.html import render

    def page() -> str:
        from inercal.systems.imu.temperature.figures import pictures

        return render(shown, pictures(model), "Bias and scale factor against temperature")

    shown = model.estimate.shown()
    return Result(model.estimate, of_coefficients(shown, page), model)
