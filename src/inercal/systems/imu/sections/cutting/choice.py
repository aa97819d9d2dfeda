"""Choice among sets of holds: the one whose poses fix the accelerometers best, without contradicting themselves.

|f| = g in every pose. By small errors of three biases, three scale factors and three misalignments, each in its
standard deviation before the data, the residual |f|/g - 1 has the derivatives A (n, 9). With the weights W of poses, in
which is what a fit leaves, log det(1 + A^T W A) is twice what the set tells of the nine, as a logarithm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.instruments.terms import ACCELEROMETER_TRIAD
from inercal.foundation.records.dwells import Dwell
from inercal.systems.imu.sections.cutting.limits import LIMITS
from inercal.systems.imu.sections.cutting.windows import PoseMeans


@dataclass(frozen=True, eq=False)
class HoldSet:
    """Stretches of blocks that are still by one threshold and one ``gate`` of turning, and their poses."""

    gate: float
    stretches: list[Dwell]
    poses: PoseMeans


def best(sets: Sequence[HoldSet], gravity: float, noise: float) -> list[Dwell]:
    """The stretches of the best of sets, which come from the calmest on; ``gravity`` is its size in outputs, ``noise``
    the standard deviation of a block over it.

    Of those that tell nearly as much as the best the one with the least turning is taken, then the calmest: slow
    motions tell no more. Where no set has enough poses, most poses count first, then the calmest that keeps most of the
    time.
    """
    most = max(len(one.poses.means) for one in sets)
    if most <= len(ACCELEROMETER_TRIAD):
        return _most(sets)
    told = [
        (one, told_by(one.poses, gravity, noise))
        for one in sets
        if len(one.poses.means) > len(ACCELEROMETER_TRIAD)
    ]
    least = max(value for _, value in told) - 2.0 * len(ACCELEROMETER_TRIAD) * np.log(LIMITS.worse_holds)
    good = [one for one, value in told if value >= least]
    gate = min(one.gate for one in good)
    return next(one.stretches for one in good if one.gate == gate)


def _most(sets: Sequence[HoldSet]) -> list[Dwell]:
    """The stretches of the set of most poses."""
    most = max(len(one.poses.means) for one in sets)
    gate = min(one.gate for one in sets if len(one.poses.means) == most)
    left = [one for one in sets if (one.gate, len(one.poses.means)) == (gate, most)]
    longest = max(one.poses.blocks for one in left)
    return next(one.stretches for one in left if one.poses.blocks >= LIMITS.kept_time * longest)


def told_by(poses: PoseMeans, gravity: float, noise: float) -> float:
    """Twice the logarithm of what poses tell of the coefficients, as log det(1 + A^T W A)."""
    y = poses.means / gravity
    centre, radius = _sphere(y)
    off = y - centre
    size = np.linalg.norm(off, axis=1)
    u = off / size[:, None]
    A = (
        np.column_stack([u, u**2, u[:, 0] * u[:, 1], u[:, 0] * u[:, 2], u[:, 1] * u[:, 2]])
        * LIMITS.usual_error
    )
    left = size / radius - 1.0
    of_noise = noise**2 / poses.lengths
    variance = of_noise + LIMITS.usual_pose_scatter**2
    for _ in range(3):
        root = A / np.sqrt(variance)[:, None]
        inside = np.linalg.inv(np.eye(len(ACCELEROMETER_TRIAD)) + root.T @ root)
        rest = left - A @ (inside @ (root.T @ (left / np.sqrt(variance))))
        freedom = len(left) - float(np.trace(inside @ root.T @ root))
        own = (rest @ rest + LIMITS.usual_pose_scatter**2) / (freedom + 1.0)
        variance = of_noise + max(own - float(np.mean(of_noise)), 0.0) + 1e-12
    root = A / np.sqrt(variance)[:, None]
    return float(np.linalg.slogdet(np.eye(len(ACCELEROMETER_TRIAD)) + root.T @ root)[1])


def _sphere(y: Array) -> tuple[Array, float]:
    """Centre (3,) and radius of the sphere that points (n, 3) lie on."""
    middle = y.mean(axis=0)
    off = y - middle
    A = np.column_stack([2.0 * off, np.ones(len(y))])
    solved = np.linalg.lstsq(A, np.sum(off**2, axis=1), rcond=1e-3)[0]
    radius = float(np.sqrt(max(solved[3] + solved[:3] @ solved[:3], 1e-6)))
    return np.asarray(middle + solved[:3]), radius
