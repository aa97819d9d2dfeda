"""Many small panels on one page, drawn on a single pair of axes: a tenth of the time that axes of their own take.

Coordinates of the drawing are inches; a `Cell` says where a panel lies and what it spans.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from inercal.arrays import Array
from inercal.report.style import INK, QUIET, figure, power_of_ten

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


_GRID = "#E3E7EB"
_TICK = 0.03


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


def frame(
    axes: Axes,
    cell: Cell,
    title: str = "",
    times: bool = False,
    label: str = "",
    ticks: Sequence[float] | None = None,
) -> None:
    """Axes of a panel with numbers on its left, and below it too where ``times``; ``label`` stands at the left."""
    right, top = cell.left + cell.width, cell.bottom + cell.height
    heights = list(cell.ticks() if ticks is None else ticks)
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
    for height, place in zip(heights, places, strict=True):
        axes.text(
            cell.left - 2.0 * _TICK,
            place,
            number(height, cell.scale),
            fontsize=6.5,
            ha="right",
            va="center_baseline",
        )
    if times:
        for value, foot in zip(along, feet, strict=True):
            axes.text(foot, cell.bottom - 2.0 * _TICK, f"{value:g}", fontsize=6.5, ha="center", va="top")
    axes.text(
        cell.left + 0.5 * cell.width, top + 0.04, title, fontsize=7.0, ha="center", va="bottom", color=INK
    )
    if label:
        axes.text(
            cell.left - 0.5,
            cell.bottom + 0.5 * cell.height,
            label,
            fontsize=7.0,
            rotation=90,
            ha="center",
            va="center",
        )


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


def line(axes: Axes, cell: Cell, x: Array, y: Array, **look: Any) -> None:
    """A line in a panel, cut off at its edges."""
    (curve,) = axes.plot(cell.across(x), cell.up(y), **look)
    curve.set_clip_path(_inside(axes, cell))


def band(axes: Axes, cell: Cell, x: Array, low: Array, high: Array, **look: Any) -> None:
    """A band between two lines, cut off at the edges of the panel."""
    area = axes.fill_between(cell.across(x), cell.up(low), cell.up(high), lw=0, **look)
    area.set_clip_path(_inside(axes, cell))


def _inside(axes: Axes, cell: Cell) -> Any:
    """The panel as a shape to cut with."""
    from matplotlib.patches import Rectangle

    return Rectangle((cell.left, cell.bottom), cell.width, cell.height, transform=axes.transData)
