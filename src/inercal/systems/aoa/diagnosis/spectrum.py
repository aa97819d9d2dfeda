"""The spectra of the sensors: how far up the model's motion goes, and the lines that are no motion."""

from __future__ import annotations

import numpy as np

from inercal.foundation.arrays import Array
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.recording import Recording
from inercal.systems.aoa.settings import AoaSettings


def powers(t: Array, values: Array) -> tuple[Array, Array]:
    """Frequencies (k,) [Hz] and the spectral densities (k, c) of columns (n, c), by segments of `Limits.line_segment`;
    columns with missing samples count with these held, one without a number as zero."""
    step = float(np.median(np.diff(t)))
    row = np.arange(len(t))
    columns = []
    for column in values.T:
        finite = np.isfinite(column)
        columns.append(np.interp(row, row[finite], column[finite]) if finite.any() else np.zeros(len(t)))
    size = min(len(t), round(LIMITS.line_segment / step))
    return np.asarray(np.fft.rfftfreq(size, step)), _welch(np.column_stack(columns), size) * step


def _welch(values: Array, size: int) -> Array:
    """One-sided spectral densities (size // 2 + 1, c) of columns (n, c) of samples at 1 Hz: Hann's window, half
    overlapping, means removed (Welch 1967, IEEE Trans. Audio Electroacoust. 15). Loading SciPy's took 0.7 s."""
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(size) / size)
    starts = range(0, len(values) - size + 1, size - size // 2)
    density = np.zeros((size // 2 + 1, values.shape[1]))
    for start in starts:
        part = values[start : start + size]
        density += np.square(np.abs(np.fft.rfft(window[:, None] * (part - part.mean(axis=0)), axis=0)))
    density /= len(starts) * float(window @ window)
    density[1 : -1 if size % 2 == 0 else None] *= 2.0
    return density


def highest_motion(recording: Recording, settings: AoaSettings) -> float:
    """The highest frequency [Hz] at which the gyro shows more than noise over some Hz; 0 where it shows none.

    A narrow line is no motion that a low pass must keep, and a gyro's noise is white: the median over a few Hz is
    held against that over all.
    """
    if not np.isfinite(recording.gyro).any():
        return 0.0
    frequency, density = powers(recording.t, recording.gyro[:, None])
    spectrum = _running_median(density[:, 0], frequency)
    floor = max(
        2.0 * settings.noise.gyro**2 * float(np.median(np.diff(recording.t))), float(np.median(spectrum))
    )
    above = np.flatnonzero(spectrum > LIMITS.motion_power * floor)
    return float(frequency[above[-1]]) if len(above) else 0.0


def white_noise(recording: Recording) -> tuple[float, float]:
    """Standard deviations of samples of the accelerometers and the gyro [SI] by the quarter of the spectrum that is
    lowest: white noise has it at all frequencies, vibration has not. The largest of several sensors; 0 without any."""
    frequency, density = powers(recording.t, np.column_stack([recording.acc, recording.gyro]))
    floor = np.quantile(density[1:], LIMITS.floor_quantile, axis=0) / LIMITS.floor_share
    size = np.sqrt(floor * frequency[-1])
    return float(size[:-1].max()), float(size[-1])


def lines(recording: Recording, motion: float, low_pass: float) -> tuple[float, ...]:
    """Frequencies [Hz] of lines of the accelerometers beyond twice the ``motion`` [Hz], up to three corners of the
    ``low_pass`` [Hz], the strongest first; none where there are so many that they are noise in a band."""
    frequency, density = powers(recording.t, recording.acc)
    strength = np.max(density / np.maximum(_running_median(density, frequency), 1e-300), axis=1)
    power = density.max(axis=1)
    inside = (frequency > max(2.0 * motion, LIMITS.lowest_line)) & (frequency < 3.0 * low_pass)
    strength[~inside] = 0.0
    # a line of a window is some bins wide: the highest of these stands for it, between them by their powers
    peaks = [
        k
        for k in range(2, len(frequency) - 2)
        if strength[k] > LIMITS.line_power and power[k] == power[k - 2 : k + 3].max()
    ]
    peaks.sort(key=lambda k: -power[k])
    found = []
    for k in peaks if len(peaks) <= LIMITS.most_lines else ():
        near = slice(k - 2, k + 3)
        found.append(float(power[near] @ frequency[near] / power[near].sum()))
    return tuple(found)


def _running_median(density: Array, frequency: Array) -> Array:
    """The median of densities (k,) or (k, c) over some Hz about each frequency."""
    half = max(2, round(0.5 * LIMITS.line_surroundings / frequency[1]))
    padded = np.pad(density, [(half, half), (0, 0)][: density.ndim], mode="edge")
    return np.asarray(
        np.median(np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1, axis=0), axis=-1)
    )
