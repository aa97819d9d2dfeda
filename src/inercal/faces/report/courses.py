"""Pictures of a filter from row to row: coefficients with bands, errors, the path of the joints, innovations."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from inercal.faces.report.cells import small
from inercal.faces.report.html import Picture
from inercal.faces.report.marks import Area, Axis, Bars, Dots, Level, Line, Mark, Panel, Strips
from inercal.faces.report.panels import draw
from inercal.faces.report.style import ALARM, COLOURS, INK, QUIET, envelope, plain_unit
from inercal.foundation.arrays import Array
from inercal.foundation.results.shown import rounded

_PIECES = 150
"""Pieces of a line in a small panel; it has at most twice as many points."""

_BAND = 200
"""Points of a band."""

_THREE = (1.0, 1.0, 1.0)
"""Widths of three columns."""


@dataclass(frozen=True, eq=False)
class CoefficientCourse:
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


def few(count: int, most: int) -> NDArray[np.int64]:
    """At most so many of ``count`` rows, evenly spread, with the first and the last."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.int64))


def converging(title: str, caption: str, t: Array, courses: Sequence[CoefficientCourse]) -> Picture:
    """Coefficients over ``t`` (n,) [s], three a row, with bands of two standard uncertainties.

    Each panel spans what is left in the last 45 % of the time; the prior is a bar at the start.
    """
    shown, panels = few(len(t), _BAND), []
    for course in courses:
        values, u = (np.where(np.abs(x) < 1e100, x, np.nan) for x in (course.values, course.u))
        value, last, *_ = rounded(float(values[-1]), float(u[-1]))
        start = np.full(2, t[0] + 0.012 * (t[-1] - t[0]))
        marks: list[Mark] = [
            Area(t[shown], (values - 2.0 * u)[shown], (values + 2.0 * u)[shown], alpha=0.2),
            Line(*envelope(t, values, _PIECES), width=0.9),
            Line(start, course.centre + 2.0 * course.prior * np.array([-1.0, 1.0]), "", INK, 1.6),
        ]
        if course.truth is not None:
            marks.append(Level(course.truth, "", ALARM, 0.9, ":"))
        head = f"{course.name}: {value} ± {last} {plain_unit(course.unit)}"
        panels.append(Panel(marks, times(t), Axis(limits=_span(course, values, u)), head))
    return small(title, caption, panels, 0.85, _THREE)


def times(t: Array) -> Axis:
    """The axis of the times ``t`` (n,) [s]."""
    return Axis("time [s]", limits=(float(t[0]), float(t[-1])))


