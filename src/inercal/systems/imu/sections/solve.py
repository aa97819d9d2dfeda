"""The solution of a problem of sections by Levenberg and Marquardt's method."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from scipy.linalg import LinAlgError

from inercal.foundation.arrays import Array
from inercal.systems.imu.sections.arrow import Linear
from inercal.systems.imu.sections.outputs import centred, rows
from inercal.systems.imu.sections.problem import Iterate, Problem
from inercal.systems.imu.sections.unknowns import RATE

_ROUNDS: Final = 40
_TRIALS: Final = 12
_LARGEST_TILT: Final = 0.7
"""Tilt [rad] in a step at most, within what `turned` takes."""

_SETTLED: Final = 1e-6
"""Gain of the sum of squares by one more step, below which the search ends."""


def solved(problem: Problem, start: Iterate, z: Array) -> tuple[Iterate, Linear, bool]:
    """The point of least squares by the logarithms ``z`` of the components, the linear problem there, and whether the
    search came to an end."""
    point = centred(problem, start)
    linear, damping = Linear(problem, point.x, rows(problem, point)), 1e-3
    for _ in range(_ROUNDS):
        cost = linear.cost(z)
        for _ in range(_TRIALS):
            try:
                step = linear.at(z, damping)
            except LinAlgError:
                damping = max(10.0 * damping, 1e-9)
                continue
            trial = centred(problem, _moved(problem, point, linear, step.shared, step.local))
            there = Linear(problem, trial.x, rows(problem, trial))
            if there.cost(z) <= cost * (1.0 + 1e-12) + 1e-12:
                break
            if step.gain < _SETTLED:  # rounding alone is left
                return point, linear, True
            damping = max(10.0 * damping, 1e-9)
        else:
            return point, linear, False
        point, linear = trial, there
        damping = 0.1 * damping if damping > 1e-13 else 0.0
        if step.gain < _SETTLED and damping < 1e-2:
            return point, linear, True
    return point, linear, False


def _moved(problem: Problem, point: Iterate, linear: Linear, shared: Array, local: Array) -> Iterate:
    """The point after a step."""
    x = point.x.copy()
    x[linear.shared] += shared
    x[linear.local] += local
    tilts = problem.local(x)[:, :RATE]
    np.clip(tilts, -_LARGEST_TILT, _LARGEST_TILT, out=tilts)
    return replace(point, x=x)
