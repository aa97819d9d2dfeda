"""An IMU in Python: calibrated by any method, from one or several runs, and over temperature."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from inercal.faces.python.result import Result, View, of_coefficients
from inercal.faces.python.study import Progress, Study, designed_by, of_files, of_runs
from inercal.foundation.errors import StudyError
from inercal.foundation.records.record import Record
from inercal.systems.imu.settings import SectionsSettings
from inercal.systems.imu.task import calibrate as calibrate_run
from inercal.systems.imu.task import calibrate_files, in_order

if TYPE_CHECKING:
    from inercal.faces.report.html import Picture
    from inercal.systems.imu.sections.design import DesignedSections
    from inercal.systems.imu.task import Calibrated
    from inercal.systems.imu.temperature.model import TemperatureModel


def calibrate(
    records: Sequence[Record], study: Study, compare: bool = False, progress: Progress = lambda _: None
) -> Result:
    """Calibrate an IMU from one run, or from repeat runs together; ``evidence`` has a calibration for each.

    Parameters and errors are those of `inercal.calibrate`; there is nothing to ``compare``.
    """
    if in_order(study.settings):
        return _one(of_files(records, study, progress, calibrate_files))
    title = "Calibration of an inertial measurement unit"
    return of_runs(records, study, progress, calibrate_run, _one, title)


def _one(calibration: Calibrated) -> Result:
    """The result of one calibration."""

    def page() -> str:
        from inercal.systems.imu import figures

        return figures.page(calibration)

    return Result(calibration.estimate, of_coefficients(calibration.estimate.shown(), page), calibration)


def simulate(study: Study, rng: np.random.Generator) -> Record:
    """A simulated record of an IMU in the poses, positions or rests of the study."""
    from inercal.systems.imu import task

    with study.at_fault():
        return task.simulate(study.settings, rng)


def design(study: Study) -> Result:
    """Say what the sections of a study would tell, and which one more would help most; ``evidence`` is the
    `inercal.systems.imu.sections.design.DesignedSections`."""
    from inercal.faces.report.html import render
    from inercal.systems.imu.sections import figures
    from inercal.systems.imu.sections.design import REFERENCES
    from inercal.systems.imu.sections.design import design as judge

    settings = study.settings
    options = SectionsSettings() if settings.method is None else settings.method

    def judged() -> DesignedSections:
        if not isinstance(options, SectionsSettings):
            raise StudyError("imu.method", "found another method, expected sections to judge")
        return judge(settings, options)

    designed, result = designed_by("design sections", study, judged, REFERENCES)

    def picture() -> Picture:
        return figures.foretold(designed)

    def page() -> str:
        return render(result, [picture()], "Sections of an IMU before the test", (), designed.tables())

    def tables() -> list[str]:
        return [f"{table.title}\n{table.text()}" for table in designed.tables()]

    return Result(result, View(result, designed.message, tables, page, picture), designed)


def of_temperature(model: TemperatureModel) -> Result:
    """The temperature model of a sensor as a result."""
    from inercal.faces.report.html import render

    def page() -> str:
        from inercal.systems.imu.temperature.figures import pictures

        return render(shown, pictures(model), "Bias and scale factor against temperature")

    shown = model.estimate.shown()
    return Result(model.estimate, of_coefficients(shown, page), model)
