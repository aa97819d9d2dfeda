"""Pictures of an angle over time: lines and bands in panels above each other, and what happened to the recording."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from inercal.arrays import Array
from inercal.report.cells import Cell, band, frame, line
from inercal.report.courses import grid
from inercal.report.html import Picture
from inercal.report.style import ALARM, COLOURS, INK, QUIET, envelope, svg

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def known(x: Array) -> Array:
    """The finite values."""
    return x[np.isfinite(x)]


def span(x: Array) -> str:
    """The range, in words."""
    numbers = known(x)
    return f"{numbers.min():.4g} to {numbers.max():.4g}" if len(numbers) else "no number"


def largest(x: Array) -> float:
    """The largest size; 0 without any."""
    return float(np.max(np.abs(known(x)), initial=0.0))


def middle(x: Array) -> float:
    """The median; NaN without any."""
    numbers = known(x)
    return float(np.median(numbers)) if len(numbers) else math.nan


def rms(x: Array) -> float:
    """The root mean square; NaN without any."""
    numbers = known(x)
    return float(np.sqrt(np.mean(numbers**2))) if len(numbers) else math.nan


Flags = NDArray[np.bool_]

_PIECES, _FEWEST, _IN_ALL = 700, 200, 2800
"""Pieces of a line, which has at most twice as many points: at most, at least, and of all panels together."""

_NARROWEST = 1.0 / 600.0
"""Part of the width of a panel that a mark has at least."""

_DECADES = 6.0
"""Powers of ten that a logarithmic panel spans at most."""

_TEXT = 0.066
"""Width of a letter in the head of a panel [inch], about."""


@dataclass(frozen=True, eq=False)
class Panel:
    """Lines (n,) over time by their names, with the ``label`` of their axis and a ``title`` above.

    ``band`` from (n,) to (n,); ``levels`` are drawn across, by their names; ``zero``: a line at 0, always in sight.
    """

    label: str
    lines: Mapping[str, Array]
    title: str = ""
    band: tuple[Array, Array] | None = None
    levels: Mapping[str, float] = field(default_factory=dict)
    scale: Literal["linear", "log"] = "linear"
    zero: bool = False


@dataclass(frozen=True, eq=False)
class Marks:
    """Marks along the time [s]: stretches (k, 2) in which samples were ``saturated``, in which there are none,
    ``gaps``, and in which the model was ``moving``; times (k,) at which an estimator started anew, ``restarts``. What
    comes in the first ``settling`` [s], or tenth, does not count where axes are spanned."""

    saturated: Array = field(default_factory=lambda: np.empty((0, 2)))
    gaps: Array = field(default_factory=lambda: np.empty((0, 2)))
    moving: Array = field(default_factory=lambda: np.empty((0, 2)))
    restarts: Array = field(default_factory=lambda: np.empty(0))
    settling: float = 0.0

    @property
    def words(self) -> str:
        """Sentences that explain the marks; empty without any."""
        texts = (
            ("Red strip: saturated samples.", self.saturated),
            ("Grey strip: no rows.", self.gaps),
            ("Dashes: the filter started anew.", self.restarts),
        )
        return "".join(f" {text}" for text, stretches in texts if len(stretches))


def stretches(t: Array, flags: Flags) -> Array:
    """Times (k, 2) [s] from and to which ``flags`` (n,) hold, wide enough to be seen; those that touch are one."""
    if not flags.any():
        return np.empty((0, 2))
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    least = 0.5 * _NARROWEST * float(t[-1] - t[0])
    return _joined(t[edges[::2]] - least, t[edges[1::2] - 1] + least)


def gaps(t: Array) -> Array:
    """Times (k, 2) [s] between which there are no rows, where that can be seen."""
    if len(t) < 3:
        return np.empty((0, 2))
    step = np.diff(t)
    wide = np.flatnonzero(step > max(5.0 * float(np.median(step)), _NARROWEST * float(t[-1] - t[0])))
    return np.stack([t[wide], t[wide + 1]], axis=-1)


def _joined(low: Array, high: Array) -> Array:
    """Stretches, in the order of their starts, with those that touch made one."""
    reach = np.maximum.accumulate(high)
    first = np.concatenate([[True], low[1:] > reach[:-1]])
    return np.stack([low[first], reach[np.append(np.flatnonzero(first)[1:] - 1, -1)]], axis=-1)


def over_time(
    title: str,
    caption: str,
    t: Array,
    panels: Sequence[Panel],
    marks: Marks | None = None,
    height: float = 0.95,
) -> Picture:
    """Panels above each other over ``t`` (n,) [s], increasing; the y axes span what comes after the settling."""
    marks = Marks() if marks is None else marks
    if len(t) < 2:
        t, panels = np.array([0.0, 1.0]), [replace(each, lines={}, band=None) for each in panels]
    cuts, pieces = np.searchsorted(t, marks.gaps[:, 1]), max(_FEWEST, min(_PIECES, _IN_ALL // len(panels)))
    late = t - t[0] >= min(marks.settling, 0.1 * float(t[-1] - t[0]))
    with grid(t, len(panels), 1, height, 0.27) as (page, axes, places):
        for k, (panel, place) in enumerate(zip(panels, places, strict=True)):
            cell = replace(place, y=_limits(panel, late), scale=panel.scale)
            _mark(axes, cell, marks)
            frame(axes, cell, times=k == len(panels) - 1, label=panel.label)
            _draw(axes, cell, panel, t, cuts, pieces)
            head(axes, cell, panel.title, [*panel.lines] if len(panel.lines) > 1 else [])
        image = svg(page)
    return Picture(title, caption, image, page)


def head(axes: Axes, cell: Cell, title: str, names: Sequence[str]) -> None:
    """The title of a panel at the left above it, and the names of its lines in their colours at the right."""
    top, right = cell.bottom + cell.height + 0.045, cell.left + cell.width
    axes.text(cell.left, top, title, fontsize=7.0, ha="left", va="bottom", color=INK)
    for k, name in reversed(list(enumerate(names))):
        colour = COLOURS[k % len(COLOURS)]
        axes.text(right, top, name, fontsize=7.0, fontweight="bold", ha="right", va="bottom", color=colour)
        right -= _TEXT * (len(name) + 2)


def _draw(axes: Axes, cell: Cell, panel: Panel, t: Array, cuts: NDArray[np.int64], pieces: int) -> None:
    """Band, levels and lines of a panel."""
    if panel.zero:
        line(axes, cell, t[[0, -1]], np.zeros(2), color=QUIET, lw=0.6)
    if panel.band is not None:
        low, high = (thinned(t, each, cuts, pieces) for each in panel.band)
        if len(t) > 2 * pieces:  # the envelope of each edge goes down and up in turn
            low, high = (low[0][::2], low[1][::2]), (high[0][::2], high[1][1::2])
        band(axes, cell, low[0], low[1], high[1], color=COLOURS[0], alpha=0.25)
    for name, level in panel.levels.items():
        line(axes, cell, t[[0, -1]], np.full(2, level), color=INK, lw=0.7, ls=(0, (4, 3)))
        place = float(cell.up(np.array(level)))
        if cell.bottom <= place <= cell.bottom + cell.height:
            right = cell.left + cell.width
            axes.text(right, place + 0.02, name, fontsize=6.5, ha="right", va="bottom", color=INK)
    for k, values in enumerate(panel.lines.values()):
        line(axes, cell, *thinned(t, values, cuts, pieces), color=COLOURS[k % len(COLOURS)], lw=0.7)


def thinned(t: Array, values: Array, cuts: NDArray[np.int64], pieces: int) -> tuple[Array, Array]:
    """A long signal as its envelope of so many ``pieces``, each part between rows ``cuts`` on its own.

    Every part has two points for each of its pieces, and two, NaN, after each part but the last: a break.
    """
    n, edges = len(t), [0, *cuts.tolist(), len(t)]
    if n <= 2 * pieces:
        return np.insert(t, cuts, np.nan), np.insert(values, cuts, np.nan)
    times: list[Array] = []
    shown: list[Array] = []
    for a, b in pairwise(edges):
        count = min(max(1, round(pieces * (b - a) / n)), max(1, (b - a - 1) // 2))
        part = envelope(t[a:b], values[a:b], count) if b - a > 2 else (t[[a, b - 1]], values[[a, b - 1]])
        for all_parts, own in zip((times, shown), part, strict=True):
            all_parts += [own, np.full(2, np.nan)]
    return np.concatenate(times[:-1]), np.concatenate(shown[:-1])


def _limits(panel: Panel, late: Flags) -> tuple[float, float]:
    """Limits of a y axis: what the lines span once settled, most of the band, and the levels."""
    values = [x[late] if np.isfinite(x[late]).any() else x for x in panel.lines.values()]
    spans = [(float(np.nanmin(x)), float(np.nanmax(x))) for x in map(_finite, values) if len(x)]
    if panel.band is not None:
        edges = [_finite(edge[late]) for edge in panel.band]
        spans += [(float(np.percentile(x, 5.0)), float(np.percentile(x, 95.0))) for x in edges if len(x)]
    spans += [(level, level) for level in panel.levels.values()]
    spans += [(0.0, 0.0)] if panel.zero and panel.scale == "linear" else []
    if panel.scale == "log":
        positive = [_finite(x[x > 0.0]) for x in values]
        low = min((float(x.min()) for x in positive if len(x)), default=0.1)
        high = max((float(x.max()) for x in positive if len(x)), default=1.0)
        spans = [(low, high), *((level, level) for level in panel.levels.values())]
        low, high = min(a for a, _ in spans), max(b for _, b in spans)
        low = max(low, high * 10.0**-_DECADES)
        return 10.0 ** np.floor(np.log10(low) - 0.05), 10.0 ** np.ceil(np.log10(high) + 0.05)
    low, high = min((a for a, _ in spans), default=0.0), max((b for _, b in spans), default=0.0)
    margin = 0.06 * (high - low) or 0.1 * abs(high) or 1.0
    return low - margin, high + margin


def _finite(x: Array) -> Array:
    """The values that are finite and can be drawn."""
    return x[np.abs(x) < 1e100]


def _mark(axes: Axes, cell: Cell, marks: Marks) -> None:
    """Stretches behind the lines, and dashes where an estimator started anew."""
    for stretches, colour, alpha in (
        (marks.moving, COLOURS[3], 0.14),
        (marks.gaps, QUIET, 0.35),
        (marks.saturated, ALARM, 0.22),
    ):
        strips(axes, cell, stretches, cell.bottom, cell.height, colour, alpha)
    feet = cell.across(marks.restarts)
    axes.vlines(feet, cell.bottom, cell.bottom + cell.height, color=INK, lw=0.7, ls=(0, (3, 2)))


def strips(
    axes: Axes, cell: Cell, stretches: Array, bottom: float, height: float, colour: str, alpha: float = 1.0
) -> None:
    """Stretches (k, 2) of the time of a panel as strips of that ``height`` [inch], cut off at its ends."""
    if not len(stretches):
        return
    places = np.clip(cell.across(stretches), cell.left, cell.left + cell.width)
    spans = [(float(a), float(b - a)) for a, b in places]
    axes.broken_barh(spans, (bottom, height), color=colour, alpha=alpha, lw=0, zorder=0.5)


def measured(t: Array, names: Sequence[str], missing: Flags, saturated: Flags, marks: Marks) -> Picture:
    """Times in which each sensor measured: ``missing`` and ``saturated`` (n, k) of ``names`` over ``t`` (n,) [s]."""
    height = 0.17
    with grid(t, 1, 1, height * len(names), 0.1) as (page, axes, places):
        cell = replace(places[0], y=(0.0, float(len(names))))
        frame(axes, cell, times=True, ticks=[])
        for k, name in enumerate(names):
            bottom = cell.bottom + height * (len(names) - 1 - k)
            axes.text(
                cell.left - 0.06, bottom + 0.5 * height, name, fontsize=7.0, ha="right", va="center_baseline"
            )
            whole = np.array([[t[0], t[-1]]])
            strips(axes, cell, whole, bottom + 0.03, height - 0.06, COLOURS[0], 0.3)
            for flags, colour in ((missing[:, k] & ~saturated[:, k], QUIET), (saturated[:, k], ALARM)):
                strips(axes, cell, stretches(t, flags), bottom + 0.03, height - 0.06, colour)
            strips(axes, cell, marks.gaps, bottom + 0.02, height - 0.04, "white")
        image = svg(page)
    lost = [
        f"{name} {_percent(flags)} {word}"
        for k, name in enumerate(names)
        for word, flags in (("saturated", saturated[:, k]), ("missing", missing[:, k] & ~saturated[:, k]))
        if flags.any()
    ]
    return Picture(
        "What was measured",
        "Blue: samples that count; red: saturated, left out; grey: missing; white: no rows. A strip is wide enough to "
        f"be seen, however short. {'; '.join(lost) + '.' if lost else ''}".rstrip(),
        image,
        page,
    )


def _percent(flags: Flags) -> str:
    """The share of flags that hold."""
    share = 100.0 * float(np.mean(flags))
    return "less than 0.01 %" if share < 0.01 else f"{share:.3g} %"
