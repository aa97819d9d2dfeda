"""Roll of a model from row to row, where gyros for roll and yaw track it.

The causal fusion tells it at each row. Smoothed, its states are kept at some thousand times only, and between them the
roll follows what the gyros read,

    phi' = p + (w sin phi - y cos phi) tan theta

with the kept roll at its right side, and what this sum runs off by, from one kept time to the next, is spread evenly
between: biases of the gyros are taken out by it, and oscillations that the kept times do not resolve are kept.
"""

from __future__ import annotations

import numpy as np

from inercal.aoa.fusion.filter_result import FilterResult
from inercal.aoa.fusion.problem import FilterProblem
from inercal.aoa.reading.clock import later
from inercal.aoa.reading.recording import Recording
from inercal.arrays import Array

_STEEP = 50.0
"""Largest tangent of theta: near 90 deg roll and yaw are one, and the roll is what the fusion says."""


def tracked(
    recording: Recording, problem: FilterProblem, filtered: FilterResult
) -> tuple[Array, Array] | None:
    """Roll (n,) and its standard uncertainty (n,) [rad] at each row, NaN where theta is; None where it is not tracked.

    Of smoothed angles the uncertainty is interpolated between the kept times.
    """
    if not problem.spatial:
        return None
    if filtered.roll is not None and filtered.roll_u is not None:
        return filtered.roll, filtered.roll_u
    k = problem.names.index("phi")
    told = np.isfinite(filtered.states_u[:, k])
    roll, roll_u = np.full((2, len(recording.t)), np.nan)
    taken = later(recording.t)
    taken = taken[np.isfinite(filtered.theta[taken])]
    if not told.any() or not len(taken):
        return roll, roll_u
    t, kept = recording.t[taken], filtered.kept_t[told]
    phi = np.unwrap(filtered.states[told, k])
    coarse = np.interp(t, kept, phi)
    tangent = np.tan(filtered.theta[taken])
    tangent = np.where(np.abs(tangent) < _STEEP, tangent, 0.0)
    p, y = np.nan_to_num(recording.turns[taken]).T
    speed = p + (np.nan_to_num(recording.gyro[taken]) * np.sin(coarse) - y * np.cos(coarse)) * tangent
    run = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(t))])
    fine = run + np.interp(t, kept, phi - np.interp(kept, t, run))
    roll[taken] = np.remainder(fine + np.pi, 2.0 * np.pi) - np.pi
    roll_u[taken] = np.interp(t, kept, filtered.states_u[told, k])
    return roll, roll_u
