"""Effects outside a model whose sizes nobody stated: how large they may be beside what a recording says of them.

Effects b (q,), small errors that no estimator fits, change the residuals of a fit linearly: the recording has of b a
likelihood with the ``score`` A^T r and the ``information`` A^T A, A what one unit of each does to normal residuals r.
Effects of one kind are normal about 0 and of one size. The size is not chosen but averaged over, with the Cauchy
distribution beyond 0 about the usual size as what is known before: where a recording shows that the effects are
smaller, they hardly count.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array

_COUNT: Final = 200
"""Sizes that are averaged over."""

_ROUNDS: Final = 3
"""Times that each kind is gone through beside the others."""


class _Averaged(NamedTuple):
    """Effects of one kind: ``sizes`` (k,) with their probabilities ``weight`` (k,); along the ``axes`` (q, q) of the
    information ``mean`` and ``variance`` (k, q) of the effects by each size."""

    sizes: Array
    weight: Array
    axes: Array
    mean: Array
    variance: Array


def second_moment(score: Array, information: Array, usual: float) -> Array:
    """Second moment (q, q) about 0 of effects of one kind, of a recording with their ``score`` (q,) and ``information``
    (q, q), its alone; ``usual`` is the median of their size."""
    of = _averaged(score, information, usual)
    moment = np.einsum("k,ka,kb->ab", of.weight, of.mean, of.mean) + np.diag(of.weight @ of.variance)
    return np.asarray(of.axes @ moment @ of.axes.T)


def joint_second_moment(score: Array, information: Array, kinds: NDArray[np.int64]) -> Array:
    """The same of effects of several ``kinds`` (q,), numbered from 0, each in units of its usual size.

    Kind after kind is averaged over its sizes, the others being normal of the sizes that they have so far; then it has
    the size that leaves as much of it. With the last sizes of all, the effects are normal together.
    """
    size = np.ones(int(kinds.max()) + 1)
    for _ in range(_ROUNDS):
        for kind in range(len(size)):
            own = kinds == kind
            of = _averaged(*_beside(score, information, own, size[kinds]), 1.0)
            left = np.sum(of.mean**2 + of.variance, axis=1)
            size[kind] = np.interp(of.weight @ left, left, of.sizes)
    spread = size[kinds]
    covariance = np.linalg.inv(np.eye(len(spread)) + spread[:, None] * information * spread)
    covariance = spread[:, None] * covariance * spread
    mean = covariance @ score
    return np.asarray(covariance + np.outer(mean, mean))


def _averaged(score: Array, information: Array, usual: float) -> _Averaged:
    """Effects of one kind by each of its sizes, whose median is ``usual``."""
    eigenvalues, axes = np.linalg.eigh(information)
    # equal shares of the distribution, each by its median
    sizes = usual * np.tan(0.5 * math.pi * (np.arange(_COUNT) + 0.5) / _COUNT)
    along, variance = axes.T @ score, np.square(sizes)[:, None]
    gain = 1.0 + variance * np.maximum(eigenvalues, 0.0)
    likelihood = 0.5 * np.sum(variance * along**2 / gain - np.log(gain), axis=1)
    weight = np.exp(likelihood - likelihood.max())
    return _Averaged(sizes, weight / weight.sum(), axes, variance * along / gain, variance / gain)


def _beside(score: Array, information: Array, own: NDArray[np.bool_], spread: Array) -> tuple[Array, Array]:
    """Score and information of some effects where all others are unknown, with standard deviations ``spread`` (q,)."""
    others = ~own
    if not others.any():
        return score, information
    by = information[np.ix_(own, others)] * spread[others]
    whole = (
        np.eye(int(others.sum()))
        + spread[others, None] * information[np.ix_(others, others)] * spread[others]
    )
    taken = np.linalg.solve(whole, np.column_stack([by.T, spread[others] * score[others]]))
    return score[own] - by @ taken[:, -1], information[np.ix_(own, own)] - by @ taken[:, :-1]
