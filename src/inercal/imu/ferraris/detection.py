"""Sections found in the data: holds with an axis upright, and turns about an axis between them.

A hold is where the windowed variance of both sensors stays near that of the calmest part of the record. Which axis
is upright shows without any calibration: of many holds, each axis lies level in most, so that the median of its means
is its bias. A turn is a stretch of motion whose integrated gyro output is dominated by one axis.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inercal.imu.ferraris.names import POSITIONS, TURNS, UP
from inercal.imu.recording import on_other_clock
from inercal.records.dwells import Dwell, breaks, static_intervals, window_samples, windowed_variance
from inercal.records.record import Triad

Array = NDArray[np.float64]

STILL = 8.0
"""Variance over that of the calm parts below which the instrument is held still."""

CALM = 0.2
"""Quantile of the windowed variance that stands for rest: holds are more than a fifth of such a recording."""

UPRIGHT = 0.9
"""Cosine of the largest angle (26 deg) from upright."""

DOMINANT = 0.9
"""Least part of the integrated rotation that is about the axis of a turn."""

SMALLEST = 0.7
"""Least size of the largest motion about an axis, over that of the others, that can be its turn."""

NEAR = 0.25
"""Largest deviation of a turn from the stated angle, or of its size from the largest of its axis, as a part of it."""


@dataclass(frozen=True)
class _Motion:
    """A stretch of motion: samples ``start`` to ``stop``, its integrated rotation (3,) [output s]."""

    start: int
    stop: int
    rotation: Array

    def with_next(self, other: _Motion) -> _Motion:
        """This and a later one, with the pause between them."""
        return _Motion(self.start, other.stop, self.rotation + other.rotation)


def detect(acc: Triad, gyro: Triad, turn: float) -> dict[str, tuple[int, int]]:
    """Find what sections there are.

    Parameters
    ----------
    acc, gyro : Triad
        The recording; the time axes may differ.
    turn : float
        Stated angle of the turns [rad], with its sign.

    Returns
    -------
    dict of name to (start, stop)
        Samples of the accelerometers. A section that was not found is not there.
    """
    holds = _holds(acc, gyro)
    if not holds:
        return {}
    found = _positions(acc, holds)
    bias = np.mean([np.nanmean(_part(gyro, acc, hold.start, hold.stop)[1], axis=0) for hold in holds], axis=0)
    for axis, motion in _turns(gyro, _motions(acc, gyro, holds, bias), turn).items():
        found[TURNS[axis]] = (motion.start, motion.stop)
    return found


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
    """Where the variance is near that of the calm parts."""
    known = variance[np.isfinite(variance)]
    return variance <= STILL * float(np.quantile(known, CALM)) if known.size else np.isfinite(variance)


def _positions(acc: Triad, holds: tuple[Dwell, ...]) -> dict[str, tuple[int, int]]:
    """The hold of each position: of several, those of the two positions of an axis that are nearest in time.

    Biases that wander then drop out of their difference.
    """
    cosines = _levelled(acc, holds) @ UP.T
    found: dict[str, tuple[int, int]] = {}
    for k in range(0, 6, 2):
        up, down = (
            _long_enough([h for h, c in zip(holds, cosines[:, n], strict=True) if c > UPRIGHT])
            for n in (k, k + 1)
        )
        chosen = [max(each, key=lambda hold: hold.samples) for each in (up, down) if each]
        if up and down:
            chosen = list(min(itertools.product(up, down), key=lambda pair: _apart(*pair)))
        there = [name for name, each in zip(POSITIONS[k : k + 2], (up, down), strict=True) if each]
        found |= {name: _without_hand(acc, hold) for name, hold in zip(there, chosen, strict=True)}
    return found


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
    """Where the time axis breaks."""
    return breaks(acc.t, 0.5 * window_samples(acc.rate) / acc.rate)


def _long_enough(holds: list[Dwell]) -> list[Dwell]:
    """Those at least half as long as the longest."""
    longest = max((hold.samples for hold in holds), default=0)
    return [hold for hold in holds if 2 * hold.samples >= longest]


def _apart(here: Dwell, there: Dwell) -> int:
    """Samples between two holds."""
    return max(here.start, there.start) - min(here.stop, there.stop)


def _part(gyro: Triad, acc: Triad, start: int, stop: int) -> tuple[Array, Array]:
    """Times and outputs of the gyro between two samples of the accelerometers."""
    if gyro.t is acc.t:
        return gyro.t[start:stop], gyro.values[start:stop]
    inside = (gyro.t >= acc.t[start]) & (gyro.t <= acc.t[stop - 1])
    return gyro.t[inside], gyro.values[inside]


def _motions(acc: Triad, gyro: Triad, holds: tuple[Dwell, ...], bias: Array) -> Iterator[_Motion]:
    """Stretches between holds and breaks of the time axis that leave the vertical where it was, and chains of them.

    A turn by hand may pause where the hand takes a new grip.
    """
    level = _levelled(acc, holds)
    before = {hold.stop: f for hold, f in zip(holds, level, strict=True)}
    after = {hold.start: f for hold, f in zip(holds, level, strict=True)}
    resting = np.zeros(len(acc.t), dtype=bool)
    for hold in holds:
        resting[hold.start : hold.stop] = True
    begins_after = {hold.start: hold.stop for hold in holds}
    chain: list[_Motion] = []
    for stretch in static_intervals(~resting, _cuts(acc), 3):
        t, output = _part(gyro, acc, stretch.start, stretch.stop)
        f = [each for each in (before.get(stretch.start), after.get(stretch.stop)) if each is not None]
        if len(t) < 3 or not np.isfinite(output).all() or (len(f) == 2 and f[0] @ f[1] < UPRIGHT):
            chain = []
            continue
        own = _Motion(
            stretch.start, stretch.stop, np.asarray(np.trapezoid(output - bias, t, axis=0), dtype=np.float64)
        )
        joined = bool(chain) and begins_after.get(chain[-1].stop) == own.start
        chain = [*(earlier.with_next(own) for earlier in chain if joined), own]
        yield from chain


def _levelled(acc: Triad, holds: tuple[Dwell, ...]) -> Array:
    """Direction (n, 3) of the specific force in the holds, as near as it shows without a calibration."""
    means = np.array([hold.of(acc.values).mean(axis=0) for hold in holds])
    f = means - np.median(means, axis=0)
    size = np.linalg.norm(f, axis=1)
    return np.asarray(f / np.where(size > 0.5 * size.max(), size, np.inf)[:, None])


def _turns(gyro: Triad, motions: Iterable[_Motion], turn: float) -> dict[int, _Motion]:
    """The turn about each axis: of physical outputs near the stated angle, of counts the largest there are."""
    about: dict[int, list[_Motion]] = {0: [], 1: [], 2: []}
    for motion in motions:
        size = float(np.linalg.norm(motion.rotation))
        axis = int(np.argmax(np.abs(motion.rotation)))
        if size > 0.0 and abs(motion.rotation[axis]) > DOMINANT * size:
            about[axis].append(motion)
    largest = [max((abs(m.rotation[k]) for m in found), default=0.0) for k, found in about.items()]
    wanted = [abs(turn) / gyro.unit.factor] * 3 if gyro.unit.dimension == "rate" else largest
    chosen = {}
    for axis, found in about.items():
        # one in the stated sense first, then the nearest, as near as a hand can tell, and the shortest of those
        ranked = sorted(
            (m.rotation[axis] * turn < 0.0, round(20.0 * off), m.stop - m.start, k)
            for k, m in enumerate(found)
            if (off := abs(abs(m.rotation[axis]) / wanted[axis] - 1.0)) < NEAR
        )
        # a turn of counts that is far smaller than the others is another motion
        if ranked and largest[axis] > SMALLEST * max(largest):
            chosen[axis] = found[ranked[0][-1]]
    return chosen
