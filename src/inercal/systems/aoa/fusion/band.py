"""Sensors limited to a band: causal, with a delay that is known, or zero phase; compiled, the same rows by blocks.

All channels pass the same filter, so what they say of a motion within the band they say later alike: a row that is
formed at t tells of t - d, with d the delay of the filter at zero frequency, and it carries that stamp. The fusion
takes one row of some, of noise that is smaller by their number; the angle at t is carried on from it by the model
(`inercal.systems.aoa.fusion.ahead`). A missing sample is held, and the channel is left out until the filter has
forgotten it; a gap starts the filter anew.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from inercal.foundation._jit import kernel
from inercal.systems.aoa.band import WHOLE, Band
from inercal.systems.aoa.fusion.loop import BESIDE
from inercal.systems.aoa.fusion.problem import FusionProblem
from inercal.systems.aoa.fusion.problem import problem as problem_of
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.recording import Recording, later, usual_step
from inercal.systems.aoa.settings import AoaSettings

Array: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.int64]

_LAST, _COUNT, _DUE, _ANGLE, _INFORMATION = range(5)
_LEFT = 1e-2
"""Share of a filter's response that is left when it has forgotten a sample."""


class BandFilter(NamedTuple):
    """A filter: ``sections`` (S, 6); ``still`` (S, 2) the state after ones without end; the usual ``step`` [s] of its
    rows; its ``delay`` [rows]; ``every`` so many rows one is fused; rows of its ``memory``."""

    sections: Array
    still: Array
    step: float
    delay: float
    every: int
    memory: int


class BandState(NamedTuple):
    """State of a filter, changed in place: ``lines`` (S, 2, W) of each channel, its ``last`` (W,) reading and the rows
    since one was missing, ``age`` (W,); the last ``stamps`` (L,) in a ring; ``numbers``: time of the last row [s], rows
    since the start, rows since one was fused, and a stated angle [rad] with its information [1/rad^2] since then."""

    lines: Array
    last: Array
    age: Array
    stamps: Array
    numbers: Array


class Fused(NamedTuple):
    """Rows that are fused: ``t`` (k,) [s] and ``rows`` (k, N + 5); ``at`` (m,) of each raw row the last of them, -1
    before the first."""

    t: Array
    rows: Array
    at: Indices

    @property
    def came(self) -> Indices:
        """(k,) raw rows in which these came."""
        return np.searchsorted(self.at, np.arange(len(self.t)))

    def recording(self, count: int) -> Recording:
        """These rows of ``count`` accelerometers as a recording."""
        z = self.rows
        return Recording(self.t, z[:, :count], z[:, count], z[:, count + 3 :], z[:, count + 1 : count + 3])


def with_rate(settings: AoaSettings, t: Array) -> AoaSettings:
    """The study with the rate of rows at ``t`` (n,) [s], increasing, as the first of them show it."""
    first = t[: LIMITS.rate_rows]
    rate = 1.0 / usual_step(first) if len(first) > 1 else 0.0
    return replace(settings, band=replace(settings.band, rate=rate))


def filter_of(band: Band) -> BandFilter | None:
    """The filter of a band; None where nothing is filtered."""
    sections = band.sections
    if not len(sections):
        return None
    b, a = sections[:, :3], sections[:, 3:]
    k = np.arange(3)
    delay = float(((b @ k) / b.sum(axis=1) - (a @ k) / a.sum(axis=1)).sum())
    pulse = _passed(sections, max(64, int(40.0 * delay)))
    left = np.cumsum(np.abs(pulse)[::-1])[::-1]
    memory = int(np.argmax(left < _LEFT * left[0])) or len(pulse)
    gain = b.sum(axis=1) / a.sum(axis=1)
    before = np.concatenate([[1.0], np.cumprod(gain)[:-1]])
    still = before[:, None] * np.column_stack([gain - b[:, 0], b[:, 2] - a[:, 2] * gain])
    return BandFilter(
        np.ascontiguousarray(sections),
        still,
        1.0 / band.rate,
        delay,
        band.every,
        memory,
    )


def _passed(sections: Array, size: int) -> Array:
    """The answer (``size``,) of sections, one after the other, to a pulse."""
    x = [1.0] + [0.0] * (size - 1)
    for b0, b1, b2, _, a1, a2 in sections.tolist():
        first, second = 0.0, 0.0
        for k, value in enumerate(x):
            x[k] = y = b0 * value + first
            first, second = b1 * value - a1 * y + second, b2 * value - a2 * y
    return np.array(x)


def initial(of: BandFilter, width: int) -> BandState:
    """Before the first row of ``width`` channels."""
    return BandState(
        np.zeros((len(of.sections), 2, width)),
        np.full(width, np.nan),
        np.zeros(width),
        np.zeros(math.ceil(of.delay) + 2),
        np.array([math.nan, 0.0, 0.0, 0.0, 0.0]),
    )


