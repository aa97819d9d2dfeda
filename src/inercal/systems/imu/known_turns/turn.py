"""One turn by a known angle in the output of a gyro: the rests before and after it, and its integral."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.noise.dwell_means import AllanFit, fit_pooled
from inercal.foundation.records.column import Triad
from inercal.systems.imu.limits import LIMITS


@dataclass(frozen=True)
class RestToRestTurn:
    """A turn from rest to rest.

    ``begin`` and ``end`` [s] its ends on the clock ``t`` (n,); ``before`` and ``after`` (3,) the mean outputs at rest
    and ``rests`` (2,) [s] their lengths; ``integral`` (3,) [output s] that of the output in the turn, ``weights``
    (2,) those by which the rests foretell the bias in its middle; ``stretches`` the samples of the two rests;
    ``speed`` (n,) the size of the output less that at rest.
    """

    t: Array
    speed: Array
    begin: float
    end: float
    before: Array
    after: Array
    rests: Array
    integral: Array
    weights: Array
    stretches: tuple[Array, Array]

    @property
    def duration(self) -> float:
        """Length of the turn [s]."""
        return self.end - self.begin

    @property
    def bias(self) -> Array:
        """Output (3,) without a rate in the middle of the turn."""
        return np.asarray(self.weights[0] * self.before + self.weights[1] * self.after)


def find_turn(t: Array, values: Array) -> RestToRestTurn | str:
    """The turn in a section with one; what is wrong, in words, where there is none from rest to rest.

    Parameters
    ----------
    t : (n,) increasing [s]
    values : (n, 3)

    Notes
    -----
    A turn begins and ends where the output, less that at rest, leaves the noise, and somewhat before and after: what
    slow tails are cut off is missing in the angle. The bias in its middle is that of a straight line through the rests.
    """
    step = float(np.median(np.diff(t)))
    rest = max(round(LIMITS.shortest_turn_rest / step), 16)
    wanted = f"{LIMITS.shortest_turn_rest:g} s of rest before and after"
    if len(t) < 3 * rest:
        return f"lasts {t[-1] - t[0]:.1f} s, expected a turn with at least {wanted}"
    ends = np.array([values[:rest].mean(axis=0), values[-rest:].mean(axis=0)])
    line = ends[0] + (t - t[0])[:, None] / (t[-1] - t[0]) * (ends[1] - ends[0])
    margin = max(round(LIMITS.turn_margin / step), 1)
    speed = np.linalg.norm(_smoothed(values - line, margin), axis=1)
    largest = float(np.max(speed))
    noise = float(np.sqrt(np.mean(np.square([speed[:rest], speed[-rest:]]))))
    if LIMITS.turn_noise * noise > LIMITS.cut_rate * largest:
        return f"is not at rest at its ends, expected a turn with at least {wanted}"
    moving = np.flatnonzero(speed > max(LIMITS.turn_noise * noise, LIMITS.turn_onset * largest))
    first, last = int(moving[0]) - margin, int(moving[-1]) + margin
    if first < rest or last > len(t) - 1 - rest:
        return f"{'begins' if first < rest else 'ends'} with the turn, expected at least {wanted}"
    gaps = np.diff(t[first : last + 1])
    if np.max(gaps) > LIMITS.motion_gap * step or np.min(gaps) < 0.0:
        return "lacks samples within the turn, expected all"
    before, after = values[:first], values[last + 1 :]
    middles = np.array([t[:first].mean(), t[last + 1 :].mean()])
    middle = 0.5 * (t[first] + t[last])
    second = float((middle - middles[0]) / (middles[1] - middles[0]))
    part = slice(first, last + 1)
    integral = np.sum(0.5 * (values[part][1:] + values[part][:-1]) * gaps[:, None], axis=0)
    return RestToRestTurn(
        t, speed, float(t[first]), float(t[last]), before.mean(axis=0), after.mean(axis=0),
        np.array([len(before), len(after)]) * step, integral, np.array([1.0 - second, second]),
        (before, after),
    )  # fmt: skip


def noise_at_rest(turns: Sequence[RestToRestTurn]) -> AllanFit:
    """The noise of the gyro in all rests together; that of one rest is hardly known."""
    stretches = [stretch for turn in turns for stretch in turn.stretches]
    interval = float(np.mean([turn.rests.sum() / sum(map(len, turn.stretches)) for turn in turns]))
    return fit_pooled(stretches, interval)


def stamped(triad: Triad) -> tuple[Array, Array]:
    """Times (n,) and outputs (n, 3) of the rows of a triad that are whole."""
    whole = np.isfinite(triad.t) & np.isfinite(triad.values).all(axis=1)
    return triad.t[whole], triad.values[whole]


def _smoothed(values: Array, samples: int) -> Array:
    """Moving mean of so many samples, of the same length."""
    kernel = np.ones(samples) / samples
    return np.stack([np.convolve(column, kernel, mode="same") for column in values.T], axis=1)
