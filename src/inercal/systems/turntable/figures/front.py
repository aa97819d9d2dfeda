"""The picture, table and page of a front of tests."""

from __future__ import annotations

import numpy as np

from inercal.faces.report.html import Picture, render
from inercal.faces.report.marks import Axis, Dots, Line, Mark, Panel
from inercal.faces.report.panels import draw
from inercal.faces.report.style import COLOURS
from inercal.foundation.results.result import Estimate
from inercal.foundation.results.shown import Table, heads, short
from inercal.systems.turntable.positions.front import Front, FrontPoint
from inercal.systems.turntable.settings import TurntableSettings


def main(front: Front, settings: TurntableSettings) -> Picture:
    """The picture that answers the question: cost of tolerances over u of the drift, a line by number of positions."""
    unit = settings.instrument.unit
    panels = []
    for constrained in dict.fromkeys(point.constrained for point in front.points):
        chosen = [point for point in front.points if point.constrained == constrained]
        marks: list[Mark] = []
        for k, number in enumerate(dict.fromkeys(len(point.plan) for point in front.points)):
            line = [point for point in chosen if len(point.plan) == number]
            drift = np.array([point.drift for point in line]) / unit.factor
            cost = np.array([point.cost for point in line])
            best = np.array([point.best for point in line], dtype=bool)
            marks.append(Line(drift, cost, "", COLOURS[k], 0.8))
            marks.append(
                Dots(drift[best], cost[best], f"{number} positions", COLOURS[k], "osD^v"[k % 5], size=4.0)
            )
        words = "only positions of low sensitivity" if constrained else "all positions"
        across = Axis(f"u of the drift [{unit.symbol}], {words}", "log", few=True)
        panels.append(Panel(marks, across, Axis("cost of tolerances", "log", few=True), grid="both"))
    return draw(
        "Positions, uncertainty and cost",
        "The cheapest tolerances of the table that reach a wanted u of the drift, by number of positions. A mark is "
        "on the front: no other test is at least as good in number, u and cost.",
        [panels],
        3.0,
        where="left",
        share_y=True,
    )


def tables(front: Front, settings: TurntableSettings) -> list[Table]:
    """Cost of the tolerances by u of the drift and number of positions, of all candidates and of those of low
    sensitivity."""
    unit = settings.instrument.unit
    made = []
    for constrained in dict.fromkeys(point.constrained for point in front.points):
        chosen = [point for point in front.points if point.constrained == constrained]
        numbers = list(dict.fromkeys(len(point.plan) for point in chosen))
        cells = {(point.drift, len(point.plan)): _cell(point) for point in chosen}
        rows = [
            (short(drift / unit.factor, 3), *(cells.get((drift, number), "–") for number in numbers))
            for drift in sorted({point.drift for point in chosen}, reverse=True)
        ]
        columns = heads(f"u of the drift [{unit.symbol}]", *(f"{number} positions" for number in numbers))
        caption = (
            "Cost of the cheapest tolerances, in the unit of [cost], that reach this u, rms over all directions of "
            "gravity; a dash where none do, brackets where another test is as good in all."
        )
        title = "Front, positions of low sensitivity" if constrained else "Front"
        made.append(Table(title, caption, columns, tuple(rows), 0))
    return made


def _cell(point: FrontPoint) -> str:
    """A cost as text."""
    text = short(point.cost, 3)
    return text if point.best else f"({text})"


def page(front: Front, settings: TurntableSettings, estimate: Estimate) -> str:
    """The report of a front as one self-contained HTML page."""
    drawn = [main(front, settings)]
    return render(estimate, drawn, "Positions, uncertainty and cost", (), tables(front, settings))
