"""Fit of the last seconds to the model: the mean squared innovation, row by row; compiled, the same by blocks.

Windows of `Limits.watched_time` are counted from the first row; each row has the mean of the last one that is over, of
innovations as far as the gate lets them through, so that a single spike says little. Nothing is counted before the
filter has settled.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from inercal.foundation._jit import kernel
from inercal.systems.aoa.limits import LIMITS

Array: TypeAlias = NDArray[np.float64]

_BEGUN, _WINDOW, _SUM, _COUNT, _MEAN, ALL, ALL_COUNT = range(7)

_SETTLING, _LENGTH, _LEAST = LIMITS.settling_time, LIMITS.watched_time, float(LIMITS.watched_innovations)


_PART = 100_000
"""Rows that are copied at a time."""


def initial() -> Array:
    """Before the first row: its time [s], the number of the window, sum and number of squared innovations in it, the
    mean of that before; sum at `ALL` and number at `ALL_COUNT` of all."""
    return np.array([math.nan, -1.0, 0.0, 0.0, math.nan, 0.0, 0.0])


def watched(t: Array, innovations: Array, gate: float, state: Array | None = None) -> Array:
    """The means (m,) of rows at ``t`` (m,) [s] with ``innovations`` (m, k), NaN where none.

    They go on from a ``state``, which is changed, or are the first.
    """
    nis, state = np.empty(len(t)), initial() if state is None else state
    for k in range(0, len(t), _PART):
        part = slice(k, k + _PART)
        _watch(state, t[part], np.ascontiguousarray(innovations[part]), gate, nis[part])
    return nis


@kernel
def _watch(state: Array, t: Array, innovations: Array, gate: float, nis: Array) -> None:
    """The loop of `watched`."""
    for i in range(len(t)):
        if math.isnan(state[_BEGUN]) and math.isfinite(t[i]):
            state[_BEGUN] = t[i]
        since = t[i] - state[_BEGUN]
        for k in range(innovations.shape[1]):
            v = innovations[i, k]
            if not (math.isfinite(v) and since >= _SETTLING):
                continue
            window = math.floor(since / _LENGTH)
            if window != state[_WINDOW]:
                if state[_COUNT] > 0.0:
                    state[_MEAN] = state[_SUM] / state[_COUNT] if state[_COUNT] >= _LEAST else math.nan
                state[_WINDOW], state[_SUM], state[_COUNT] = window, 0.0, 0.0
            own = min(v * v, gate)
            state[_SUM] += own
            state[_COUNT] += 1.0
            state[ALL] += own
            state[ALL_COUNT] += 1.0
        nis[i] = state[_MEAN]
