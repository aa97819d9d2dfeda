"""Pictures of what a filter knows from row to row: coefficients with bands, errors, and the path of the joints."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from inercal.arrays import Array
from inercal.estimate.rounding import rounded
from inercal.report import marks as marks_of
from inercal.report.cells import Cell, band, canvas, frame, line
from inercal.report.html import Picture
from inercal.report.marks import Axis, Level, Mark, Panel, Strips
from inercal.report.panels import draw
from inercal.report.style import (
    ALARM,
    COLOURS,
    INK,
    QUIET,
    WIDTH,
    envelope,
    plain_unit,
    svg,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


_PIECES = 150
"""Pieces of a line in a small panel; it has at most twice as many points."""

_BAND = 200
"""Points of a band."""


@dataclass(frozen=True, eq=False)
class Course:
    """A coefficient over time: ``values`` (n,) and their ``u`` (n,) in ``unit``; ``prior`` standard deviation at the
    start about ``centre``, ``truth`` where known, ``bound`` the smallest u at the end that the path allows, where
    known."""

    name: str
    unit: str
    values: Array
    u: Array
    prior: float
    truth: float | None = None
    bound: float | None = None
    centre: float = 0.0


@dataclass(frozen=True, eq=False)
class Line:
    """A line (n,) of a panel, and half the width (n,) of a band about zero that belongs to it."""

    label: str
    values: Array
    band: Array | None = None


def few(count: int, most: int) -> NDArray[np.int64]:
    """At most so many of ``count`` rows, evenly spread, with the first and the last."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.int64))


def converging(title: str, caption: str, t: Array, courses: Sequence[Course]) -> Picture:
    """Coefficients over ``t`` (n,) [s], three a row, with bands of two standard uncertainties.

    Each panel spans what is left in the last 45 % of the time; the prior is a bar at the start.
    """
    shown = few(len(t), _BAND)
    with grid(t, len(courses), 3, 0.85) as (page, axes, places):
        for k, course in enumerate(courses):
            values, u = (np.where(np.abs(x) < 1e100, x, np.nan) for x in (course.values, course.u))
            cell = replace(places[k], y=_span(course, values, u))
            value, last, *_ = rounded(float(values[-1]), float(u[-1]))
            frame(
                axes,
                cell,
                f"{course.name}: {value} ± {last} {plain_unit(course.unit)}",
                times=k >= len(courses) - 3,
            )
            low, high = (values - 2.0 * u)[shown], (values + 2.0 * u)[shown]
            band(axes, cell, t[shown], low, high, color=COLOURS[0], alpha=0.2)
            line(axes, cell, *envelope(t, values, _PIECES), color=COLOURS[0], lw=0.9)
            bar = course.centre + 2.0 * course.prior * np.array([-1.0, 1.0])
            line(axes, cell, np.full(2, t[0] + 0.012 * (t[-1] - t[0])), bar, color=INK, lw=1.6)
            if course.truth is not None:
                line(axes, cell, t[[0, -1]], np.full(2, course.truth), color=ALARM, lw=0.9, ls=":")
        image = svg(page)
    return Picture(title, caption, image, page)


