"""Figures of plotly over the time of a recording: its channels, as much of them as a screen can show, and residuals.

A channel zooms to its samples; a residual has the time of the recording that it is of.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inercal.bench.workbench import interactive
from inercal.faces.report.marks import Axis, Dots, Level, Line, Mark, Note, Panel, Strips
from inercal.faces.report.style import ALARM, COLOURS, plain_unit
from inercal.foundation.arrays import Array
from inercal.foundation.instruments.terms import shown_unit
from inercal.foundation.records.channels import sensor_and_axis
from inercal.foundation.records.column import counted_rows
from inercal.foundation.records.record import Record

PIECES = 1200
"""Pieces of a line, each shown by its least and greatest value: some of the pixels across a screen."""

BLOCK = 512
"""Samples whose least and greatest value is kept, so that a long recording is not gone through again."""


_MARKED, _SHADED = 60, 300
"""Most marks, and most rests, that are drawn."""


@dataclass(frozen=True, eq=False)
class ChannelCourse:
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


def courses(record: Record) -> tuple[ChannelCourse, ...]:
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
            ChannelCourse(
                column.name, plain_unit(column.unit.symbol), column.t, values, low, high, rising[key]
            )
        )
    return tuple(found)


def _blocks(values: Array) -> tuple[Array, Array]:
    """Least and greatest value of each block; NaN of one without any."""
    if not len(values):
        return values, values
    starts = np.arange(0, len(values), BLOCK)
    with np.errstate(invalid="ignore"):
        return np.fmin.reduceat(values, starts), np.fmax.reduceat(values, starts)


def line(course: ChannelCourse, begin: float | None = None, end: float | None = None) -> tuple[Array, Array]:
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


def course_figure(
    shown: Sequence[ChannelCourse], span: tuple[float, float] | None = None, notes: Notes | None = None
) -> dict[str, Any]:
    """A figure of plotly with a panel for each sensor, one time axis with one cursor, and ``notes`` at their times."""
    across = Axis("time [s]" if all(course.rising for course in shown) else "row", limits=span)
    panels = []
    for sensor in dict.fromkeys(course.sensor for course in shown):
        own = [course for course in shown if course.sensor == sensor]
        marks = [
            Line(*line(course, *(span or ())), course.name, COLOURS[k % len(COLOURS)], 1.0)
            for k, course in enumerate(own)
        ]
        units = ", ".join(dict.fromkeys(course.unit for course in own))
        panels.append(Panel(marks, across, Axis(f"{sensor} [{units}]")))
    return interactive.figure(panels, 150.0, _over(notes or Notes(), span), unified=True)


def _over(notes: Notes, span: tuple[float, float] | None) -> list[Mark]:
    """Strips behind rests, and of another colour behind the turns between them; marks with their words."""
    begin, end = span or (-np.inf, np.inf)
    inside = [(a, b) for a, b in notes.rests if b >= begin and a <= end]
    inside = inside if len(inside) <= _SHADED else []
    over: list[Mark] = [
        Strips(inside, COLOURS[2], 0.16),
        Strips([(a[1], b[0]) for a, b in pairwise(inside)], COLOURS[1], 0.1),
    ]
    for t, words in [*notes.marks.items()][:_MARKED]:
        over += [Level(t, "", ALARM, upright=True), Note((t, 1.0), words, ALARM)]
    return over


@dataclass(frozen=True)
class ResidualKind:
    """Residuals of one kind: what they are, their unit for people, and of each (label, begin, end [s], value)."""

    what: str
    unit: str
    rows: tuple[tuple[str, float, float, float], ...]


def parts_of(result: Mapping[str, Any]) -> tuple[ResidualKind, ...]:
    """The residuals in the command's part of a result (`inercal.foundation.results.result.Estimate`); none where it
    has none."""
    found = [*_poses(result), *_turns(result), *_rests(result), *_unit_turns(result), *_points(result)]
    return tuple(part for part in found if part.rows)


def spans_of(result: Mapping[str, Any]) -> tuple[tuple[float, float], ...]:
    """Stretches (begin, end) [s] that a result took as rests; empty where it does not say."""
    if "intervals" in result:
        return tuple((float(each["start_s"]), float(each["end_s"])) for each in result["intervals"])
    if "rests" in result:
        return tuple(_span(each) for each in result["rests"])
    return tuple((float(each["begin"]), float(each["end"])) for each in result.get("points") or ())


def _span(rest: Any) -> tuple[float, float]:
    """A rest as a pair of times, or as an object."""
    if isinstance(rest, Mapping):
        return float(rest["start_s"]), float(rest["end_s"])
    return float(rest[0]), float(rest[1])


def _poses(result: Mapping[str, Any]) -> Iterator[ResidualKind]:
    """Of |f| in the poses of an IMU moved by hand."""
    unit, size = shown_unit("m/s^2")
    yield ResidualKind(
        "|f| − g of poses",
        unit,
        tuple(
            (f"pose {each['pose']}", each["start_s"], each["end_s"], each["residual_m_s2"] / size)
            for each in result.get("intervals", ())
            if each.get("residual_m_s2") is not None
        ),
    )


def _turns(result: Mapping[str, Any]) -> Iterator[ResidualKind]:
    """Of the turns between poses."""
    unit, size = shown_unit("rad")
    yield ResidualKind(
        "miss of turns",
        unit,
        tuple(
            (
                f"turn from pose {each['from_pose']}",
                each["start_s"],
                each["start_s"] + each["duration_s"],
                each["miss_rad"] / size,
            )
            for each in result.get("turns", ())
            if each.get("miss_rad") is not None
        ),
    )


def _rests(result: Mapping[str, Any]) -> Iterator[ResidualKind]:
    """Of the rests of an IMU on a table, axis by axis, in the units of its outputs."""
    rests = [each for each in result.get("rests", ()) if isinstance(each, Mapping)]
    for sensor in ("acc", "gyro"):
        unit = str(result.get("unit", {}).get(sensor, "")) if rests else ""
        text, size = shown_unit(unit)
        for k, axis in enumerate("xyz"):
            rows = [
                (f"rest {n}", *_span(each), each[f"residual_{sensor}"][k] / size)
                for n, each in enumerate(rests, start=1)
                if each.get(f"residual_{sensor}")
            ]
            yield ResidualKind(f"{sensor}_{axis} at rest", text, tuple(rows))


def _unit_turns(result: Mapping[str, Any]) -> Iterator[ResidualKind]:
    """Of the turns of a strapdown unit, over their noise."""
    rests = [_span(each) for each in result.get("rests", ())]
    rows = [
        (f"turn {n}", before[1], after[0], each["residual_z"])
        for n, (each, before, after) in enumerate(
            zip(result.get("turns", ()), rests, rests[1:], strict=False), start=1
        )
        if each.get("residual_z") is not None
    ]
    yield ResidualKind("turns, over noise", "1", tuple(rows))


def _points(result: Mapping[str, Any]) -> Iterator[ResidualKind]:
    """Scatter of the angle within the points of a run in a tunnel."""
    rows = [
        (f"point {each['number']:g}", each["begin"], each["end"], math.degrees(each["scatter"]))
        for each in result.get("points") or ()
        if each.get("scatter") is not None and each.get("number") is not None
    ]
    yield ResidualKind("scatter of points", "deg", tuple(rows))


def residual_figure(parts: Sequence[ResidualKind], chosen: str = "") -> dict[str, Any]:
    """Residuals over the time of the recording, a panel for each kind; the ``chosen`` one is marked."""
    panels = []
    for title in dict.fromkeys(map(_panel, parts)):
        own = [part for part in parts if _panel(part) == title]
        marks: list[Mark] = [Level(0.0)]
        for k, part in enumerate(own):
            for alone in (False, True):
                rows = [row for row in part.rows if (row[0] == chosen) == alone]
                x, y = [0.5 * (begin + end) for _, begin, end, _ in rows], [value for *_, value in rows]
                name = "" if alone or len(own) < 2 else part.what
                colour, size = (ALARM, 13.0) if alone else (COLOURS[k % len(COLOURS)], 8.0)
                marks.append(Dots(x, y, name, colour, size=size, words=[label for label, *_ in rows]))
        panels.append(Panel(marks, Axis("time [s]"), Axis(title)))
    return interactive.figure(panels, 210.0)


def span_of(parts: Sequence[ResidualKind], label: str) -> tuple[float, float]:
    """The stretch (begin, end) [s] of the residual of that label."""
    return next((begin, end) for part in parts for name, begin, end, _ in part.rows if name == label)


def _panel(part: ResidualKind) -> str:
    """The title of the panel that a part is drawn in: axes of a sensor share one."""
    of = part.what.split("_")[0] if part.what[-4:] == "rest" else part.what
    return f"{of} [{part.unit}]"
