"""The figures of a calibration from sections: coefficients, what is left of each section, correlation and budget."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from inercal.faces.report.coefficients import budget, correlation, values
from inercal.faces.report.html import Picture
from inercal.faces.report.marks import Axis, Dots, Level, Panel
from inercal.faces.report.panels import draw
from inercal.faces.report.sphere import hemispheres
from inercal.systems.imu.sections.calibration import SectionCalibration
from inercal.systems.imu.sections.outcome import CalibrationFromSections


def pictures(calibration: CalibrationFromSections) -> list[Picture]:
    """Draw what there is to see of a calibration of any status; nothing where there was no fit."""
    estimate, found = calibration.estimate, calibration.found
    if found is None:
        swung = bool(estimate.names)
        return [values(estimate), correlation(estimate), budget(estimate)] if swung else []
    return [*_directions(found), _left(found), values(estimate), correlation(estimate), budget(estimate)]


def _directions(found: SectionCalibration) -> list[Picture]:
    """Verticals and axes of sections, where the fit found some of them."""
    readings, point = found.problem.readings, found.point
    seen: NDArray[np.bool_] = np.any(readings.seen, axis=2)
    felt = seen[:, 0]
    turned = ~felt & seen[:, 2] & (readings.rate != 0.0)
    if not np.any((felt & ~readings.know_up) | (turned & ~readings.know_axis)):
        return []
    ways = np.where(felt[:, None], point.up, point.axis)[felt | turned]
    words = " and ".join(
        name
        for name, some in (("specific force at rest", felt), ("the axis of a rate or turn", turned))
        if some.any()
    )
    return [
        draw(
            "Directions",
            f"Direction of {words} in each section, on two hemispheres seen along −z (equal-area projection; circles "
            "at 30° and 60° from the pole), numbered in their order; near ones share a label.",
            [hemispheres(ways)],
            3.3,
        )
    ]


def _left(found: SectionCalibration) -> Picture:
    """Residuals of the outputs."""
    readings, panels = found.problem.readings, []
    for name, kind in (("accelerometers", 0), ("gyro", 2)):
        seen = readings.seen[:, kind]
        if seen.any():
            numbers = np.broadcast_to(np.arange(1, len(seen) + 1)[:, None], seen.shape)[seen]
            panels.append(
                [
                    Panel(
                        [Level(0.0), Dots(numbers, found.residuals[:, kind][seen])],
                        Axis("section", whole=True, margin=0.02),
                        Axis(f"{name}\n[output]"),
                        grid="y",
                    )
                ]
            )
    return draw(
        "Residuals of the sections",
        "Mean outputs of each section less those of the model, all axes, by the number of the section.",
        panels,
        0.5 + 1.6 * len(panels),
    )
