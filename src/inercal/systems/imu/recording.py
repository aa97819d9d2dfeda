"""Samples of a recording: on another clock, their steps, the ends of their range, and units that cannot be."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.instruments.triad import TriadModel
from inercal.foundation.records.checks.values import at_ends
from inercal.foundation.records.column import Triad
from inercal.foundation.units import RAW


def on_other_clock(values: Array, t: Array, other: Array) -> Array:
    """Values at the nearest sample of another time axis; infinite outside."""
    nearest = np.clip(np.searchsorted(t, other), 0, len(t) - 1)
    out = values[nearest]
    out[(other < t[0]) | (other > t[-1])] = np.inf
    return out


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


def unit_words(triad: Triad, model: TriadModel) -> str:
    """A wrong unit of physical outputs, in words, by scale factors far from nominal; empty if they are near."""
    if triad.unit.dimension in RAW:
        return ""
    nominal = 1.0 / triad.unit.factor
    ratio = float(np.median(model.scale) / nominal)
    if 0.5 < ratio < 2.0:
        return ""
    return (
        f"the scale factors of {triad.sensor} are {ratio:.3g} times those of outputs in {triad.unit.symbol}: check "
        f"the unit{' and the time stamps' if triad.sensor == 'gyro' else ''} in the map or header"
    )
