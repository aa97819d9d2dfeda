"""Many small panels on one page, drawn on a single pair of axes: a tenth of the time that axes of their own take.

The panels are those of `inercal.faces.report.marks`. Coordinates of the drawing are inches; a `Cell` says where a panel
lies and what it spans.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from inercal.faces.report.html import Picture
from inercal.faces.report.marks import Area, Axis, Bars, Dots, Level, Line, Mark, Panel, Strips
from inercal.faces.report.style import INK, QUIET, WIDTH, figure, power_of_ten, svg
from inercal.foundation.arrays import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


_GRID = "#E3E7EB"
_TICK = 0.03

_TEXT = 0.066
"""Width of a letter above a panel [inch], about."""


@contextmanager
def canvas(width: float, height: float) -> Iterator[tuple[Figure, Axes]]:
    """An empty drawing of that size [inch], coordinates in inches from its lower left corner."""
    with figure(width, height) as page:
        page.set_layout_engine("none")
        axes = page.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set_axis_off()
        axes.set_xlim(0.0, width)
        axes.set_ylim(0.0, height)
        yield page, axes


@dataclass(frozen=True)
class Cell:
    """A panel: ``left``, ``bottom``, ``width``, ``height`` [inch], and the limits ``x`` and ``y`` of what it shows.

    ``scale`` of y: with ``log`` the limits are positive.
    """

    left: float
    bottom: float
    width: float
    height: float
    x: tuple[float, float]
    y: tuple[float, float]
    scale: Literal["linear", "log"] = "linear"

    def across(self, x: Array) -> Array:
        """Inches from the left edge of the drawing."""
        low, high = self.x
        return np.asarray(self.left + self.width * (x - low) / ((high - low) or 1.0))

    def up(self, y: Array) -> Array:
        """Inches from the lower edge of the drawing; NaN for a value without logarithm; values far off stay near by."""
        low, high = self.y
        if self.scale == "log":
            low, high = float(np.log10(low)), float(np.log10(high))
            y = np.log10(np.where(y > 0.0, y, np.nan))
        part = np.clip((y - low) / ((high - low) or 1.0), -3.0, 4.0)
        return np.asarray(self.bottom + self.height * part)

    def ticks(self) -> list[float]:
        """Round numbers on the y axis, or powers of ten."""
        if self.scale == "log":
            low, high = (np.log10(end) for end in self.y)
            powers = np.arange(np.ceil(low - 1e-9), np.floor(high + 1e-9) + 1.0)
            return [float(10.0**power) for power in powers[:: -(-len(powers) // 4) or 1]]
        return _round_numbers(*self.y, 2)


def _round_numbers(low: float, high: float, fewest: int) -> list[float]:
    """Multiples of 1, 2 or 5 times a power of ten between the limits, as few as there can be of at least so many."""
    if not high > low:
        return [low]
    finest = (high - low) / fewest
    power = 10.0 ** np.floor(np.log10(finest))
    # half of a power that the logarithm rounded up to
    step = power * max((size for size in (1.0, 2.0, 5.0) if size * power <= finest), default=0.5)
    return [float(k * step) + 0.0 for k in np.arange(np.ceil(low / step), np.floor(high / step) + 1.0)]


def small(
    title: str,
    caption: str,
    panels: Sequence[Panel],
    height: float,
    widths: Sequence[float] = (1.0,),
    head: float = 0.28,
) -> Picture:
    """A picture of ``panels`` of that ``height`` [inch], row by row, with ``head`` [inch] above each; ``widths`` of the
    columns are in proportion.

    Axes have limits, or names. What is labelled has its name above the panel, in its colour. The x axis has its numbers
    and label below the last panel of a column.
    """
    gap, margin, foot, columns = 0.62, 0.62, 0.42, len(widths)
    inches = (WIDTH - 0.12 - margin * columns) * np.asarray(widths) / sum(widths)
    left = gap + np.cumsum([0.0, *(inches[:-1] + margin)])
    total = foot + -(-len(panels) // columns) * (height + head)
    with canvas(WIDTH, total) as (page, axes):
        for k, panel in enumerate(panels):
            row, column = divmod(k, columns)
            bottom = total - (row + 1) * (height + head)
            place = float(left[column]), bottom, float(inches[column]), height
            count = len(panel.y.names)
            cell = Cell(
                *place,
                _ends(panel.x),
                (count - 0.5, -0.5) if count else _ends(panel.y),
                "log" if panel.y.scale == "log" else "linear",
            )
            last = k >= len(panels) - columns
            _frame(axes, cell, panel, last, "left" if columns == 1 else "center")
            for mark in panel.marks:
                _mark(axes, cell, mark)
            if last:
                middle = cell.left + 0.5 * cell.width
                axes.text(middle, bottom - foot + 0.06, panel.x.label, fontsize=7.5, ha="center", va="bottom")
        return Picture(title, caption, svg(page), page)


def _ends(axis: Axis) -> tuple[float, float]:
    """The limits of an axis, which are stated."""
    assert axis.limits is not None
    low, high = axis.limits
    assert low is not None
    assert high is not None
    return low, high


def _frame(axes: Axes, cell: Cell, panel: Panel, numbered: bool, ha: Literal["left", "center"]) -> None:
    """Edges, numbers and words of a panel, with numbers on its left, and below it too where it is ``numbered``."""
    right, top = cell.left + cell.width, cell.bottom + cell.height
    heights = [] if panel.y.names else cell.ticks()
    places = cell.up(np.array(heights))
    along = _round_numbers(*cell.x, 4 if cell.width > 3.0 else 2)
    feet = cell.across(np.array(along))
    _strokes(axes, [[(cell.left, y), (right, y)] for y in places], _GRID, 0.5, zorder=0)
    edges = [
        [(cell.left, top), (cell.left, cell.bottom), (right, cell.bottom)],
        *([(cell.left - _TICK, y), (cell.left, y)] for y in places),
        *([(x, cell.bottom - _TICK), (x, cell.bottom)] for x in feet),
    ]
    _strokes(axes, edges, QUIET, 0.6)
    texts = [(place, number(height, cell.scale), 6.5) for height, place in zip(heights, places, strict=True)]
    texts += [(float(cell.up(np.array(k))), name, 7.0) for k, name in enumerate(panel.y.names)]
    for place, text, size in texts:
        axes.text(cell.left - 2.0 * _TICK, place, text, fontsize=size, ha="right", va="center_baseline")
    if numbered:
        for value, foot in zip(along, feet, strict=True):
            axes.text(foot, cell.bottom - 2.0 * _TICK, f"{value:g}", fontsize=6.5, ha="center", va="top")
    if panel.y.label:
        x, y = cell.left - 0.5, cell.bottom + 0.5 * cell.height
        axes.text(x, y, panel.y.label, fontsize=7.0, rotation=90, ha="center", va="center")
    above = top + 0.045
    at = cell.left if ha == "left" else cell.left + 0.5 * cell.width
    if panel.title:
        axes.text(at, above, panel.title, fontsize=7.0, ha=ha, va="bottom", color=INK)
    named = [mark for mark in panel.marks if isinstance(mark, Line | Dots | Area | Bars) and mark.label]
    for mark in reversed(named):
        axes.text(
            right,
            above,
            mark.label,
            fontsize=7.0,
            fontweight="bold",
            ha="right",
            va="bottom",
            color=mark.colour,
        )
        right -= _TEXT * (len(mark.label) + 2)


def _mark(axes: Axes, cell: Cell, mark: Mark) -> None:
    """One mark of a panel."""
    right, top = cell.left + cell.width, cell.bottom + cell.height
    match mark:
        case Line():
            x, y = np.asarray(mark.x, dtype=float), np.asarray(mark.y, dtype=float)
            _line(axes, cell, x, y, color=mark.colour, lw=mark.width, ls=mark.style)
        case Level():
            ends = (
                (np.full(2, mark.at), np.array(cell.y))
                if mark.upright
                else (np.array(cell.x), np.full(2, mark.at))
            )
            _line(axes, cell, *ends, color=mark.colour, lw=mark.width, ls=mark.style)
            place = float(cell.up(np.array(mark.at)))
            if mark.label and cell.bottom <= place <= top:
                axes.text(right, place + 0.02, mark.label, fontsize=6.5, ha="right", va="bottom", color=INK)
        case Area():
            x, low, high = (np.asarray(each, dtype=float) for each in (mark.x, mark.low, mark.high))
            area = axes.fill_between(
                cell.across(x), cell.up(low), cell.up(high), lw=0, color=mark.colour, alpha=mark.alpha
            )
            area.set_clip_path(_inside(axes, cell))
        case Strips():
            _strips(
                axes, cell, np.reshape(mark.spans, (-1, 2)), cell.bottom, cell.height, mark.colour, mark.alpha
            )
        case Bars(upright=True):
            x, low, high = (np.asarray(each, dtype=float) for each in (mark.at, mark.start, mark.end))
            axes.vlines(cell.across(x), cell.up(low), cell.up(high), color=mark.colour, lw=1.4)
        case Bars():
            thick = mark.thickness * cell.height / abs(cell.y[1] - cell.y[0])
            rows, spans = np.asarray(mark.at), np.column_stack([mark.start, mark.end])
            for row in np.unique(rows):
                bottom = float(cell.up(row)) - 0.5 * thick
                _strips(axes, cell, spans[rows == row], bottom, thick, mark.colour, mark.alpha)
        case Dots():
            x, y = np.asarray(mark.x, dtype=float), np.asarray(mark.y, dtype=float)
            axes.plot(
                cell.across(x),
                cell.up(y),
                ls="none",
                marker=mark.shape,
                color=mark.colour,
                ms=mark.size,
                mew=1.6,
            )
        case _:
            raise TypeError(f"found a {type(mark).__name__}, expected marks that small panels have")


def _strokes(
    axes: Axes,
    strokes: Sequence[Sequence[tuple[float, float]]],
    colour: str,
    width: float,
    zorder: float = 2.0,
) -> None:
    """Lines through the points of each stroke, all of one look, at once: `Axes.hlines` takes four times as long."""
    from matplotlib.collections import LineCollection

    lines = LineCollection(strokes, colors=colour, linewidths=width, zorder=zorder)
    axes.add_collection(lines, autolim=False)


def number(value: float, scale: str) -> str:
    """A tick's number: plain, or a power of ten."""
    return power_of_ten(value) if scale == "log" else f"{value:g}".replace("-", "−")


def _line(axes: Axes, cell: Cell, x: Array, y: Array, **look: Any) -> None:
    """A line in a panel, cut off at its edges."""
    (curve,) = axes.plot(cell.across(x), cell.up(y), **look)
    curve.set_clip_path(_inside(axes, cell))


def _strips(
    axes: Axes, cell: Cell, spans: Array, bottom: float, height: float, colour: str, alpha: float
) -> None:
    """Strips (k, 2) of the x axis of that ``height`` [inch], cut off at the ends of the panel."""
    if len(spans):
        places = np.clip(cell.across(spans), cell.left, cell.left + cell.width)
        lengths = [(float(a), float(b - a)) for a, b in places]
        axes.broken_barh(lengths, (bottom, height), color=colour, alpha=alpha, lw=0, zorder=0.5)


def _inside(axes: Axes, cell: Cell) -> Any:
    """The panel as a shape to cut with."""
    from matplotlib.patches import Rectangle

    return Rectangle((cell.left, cell.bottom), cell.width, cell.height, transform=axes.transData)
