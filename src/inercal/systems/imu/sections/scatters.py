"""Variances that nobody states: their likeliest values, and what the data leave open of them.

The restricted likelihood of the linear problem (`inercal.foundation.inference.variances`) has a broad prior of each
logarithm, so that nothing fails where a scatter is none at all, or where hardly anything tells of it.
"""

from __future__ import annotations

from itertools import combinations
from typing import Final

import numpy as np
from scipy.special import ndtr, ndtri
from scipy.stats import qmc

from inercal.foundation.arrays import Array
from inercal.systems.imu.sections.arrow import Linear

_STEP: Final = 0.05
"""Difference of logarithms for derivatives."""

_ROUNDS: Final = 25
_LONGEST: Final = 1.5
_SETTLED: Final = 0.02
"""Steps of the logarithms: their number, the longest, and that which ends the search."""

_LEAST_CURVATURE: Final = 0.15

_REACH: Final = {1: np.arange(-2.6, 3.5, 0.5), 2: np.arange(-2.6, 3.5, 0.8), 3: np.arange(-2.6, 3.5, 1.2)}
"""Nodes along each principal axis, in standard deviations, by the number of variances; more have scattered nodes."""

_FARTHEST: Final = 4.2
"""Distance of a node in standard deviations at most."""

_SCATTERED: Final = 8
"""Logarithm to the base 2 of the number of scattered nodes."""

_WIDER: Final = 1.4
"""Standard deviation of these, which reach further than the distribution itself."""


def mode(linear: Linear, z: Array) -> tuple[Array, Array]:
    """The likeliest logarithms (c,) from ``z`` on, by Newton's steps, and a root (c, c) of the inverse curvature."""
    n, e = len(z), _STEP * np.eye(len(z))
    values, vectors = np.ones(n), np.eye(n)
    for _ in range(_ROUNDS):
        here = linear.likelihood(z)
        up, down = (np.array([linear.likelihood(z + sign * d) for d in e]) for sign in (1.0, -1.0))
        curvature = np.diag(2.0 * here - up - down)
        for i, j in combinations(range(n), 2):
            curvature[i, j] = curvature[j, i] = up[i] + up[j] - here - linear.likelihood(z + e[i] + e[j])
        values, vectors = np.linalg.eigh(curvature / _STEP**2)
        values = np.maximum(values, _LEAST_CURVATURE)
        step = vectors @ ((vectors.T @ (up - down)) / (2.0 * _STEP * values))
        step *= min(1.0, _LONGEST / max(float(np.linalg.norm(step)), 1e-300))
        while np.linalg.norm(step) > _SETTLED and linear.likelihood(z + step) < here:
            step *= 0.5
        z = z + step
        if np.linalg.norm(step) <= _SETTLED:
            break
    return z, vectors / np.sqrt(values)


def nodes(z: Array, spread: Array) -> tuple[Array, Array]:
    """Logarithms (g, c) about the likeliest ones ``z``, over which to average, and logarithms (g,) of the volume that
    each stands for."""
    n = len(z)
    if n == 0:
        return np.zeros((1, 0)), np.zeros(1)
    if n in _REACH:
        grid = np.stack(np.meshgrid(*[_REACH[n]] * n, indexing="ij"), axis=-1).reshape(-1, n)
        volume = np.zeros(len(grid))
    else:
        grid = _WIDER * ndtri(qmc.Sobol(n, scramble=False).random_base2(_SCATTERED) * (1.0 - 2e-3) + 1e-3)
        volume = 0.5 * np.sum((grid / _WIDER) ** 2, axis=1)
    near = np.linalg.norm(grid, axis=1) < _FARTHEST
    return z + grid[near] @ spread.T, volume[near]


def half_widths(weights: Array, means: Array, sds: Array) -> Array:
    """Half widths (p,) of intervals about 0 that hold 95 % of mixtures of normal distributions, their ``weights`` (g,),
    ``means`` and ``sds`` (g, p)."""
    u = np.sqrt(weights @ (means**2 + sds**2))
    low, high = 0.5 * u, 8.0 * u
    for _ in range(40):
        middle = 0.5 * (low + high)
        inside = weights @ (ndtr((middle - means) / sds) - ndtr((-middle - means) / sds))
        low, high = np.where(inside < 0.95, middle, low), np.where(inside < 0.95, high, middle)
    return np.asarray(0.5 * (low + high))