def _span(course: Course, values: Array, u: Array) -> tuple[float, float]:
    """Limits of the y axis: the band of the last 45 % of the time about the last value, truth included."""
    late = slice(11 * len(values) // 20, None)
    middle = float(values[-1]) if np.isfinite(values[-1]) else 0.0
    apart = np.abs(values[late] - middle) + 2.0 * u[late]
    if course.truth is not None:
        apart = np.append(apart, abs(course.truth - middle))
    widest = float(np.nanmax(apart)) if np.isfinite(apart).any() else 0.0
    half = 1.15 * min(widest, 4.0 * course.prior + abs(middle - course.centre)) or 1.0
    return middle - half, middle + half


def falling(title: str, caption: str, t: Array, courses: Sequence[Course]) -> Picture:
    """Standard uncertainties over their priors along ``t`` (n,) [s], on a logarithmic scale, three lines a panel.

    A dash at the end is the bound.
    """
    groups = [courses[k : k + 3] for k in range(0, len(courses), 3)]
    shown = few(len(t), _BAND)
    left = [np.where(course.u > 0.0, course.u, np.nan) / course.prior for course in courses]
    last = [x[np.isfinite(x)].min() for x in left if np.isfinite(x).any()]
    lowest = 10.0 ** np.floor(np.log10(max(min(last, default=0.1), 1e-12)))
    with grid(t, len(groups), 3, 1.45) as (page, axes, places):
        for k, group in enumerate(groups):
            cell = replace(places[k], y=(float(lowest), 2.0), scale="log")
            frame(axes, cell, times=k >= len(groups) - 3, label="u / prior" if k % 3 == 0 else "")
            for j, course in enumerate(group):
                line(axes, cell, t[shown], left[3 * k + j][shown], color=COLOURS[j], lw=1.0)
                axes.text(
                    cell.left + (j + 0.5) * cell.width / 3.0,
                    cell.bottom + cell.height + 0.03,
                    course.name,
                    color=COLOURS[j],
                    fontsize=7.0,
                    fontweight="bold",
                    ha="center",
                )
                if course.bound is not None and 0.0 < course.bound < np.inf:
                    axes.plot(
                        cell.across(t[-1:]),
                        cell.up(np.array([course.bound / course.prior])),
                        "_",
                        color=COLOURS[j],
                        ms=8,
                        mew=1.6,
                    )
        image = svg(page)
    return Picture(title, caption, image, page)


@contextmanager
def grid(
    t: Array, count: int, columns: int, height: float, head: float = 0.28
) -> Iterator[tuple[Figure, Axes, list[Cell]]]:
    """A drawing with ``count`` panels of that ``height`` [inch] over ``t`` (n,) [s], row by row."""
    gap, margin, foot = 0.62, 0.62, 0.42
    wide, rows = (WIDTH - 0.12 - margin * columns) / columns, -(-count // columns)
    total = foot + rows * (height + head)
    with canvas(WIDTH, total) as (page, axes):
        span = float(t[0]), float(t[-1])
        cells = [
            Cell(
                gap + column * (wide + margin),
                total - (row + 1) * (height + head),
                wide,
                height,
                span,
                (0.0, 1.0),
            )
            for row in range(rows)
            for column in range(columns)
        ][:count]
        for cell in cells[-columns:]:
            below = cell.bottom - foot + 0.06
            axes.text(cell.left + 0.5 * cell.width, below, "time [s]", fontsize=7.5, ha="center", va="bottom")
        yield page, axes, cells


def panels_of_lines(
    title: str,
    caption: str,
    t: Array,
    panels: Mapping[str, Sequence[Line]],
    changes: Sequence[float] = (),
) -> Picture:
    """Lines over ``t`` (n,) [s], a panel for each label of an axis, all with the same legend; dots upright at the
    ``changes`` [s].

    The second line and those after it are dashes in turn on top of the first, so that lines that agree are all seen.
    """
    shown = few(len(t), _BAND)
    with grid(t, len(panels), 1, 0.95, 0.2) as (page, axes, places):
        for number, (place, (label, lines)) in enumerate(zip(places, panels.items(), strict=True)):
            thinned = [envelope(t, each.values, _PIECES if len(lines) > 1 else 2 * _PIECES) for each in lines]
            cell = replace(place, y=_limits(thinned))
            frame(axes, cell, times=number == len(panels) - 1, label=label)
            line(axes, cell, t[[0, -1]], np.zeros(2), color=QUIET, lw=0.6)
            for change in changes:
                line(axes, cell, np.full(2, change), np.array(cell.y), color=INK, lw=0.6, ls=":")
            for k, (each, points) in enumerate(zip(lines, thinned, strict=True)):
                if each.band is not None:
                    half = np.where(np.isfinite(each.band), each.band, np.nan)[shown]
                    band(axes, cell, t[shown], -half, half, color=COLOURS[k], alpha=0.25)
                line(
                    axes,
                    cell,
                    *points,
                    color=COLOURS[k],
                    lw=1.4 if k == 0 and len(lines) > 1 else 0.8,
                    ls="-" if k == 0 else (4.0 * k, (4.0, 4.0 * (len(lines) - 1) - 2.0)),
                    label=each.label if number == 0 else "",
                )
        handles, labels = axes.get_legend_handles_labels()
        if len(labels) > 1:
            axes.legend(handles, labels, loc="upper right", ncols=6, borderaxespad=0.1)
        image = svg(page)
    return Picture(title, caption, image, page)


def _limits(lines: Sequence[tuple[Array, Array]]) -> tuple[float, float]:
    """Limits that hold all lines, and zero, with a margin."""
    values = np.concatenate([np.zeros(1), *(y[np.isfinite(y)] for _, y in lines)])
    low, high = float(values.min()), float(values.max())
    margin = 0.06 * (high - low) or 1.0
    return low - margin, high + margin


def lines_by_group(
    title: str, caption: str, t: Array, panels: Mapping[str, Sequence[Line]], symlog: float
) -> Picture:
    """Lines over ``t`` (n,) [s], a panel with its own legend for each label of an axis, on a scale linear up to
    ``symlog`` and logarithmic beyond."""
    shown = few(len(t), 3 * _PIECES)
    rows = []
    for label, lines in panels.items():
        values = [np.where(np.isfinite(each.values), each.values, np.nan)[shown] for each in lines]
        marks: list[Mark] = [Level(0.0)]
        marks += [
            marks_of.Line(t[shown], y, each.label, COLOURS[k], 0.9)
            for k, (each, y) in enumerate(zip(lines, values, strict=True))
        ]
        least, most = np.nanmin([0.0, *np.ravel(values)]), np.nanmax([0.0, *np.ravel(values)])
        far = 1e9 * symlog
        limits = max(min(1.3 * least, -symlog), -far), min(max(1.3 * most, symlog), far)
        up = Axis(label, "symlog", limits, linear=symlog)
        rows.append([Panel(marks, Axis(margin=0.005), up, grid="y", legend="beside")])
    rows[-1] = [replace(rows[-1][0], x=Axis("time [s]", margin=0.005))]
    return draw(title, caption, rows, 0.4 + 2.0 * len(panels))


def path(t: Array, angles: Array, joints: Sequence[str], title: str, caption: str) -> Picture:
    """Angles (n, k) [rad] of joints over ``t`` (n,) [s]; the background has the colour of the joint that turns."""
    shown = few(len(t), 400)
    marks: list[Mark] = []
    for k, (joint, turned) in enumerate(zip(joints, angles.T, strict=True)):
        finite = shown[np.isfinite(turned[shown])]
        marks.append(Strips(turning(t, turned), COLOURS[k], 0.13))
        marks.append(marks_of.Line(t[finite], np.degrees(turned[finite]), joint, COLOURS[k], 1.4))
    marks.append(Level(0.0, "", INK, 0.4))
    reach = np.degrees(angles[np.isfinite(angles)])
    ticks = _quarters(float(reach.min()), float(reach.max())) if len(reach) else None
    axes = Axis("time [s]", margin=0.005), Axis("angle [°]", ticks=ticks)
    return draw(title, caption, [[Panel(marks, *axes, grid="y")]], 2.3)


def _quarters(low: float, high: float) -> list[float]:
    """At most nine angles [deg] between the limits that divide a turn evenly."""
    step = next((s for s in (1.0, 5.0, 15.0, 30.0, 45.0, 90.0, 180.0, 360.0) if high - low <= 8.0 * s), 720.0)
    return [float(k * step) for k in range(math.floor(low / step + 0.1), math.ceil(high / step - 0.1) + 1)]


def turning(
    t: Array, angle: Array, slowest: float = np.radians(0.05), window: float = 2.0
) -> list[tuple[float, float]]:
    """Times (from, to) [s] between which a joint with ``angle`` (n,) [rad] turned faster than ``slowest`` [rad/s].

    The rate is that over a ``window`` [s]; rows that are NaN are left out.
    """
    finite = np.isfinite(angle)
    t, angle = t[finite], angle[finite]
    if len(t) < 2:
        return []
    ends = t[0] + window * np.arange(int((t[-1] - t[0]) / window) + 1)
    ends = np.append(ends, t[-1]) if ends[-1] < t[-1] else ends
    at = np.interp(ends, t, angle)
    moved = np.abs(np.diff(at)) > slowest * np.diff(ends)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], moved, [False]]).astype(np.int64)))
    return [(float(ends[a]), float(ends[b])) for a, b in edges.reshape(-1, 2)]
