"""Sections found in the data: holds with an axis upright, and motions about an axis between them.

A hold is where the windowed variance of both sensors stays near that of the calmest part of the record. Which axis
is upright shows without any calibration: of many holds, each axis lies level in most, so that the median of its means
is its bias. Which of the motions are the turns is chosen in `inercal.systems.imu.ferraris.sections`.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.records.column import Triad
from inercal.foundation.records.dwells import (
    Dwell,
    breaks,
    static_intervals,
    window_samples,
    windowed_variance,
)
from inercal.systems.imu.ferraris.motions import AccelerometerLevel, SectionMotion, motions, part
from inercal.systems.imu.ferraris.names import POSITIONS, UP
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.recording import on_other_clock


@dataclass(frozen=True)
class Detected:
    """The holds, those of them that are ``positions`` by name (start, stop), and the ``motions`` that leave the
    vertical where it was; in samples of the accelerometers."""

    holds: tuple[Dwell, ...]
    positions: dict[str, tuple[int, int]]
    motions: tuple[SectionMotion, ...]


def detect(acc: Triad, gyro: Triad) -> Detected:
    """Find the holds, the positions among them and the motions that may be turns; the time axes may differ."""
    holds = _holds(acc, gyro)
    if not holds:
        return Detected((), {}, ())
    level = AccelerometerLevel.of(acc, holds)
    bias = np.mean([np.nanmean(part(gyro, acc, hold.start, hold.stop)[1], axis=0) for hold in holds], axis=0)
    candidates = motions(acc, gyro, holds, level, bias, _cuts(acc))
    return Detected(holds, _positions(acc, holds, level), tuple(candidates))


def _holds(acc: Triad, gyro: Triad) -> tuple[Dwell, ...]:
    """Static intervals, judged by both sensors."""
    window = window_samples(acc.rate)
    if len(acc.t) < 2 * window:
        return ()
    of_gyro = windowed_variance(gyro.values, window_samples(gyro.rate))
    if gyro.t is not acc.t:
        of_gyro = on_other_clock(of_gyro, gyro.t, acc.t)
    still = _calm(windowed_variance(acc.values, window)) & _calm(of_gyro)
    return static_intervals(still, _cuts(acc), max(window // 2, 2))


def _calm(variance: Array) -> NDArray[np.bool_]:
    """True (n,) where the variance is near that of the calm parts."""
    finite = variance[np.isfinite(variance)]
    return (
        variance <= LIMITS.hold_variance * float(np.quantile(finite, LIMITS.calm_quantile))
        if finite.size
        else np.isfinite(variance)
    )


def _positions(acc: Triad, holds: tuple[Dwell, ...], level: AccelerometerLevel) -> dict[str, tuple[int, int]]:
    """The hold of each position: of several, those of the two positions of an axis that are nearest in time.

    Biases that wander then drop out of their difference.
    """
    cosines = np.array([level.up(hold.of(acc.values)) for hold in holds]) @ UP.T
    positions: dict[str, tuple[int, int]] = {}
    for k in range(0, 6, 2):
        up, down = (
            _long_enough([h for h, c in zip(holds, cosines[:, n], strict=True) if c > LIMITS.upright_cosine])
            for n in (k, k + 1)
        )
        chosen = [max(each, key=lambda hold: hold.samples) for each in (up, down) if each]
        if up and down:
            chosen = list(min(itertools.product(up, down), key=lambda pair: _apart(*pair)))
        there = [name for name, each in zip(POSITIONS[k : k + 2], (up, down), strict=True) if each]
        positions |= {name: _without_hand(acc, hold) for name, hold in zip(there, chosen, strict=True)}
    return positions


def _without_hand(acc: Triad, hold: Dwell) -> tuple[int, int]:
    """A hold less half a window at either end, where the hand may still be on it; or up to a break of the record.

    Windows across a break are never calm, but those that reach it are, to their ends.
    """
    half = window_samples(acc.rate) // 2
    edges = np.concatenate([[0, len(acc.t)], _cuts(acc)])
    margin = min(half, hold.samples // 4)
    before, after = edges[edges <= hold.start].max(), edges[edges >= hold.stop].min()
    start = before if hold.start - before <= half else hold.start + margin
    stop = after if after - hold.stop <= half else hold.stop - margin
    return int(start), int(stop)


def _cuts(acc: Triad) -> NDArray[np.int64]:
    """Samples at which the time axis breaks."""
    return breaks(acc.t, 0.5 * window_samples(acc.rate) / acc.rate)


def _long_enough(holds: list[Dwell]) -> list[Dwell]:
    """The holds at least half as long as the longest."""
    longest = max((hold.samples for hold in holds), default=0)
    return [hold for hold in holds if 2 * hold.samples >= longest]


def _apart(here: Dwell, there: Dwell) -> int:
    """Samples between two holds."""
    return max(here.start, there.start) - min(here.stop, there.stop)
