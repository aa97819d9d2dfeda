"""Rows of a measurement over time: a figure of plotly of one quantity with its band."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from inercal.bench.workbench import interactive
from inercal.faces.report.marks import Area, Axis, Line, Mark, Panel
from inercal.foundation.results.shown import rounded, short

POINTS = 1000
"""Points of a line at most: some of the pixels across a screen."""

KEPT = 6000
"""Rows that are kept for the picture: two minutes of 50 a second."""

Rows = Sequence[Sequence[float | str | None]]


def drawable(columns: Sequence[str]) -> dict[str, int]:
    """Places of the columns to be drawn over the first one, the time, by their titles: those with a band first."""
    places = {title: k for k, title in enumerate(columns[1:], start=1) if not title.startswith("u_")}
    return dict(sorted(places.items(), key=lambda each: (band(columns, each[0]) is None, each[1])))


def band(columns: Sequence[str], title: str) -> int | None:
    """Place of the standard uncertainty of a column, None without one."""
    return list(columns).index(f"u_{title}") if f"u_{title}" in columns else None


def figure(columns: Sequence[str], rows: Rows, title: str) -> dict[str, Any]:
    """The quantity of that title over time, with a band of two standard uncertainties where it has one."""
    marks: list[Mark] = []
    places = drawable(columns)
    if title in places:
        some = rows[:: max(1, -(-len(rows) // POINTS))]
        t, y, u = (
            np.array([math.nan if k is None else _number(row[k]) for row in some])
            for k in (0, places[title], band(columns, title))
        )
        if band(columns, title) is not None:
            marks.append(Area(t, y - 2.0 * u, y + 2.0 * u, "± U (k = 2)", alpha=0.25))
        marks.append(Line(t, y, title, width=1.5))
    return interactive.figure([Panel(marks, Axis(columns[0] if columns else "t [s]"), Axis(title))], 236.0)


def _number(value: float | str | None) -> float:
    """The number, NaN for what is none."""
    return float(value) if isinstance(value, float | int) else math.nan


def words_of(value: float | str | None, u: float | None) -> str:
    """A value with its expanded uncertainty, k = 2, for a person who looks at it."""
    if value is None or isinstance(value, str):
        return value or "–"
    if u is None or not u > 0.0:
        return short(value, 3)
    return " ± ".join(rounded(value, 2.0 * u))
