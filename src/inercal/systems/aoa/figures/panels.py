"""Pictures of an angle over time, and of long signals over frequency: lines, bands, spectra, events of recordings."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from inercal.faces.report.cells import small
from inercal.faces.report.courses import times
from inercal.faces.report.html import Picture
from inercal.faces.report.marks import Area, Axis, Bars, Level, Line, Mark, Note, Panel, Strips
from inercal.faces.report.panels import draw
from inercal.faces.report.style import ALARM, COLOURS, INK, QUIET, envelope
from inercal.foundation.arrays import Array

LONGEST = 16384
"""Samples of a segment, at most."""

_SHORTEST = 256
_MISSING = 0.2
"""Part of a segment that may be missing; it is bridged by straight lines."""

_POINTS = 300
"""Points of a line, about evenly spread on its logarithmic axis."""

_ALONE = 30.0
"""Ratio of a peak to the median of its surroundings, in power."""


def spectral_density(t: Array, values: Array) -> tuple[Array, Array]:
    """Welch's estimate of the power spectral density (f,) [unit^2/Hz] of ``values`` (n,), at frequencies (f,) [Hz].

    Segments with Hann's window that overlap by half, their straight lines taken off; those with a jump of ``t`` (n,)
    [s], or too much missing (NaN), are left out. Both empty where none is left. Source: Welch 1967.
    """
    none = np.empty(0)
    finite = np.isfinite(values)
    if len(t) < _SHORTEST or finite.sum() < _SHORTEST:
        return none, none
    step = np.diff(t)
    even = float(np.median(step))
    length = int(2 ** np.clip(np.floor(np.log2(len(t) / 8.0)), np.log2(_SHORTEST), np.log2(LONGEST)))
    jumps = np.concatenate([[0], np.cumsum(np.abs(step - even) > 5.0 * even)])
    lost = np.concatenate([[0], np.cumsum(~finite)])
    rows = np.flatnonzero(finite)
    filled = values if finite.all() else np.interp(np.arange(len(t)), rows, values[rows])
    window = np.hanning(length + 1)[:-1]
    ramp = np.linspace(-1.0, 1.0, length)
    total, count = np.zeros(length // 2 + 1), 0
    for a in range(0, len(t) - length + 1, length // 2):
        b = a + length
        if jumps[b - 1] > jumps[a] or lost[b] - lost[a] > _MISSING * length:
            continue
        part = filled[a:b] - filled[a:b].mean()
        part = part - ramp * (ramp @ part) / (ramp @ ramp)
        total += np.abs(np.fft.rfft(window * part)) ** 2
        count += 1
    if not count:
        return none, none
    density = total * (2.0 * even / (count * (window @ window)))
    return np.fft.rfftfreq(length, even)[1:].astype(np.float64), density[1:]


def peak(frequency: Array, density: Array) -> float | None:
    """Frequency [Hz] of the line that stands out of a spectrum; None where none does."""
    if len(density) < 8:
        return None
    k = int(np.argmax(density))
    if k < 2 or k == len(density) - 1:
        return None
    around = density[max(0, k // 2) : 2 * k + 8]
    if not density[k] > _ALONE * float(np.median(around)):
        return None
    left, middle, right = np.log(np.maximum(density[k - 1 : k + 2], 1e-300))
    bend = left - 2.0 * middle + right
    shift = 0.5 * (left - right) / bend if bend < 0.0 else 0.0
    return float(frequency[k] + shift * (frequency[1] - frequency[0]))


def of_angle(t: Array, angle: Array, error: Array | None, innovations: Mapping[str, Array]) -> list[Picture]:
    """Spectra of an ``angle`` (n,) and of its ``error`` (n,) [deg], and of ``innovations`` (n,) by sensor, over ``t``
    (n,) [s]; nothing of what is too short."""
    of_theta = _known({"angle": angle} | ({} if error is None else {"error": error}), t)
    if "angle" not in of_theta:
        return []
    line = peak(*of_theta["angle"])
    panels, white = {"angle [°/√Hz]": of_theta}, {}
    caption = "Amplitude spectral density of the angle (Welch's method)."
    if line is not None:
        caption += f" Dots: the model oscillates at {line:.3g} Hz."
    if innovations:
        label = "innovations [1/√Hz]"
        panels[label], white[label] = _known(innovations, t), float(np.sqrt(2.0 * np.median(np.diff(t))))
        caption += (
            " Right: innovations over their standard deviations; dashes: white noise of the size that the filter "
            "expects. A line of one sensor alone is a vibration or a pick-up of that sensor; one at twice the "
            "oscillation a centrifugal term that is not right."
        )
    return [spectra("Spectra", caption, panels, line, white)]


def _known(signals: Mapping[str, Array], t: Array) -> dict[str, tuple[Array, Array]]:
    """Spectra of those signals that are long enough."""
    spectra = {name: spectral_density(t, values) for name, values in signals.items()}
    return {name: (f, density) for name, (f, density) in spectra.items() if len(f)}


def spectra(
    title: str,
    caption: str,
    panels: Mapping[str, Mapping[str, tuple[Array, Array]]],
    mark: float | None = None,
    levels: Mapping[str, float] | None = None,
) -> Picture:
    """Spectra side by side: by the label of their axis, and by name, frequencies (f,) [Hz] and densities (f,) per Hz,
    drawn as their roots. ``mark`` [Hz] across all; ``levels``, by label of the axis, the root of a flat one."""
    row = []
    for label, lines in panels.items():
        marks: list[Mark] = []
        for k, (name, (frequency, density)) in enumerate(lines.items()):
            marks.append(Line(*_few(frequency, np.sqrt(density)), name, COLOURS[k % len(COLOURS)], 0.9))
        if label in (levels or {}):
            marks.append(Level((levels or {})[label], "white", INK, 0.7, (0, (4, 3))))
        if mark is not None:
            text = f"{mark:.3g} Hz"
            marks.append(Level(mark, "", QUIET, 0.8, ":", upright=True))
            marks.append(Note((mark, 1.0), text, va="top", shift=(2.0, -1.0), of_panel="y"))
        across, up = Axis("frequency [Hz]", "log", margin=0.01), Axis(label, "log")
        row.append(Panel(marks, across, up, grid="both", legend="inside" if lines else ""))
    return draw(title, caption, [row], 2.7)


def _few(f: Array, values: Array) -> tuple[Array, Array]:
    """Means over pieces that are evenly wide on a logarithmic axis, or as wide as the values lie apart."""
    if not len(f):
        return f, values
    starts = np.unique(np.searchsorted(f, np.geomspace(f[0], f[-1], _POINTS)))
    size = np.diff(np.append(starts, len(f)))
    return np.add.reduceat(f, starts) / size, np.sqrt(np.add.reduceat(values**2, starts) / size)


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


@dataclass(frozen=True, eq=False)
class Signals:
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
    panels: Sequence[Signals],
    marks: Marks | None = None,
    height: float = 0.95,
) -> Picture:
    """Panels above each other over ``t`` (n,) [s], increasing; the y axes span what comes after the settling."""
    marks = Marks() if marks is None else marks
    if len(t) < 2:
        t, panels = np.array([0.0, 1.0]), [replace(each, lines={}, band=None) for each in panels]
    cuts, pieces = np.searchsorted(t, marks.gaps[:, 1]), max(_FEWEST, min(_PIECES, _IN_ALL // len(panels)))
    late = t - t[0] >= min(marks.settling, 0.1 * float(t[-1] - t[0]))
    drawn = [
        Panel(
            [*_along(marks), *_marks(panel, t, cuts, pieces)],
            times(t),
            Axis(panel.label, panel.scale, _limits(panel, late)),
            panel.title,
        )
        for panel in panels
    ]
    return small(title, caption, drawn, height, head=0.27)


def _marks(panel: Signals, t: Array, cuts: NDArray[np.int64], pieces: int) -> list[Mark]:
    """Band, levels and lines of a panel."""
    marks: list[Mark] = [Level(0.0)] if panel.zero else []
    if panel.band is not None:
        low, high = (thinned(t, each, cuts, pieces) for each in panel.band)
        if len(t) > 2 * pieces:  # the envelope of each edge goes down and up in turn
            low, high = (low[0][::2], low[1][::2]), (high[0][::2], high[1][1::2])
        marks.append(Area(low[0], low[1], high[1], alpha=0.25))
    marks += [Level(level, name, INK, 0.7, (0.0, (4.0, 3.0))) for name, level in panel.levels.items()]
    for k, (name, values) in enumerate(panel.lines.items()):
        said = name if len(panel.lines) > 1 else ""
        marks.append(Line(*thinned(t, values, cuts, pieces), said, COLOURS[k % len(COLOURS)], 0.7))
    return marks


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


def _limits(panel: Signals, late: Flags) -> tuple[float, float]:
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


def _along(marks: Marks) -> list[Mark]:
    """Stretches behind the lines, and dashes where an estimator started anew."""
    return [
        Strips(marks.moving, COLOURS[3], 0.14),
        Strips(marks.gaps, QUIET, 0.35),
        Strips(marks.saturated, ALARM, 0.22),
        *(Level(float(at), "", INK, 0.7, (0.0, (3.0, 2.0)), upright=True) for at in marks.restarts),
    ]


def measured(t: Array, names: Sequence[str], missing: Flags, saturated: Flags, marks: Marks) -> Picture:
    """Times in which each sensor measured: ``missing`` and ``saturated`` (n, k) of ``names`` over ``t`` (n,) [s]."""
    bars: list[Mark] = [_row(np.arange(len(names)), np.array([[t[0], t[-1]]] * len(names)), COLOURS[0], 0.3)]
    for k in range(len(names)):
        for flags, colour in ((missing[:, k] & ~saturated[:, k], QUIET), (saturated[:, k], ALARM)):
            bars.append(_row(k, stretches(t, flags), colour))
        bars.append(_row(k, marks.gaps, "white"))
    lost = [
        f"{name} {_percent(flags)} {word}"
        for k, name in enumerate(names)
        for word, flags in (("saturated", saturated[:, k]), ("missing", missing[:, k] & ~saturated[:, k]))
        if flags.any()
    ]
    return small(
        "What was measured",
        "Blue: samples that count; red: saturated, left out; grey: missing; white: no rows. A strip is wide enough to "
        f"be seen, however short. {'; '.join(lost) + '.' if lost else ''}".rstrip(),
        [Panel(bars, times(t), Axis(names=names))],
        0.17 * len(names),
        head=0.1,
    )


def _row(at: int | NDArray[np.int64], spans: Array, colour: str, alpha: float = 1.0) -> Bars:
    """Bars along the ``spans`` (k, 2) [s] of a row, or of rows."""
    return Bars(np.broadcast_to(at, len(spans)), spans[:, 0], spans[:, 1], "", colour, 0.65, alpha=alpha)


def _percent(flags: Flags) -> str:
    """The share of flags that hold."""
    share = 100.0 * float(np.mean(flags))
    return "less than 0.01 %" if share < 0.01 else f"{share:.3g} %"
