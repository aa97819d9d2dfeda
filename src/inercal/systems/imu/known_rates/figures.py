"""The figures of a gyro at known rates: orientations, residuals, coefficients, correlation and budget."""

from __future__ import annotations

import math

import numpy as np

from inercal.faces.report.coefficients import budget, correlation, values
from inercal.faces.report.html import Picture
from inercal.faces.report.marks import Axis, Dots, Level, Mark, Panel
from inercal.faces.report.panels import draw
from inercal.faces.report.sphere import hemispheres
from inercal.faces.report.style import COLOURS
from inercal.systems.imu.known_rates.calibration import KnownRatesCalibration


def pictures(calibration: KnownRatesCalibration) -> list[Picture]:
    """Draw what there is to see of a calibration of any status; nothing where there was no fit."""
    estimate = calibration.estimate
    if calibration.fit is None:
        return []
    rows = estimate.result["orientations"]
    rates = np.array([row["rate_rad_s"] for row in rows])
    turned = np.flatnonzero(rates != 0.0)
    ppm = 1e6 * np.array([row["residual_rad_s"] for row in rows])[turned] / np.abs(rates[turned])
    directions = np.array([row["direction"] for row in rows])[turned]
    sphere = draw(
        "Orientations",
        "Axis of the table in each orientation in which it turned, in the frame of the gyro, on "
        "two hemispheres seen along "
        "−z (equal-area projection; circles at 30° and 60° from the pole), coloured by residual. The numbers count the "
        "orientations in the order of the files; near ones share a label.",
        [hemispheres(directions, ppm, "|ω| / rate − 1 [ppm]")],
        3.3,
    )
    marks: list[Mark] = [Level(0.0)]
    for k, rate in enumerate(dict.fromkeys(rates[turned].tolist())):
        own = rates[turned] == rate
        label = f"{rate * 30.0 / math.pi:.5g} rpm"
        marks.append(Dots(np.flatnonzero(own) + 1, ppm[own], label, COLOURS[k % len(COLOURS)]))
    left = draw(
        "Residual of each orientation",
        "Size of the calibrated rate over that of the table, less 1.",
        [
            [
                Panel(
                    marks,
                    Axis("orientation", whole=True, margin=0.02),
                    Axis("|ω| / rate − 1 [ppm]"),
                    grid="y",
                )
            ]
        ],
        2.1,
    )
    return [sphere, values(estimate), left, correlation(estimate), budget(estimate)]
