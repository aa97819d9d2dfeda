"""Delay of the gyro against the accelerometers, from their cross-spectrum.

The angular acceleration a that the accelerometers show, (A1 + A3)/(r3 - r1) for three axes, and the derivative b of the
gyro's rate are the same motion. A delay tau of the gyro turns the phase of their cross-spectrum S(f) by 2 pi f tau; the
delay that is most likely makes

    sum over f of gamma^2 / (1 - gamma^2) cos(arg S - 2 pi f tau)

largest, with gamma^2 the coherence (Hannan and Thomson 1973, Biometrika 60, pp. 469-480).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.systems.aoa.layout import Layout, all_weights, centrifugal_arms
from inercal.systems.aoa.paper.limits import LIMITS
from inercal.systems.aoa.reading.recording import Recording, in_time, later, shortened, usual_step

_STEP = 2e-4
_SEGMENTS = 16
_SHORTEST, _LONGEST = 2.0, 16.0
"""Length [s] of a segment."""

_OVERLAP = 2.0 * 0.59375 / 0.5625
"""Factor by which Hann windows that overlap by half enlarge the variance over that of independent segments and
frequencies: with W the sum of the squared windows over time, 2 mean(W^2) / mean(W)^2."""

_FIRST = 2
"""First frequency of the spectrum that counts: the mean that is taken off leaks into those before."""

_WHOLE = 1.0 - 1e-9
_ROUNDS = 5
_SETTLED = 1e-2

_ROUNDING = 1e-6

_PART = 50_000
"""Rows that are interpolated at a time."""


@dataclass(frozen=True)
class Delay:
    """Delay of the gyro against the accelerometers [s], positive where the gyro is late, with standard uncertainty.

    ``coherence`` at its highest; ``low`` and ``high`` [Hz] the band that counted.
    """

    value: float
    u: float
    coherence: float
    low: float
    high: float


def relative_delay(recording: Recording, layout: Layout) -> Delay | None:
    """The delay; None where nothing moves, there is no gyro, the axes do not show angular acceleration, either is
    missing now and then all along, as in saturation, sensors have clocks of their own, between whose samples there are
    no spectra of all, or the phases are not those of a delay within 0.1 s.

    The phase at a frequency of n segments has the variance (1 - gamma^2) / (2 n gamma^2), hence

        u^2 = k / sum of 2 n gamma^2 / (1 - gamma^2) (2 pi f)^2

    with k = 2.11 for windows that overlap. What else differs between both signals with a phase of its own, such as a
    filter in one of them, counts as delay. Raises `RecordError` where time does not go on.
    """
    weights = all_weights(layout)
    taken = in_time(recording.t)
    if (
        weights is None
        or len(recording.t[taken]) < 2
        or any(each.code == "other_clock" for each in recording.findings)
    ):
        return None
    t, gyro = recording.t[taken], recording.gyro[taken]
    used = np.flatnonzero(weights)
    shown = recording.acc[taken][:, used] @ weights[used]
    shown += float(weights @ centrifugal_arms(layout)) * gyro**2
    if min(np.isfinite(shown).sum(), np.isfinite(gyro).sum()) < 2:
        return None
    # within a gap nothing counts, and beside it nothing of its other side
    bridged = LIMITS.bridged_samples
    t = shortened(t, LIMITS.longest_delay + 2 * (bridged + 1) * recording.interval)
    step = usual_step(t)
    grid = np.arange(t[0], t[-1] + 0.5 * step, step)
    missing = _missing(grid, t, np.isnan(shown) | np.isnan(gyro), step)
    shown, gyro = (_bridged(grid, t, x) for x in (shown, gyro))
    size = _segment(gyro, step)
    if not 2 <= size <= len(grid):
        return None
    tau, delay = 0.0, None
    for _ in range(_ROUNDS):
        # beside a line of the spectrum the phase is that of the line: only where all is aligned is it the right one
        moved = gyro if tau == 0.0 else _moved(gyro, tau / step)
        if moved is None:
            return None
        turned = np.gradient(moved, step)
        delay = _most_likely(*_spectra(shown, turned, missing, size), 1.0 / (size * step))
        if delay is None:
            return None
        tau += delay.value
        if abs(delay.value) < _SETTLED * delay.u:
            break
    return None if delay is None else replace(delay, value=tau)


def _segment(gyro: Array, step: float) -> int:
    """Samples of a segment: a sixteenth of the recording, or `LIMITS.line_periods` periods of the strongest line of the
    rate, where that is longer; 0 where such segments are too few, so that the line lies among what is taken off."""
    lasts = (len(gyro) - 1) * step
    usual = min(max(lasts / _SEGMENTS, _SHORTEST), _LONGEST)
    window = np.sin(math.pi * (np.arange(len(gyro)) + 0.5) / len(gyro)) ** 2
    power = np.abs(np.fft.rfft(window * (gyro - gyro.mean()))) ** 2
    line = float(np.argmax(power)) / (len(gyro) * step)
    if line * usual >= LIMITS.line_periods:
        return round(usual / step)
    long = LIMITS.line_periods / line if line > 0.0 else math.inf
    if lasts < 0.5 * (LIMITS.delay_segments + 1) * long:
        return 0
    return round(long / step)


def _bridged(grid: Array, t: Array, values: Array) -> Array:
    """Values (n,) at ``t`` (n,) on a grid, with straight lines where they are missing."""
    finite = np.isfinite(values)
    return np.interp(grid, t, values) if finite.all() else np.interp(grid, t[finite], values[finite])


def _missing(grid: Array, t: Array, lost: NDArray[np.bool_], step: float) -> NDArray[np.bool_]:
    """Points of a grid in stretches of more than `Limits.bridged_samples` whose samples are ``lost`` (n,), or in a gap
    of ``t`` (n,) [s]."""
    bridged = LIMITS.bridged_samples
    long = np.diff(t) > bridged * step
    if not (lost.any() or long.any()):
        return np.zeros(len(grid), dtype=bool)
    missing = np.interp(grid, t, lost.astype(float)) > 0.5
    missing |= np.append(long, True)[np.searchsorted(t, grid, side="right") - 1]
    return np.asarray(np.convolve(missing, np.ones(bridged + 1), "same") > bridged + 0.5)


def _moved(values: Array, steps: float) -> Array | None:
    """Even samples (n,) as they are so many ``steps`` later, by a quintic spline, constant beyond the ends; None where
    nothing is left. A cubic through four samples is a fortieth of a step off at a fifth of the sample rate."""
    from scipy.ndimage import shift

    if abs(steps) >= len(values) - 1:
        return None
    return np.asarray(shift(values, -steps, order=5, mode="nearest"))


def _spectra(a: Array, b: Array, missing: NDArray[np.bool_], size: int) -> tuple[Array, Array, int]:
    """Coherence squared and phase of two signals, by segments of ``size``, and the number of these."""
    window = np.sin(math.pi * (np.arange(size) + 0.5) / size) ** 2
    of_a, of_b, cross = np.zeros((3, size // 2 + 1), dtype=complex)
    count = 0
    for begin in range(0, len(a) - size + 1, max(1, size // 2)):
        of_segment = slice(begin, begin + size)
        if missing[of_segment].any():
            continue
        p, q = (np.fft.rfft(window * (x[of_segment] - x[of_segment].mean())) for x in (a, b))
        of_a, of_b, cross = of_a + p * p.conj(), of_b + q * q.conj(), cross + p * q.conj()
        count += 1
    power = of_a.real * of_b.real
    coherence = np.abs(cross) ** 2 / np.where(power > 0.0, power, 1.0)
    return np.asarray(coherence), np.angle(cross), count


def _most_likely(coherence: Array, phase: Array, count: int, spacing: float) -> Delay | None:
    """The delay by the phases at frequencies ``spacing`` [Hz] apart, of ``count`` segments."""
    if count < LIMITS.delay_segments:
        return None
    by_chance = 1.0 - (LIMITS.delay_chance / len(coherence)) ** (1.0 / (count - 1))
    k = np.flatnonzero(coherence > by_chance)
    k = k[k >= _FIRST]
    if not len(k):
        return None
    # what coherence noise alone would show is taken off; rounding bounds it from above
    squared = np.minimum((count * coherence[k] - 1.0) / (count - 1.0), _WHOLE)
    weight = squared / (1.0 - squared)
    omega, phase = 2.0 * math.pi * spacing * k, phase[k]
    tries = np.arange(-LIMITS.longest_delay, LIMITS.longest_delay + _STEP, _STEP)
    tau = float(tries[np.argmax([weight @ np.cos(phase - omega * each) for each in tries])])
    for _ in range(_ROUNDS):
        apart = phase - omega * tau
        tau += float((weight * omega) @ np.sin(apart) / ((weight * omega**2) @ np.cos(apart)))
    share = weight @ np.cos(phase - omega * tau) / weight.sum()
    if abs(tau) > LIMITS.longest_delay or share < LIMITS.delay_share:
        return None
    u = math.sqrt(_OVERLAP / float(2.0 * count * weight @ omega**2))
    return Delay(tau, u, float(np.sqrt(coherence[k].max())), float(k[0] * spacing), float(k[-1] * spacing))


def aligned(recording: Recording, delay: float) -> Recording:
    """The recording with its gyros as they would read without a ``delay`` [s], by cubic interpolation.

    Between two samples whose neighbours are missing it is linear; NaN where a sample beside is missing, over gaps of
    time, and beyond the ends.
    """
    if delay == 0.0:
        return recording
    taken = later(recording.t)
    t = recording.t[taken]
    gyro, turns = np.full_like(recording.gyro, np.nan), np.full_like(recording.turns, np.nan)
    gyro[taken] = _interpolated(t, recording.gyro[taken], t + delay)
    for k in range(2):
        turns[taken, k] = _interpolated(t, recording.turns[taken, k], t + delay)
    return replace(recording, gyro=gyro, turns=turns)


def _interpolated(t: Array, values: Array, at: Array) -> Array:
    """Lagrange's cubic through the two samples on either side, else a straight line, NaN where neither is there."""
    if len(t) < 2 or not np.isfinite(values).any():
        return np.full(len(at), np.nan)
    step = float(np.median(np.diff(t)))
    # some rows at a time: their many terms stay near
    parts = (at[k : k + _PART] for k in range(0, len(at), _PART))
    return np.concatenate([np.empty(0), *(_interpolated_part(t, values, part, step) for part in parts)])


def _interpolated_part(t: Array, values: Array, at: Array, step: float) -> Array:
    """As `_interpolated`, of few rows; ``step`` [s] is the usual one of ``t``."""
    n = len(t)
    j = np.clip(np.searchsorted(t, at, side="right") - 1, 0, n - 2)
    before, after = t[j], t[j + 1]
    gap = after - before
    s = (at - before) / gap
    line = (1.0 - s) * values[j] + s * values[j + 1]
    a, d = np.maximum(j - 1, 0), np.minimum(j + 2, n - 1)
    x = [(t[k] - before) / gap for k in (a, j, j + 1, d)]
    cubic = np.zeros(len(at))
    inside = (a < j) & (d > j + 1)
    # at the ends two samples coincide, and the line is taken
    with np.errstate(divide="ignore", invalid="ignore"):
        for m, k in enumerate((a, j, j + 1, d)):
            others = [y for i, y in enumerate(x) if i != m]
            cubic += values[k] * math.prod((s - y) / (x[m] - y) for y in others)
    curve = np.where(inside & np.isfinite(cubic), cubic, line)
    usable = (s > -_ROUNDING) & (s < 1.0 + _ROUNDING) & (gap < LIMITS.gyro_gap * step)
    return np.where(usable, curve, np.nan)
