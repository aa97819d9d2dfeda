"""Pictures and the page of several runs: their points about the mean of each angle, and error terms of oscillations."""

from __future__ import annotations

import math

import numpy as np

from inercal.faces.report.html import Picture, render
from inercal.faces.report.marks import Axis, Dots, Level, Mark, Panel
from inercal.faces.report.panels import draw
from inercal.faces.report.style import COLOURS
from inercal.systems.aoa.runs.outcome import tables
from inercal.systems.aoa.runs.series import Series

_SENSES = (("up", "^", 0), ("down", "v", 1), ("run", "o", 2))


def page(series: Series) -> str:
    """The report of several runs as one self-contained HTML page."""
    pictures = [main(series)]
    if series.oscillating:
        pictures.append(_terms(series))
    return render(series.estimate, pictures, "Runs of a wind-tunnel model", (), tables(series.estimate))


def main(series: Series) -> Picture:
    """Points of all runs less the mean of their angle, with u of that mean; ranges of the runs without points."""
    means = np.array([each.theta for each in series.at_points])
    u = np.degrees([each.u for each in series.at_points])
    marks: list[Mark] = [Level(0.0)]
    for sense, shape, colour in _SENSES:
        theta = np.array(
            [p.theta for each in series.measured if each.run.role == sense for p in each.measurement.points]
        )
        if len(theta) and len(means):
            nearest = means[np.argmin(np.abs(theta[:, None] - means), axis=1)]
            off = np.degrees(theta - nearest)
            marks.append(Dots(np.degrees(theta), off, sense, COLOURS[colour], shape, size=4.0))
    if len(means):
        marks.append(
            Dots(np.degrees(means), np.zeros(len(means)), "u of the mean, twice", size=0.5, up=2.0 * u)
        )
    return draw(
        "Points of all runs",
        "Each point less the mean of all runs at its angle; bars are two standard uncertainties of that mean. Up and "
        "down apart at all angles is hysteresis of the support or of its tare; scatter of repeats is what the tunnel "
        "adds.",
        [[Panel(marks, Axis("mean angle [°]"), Axis("point less mean [°]"), grid="both")]],
        2.6,
        where="left",
    )


def _terms(series: Series) -> Picture:
    """Error terms in closed form over the peak rate, and errors of methods where a reference was recorded."""
    peak = np.array(
        [2.0 * math.pi * each.frequency * math.degrees(each.amplitude) for each in series.oscillating]
    )

    def panel(values: list[dict[str, float]], title: str) -> Panel:
        names = list(dict.fromkeys(name for each in values for name in each))
        marks: list[Mark] = []
        for k, name in enumerate(names):
            y = np.degrees([each.get(name, math.nan) for each in values])
            y = np.where(y > 0.0, y, np.nan)
            marks.append(Dots(peak, y, name, COLOURS[k % len(COLOURS)], "os^vD"[k % 5], size=4.0))
        return Panel(marks, Axis("peak rate [°/s]", "log"), Axis(title, "log"), grid="both")

    panels = [panel([dict(each.terms) for each in series.oscillating], "left of a term [°]")]
    if any(each.errors for each in series.oscillating):
        panels.append(panel([dict(each.errors) for each in series.oscillating], "rms error [°]"))
    return draw(
        "Oscillations",
        "Left of the centrifugal and tangential terms by each way of the paper, in closed form for the stated noise; "
        "right, where a reference was recorded, the rms error of each method.",
        [panels],
        2.8,
        where="left",
    )
