"""Spectra of long signals, and their picture."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from inercal.faces.report.html import Picture
from inercal.faces.report.marks import Axis, Level, Line, Mark, Note, Panel
from inercal.faces.report.panels import draw
from inercal.faces.report.style import COLOURS, INK, QUIET
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
