"""Samples of a recording: their steps, and the ends of their range."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.records.checks.values import at_ends
from inercal.foundation.records.column import Triad


def coarse_steps(values: Array, deviation: Array) -> Array:
    """The output's step on axes (3,) whose standard ``deviation`` (3,) at rest is below half of it, else 0."""
    steps = np.zeros(3)
    for i in range(3):
        moves = np.abs(np.diff(values[:, i]))
        least = np.min(moves, initial=np.inf, where=np.isfinite(moves) & (moves > 0))
        if deviation[i] < 0.5 * least < np.inf:
            steps[i] = least
    return steps


def clipped_rows(gyro: Triad) -> NDArray[np.bool_]:
    """Rows (n,) in which an axis saturates."""
    return np.asarray(np.any([at_ends(values) for values in gyro.values.T], axis=0))
