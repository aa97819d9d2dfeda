"""Rows of a measurement over time: a figure of plotly of one quantity with its band."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from inercal.estimate.rounding import rounded, short
from inercal.report.style import COLOURS
from inercal.workbench.charts import CONFIG

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
    data: list[dict[str, Any]] = []
    places = drawable(columns)
    if title in places:
        some = rows[:: max(1, -(-len(rows) // POINTS))]
        place, u = places[title], band(columns, title)
        t, y = ([_number(row[k]) for row in some] for k in (0, place))
        if u is not None:
            half = [_number(row[u]) for row in some]
            ends = [
                [None if a is None or b is None else a + sign * 2.0 * b for a, b in zip(y, half, strict=True)]
                for sign in (-1.0, 1.0)
            ]
            line = {"type": "scatter", "mode": "lines", "line": {"width": 0}, "hoverinfo": "skip", "x": t}
            data += [
                {**line, "y": ends[0], "showlegend": False},
                {
                    **line,
                    "y": ends[1],
                    "fill": "tonexty",
                    "fillcolor": "rgba(68,119,170,0.25)",
                    "name": "± U (k = 2)",
                },
            ]
        data.append(
            {
                "type": "scatter",
                "mode": "lines",
                "name": title,
                "x": t,
                "y": y,
                "line": {"width": 1.5, "color": COLOURS[0]},
            }
        )
    axis = {"gridcolor": "rgba(128,128,128,0.25)", "zeroline": False, "automargin": True}
    layout = {
        "xaxis": {**axis, "title": {"text": columns[0] if columns else "t [s]"}},
        "yaxis": {**axis, "title": {"text": title}},
        "height": 320,
        "margin": {"l": 70, "r": 15, "t": 34, "b": 45},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "font": {"color": "#7A858F"},
        "legend": {"orientation": "h", "y": 1.0, "yanchor": "bottom"},
        "uirevision": "kept",
        "showlegend": True,
    }
    return {"data": data, "layout": layout, "config": CONFIG}


def _number(value: float | str | None) -> float | None:
    """A finite number, else None."""
    return value if isinstance(value, float | int) and math.isfinite(value) else None


def words_of(value: float | str | None, u: float | None) -> str:
    """A value with its expanded uncertainty, k = 2, for a person who looks at it."""
    if value is None or isinstance(value, str):
        return value or "–"
    if u is None or not u > 0.0:
        return short(value, 3)
    return " ± ".join(rounded(value, 2.0 * u))
