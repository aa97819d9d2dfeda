"""The figures' common style: colours, sizes, and how a long signal is drawn.

Figures are made without pyplot. Text becomes outlines, so that it looks the same wherever the page is read;
names and units are taken literally, never as formulas.
"""

from __future__ import annotations

import io
import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from inercal.foundation.arrays import Array

if TYPE_CHECKING:
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure


WIDTH = 7.1
"""Width of a figure [inch]: the text width of an A4 page."""

COLOURS = ("#4477AA", "#EE8866", "#44AA99", "#CCBB44", "#AA4499", "#77AADD", "#999933", "#BBBBBB")
"""Colours of data, told apart by colour-blind readers too (after P. Tol's schemes)."""

INK, QUIET, ALARM = "#22303C", "#8A949E", "#C03A2B"
"""Colours of text, of what stands back, and of what matters."""

DIVERGING = "RdBu_r"
"""Colour map of numbers with a sign."""

SEQUENTIAL = "Blues"
"""Colour map of numbers from zero up."""

_STYLE: Any = {
    "axes.axisbelow": True,
    "axes.edgecolor": QUIET,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.6,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": 8.5,
    "font.family": "DejaVu Sans",
    "font.size": 8.0,
    "grid.color": "#E3E7EB",
    "grid.linewidth": 0.5,
    "legend.fontsize": 7.5,
    "legend.frameon": False,
    "lines.linewidth": 0.8,
    "lines.markersize": 4.0,
    "svg.fonttype": "path",
    "svg.hashsalt": "inercal",
    "text.color": INK,
    "text.parse_math": False,
    "xtick.color": INK,
    "xtick.labelsize": 7.5,
    "xtick.major.width": 0.6,
    "ytick.color": INK,
    "ytick.labelsize": 7.5,
    "ytick.major.width": 0.6,
}

_LOCK = threading.RLock()
_HELD: list[bool] = []  # not empty while this thread, which has the lock, has our settings on
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@contextmanager
def _style() -> Iterator[None]:
    """Matplotlib's settings for the time being ours, in one thread at a time."""
    import matplotlib

    with _LOCK:
        if _HELD:  # setting them takes longer than drawing a small figure
            yield
            return
        with matplotlib.rc_context():
            matplotlib.rcdefaults()
            matplotlib.rcParams.update(_STYLE)
            _HELD.append(True)
            try:
                yield
            finally:
                _HELD.clear()


@contextmanager
def figure(width: float, height: float) -> Iterator[Figure]:
    """An empty figure of ``width`` and ``height`` [inch], to be drawn on and made SVG within the block."""
    from matplotlib.figure import Figure

    with _style():
        yield Figure(figsize=(width, height), layout="compressed")


def svg(figure: Figure) -> str:
    """The figure as an ``<svg>`` element; the same figure gives the same text."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    buffer = io.StringIO()
    nobody = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    with _style():  # not savefig, which draws twice, to the same text
        FigureCanvasSVG(figure).print_svg(buffer, metadata=nobody)  # type: ignore[no-untyped-call]
    text = buffer.getvalue()
    return text[text.index("<svg") :]


def envelope(t: Array, values: Array, pieces: int = 800) -> tuple[Array, Array]:
    """A long signal as the line (m,), m <= 2 ``pieces``, through the least and the greatest value of each piece of it.

    Values (n,) that are not finite, or beyond 1e100, leave a gap; a signal of at most 2 ``pieces`` samples stays as it
    is.
    """
    t, shown = (np.where(np.abs(x) < 1e100, x, np.nan) for x in (t, values))
    if len(shown) <= 2 * pieces:
        return t, shown
    starts = np.linspace(0, len(shown), pieces, endpoint=False).astype(np.int64)
    low, high = np.fmin.reduceat(shown, starts), np.fmax.reduceat(shown, starts)
    middle = 0.5 * (np.fmin.reduceat(t, starts) + np.fmax.reduceat(t, starts))
    return np.repeat(middle, 2), np.column_stack([low, high]).ravel()


def power_of_ten(value: float) -> str:
    """Zero or a power of ten with its sign, as logarithmic axes show it: ``1``, ``100``, ``10⁶``, ``−10⁻²``."""
    if value == 0.0:
        return "0"
    sign, power = "−" if value < 0.0 else "", round(np.log10(abs(value)))
    return sign + (f"{abs(value):g}" if 0 <= power <= 3 else f"10{str(power).translate(_SUPERSCRIPTS)}")


def powers_of_ten(axis: Axis) -> None:
    """Label a logarithmic axis with plain powers of ten."""
    from matplotlib.ticker import FuncFormatter, NullFormatter

    axis.set_major_formatter(FuncFormatter(lambda value, _: power_of_ten(value)))
    axis.set_minor_formatter(NullFormatter())


def few_powers(axis: Axis, most: int = 6) -> None:
    """Label a logarithmic axis of whatever span: at most so many powers of ten, or plain numbers over a short one."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low, high = axis.get_view_interval()
    if high > 30.0 * low:
        axis.set_major_locator(LogLocator(numticks=most))
        powers_of_ten(axis)
        return
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def plain_unit(unit: str) -> str:
    """Units with signs for powers and roots, also in the midst of text: ``m/s²`` for ``m/s^2``."""
    return re.sub(r"sqrt\((\w+)\)", r"√\1", unit.replace("^2", "²").replace("^3", "³"))
