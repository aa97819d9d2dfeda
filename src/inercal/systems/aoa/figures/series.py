"""Pictures and the page of several runs: their points about the mean of each angle, and error terms of oscillations."""

from __future__ import annotations

import numpy as np

from inercal.faces.report.html import Picture, render
from inercal.faces.report.marks import Axis, Dots, Level, Mark, Panel
from inercal.faces.report.panels import draw
from inercal.faces.report.style import COLOURS
from inercal.systems.aoa.figures import paper
from inercal.systems.aoa.runs.outcome import tables
from inercal.systems.aoa.runs.series import Series

_SENSES = (("up", "^", 0), ("down", "v", 1), ("run", "o", 2))


def page(series: Series) -> str:
    """The report of several runs as one self-contained HTML page."""
    drawn = [main(series), *paper.pictures(series)]
    return render(series.estimate, drawn, "Runs of a wind-tunnel model", (), tables(series.estimate))


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