def _span(course: CoefficientCourse, values: Array, u: Array) -> tuple[float, float]:
    """Limits of the y axis: the band of the last 45 % of the time about the last value, truth included."""
    late = slice(11 * len(values) // 20, None)
    middle = float(values[-1]) if np.isfinite(values[-1]) else 0.0
    apart = np.abs(values[late] - middle) + 2.0 * u[late]
    if course.truth is not None:
        apart = np.append(apart, abs(course.truth - middle))
    widest = float(np.nanmax(apart)) if np.isfinite(apart).any() else 0.0
    half = 1.15 * min(widest, 4.0 * course.prior + abs(middle - course.centre)) or 1.0
    return middle - half, middle + half


def falling(title: str, caption: str, t: Array, courses: Sequence[CoefficientCourse]) -> Picture:
    """Standard uncertainties over their priors along ``t`` (n,) [s], on a logarithmic scale, three lines a panel.

    A dash at the end is the bound.
    """
    shown = few(len(t), _BAND)
    left = [np.where(course.u > 0.0, course.u, np.nan) / course.prior for course in courses]
    last = [x[np.isfinite(x)].min() for x in left if np.isfinite(x).any()]
    lowest = 10.0 ** np.floor(np.log10(max(min(last, default=0.1), 1e-12)))
    panels = []
    for k in range(0, len(courses), 3):
        marks: list[Mark] = []
        for course, part, colour in zip(courses[k : k + 3], left[k : k + 3], COLOURS, strict=False):
            marks.append(Line(t[shown], part[shown], course.name, colour, 1.0))
            if course.bound is not None and 0.0 < course.bound < np.inf:
                marks.append(Dots(t[-1:], [course.bound / course.prior], "", colour, "_", 8.0))
        up = Axis("" if k % 9 else "u / prior", "log", (float(lowest), 2.0))
        panels.append(Panel(marks, times(t), up))
    return small(title, caption, panels, 1.45, _THREE)


def panels_of_lines(
    title: str,
    caption: str,
    t: Array,
    panels: Mapping[str, Mapping[str, Array]],
    halves: Mapping[str, Array] | None = None,
    changes: Sequence[float] = (),
) -> Picture:
    """Lines (n,) by their names over ``t`` (n,) [s], a panel for each label of an axis, all with the same names; dots
    upright at the ``changes`` [s]. ``halves`` (n,) are half the width of a band about zero, by the label of an axis.

    The second line and those after it are dashes in turn on top of the first, so that lines that agree are all seen.
    """
    shown, drawn = few(len(t), _BAND), list[Panel]()
    for label, lines in panels.items():
        count = len(lines)
        thinned = [envelope(t, values, _PIECES if count > 1 else 2 * _PIECES) for values in lines.values()]
        marks: list[Mark] = [Level(0.0), *(Level(each, "", INK, 0.6, ":", upright=True) for each in changes)]
        if halves and label in halves:
            half = np.where(np.isfinite(halves[label]), halves[label], np.nan)[shown]
            marks.append(Area(t[shown], -half, half, alpha=0.25))
        for k, (name, points) in enumerate(zip(lines, thinned, strict=True)):
            dashes = (4.0 * k, (4.0, 4.0 * (count - 1) - 2.0)) if k else "-"
            said = name if count > 1 and not drawn else ""
            marks.append(Line(*points, said, COLOURS[k], 1.4 if k == 0 and count > 1 else 0.8, dashes))
        drawn.append(Panel(marks, times(t), Axis(label, limits=_limits(thinned))))
    return small(title, caption, drawn, 0.95, head=0.22)


def _limits(lines: Sequence[tuple[Array, Array]]) -> tuple[float, float]:
    """Limits that hold all lines, and zero, with a margin."""
    values = np.concatenate([np.zeros(1), *(y[np.isfinite(y)] for _, y in lines)])
    low, high = float(values.min()), float(values.max())
    margin = 0.06 * (high - low) or 1.0
    return low - margin, high + margin


def lines_by_group(
    title: str, caption: str, t: Array, panels: Mapping[str, Mapping[str, Array]], symlog: float
) -> Picture:
    """Lines (n,) by their names over ``t`` (n,) [s], a panel with its own legend for each label of an axis, on a scale
    linear up to ``symlog`` and logarithmic beyond."""
    shown = few(len(t), 3 * _PIECES)
    rows = []
    for label, lines in panels.items():
        values = [np.where(np.isfinite(each), each, np.nan)[shown] for each in lines.values()]
        marks: list[Mark] = [Level(0.0)]
        marks += [
            Line(t[shown], y, name, COLOURS[k], 0.9)
            for k, (name, y) in enumerate(zip(lines, values, strict=True))
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
        marks.append(Line(t[finite], np.degrees(turned[finite]), joint, COLOURS[k], 1.4))
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


_WINDOW = 50
"""Rows of a running mean."""

_LAGS = 30
"""Rows by which innovations are shifted against each other."""

_CONFIDENCE = 0.95
"""Probability of the bands."""


def nis(t: Array, values: Array, dims: NDArray[np.int64]) -> Picture:
    """Normalised innovations squared over time, as running means in their band.

    ``t`` (m,) [s], ``values`` (m,) NaN where nothing was measured, ``dims`` (m,) how many scalars each is of.
    """
    from scipy.special import chdtri

    finite = np.isfinite(values) & (dims > 0)
    t, values, dims = t[finite], np.clip(values[finite], 0.0, 1e12), dims[finite]
    window, tail = min(_WINDOW, len(values)), 0.5 * (1.0 - _CONFIDENCE)
    title = "Normalised innovations squared"
    if not window:
        return draw(title, "Nothing was measured.", [[Panel((), Axis("time [s]"), Axis("NIS"))]], 2.4)
    ends = np.arange(0, len(values) - window + 1)
    run, many = (_running(x.astype(float), window) for x in (values, dims))
    middle = 0.5 * (t[ends] + t[ends + window - 1])
    # chdtri takes the probability of more
    low, high = chdtri(many, 1.0 - tail) / window, chdtri(many, tail) / window
    shown = np.unique(np.linspace(0, len(ends) - 1, min(len(ends), 200)).round().astype(np.int64))
    marks: list[Mark] = [
        Area(middle[shown], low[shown], high[shown], "95 % band", alpha=0.18),
        Line(*envelope(middle, run / window, 300), f"mean of {window} rows"),
        Line(middle[shown], many[shown] / window, "expected", QUIET, 0.7),
    ]
    scale: Literal["linear", "log"] = "log" if (run / window).max() > 5.0 * high.max() else "linear"
    total, mean = int(dims.sum()), float(values.mean())
    least, most = (float(chdtri(total, p)) / len(values) for p in (1.0 - tail, tail))
    verdict = "within" if least <= mean <= most else "above" if mean > most else "below"
    outside = float(np.mean((run < chdtri(many, 1.0 - tail)) | (run > chdtri(many, tail))))
    return draw(
        title,
        f"What each row tells beyond what the filter expected, squared and over its covariance (NIS), as the mean of "
        f"{window} rows, with the band in which 95 % of such means lie if model and noise are right; "
        f"{100.0 * outside:.0f} % of them lie outside. Over all {len(values)} rows the mean is {mean:.3f}, {verdict} "
        f"{least:.3f} to {most:.3f}, its own 95 % band about {total / len(values):.4g}. Above: noise or model are "
        "worse than stated; below: better.",
        [[Panel(marks, Axis("time [s]", margin=0.005), Axis("NIS", scale), grid="y")]],
        2.4,
    )


def _running(x: Array, window: int) -> Array:
    """Sums of so many neighbours."""
    total = np.concatenate([[0.0], np.cumsum(x)])
    return np.asarray(total[window:] - total[:-window])


def innovations(t: Array, values: Array, channels: Sequence[str]) -> Picture:
    """Normalised innovations (m, c) over ``t`` (m,) [s], and beside each channel its autocorrelation."""
    panels, beyond = list[Panel](), []
    for channel, own in zip(channels, values.T, strict=True):
        largest = float(np.max(np.abs(own), initial=0.0, where=np.isfinite(own)))
        top = max(4.0, 1.1 * min(largest, 1e6))
        over: list[Mark] = [
            Area(t[[0, -1]], [-2.0, -2.0], [2.0, 2.0]),
            Line(*envelope(t, own, 250), width=0.5),
        ]
        r, pairs = autocorrelation(own, _LAGS)
        limit = 2.0 / np.sqrt(np.maximum(pairs, 1))  # twice the standard deviation of white noise
        most = max(0.1, 1.1 * float(np.max(np.abs(r), initial=0.0)))
        lags, far = np.arange(1.0, len(r) + 1.0), np.abs(r) > limit
        beyond.append(f"{channel} {int(far.sum())}")
        shifted: list[Mark] = [Area(lags, -limit, limit)]
        for chosen, colour in ((~far, COLOURS[0]), (far, ALARM)):
            shifted.append(Bars(lags[chosen], 0.0 * r[chosen], r[chosen], "", colour, upright=True))
        heads = ("", "") if panels else ("innovation / its standard deviation", "autocorrelation")
        panels.append(Panel(over, times(t), Axis(channel, limits=(-top, top)), heads[0]))
        along = Axis("lag [rows]", limits=(0.0, _LAGS + 1.0))
        panels.append(Panel(shifted, along, Axis(limits=(-most, most)), heads[1]))
    return small(
        "Innovations and whether they are white",
        "Left: measurement less what the filter expected, over its standard deviation; least and greatest value of "
        "pieces of the recording; band: ± 2. Right: correlation with itself some rows later; band: ± two standard "
        f"deviations of white noise, red beyond. Of {_LAGS} lags one or two lie beyond by chance; many, or a slow "
        f"fall, show what the model lacks. Beyond: {', '.join(beyond)}.",
        panels,
        0.72,
        (4.05, 1.7),
        0.18,
    )


def autocorrelation(x: Array, lags: int) -> tuple[Array, NDArray[np.int64]]:
    """Correlation of ``x`` (n,) about zero with itself 1 to ``lags`` rows later, and the number of pairs of each.

    NaN are left out in pairs; 0 where there are no pairs.
    """
    finite = np.isfinite(x)
    values = np.where(finite, x, 0.0)
    power = float(np.mean(values[finite] ** 2)) if finite.any() else 1.0
    count = np.array(
        [int((finite[k:] & finite[: len(x) - k]).sum()) for k in range(1, min(lags, len(x) - 1) + 1)]
    )
    sums = np.array([float(values[k:] @ values[: len(x) - k]) for k in range(1, len(count) + 1)])
    return sums / np.maximum(count, 1) / (power or 1.0), count.astype(np.int64)