def causal(of: BandFilter, state: BandState, t: Array, rows: Array) -> Fused:
    """Go on by rows (m, N + 5) at ``t`` (m,) [s], increasing; the state is changed."""
    rows = np.ascontiguousarray(rows)
    fused_t, fused, at = np.empty(len(t)), np.empty(rows.shape), np.empty(len(t), dtype=np.int64)
    count = _band_pass(of, state, t, rows, fused_t, fused, at)
    return Fused(fused_t[:count], fused[:count], at)


def zero_phase(of: BandFilter, t: Array, rows: Array) -> Fused:
    """Rows filtered forward and backward: those that are fused are at their own time."""
    each = of._replace(every=1)
    forward = causal(each, initial(of, rows.shape[1]), t, rows)
    backward = causal(each, initial(of, rows.shape[1]), -forward.t[::-1], forward.rows[::-1])
    chosen = slice(None, None, of.every)
    fused_t = -backward.t[::-1][chosen]
    return Fused(fused_t, backward.rows[::-1][chosen], np.searchsorted(fused_t, t, side="right") - 1)


def fused(recording: Recording, problem: FusionProblem) -> tuple[Recording, FusionProblem]:
    """The rows of a recording that are fused, causally limited to the problem's band, and the problem for these."""
    of = filter_of(problem.band)
    if of is None:
        return recording, problem
    taken = later(recording.t)
    rows = recording.rows[taken]
    limited = causal(of, initial(of, rows.shape[1]), recording.t[taken], rows)
    return limited.recording(problem.count), replace(problem, band=WHOLE)


def fused_case(recording: Recording, settings: AoaSettings) -> tuple[Recording, AoaSettings]:
    """The rows of a recording that are fused, and the study for these, without a band."""
    limited, _ = fused(recording, problem_of(settings, recording.spatial))
    fewer, noise = math.sqrt(settings.band.every), settings.noise
    noise = replace(noise, accelerometer=noise.accelerometer / fewer, gyro=noise.gyro / fewer)
    return limited, replace(settings, band=WHOLE, noise=noise)


@kernel
def _band_pass(
    of: BandFilter, state: BandState, t: Array, rows: Array, fused_t: Array, fused: Array, at: Indices
) -> int:
    """The loop of `causal`; the number of rows that are fused."""
    sections, still, step, delay, every, memory = of
    lines, last, age, stamps, numbers = state
    width, count = rows.shape[1], 0
    angle = width - BESIDE + 1
    for k in range(len(t)):
        passed = (t[k] - numbers[_LAST]) / step
        if not passed < memory + 2.0:
            numbers[_COUNT], numbers[_DUE], numbers[_INFORMATION] = 0.0, 0.0, 0.0
            last[:] = math.nan
            passed = 1.0
        missing = max(round(passed) - 1, 0)
        for i in range(missing + 1):
            real = i == missing
            numbers[_COUNT] += 1.0
            numbers[_DUE] += 1.0
            number = int(numbers[_COUNT])
            stamps[number % len(stamps)] = t[k] - (missing - i) * step
            for c in range(width):
                if c == angle or c == angle + 1:
                    continue
                value = rows[k, c] if real else math.nan
                age[c] += 1.0
                if not abs(value) < 1e100:
                    value, age[c] = last[c], 0.0
                elif math.isnan(last[c]):
                    age[c] = 0.0
                    for s in range(len(sections)):
                        lines[s, 0, c], lines[s, 1, c] = still[s, 0] * value, still[s, 1] * value
                last[c] = value
                for s in range(len(sections)):
                    y = sections[s, 0] * value + lines[s, 0, c]
                    lines[s, 0, c] = sections[s, 1] * value - sections[s, 4] * y + lines[s, 1, c]
                    lines[s, 1, c] = sections[s, 2] * value - sections[s, 5] * y
                    value = y
                fused[count, c] = value if age[c] >= memory else math.nan
        numbers[_LAST] = t[k]
        if not math.isnan(rows[k, angle]):
            numbers[_ANGLE] = rows[k, angle]
            numbers[_INFORMATION] += 1.0 / (rows[k, angle + 1] * rows[k, angle + 1])
        if numbers[_COUNT] > memory + delay + 1.0 and numbers[_DUE] >= every:
            number, size = int(numbers[_COUNT]), len(stamps)
            back = int(delay)
            part = delay - back
            fused_t[count] = (1.0 - part) * stamps[(number - back) % size] + part * stamps[
                (number - back - 1) % size
            ]
            fused[count, angle], fused[count, angle + 1] = math.nan, math.nan
            if numbers[_INFORMATION] > 0.0:
                fused[count, angle] = numbers[_ANGLE]
                fused[count, angle + 1] = 1.0 / math.sqrt(numbers[_INFORMATION])
            numbers[_DUE], numbers[_INFORMATION] = 0.0, 0.0
            count += 1
        at[k] = count - 1
    return count
