"""Pictures and the page of the calibration of a strapdown unit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from inercal.faces.report.coefficients import budget, correlation, values
from inercal.faces.report.html import Picture, render
from inercal.faces.report.marks import Axis, Bars, Level, Line, Mark, Panel, Strips, Style
from inercal.faces.report.panels import draw
from inercal.faces.report.style import ALARM, COLOURS, envelope

if TYPE_CHECKING:
    from inercal.foundation.results.result import Estimate
    from inercal.systems.strapdown.before.design import DesignedTurns
    from inercal.systems.strapdown.task import StrapdownCalibration


def pictures(calibration: StrapdownCalibration) -> list[Picture]:
    """All pictures of a calibration of any status, the main one first."""
    estimate = calibration.estimate
    if not estimate.names:
        return [_rests(calibration)]
    shown = estimate.shown()
    return [_turns(calibration), values(shown), _rests(calibration), correlation(shown), budget(shown)]


def page(calibration: StrapdownCalibration) -> str:
    """The report as one self-contained HTML page."""
    return render(calibration.estimate.shown(), pictures(calibration), "Calibration of a strapdown unit")


def _turns(calibration: StrapdownCalibration) -> Picture:
    """Standardised residual of each turn."""
    z = np.array([turn["residual_z"] for turn in calibration.estimate.result["turns"]])
    numbers = np.arange(1.0, len(z) + 1.0)
    marks: list[Mark] = [
        Bars(numbers, np.zeros(len(z)), z, thickness=0.5, upright=True),
        Level(1.0, "expected", ALARM, 0.9),
    ]
    return draw(
        "Residual of each turn",
        "Attitude and velocity after each turn, as carried through it, less those of the rest that follows: root mean "
        "square over what the stated noise makes expect, with the degrees of freedom that the turn leaves. Turns that "
        "stand out were clipped, filtered or knocked, or the model lacks a term.",
        [
            [
                Panel(
                    marks,
                    Axis("turn", whole=True, margin=0.02),
                    Axis("residual / noise", limits=(0.0, None)),
                    grid="y",
                )
            ]
        ],
        2.1,
    )


def _rests(calibration: StrapdownCalibration) -> Picture:
    """Size of the rate over time, and the rests."""
    samples = calibration.samples
    t = samples.ts * np.arange(1.0, len(samples.rate) + 1.0)
    size = np.degrees(np.linalg.norm(samples.rate, axis=1))
    spans = [(each.start * samples.ts, each.stop * samples.ts) for each in calibration.rests]
    marks: list[Mark] = [Strips(spans, COLOURS[2], 0.25), Line(*envelope(t, size), width=0.5)]
    return draw(
        "Rests",
        f"Size of the rate; shaded: the {len(spans)} rests at which the velocity is known to be zero.",
        [[Panel(marks, Axis("time [s]", margin=0.005), Axis("rate [deg/s]"))]],
        1.9,
    )


def progress(designed: DesignedTurns) -> Picture:
    """Largest u of each kind of coefficient, over its goal, after each rest of a plan."""
    from inercal.systems.strapdown.before.design import by_kind

    marks: list[Mark] = [Level(1.0, "goal", ALARM, 0.9)]
    for k, (kind, ratio) in enumerate(by_kind(designed).items()):
        style: Style = "-" if k < len(COLOURS) else "--"
        marks.append(
            Line(np.arange(len(ratio)), ratio, kind.replace("_", " "), COLOURS[k % len(COLOURS)], 1.0, style)
        )
    return draw(
        "What the turns tell",
        "Largest standard uncertainty of each kind of coefficient, over its goal, after each turn and the rest that "
        "follows: the best that any estimator can reach.",
        [[Panel(marks, Axis("turn", whole=True, margin=0.02), Axis("u / goal", "log"), legend="beside")]],
        3.0,
    )


def design_page(designed: DesignedTurns, estimate: Estimate) -> str:
    """The report of a design as one self-contained HTML page."""
    return render(estimate, [progress(designed)], "Turns of a strapdown unit", (), designed.tables())
