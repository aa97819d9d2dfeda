"""Moments of a random angle d for the exact analysis: mean and uncorrelated parts of its rotation matrix.

With K = skew(axis) and C = -K^2 (1 in the plane, 0 along the axis)::

    R(d) = I + s K - e C ,   s = sin d ,   e = 1 - cos d = 2 sin^2(d/2)

and R(d) x R(d), which carries outputs quadratic in a reference, needs s e and e^2 besides. These four functions
are of order d, d^2, d^3, d^4. In this order each is split into its regression on those before it and the rest,
f - E f = L xi: the parts xi are uncorrelated, their variances are sums of squares, and nothing cancels however
small the angle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.rigs.distribution import Distribution

ODD = np.array([True, False, True, False])
"""Which of s, e, s e, e^2 change sign with the angle."""


@dataclass(frozen=True, eq=False)
class Moments:
    """Moments of the first f functions of s, e, s e, e^2.

    ``mean`` (f,) their expectations; ``variance`` (f,) of the uncorrelated parts xi; ``lower`` (f, f), unit lower
    triangular, with functions - mean = lower @ xi.
    """

    mean: Array
    variance: Array
    lower: Array


def moments(distribution: Distribution, degree: int = 1) -> Moments:
    """Moments of an angle [rad]: of s and e for ``degree`` 1, of s e and e^2 too for ``degree`` 2.

    Of a symmetric distribution the odd means and the covariances of odd with even functions are exactly zero.
    """
    nodes, weights = distribution.nodes, distribution.weights
    s, e = np.sin(nodes), 2.0 * np.sin(0.5 * nodes) ** 2
    functions = np.stack([s, e, s * e, e * e][: 2 * degree])
    symmetric = np.array_equal(nodes, -nodes[::-1]) and np.array_equal(weights, weights[::-1])
    odd = ODD[: len(functions)]
    mean = functions @ weights
    if symmetric:
        mean[odd] = 0.0
    parts, lower, variance = functions - mean[:, None], np.eye(len(functions)), np.zeros(len(functions))
    for i in range(len(functions)):
        for j in range(i):
            if variance[j] > 0.0 and not (symmetric and odd[i] != odd[j]):
                lower[i, j] = weights @ (parts[i] * parts[j]) / variance[j]
                parts[i] -= lower[i, j] * parts[j]
        variance[i] = weights @ np.square(parts[i])
    return Moments(mean, variance, lower)
