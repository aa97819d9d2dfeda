"""The figures of a calibration by pose means: poses, residuals, coefficients, correlation and budget."""

from __future__ import annotations

from inercal.faces.report.coefficients import budget, correlation, values
from inercal.faces.report.html import Picture
from inercal.faces.report.marks import Axis, Dots, Level, Panel, Strips
from inercal.faces.report.panels import draw
from inercal.faces.report.sphere import hemispheres
from inercal.foundation.units import parse_unit
from inercal.systems.imu.means.calibration import MeansCalibration

_UG = parse_unit("ug").factor


def pictures(calibration: MeansCalibration) -> list[Picture]:
    """Draw what there is to see of a calibration of any status; nothing where there was no fit."""
    estimate, fit = calibration.estimate, calibration.fit
    if fit is None:
        return []
    residuals, size = fit.fit.residuals / _UG, estimate.statistics["scatter"] / _UG
    sphere = draw(
        "Poses",
        "Direction of the specific force in each pose, in the frame of the accelerometers, on "
        "two hemispheres seen along "
        "−z (equal-area projection; circles at 30° and 60° from the pole), coloured by residual. The numbers count the "
        "poses that were used, in the order of the rows; near ones share a label.",
        [hemispheres(fit.directions, residuals, "|f| − g [µg]")],
        3.3,
    )
    left = draw(
        "Residual of each pose",
        "Size of the calibrated specific force less local gravity, by the number of the row. "
        f"Band: ± {size:.2g} µg, the "
        "standard deviation on which the uncertainties rest.",
        [
            [
                Panel(
                    [Strips((-size, size), level=True), Level(0.0), Dots(calibration.numbers, residuals)],
                    Axis("row", whole=True, margin=0.02),
                    Axis("|f| − g [µg]"),
                    grid="y",
                )
            ]
        ],
        2.1,
    )
    return [sphere, values(estimate), left, correlation(estimate), budget(estimate)]
