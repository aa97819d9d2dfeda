"""The solution of a problem of sections by Levenberg and Marquardt's method."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from scipy.linalg import LinAlgError

from inercal.foundation.arrays import Array
from inercal.systems.imu.sections.arrow import ArrowSolution, Linear
from inercal.systems.imu.sections.outputs import centred, rows
from inercal.systems.imu.sections.problem import Iterate, Problem
from inercal.systems.imu.sections.unknowns import RATE

FAR: Final = 1e-3
NEAR: Final = 1e-9
"""Damping of a first step, as a part of the diagonal."""

_ROUNDS: Final = 40
_TRIALS: Final = 12
_STRAIGHT: Final = 6
"""Steps after which they follow the bend of the valley."""

_AHEAD: Final = 0.1
"""Part of a step over which its bend is measured."""

_BENT: Final = 0.75
"""Twice the bend over the step, the longest that is taken."""

_LARGEST_TILT: Final = 0.7
"""Tilt [rad] in a step at most, within what `turned` takes."""

_SETTLED: Final = 1e-6
"""Gain of the sum of squares by one more step, below which the search ends."""

_STUCK: Final = 1e-3
"""The same where no step brings it: 0.03 standard deviations at most."""


def solved(problem: Problem, start: Iterate, z: Array, damping: float = FAR) -> tuple[Iterate, Linear, bool]:
    """The point of least squares by the logarithms ``z`` of the components, the linear problem there, and whether the
    search came to an end. ``damping`` is that of the first step: `FAR` from a first guess, `NEAR` from a solution."""
    point = centred(problem, start)
    linear = Linear(problem, point.x, rows(problem, point))
    for turn in range(_ROUNDS):
        cost = linear.cost(z)
        for _ in range(_TRIALS):
            try:
                step = linear.at(z, damping)
                bent = _bent(problem, point, linear, z, step, damping) if turn >= _STRAIGHT else step
            except LinAlgError:
                damping = max(10.0 * damping, 1e-9)
                continue
            trial = centred(problem, _moved(problem, point, linear, bent.shared, bent.local))
            there = Linear(problem, trial.x, rows(problem, trial))
            if there.cost(z) <= cost * (1.0 + 1e-12) + 1e-12:
                break
            if step.gain < _STUCK:  # what rotations are integrated to, and rounding, is all that is left
                return point, linear, True
            damping = max(10.0 * damping, 1e-9)
        else:
            return point, linear, False
        point, linear = trial, there
        damping = 0.1 * damping if damping > 1e-13 else 0.0
        if step.gain < _SETTLED and damping < 1e-2:
            return point, linear, True
    return point, linear, False


def _bent(
    problem: Problem, point: Iterate, linear: Linear, z: Array, step: ArrowSolution, damping: float
) -> ArrowSolution:
    """The step with what residuals of second order along it add, so that it follows a bent valley (geodesic
    acceleration; Transtrum, Sethna, arXiv:1201.5885); the step itself where that is no small part of it."""
    ahead = _moved(problem, point, linear, _AHEAD * step.shared, _AHEAD * step.local)
    second = linear.second_order(rows(problem, ahead), step, _AHEAD)
    more = second.at(z, damping)
    whole = np.concatenate([step.shared, step.local]) / linear.size(z)
    added = 0.5 * np.concatenate([more.shared, more.local]) / linear.size(z)
    if 2.0 * np.linalg.norm(added) > _BENT * np.linalg.norm(whole):
        return step
    return replace(step, shared=step.shared + 0.5 * more.shared, local=step.local + 0.5 * more.local)


def _moved(problem: Problem, point: Iterate, linear: Linear, shared: Array, local: Array) -> Iterate:
    """The point after a step."""
    x = point.x.copy()
    x[linear.shared] += shared
    x[linear.local] += local
    tilts = problem.local(x)[:, :RATE]
    np.clip(tilts, -_LARGEST_TILT, _LARGEST_TILT, out=tilts)
    return replace(point, x=x)
