"""The spectra of the sensors: how far up the model's motion goes, and the lines that are no motion.

Stretches of a recording by which the choices are made: the liveliest ones.

Rectification: the offset that vibration makes of an accelerometer, by its second-order coefficient K2.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array, remembered
from inercal.foundation.findings import EVERYTHING, Finding
from inercal.foundation.units import STANDARD_GRAVITY
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.recording import Recording, in_time, later
from inercal.systems.aoa.settings import AoaSettings


def of_rectification(recording: Recording, settings: AoaSettings, u: float) -> list[Finding]:
    """``rectification``: vibration that by a common K2 makes an offset of the angle near its ``u`` [rad], without being
    in it."""
    stated, power = settings.noise.rectification, _vibration(recording)
    k2 = stated or LIMITS.common_k2
    off = k2 * power / STANDARD_GRAVITY
    if settings.prior.rectified or not off > LIMITS.told_offset * u:
        return []
    advice = (
        "band and snap are stated, so u has none of it"
        if stated
        else "write rectification under [noise], so that u has it"
    )
    text = (
        f"sensors feel {math.sqrt(power) / STANDARD_GRAVITY:.2g} g rms above {LIMITS.lowest_line:g} Hz: a K2 of "
        f"{1e6 * k2 * STANDARD_GRAVITY:.3g} ug/g^2 shifts the angle by {math.degrees(off):.2g} deg"
    )
    return [Finding("rectification", text, harm=EVERYTHING if off > u else (), action=advice)]


def with_offsets(recording: Recording, settings: AoaSettings) -> AoaSettings:
    """The study with what vibration may make of the stated K2, which lies anywhere up to it."""
    k2 = settings.noise.rectification
    if not k2:
        return settings
    offset = k2 * _vibration(recording) / math.sqrt(3.0)
    return replace(settings, prior=replace(settings.prior, rectified=offset))


def _vibration(recording: Recording) -> float:
    """Mean square [m^2/s^4] above `Limits.lowest_line` in the liveliest stretch, of the accelerometer that feels most;
    0 of a short recording."""
    rows = next(iter(liveliest(recording)), None)
    if rows is None:
        return 0.0
    frequency, density = powers(recording.t[rows], recording.acc[rows])
    return float(density[frequency > LIMITS.lowest_line].sum(axis=0).max() * frequency[1])


@remembered
def liveliest(recording: Recording) -> tuple[NDArray[np.int64], ...]:
    """Rows of the stretches in which readings differ most from one row to the next, the liveliest first."""
    taken, t = later(recording.t), recording.t[in_time(recording.t)]
    number = np.floor((t - t[:1]) / LIMITS.snap_time)
    stretches = [
        rows for rows in np.split(taken, np.flatnonzero(np.diff(number)) + 1) if _enough(recording, rows)
    ]
    sizes = [_restless(recording, rows) for rows in stretches]
    return tuple(stretches[k].copy() for k in np.argsort(sizes)[::-1][: LIMITS.snap_stretches])


def _enough(recording: Recording, rows: NDArray[np.int64]) -> bool:
    """True for a stretch that goes on for twice the time in which a filter settles, in rows near enough for spectra."""
    t = recording.t[rows]
    if len(rows) < 4 or not np.ptp(t) > 2.0 * LIMITS.settling_time:
        return False
    return bool(4.0 * np.median(np.diff(t)) <= LIMITS.line_segment)


def _restless(recording: Recording, rows: NDArray[np.int64]) -> float:
    """Root mean square of the second differences of all readings of a stretch, without single wild ones."""
    second = np.abs(np.diff(np.column_stack([recording.acc[rows], recording.gyro[rows]]), 2, axis=0))
    finite = second[np.isfinite(second)]
    return float(np.sqrt(np.mean(np.minimum(finite, np.quantile(finite, 0.99)) ** 2))) if finite.size else 0.0


def part_of(recording: Recording, rows: NDArray[np.int64]) -> Recording:
    """A stretch of a recording."""
    columns = {name: getattr(recording, name)[rows] for name in ("t", "acc", "gyro", "turns", "zero_angle")}
    return replace(recording, **columns, point=None, trigger=None, reference=None, masked=None)


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
