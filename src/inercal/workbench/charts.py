"""Channels of a recording over time, as much of them as a screen can show: figures of plotly that zoom to samples."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inercal.arrays import Array
from inercal.records.channels import sensor_and_axis
from inercal.records.column import counted_rows
from inercal.records.record import Record
from inercal.report.style import ALARM, COLOURS, plain_unit

PIECES = 1200
"""Pieces of a line, each shown by its least and greatest value: some of the pixels across a screen."""

BLOCK = 512
"""Samples whose least and greatest value is kept, so that a long recording is not gone through again."""


_REST, _TURN = "rgba(68,170,153,0.16)", "rgba(238,136,102,0.10)"
"""Shades of rests and of turns."""

_MARKED, _SHADED = 60, 300
"""Most marks, and most rests, that are drawn."""


@dataclass(frozen=True, eq=False)
class Course:
    """A channel: name, unit, times and values (n,); ``low`` and ``high`` of each block of `BLOCK` samples.

    ``rising`` says whether the times do; where they don't, rows are counted in their place.
    """

    name: str
    unit: str
    t: Array
    values: Array
    low: Array
    high: Array
    rising: bool

    @property
    def sensor(self) -> str:
        """The sensor that it is an axis of."""
        return sensor_and_axis(self.name)[0]


def courses(record: Record) -> tuple[Course, ...]:
    """The channels of a record; times that do not rise are counted."""
    rising: dict[int, bool] = {}
    found = []
    counted = counted_rows(record.columns)
    for column in record.columns.values():
        key = id(column.t)
        if key not in rising:
            rising[key] = not counted and bool(np.all(np.diff(column.t) > 0.0))
        values = np.asarray(column.values, dtype=float)
        low, high = _blocks(values)
        found.append(
            Course(column.name, plain_unit(column.unit.symbol), column.t, values, low, high, rising[key])
        )
    return tuple(found)


def _blocks(values: Array) -> tuple[Array, Array]:
    """Least and greatest value of each block; NaN of one without any."""
    if not len(values):
        return values, values
    starts = np.arange(0, len(values), BLOCK)
    with np.errstate(invalid="ignore"):
        return np.fmin.reduceat(values, starts), np.fmax.reduceat(values, starts)


def line(course: Course, begin: float | None = None, end: float | None = None) -> tuple[Array, Array]:
    """Points (m,) of a channel between two times [s]: all samples, or the least and greatest value of each piece.

    A sample more on each side leads the line out of the picture.
    """
    n = len(course.values)
    t = course.t if course.rising else np.arange(n, dtype=float)
    first = 0 if begin is None else max(int(np.searchsorted(t, begin)) - 1, 0)
    last = n if end is None else min(int(np.searchsorted(t, end, "right")) + 1, n)
    count = max(last - first, 0)
    if count <= 2 * PIECES:
        return t[first:last], course.values[first:last]
    if count <= 2 * PIECES * BLOCK:
        starts = _starts(first, last, PIECES)
        low = np.fmin.reduceat(course.values[:last], starts)
        high = np.fmax.reduceat(course.values[:last], starts)
        return np.repeat(t[starts], 2), _alternating(low, high)
    blocks = _starts(first // BLOCK, -(-last // BLOCK), PIECES)
    stop = -(-last // BLOCK)
    low, high = np.fmin.reduceat(course.low[:stop], blocks), np.fmax.reduceat(course.high[:stop], blocks)
    return np.repeat(t[blocks * BLOCK], 2), _alternating(low, high)


def _starts(first: int, last: int, pieces: int) -> NDArray[np.int64]:
    """Beginnings of pieces of about equal length."""
    return np.linspace(first, last, pieces, endpoint=False).astype(np.int64)


def _alternating(low: Array, high: Array) -> Array:
    """Least and greatest values in turns (2 m,)."""
    return np.column_stack([low, high]).ravel()


@dataclass(frozen=True)
class Notes:
    """Notes on a recording over time: ``marks`` at times [s] with their words, and ``rests`` (begin, end) [s]."""

    marks: Mapping[float, str] = field(default_factory=dict)
    rests: Sequence[tuple[float, float]] = ()


def marks_of(record: Record) -> dict[float, str]:
    """Times [s] at which a finding about a record says it lies, with its code; the first of those at one time."""
    t = next(iter(record.columns.values())).t if record.columns else np.zeros(0)
    marks: dict[float, str] = {}
    for finding in record.findings:
        times = [float(each) for each in re.findall(r"(-?\d[\d.e+-]*) s\b", finding.where)]
        rows = re.fullmatch(r"rows? (.+?)(?: and \d+ more)?", finding.where)
        if rows and len(t):
            numbers = [
                int(each.split("-")[0]) for each in rows[1].split(", ") if each.split("-")[0].isdigit()
            ]
            times += [float(t[min(max(number - 1, 0), len(t) - 1)]) for number in numbers]
        for time in times:
            marks.setdefault(time, finding.code)
    return marks


def figure(
    shown: Sequence[Course], span: tuple[float, float] | None = None, notes: Notes | None = None
) -> dict[str, Any]:
    """A figure of plotly with a panel for each sensor, one time axis with one cursor, and ``notes`` at their times."""
    sensors = list(dict.fromkeys(course.sensor for course in shown))
    begin, end = span or (None, None)
    data = []
    for course in shown:
        t, values = line(course, begin, end)
        axis = sensors.index(course.sensor) + 1
        own = [each.name for each in shown if each.sensor == course.sensor]
        data.append(
            {
                "type": "scattergl" if len(t) > 2 * PIECES else "scatter",
                "mode": "lines+markers" if len(t) < 150 else "lines",
                "name": course.name,
                "x": t.tolist(),
                "y": [None if np.isnan(value) else value for value in values.tolist()],
                "yaxis": f"y{axis}" if axis > 1 else "y",
                "line": {"width": 1, "color": COLOURS[own.index(course.name) % len(COLOURS)]},
                "marker": {"size": 4},
                "hovertemplate": f"%{{y:.6g}} {course.unit}",
            }
        )
    return {"data": data, "layout": _layout(shown, sensors, span, notes or Notes()), "config": CONFIG}


CONFIG = {
    "displaylogo": False,
    "responsive": True,
    "scrollZoom": True,
    "modeBarButtonsToRemove": ["lasso2d", "select2d"],
}
"""Behaviour of figures under the mouse."""


def _bands(rests: Sequence[tuple[float, float]], span: tuple[float, float] | None) -> list[dict[str, Any]]:
    """Shades behind rests, and of another colour behind the turns between them."""
    begin, end = span or (-np.inf, np.inf)
    inside = [(a, b) for a, b in rests if b >= begin and a <= end]
    inside = inside if len(inside) <= _SHADED else []
    turns = [(a[1], b[0]) for a, b in pairwise(inside)]
    return [
        {"type": "rect", "xref": "x", "yref": "paper", "x0": a, "x1": b, "y0": 0, "y1": 1, "layer": "below",
         "line": {"width": 0}, "fillcolor": colour}
        for colour, of in ((_REST, inside), (_TURN, turns))
        for a, b in of
    ]  # fmt: skip


def _lines(marks: Mapping[float, str]) -> list[dict[str, Any]]:
    """Lines at the times of marks."""
    return [
        {"type": "line", "xref": "x", "yref": "paper", "x0": t, "x1": t, "y0": 0, "y1": 1,
         "line": {"color": ALARM, "width": 1, "dash": "dot"}}
        for t in [*marks][:_MARKED]
    ]  # fmt: skip


def _layout(
    shown: Sequence[Course],
    sensors: Sequence[str],
    span: tuple[float, float] | None,
    notes: Notes,
) -> dict[str, Any]:
    """Panels one above the other, the time below, cursors on all of them."""
    timed = all(course.rising for course in shown)
    x: dict[str, Any] = {"title": {"text": "time [s]" if timed else "row"}, "anchor": f"y{len(sensors)}"}
    if len(sensors) < 2:
        x["anchor"] = "y"
    x |= {"showspikes": True, "spikemode": "across", "spikethickness": 1, "spikesnap": "cursor"}
    x["gridcolor"] = "rgba(128,128,128,0.25)"
    if span is not None:
        x |= {"range": list(span), "autorange": False}
    layout: dict[str, Any] = {
        "xaxis": x,
        "hovermode": "x unified",
        "dragmode": "zoom",
        "uirevision": "kept",
        "margin": {"l": 70, "r": 15, "t": 34, "b": 45},
        "height": max(150 * len(sensors) + 84, 284),
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "font": {"color": "#7A858F"},
        "legend": {"orientation": "h", "y": 1.0, "yanchor": "bottom"},
        "hoversubplots": "axis",
        "shapes": [*_bands(notes.rests, span), *_lines(notes.marks)],
        "annotations": [
            {"xref": "x", "yref": "paper", "x": t, "y": 1.0, "text": words, "showarrow": False, "textangle": -90,
             "xanchor": "right", "yanchor": "top", "font": {"color": ALARM, "size": 10}}
            for t, words in [*notes.marks.items()][:_MARKED]
        ],
    }  # fmt: skip
    height = 1.0 / max(len(sensors), 1)
    for k, sensor in enumerate(sensors):
        units = dict.fromkeys(course.unit for course in shown if course.sensor == sensor)
        layout["yaxis" if k == 0 else f"yaxis{k + 1}"] = {
            "title": {"text": f"{sensor} [{', '.join(units)}]"},
            "domain": [1.0 - (k + 0.9) * height, 1.0 - k * height],
            "gridcolor": "rgba(128,128,128,0.25)",
            "zeroline": False,
            "automargin": True,
        }
    return layout
