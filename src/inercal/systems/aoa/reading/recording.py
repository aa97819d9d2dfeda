"""A recording of a wind-tunnel model for the estimators: in SI, calibrated, on one clock, NaN where samples lack.

Of its stretches that a trigger channel marks, a level holds over a point, or a pulse or count begins one. Means are
over rows that are correlated, often negatively: noise, buffet, an oscillation cut off. Their uncertainty is found from
the spectrum near zero: with the lowest K cosines of n rows,

    L_k = sqrt(2/n) sum_i x_i cos(pi k (i + 1/2) / n),   var(mean) = (1/n) (1/K) sum_k L_k^2,

K = 8 degrees of freedom. For white noise that is s^2/n, for noise of correlation time c well below the length T of all
rows (c < T / pi K) s^2 2c/T, and for an oscillation, whose mean is all but zero over whole periods, twice the variance
that its cut periods leave. Source: Lazarus, Lewis, Stock and Watson 2018, "HAR inference: recommendations for
practice", J. Business and Economic Statistics 36(4) (equally weighted cosines).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.errors import RecordError
from inercal.foundation.findings import Finding
from inercal.foundation.inputs import Source
from inercal.foundation.units import Quantity
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.settings import PointPlan

_PART = 100_000
"""Rows that are looked at at a time."""


def later(t: Array, last: float = -math.inf, where: object = "t") -> NDArray[np.int64]:
    """Rows of ``t`` (n,) [s] that are later than all before them and than ``last``.

    Raises `RecordError` where so many successive rows are not later that the clock was set back.
    """
    if len(t) and t[0] > last and _goes_on(t):
        return np.arange(len(t))
    before = np.maximum.accumulate(np.append(last, np.where(np.isnan(t), -np.inf, t)))
    taken = np.flatnonzero(t > before[:-1])
    left = np.diff(np.concatenate([[-1], taken, [len(t)]])) - 1
    if left.size and left.max() >= LIMITS.backward_rows:
        row = int(np.concatenate([[-1], taken])[int(np.argmax(left))]) + 1
        raise RecordError(
            where,
            f"t: {int(left.max())} rows in a row from row {row + 1} on are not later than {before[row]:.10g} s, the "
            f"first at {t[row]:.10g} s, expected time to increase",
        )
    return taken


def in_time(t: Array, where: object = "t") -> slice | NDArray[np.int64]:
    """The rows of `later`, a slice where these are all: what it takes out of arrays are no copies then."""
    return slice(None) if _goes_on(t) else later(t, where=where)


def _goes_on(t: Array) -> bool:
    """True where each stamp of ``t`` (n,) is later than that before it; looked at in parts, which takes no memory."""
    parts = (t[k : k + _PART + 1] for k in range(0, len(t), _PART))
    return bool(np.isfinite(t[:1]).all()) and all(bool((np.diff(part) > 0.0).all()) for part in parts)


def set_back(where: object, late: int, last: float, t: float) -> RecordError:
    """The error of a stream of which ``late`` rows in a row, the last at ``t`` [s], are not later than ``last`` [s]."""
    return RecordError(
        where,
        f"t: {late} rows in a row are not later than {last:.10g} s, the last at {t:.10g} s, expected time to increase",
    )


def shortened(t: Array, longest: float) -> Array:
    """Times ``t`` (n,) [s], increasing, with gaps above ``longest`` [s] shortened to it: a clock that jumped, or runs
    hours apart, must not make hours of an even grid."""
    excess = np.maximum(np.diff(t, prepend=t[:1]) - longest, 0.0)
    return t - np.cumsum(excess) if excess.any() else t


def usual_step(t: Array) -> float:
    """Median interval [s] of ``t`` (n,); where rows come in bursts it is at least a sixteenth of the mean one, so that
    an even grid has no more than 16 n points."""
    return max(float(np.median(np.diff(t))), float(t[-1] - t[0]) / len(t) / 16.0)


def settled(t: Array) -> NDArray[np.bool_]:
    """Rows (n,) of ``t`` (n,) [s] after the time in which a filter settles; all of a shorter record."""
    late = t - t[0] >= LIMITS.settling_time
    return late if late.any() else np.ones(len(t), dtype=bool)


COSINES = 8


def mean_u(x: Array) -> float:
    """Standard uncertainty of the mean of ``x`` (n,), evenly sampled, by noise and oscillations; 0 for one value."""
    n = len(x)
    count = min(COSINES, n - 1)
    if count < 1:
        return 0.0
    k = np.arange(1, count + 1)
    cosines = np.cos(math.pi / n * k[:, None] * (np.arange(n) + 0.5))
    coefficients = math.sqrt(2.0 / n) * (cosines @ (x - x.mean()))
    return math.sqrt(float(coefficients @ coefficients) / (count * n))


def triggered(t: Array, trigger: Array, plan: PointPlan) -> list[tuple[float, int, int]]:
    """Stretches of a trigger (n,) at times ``t`` (n,) [s]: the number, the first row and the one after the last.

    0 and no number mean no trigger. A stretch begins where another value begins, ``plan.delay`` later, and ends with
    the value, or ``plan.length`` after. Its number is the value, or counted from 1 where all values are the same.
    """
    value = np.where(np.isfinite(trigger), trigger, 0.0)
    changed = np.flatnonzero(np.diff(value, prepend=0.0) != 0.0)
    begins = changed[value[changed] != 0.0]
    alike = len(np.unique(value[begins])) == 1
    found = []
    for count, begin in enumerate(begins.tolist(), start=1):
        after = changed[changed > begin]
        start = t[begin] + plan.delay
        if plan.length is None:
            b = int(after[0]) if len(after) else len(t)
            a = begin + int(np.searchsorted(t[begin:b], start))
        else:
            a, b = (int(np.searchsorted(t, at)) for at in (start, start + plan.length))
        if b > a:
            found.append((float(count) if alike else float(value[begin]), a, b))
    return found


@dataclass(frozen=True, eq=False)
class Recording:
    """Samples of the sensors of a model, one row for each of n rows of the record; NaN where missing or saturated.

    ``t`` [s] as recorded: rows in which time stands still or runs backward are left out by estimators. ``acc`` (n, N)
    [m/s^2] calibrated, in the order of the layout; ``gyro`` [rad/s] nose-up; ``turns`` (n, 2) [rad/s] of the gyros for
    roll (about x) and yaw (about z), right-handed. ``zero_angle`` (n, 2) [rad]: angle known from elsewhere, as at
    wind-off, and its standard uncertainty. ``point`` and ``trigger`` are numbers to be handed on; ``reference`` is the
    angle ``theta_ref`` [rad], without jumps of a turn; ``masked`` (n, N + 1) marks saturated samples of accelerometers
    and gyro; ``temperature`` is the mean of that recorded, with its standard deviation.
    """

    t: Array
    acc: Array
    gyro: Array
    turns: Array
    zero_angle: Array
    point: Array | None = None
    trigger: Array | None = None
    reference: Array | None = None
    masked: NDArray[np.bool_] | None = None
    findings: tuple[Finding, ...] = ()
    sources: tuple[Source, ...] = ()
    temperature: Quantity | None = None

    @property
    def rows(self) -> Array:
        """(n, N + 5) as `inercal.systems.aoa.fusion.loop.advance` takes them."""
        return np.column_stack([self.acc, self.gyro, self.zero_angle, self.turns])

    @cached_property
    def interval(self) -> float:
        """Median time [s] from one row to the next, of those that go on in time; NaN of fewer than two."""
        t = self.t[in_time(self.t)]
        return float(np.median(np.diff(t))) if len(t) > 1 else math.nan

    def of(self, rows: slice | NDArray[np.int64]) -> Recording:
        """These rows, less all that no filter takes."""
        return Recording(
            self.t[rows], self.acc[rows], self.gyro[rows], self.turns[rows], self.zero_angle[rows]
        )

    @cached_property
    def spatial(self) -> bool:
        """True where roll and yaw gyros are there."""
        return bool(np.isfinite(self.turns).all(axis=1).any())


def plain(t: Array, acc: Array, gyro: Array) -> Recording:
    """A recording of accelerometers and one gyro alone."""
    none = np.full((len(t), 2), np.nan)
    return Recording(t, acc, gyro, none, none.copy())
