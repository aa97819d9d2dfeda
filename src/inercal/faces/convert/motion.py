"""Accelerometers at places of their own that are late: force at the origin of b, at the time of the stamp, and back.

Unlike the other terms of a calibration these act on the motion, which a row tells with those beside it: a row reads
the rows up to `reach` before and behind it, and its digits depend on these alone. Where a record begins or ends its
last row stands for those that are missing. Where the steps of time are uneven nothing is known of the motion.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.systems.strapdown.model.delay import delayed

_HEAD = 50
"""Steps of time at the beginning of a record, whose median is the interval of its samples."""

_UNEVEN = 0.5
"""Part of that interval by which a step may differ from it."""


@dataclass(frozen=True)
class Placed:
    """Places ``levers`` (3, 3) [m] of accelerometers x, y, z in b, and by how much they are late, ``delay`` [s]."""

    levers: Array
    delay: float

    def reach(self, step: float) -> int:
        """Rows before and behind a row that it needs, of samples every ``step`` [s]."""
        return 6 + math.ceil(abs(self.delay) / step)

    def at_stamp(self, x: Array, step: float, late: bool) -> Array:
        """Samples (n, 3) of late sensors at their stamps; those of late sensors with ``late``, of such at stamps."""
        samples = self.delay / step if late else -self.delay / step
        return x if samples == 0.0 else delayed(x, samples)

    def of_turning(self, w: Array, step: float) -> Array:
        """Force (n, 3) that the accelerometers feel at their places by the turning ``w`` (n, 3) [rad/s] alone."""
        k = np.arange(len(w))
        far, near, next_, last = (w[np.clip(k + by, 0, len(w) - 1)] for by in (-2, -1, 1, 2))
        wd = (8.0 * (next_ - near) - (last - far)) / (12.0 * step)
        s, r = step * step / 12.0, self.levers  # the rate changes within a sample
        square = sum(w[:, j] * w[:, j] + s * wd[:, j] * wd[:, j] for j in range(3))
        out = np.empty_like(w)
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            along = sum((w[:, i] * w[:, j] + s * wd[:, i] * wd[:, j]) * r[i, j] for j in range(3))
            out[:, i] = along - square * r[i, i] + wd[:, a] * r[i, b] - wd[:, b] * r[i, a]
        return out


def interval(t: Array) -> float:
    """Interval [s] of samples with stamps ``t`` (n,), as the first of them have it; NaN where they do not tell."""
    steps = np.diff(t[: _HEAD + 1])
    step = float(np.median(steps)) if len(steps) else math.nan
    return step if step > 0.0 else math.nan


HEAD = _HEAD + 1
"""Rows that tell the interval."""


def even(t: Array, step: float, reach: int) -> Array:
    """True (n,) for rows whose neighbours up to ``reach`` before and behind have even stamps."""
    if not len(t):
        return np.ones(0, dtype=bool)
    uneven = np.concatenate([[0], ~(np.abs(np.diff(t) - step) <= _UNEVEN * step)]).astype(int)
    sums, k = np.concatenate([[0], np.cumsum(uneven)]), np.arange(len(t))
    first, last = np.maximum(k - reach + 1, 0), np.minimum(k + reach + 1, len(t))
    return np.asarray(sums[last] - sums[np.minimum(first, last)] == 0)


def where_even(
    t: Array,
    step: float,
    reach: int,
    moving: Callable[[], tuple[Array, Array]],
    still: Callable[[], tuple[Array, Array]],
) -> tuple[Array, Array, Array]:
    """Two results (n, 3) of ``moving`` where stamps are even, of ``still`` elsewhere, and where that is (n,)."""
    if not math.isfinite(step):
        return (*still(), np.zeros(len(t), dtype=bool))
    sound = even(t, step, reach)
    if sound.all():
        return (*moving(), sound)
    pairs = zip(moving(), still(), strict=True)
    one, two = (np.where(sound[:, None], a, b) for a, b in pairs)
    return one, two, sound
