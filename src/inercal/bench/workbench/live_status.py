"""A measurement shown: its state as plain objects, for pages and programs, and its rows as a figure of plotly."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from inercal.bench.workbench import interactive
from inercal.bench.workbench.measurements import RestState, WishedMeasurement
from inercal.faces.report.marks import Area, Axis, Line, Mark, Panel
from inercal.foundation.arrays import finite
from inercal.foundation.results.shown import rounded, short
from inercal.systems.imu.limits import LIMITS


def status(live: WishedMeasurement) -> dict[str, Any]:
    """The measurement at this moment, as plain objects."""
    of = live.measurement
    counts = of.counts
    return {
        "state": of.state,
        "words": _words(live),
        "rest_words": _rest_words(live.rest),
        "gone": live.gone,
        "failure": of.failure,
        "verdict": of.verdict,
        "rest": live.rest.at,
        "still_s": finite(live.rest.long),
        "latest": {name: _quantity(each) for name, each in of.latest.items()},
        "channels": {name: _quantity(each) for name, each in of.channels.items()},
        "counts": {
            name: finite(value) if isinstance(value, float) else value
            for name, value in vars(counts).items()
            if name != "sinks"
        },
        "sinks": {
            name: {
                key: finite(value) if isinstance(value, float) else value for key, value in vars(each).items()
            }
            for name, each in counts.sinks.items()
        },
        "said": str(counts),
        "alarms": [vars(each) for each in of.alarms],
        "command": live.command,
        "recording": None if live.recording is None else live.recording.name,
    }


_STATES = {
    "new": "The measurement begins.",
    "preparing": "The measurement begins: the estimator is made ready.",
    "waiting": "The measurement waits for rows.",
    "running": "The measurement is running.",
    "ended": "The measurement has ended.",
}


def _words(live: WishedMeasurement) -> str:
    """The state for people."""
    of = live.measurement
    if of.state == "ended" and of.failure:
        return "The measurement has ended with an error."
    if live.gone:
        return "The source is gone, and is tried again."
    return _STATES[of.state]


def _rest_words(rest: RestState) -> str:
    """Rest for people."""
    if rest.at is None:
        return f"Rest: not known, for nothing was quiet for {LIMITS.initial_rest:g} s yet."
    return f"At rest for {rest.long:.0f} s." if rest.at else "In motion."


def rows(live: WishedMeasurement, after: int) -> dict[str, Any]:
    """Rows of the last two minutes that came after a number, with the number to ask with next."""
    number, found = live.measurement.rows(max(after, 0))
    kept = [[finite(each) if isinstance(each, float) else each for each in row] for row in found]
    return {"next": number, "columns": list(live.measurement.columns), "rows": kept}


def _quantity(quantity: Any) -> dict[str, Any]:
    """A quantity as plain objects."""
    return {"value": quantity.value, "u": quantity.u, "unit": quantity.unit}


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


def row_figure(columns: Sequence[str], rows: Rows, title: str) -> dict[str, Any]:
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
