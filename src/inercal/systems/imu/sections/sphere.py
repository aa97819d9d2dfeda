"""The sphere on which outputs of a triad lie while what it measures has one size, found in spite of knocks."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from inercal.foundation.arrays import Array
from inercal.systems.imu.sections.priors import Size

_DRAWS: Final = 800
"""Spheres through four points; of rows of which a fifth is off, all but one in 10^180 of such draws hold one that is
right."""


class Sphere(NamedTuple):
    """A sphere with its ``centre`` (3,) and ``radius`` in units of the outputs, and the median distance ``miss`` of
    points from it as a part of the radius, inf where the points say nothing of a sphere."""

    centre: Array
    radius: float
    miss: float


def sphere(points: Array, radius: Size | None) -> Sphere:
    """The sphere of the least median distance from points (n, 3), among those through four of them.

    Parameters
    ----------
    points : (n, 3)
        At least four.
    radius : Size or None
        What is known of it beforehand and its relative standard deviation, in units of the points; None: it is within
        a quarter of the range of the points and that.
    """
    rng = np.random.default_rng(1)
    span = max(float(np.ptp(np.quantile(points, [0.03, 0.97], axis=0), axis=0).max()), 1e-300)
    four = points[np.argsort(rng.random((_DRAWS, len(points))), axis=1)[:, :4]] if len(points) < 64 else (
        points[rng.integers(len(points), size=(_DRAWS, 4))]
    )  # fmt: skip
    A = np.concatenate([2.0 * four, np.ones((_DRAWS, 4, 1))], axis=2)
    sound = np.abs(np.linalg.det(A)) > 1e-9 * span**3
    solved = np.linalg.solve(A[sound], np.sum(four[sound] ** 2, axis=2)[..., None])[..., 0]
    centres = solved[:, :3]
    radii = np.sqrt(np.maximum(solved[:, 3] + np.sum(centres**2, axis=1), 0.0))
    low, high = 0.25 * span, span
    if radius is not None:
        low, high = (radius.median * (1.0 + sign * 4.0 * radius.spread) for sign in (-1.0, 1.0))
        centres, radii = np.vstack([np.zeros(3), centres]), np.concatenate([[radius.median], radii])
    best = Sphere(points.mean(axis=0), 0.5 * span, np.inf)
    for k in np.flatnonzero((low < radii) & (radii < high)):
        miss = float(np.median(np.abs(np.linalg.norm(points - centres[k], axis=1) / radii[k] - 1.0)))
        if miss < best.miss:
            best = Sphere(centres[k], float(radii[k]), miss)
    return best
