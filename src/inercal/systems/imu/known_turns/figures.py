"""The figures of a gyro turned by known angles: the turns over time, coefficients, correlation and budget."""

from __future__ import annotations

from inercal.faces.report.coefficients import budget, correlation, values
from inercal.faces.report.html import Picture
from inercal.faces.report.marks import Axis, Line, Panel, Strips
from inercal.faces.report.panels import draw
from inercal.faces.report.style import COLOURS, envelope
from inercal.systems.imu.known_turns.calibration import KnownTurnsCalibration


def pictures(calibration: KnownTurnsCalibration) -> list[Picture]:
    """Draw what there is to see of a calibration of any status: nothing where no turn was found."""
    estimate, turns = calibration.estimate, calibration.turns
    drawn = []
    if turns:
        panels = [
            [
                Panel(
                    [
                        Strips([(turn.begin, turn.end)], COLOURS[2], 0.25),
                        Line(*envelope(turn.t, turn.speed), width=0.5),
                    ],
                    Axis("time [s]", margin=0.005),
                    Axis(f"turn about {axis}\noutput less rest"),
                )
            ]
            for axis, turn in turns.items()
        ]
        drawn.append(
            draw(
                "Turns",
                "Size of the output of the gyro less that at rest, by section. Shaded: the turn "
                "whose angle is known; the "
                "rest before and after gives the bias in it.",
                panels,
                0.6 + 1.4 * len(panels),
            )
        )
    return [
        *drawn,
        *([values(estimate), correlation(estimate), budget(estimate)] if estimate.names else []),
    ]
