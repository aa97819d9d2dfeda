"""Curvature of a problem of sections: terms of second order in what the data leave open.

Where sections leave combinations of coefficients open (how the axes of a gyro lie to those of accelerometers, where no
axis of rotation is known; misalignments as large as placing), others that are well known follow them along a curve, not
a line: an angle p of which nothing is known adds p^2/2 to a scale factor. With x = x0 + sum a_i v_i, a_i of variance 1,
the others follow by sum a_i a_j d_ij, whose mean is the sum of d_ii and whose covariance is 2 sum d_ij d_ij^T.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from inercal.foundation.arrays import Array
from inercal.systems.imu.sections.arrow import ArrowSolution, Linear
from inercal.systems.imu.sections.limits import LIMITS
from inercal.systems.imu.sections.outputs import misfits
from inercal.systems.imu.sections.problem import Iterate, Problem


class Bend(NamedTuple):
    """Mean (s,) and covariance (s, s) of what terms of second order add to the free shared unknowns."""

    mean: Array
    covariance: Array


def bend(problem: Problem, point: Iterate, linear: Linear, z: Array, solution: ArrowSolution) -> Bend:
    """Terms of second order of the means of sections, along all combinations whose curvature their noise lets see."""
    size = np.sqrt(np.diag(solution.covariance))
    values, vectors = np.linalg.eigh(solution.covariance / np.outer(size, size))
    along = (size[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))).T
    here = misfits(problem, point, point.x[None])

    def curved(directions: Array) -> Array:
        """Residuals (k, n, 9) by half the second derivatives along directions (k, s)."""
        step = np.zeros((len(directions), len(point.x)))
        step[:, linear.shared] = directions
        step[:, linear.local] = -directions @ solution.carried.T
        both = [misfits(problem, point, point.x + sign * step) for sign in (1.0, -1.0)]
        return np.asarray(0.5 * (both[0] + both[1]) - here)

    signs = np.where(np.arange(len(along)) % 3 == 1, -1.0, 1.0)
    others = (signs[:, None] * along).sum(axis=0) - signs[:, None] * along
    # with the others at once, for a product of two combinations is 0 along either
    change = linear.weighed_misfits(z, curved(along + others) - curved(others))
    kept = np.argsort(-change)[: LIMITS.most_bends]
    kept = kept[change[kept] > LIMITS.visible_bend]
    if not len(kept):
        return Bend(np.zeros(len(along)), np.zeros_like(solution.covariance))
    i, j = np.triu_indices(len(kept))
    v = along[kept]
    single = curved(v)
    pair = np.where((i == j)[:, None, None], single[i], 0.5 * (curved(v[i] + v[j]) - single[i] - single[j]))
    moved = linear.displaced(z, solution, pair)
    times = np.where(i == j, 2.0, 4.0)
    return Bend(moved[i == j].sum(axis=0), (moved.T * times) @ moved)
