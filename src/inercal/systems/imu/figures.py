"""Pictures and the page of an IMU's calibration, by whichever method it was made."""

from __future__ import annotations

from typing import TypeAlias

from inercal.faces.report.html import Picture, render
from inercal.systems.imu.aided.calibration import AidedCalibration
from inercal.systems.imu.aided.figures import pictures as of_aided
from inercal.systems.imu.sections.figures import pictures as of_sections
from inercal.systems.imu.sections.outcome import CalibrationFromSections

AnyCalibration: TypeAlias = AidedCalibration | CalibrationFromSections


def pictures(calibration: AnyCalibration) -> list[Picture]:
    """All pictures of a calibration of any status, the main one first."""
    match calibration:
        case AidedCalibration():
            return of_aided(calibration)
        case CalibrationFromSections():
            return of_sections(calibration)


def page(calibration: AnyCalibration) -> str:
    """The report of a calibration as one self-contained HTML page."""
    return render(
        calibration.estimate.shown(), pictures(calibration), "Calibration of an inertial measurement unit"
    )
