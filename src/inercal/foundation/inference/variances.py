"""Variances that nobody states, by restricted likelihood.

Readings ``y = A x + e`` have a covariance V of unknown sizes. Whitened by the root of V, and with the unknowns x
integrated out, their likelihood is (Patterson and Thompson, Biometrika 58 (1971) 545)

    -2 ln L = ln |V| + ln |A^T A| + chi-square

but for a constant. A prior of the unknowns is more rows of A and y. A caller has its own V; what it does with the
likelihood is here: `highest` finds the likeliest variances, `weighed` and `second_moment` average over sizes where
one recording hardly tells them, `degrees` says how well a variance is known.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from inercal.foundation.arrays import Array

_STEPS = 60
"""Scoring steps at most; a dozen do unless a variance is none at all."""

_LONGEST = 3.0
"""Change of the logarithm of a variance in a step at most."""

_SETTLED = 1e-4
"""The same, below which the search ends."""


@dataclass(frozen=True, eq=False)
class Solved:
    """Least squares on whitened rows, by the triangular ``root`` R (..., p + 1, p + 1) of ``[A y]``:
    ``R^T R = [A y]^T [A y]``, as QR or Cholesky gives it."""

    root: Array

    @property
    def inverse(self) -> Array:
        """Root (..., p, p) of the covariance P of the unknowns, ``P = inverse inverse^T``."""
        return np.asarray(np.linalg.inv(self.root[..., :-1, :-1]))

    @property
    def x(self) -> Array:
        """The unknowns (..., p)."""
        return np.asarray((self.inverse @ self.root[..., :-1, -1:])[..., 0])

    @property
    def chi2(self) -> Array:
        """Weighted sum of squares (...), prior rows included."""
        return np.asarray(np.square(self.root[..., -1, -1]))

    @property
    def volume(self) -> Array:
        """Logarithm (...) of the determinant of ``A^T A``."""
        diagonal = np.einsum("...kk->...k", self.root[..., :-1, :-1])
        return np.asarray(2.0 * np.log(np.abs(diagonal)).sum(axis=-1))

    def likelihood(self, size: Array | float) -> Array:
        """Logarithm (...) of the restricted likelihood; ``size`` (...) is that of the determinant of V."""
        return np.asarray(-0.5 * (size + self.volume + self.chi2))


def solved(rows: Array) -> Solved:
    """Least squares on whitened ``rows`` (..., n, p + 1) of A and, last, y; n > p."""
    return Solved(np.asarray(np.linalg.qr(rows, mode="r")))


class Score(NamedTuple):
    """The likelihood of some variances: ``value`` its logarithm, its ``slope`` (k,) by them, its ``information``
    (k, k), exact or near it."""

    value: float
    slope: Array
    information: Array


class Highest(NamedTuple):
    """The likeliest ``variances`` (k,), the ``score`` there, and the ``gain`` of the logarithm since the start."""

    variances: Array
    score: Score
    gain: float


def highest(score: Callable[[Array], Score], start: Array, least: Array) -> Highest:
    """The likeliest variances, from ``start`` (k,) on and never below ``least`` (k,).

    Fisher's scoring of their logarithms. A step that lowers the likelihood is not taken: the information was too
    small, by some factor that from then on is measured along each step (Barzilai, Borwein 1988).
    """
    low, log, now, factor = np.log(least), np.log(start), score(start), 1.0
    first = now.value
    for _ in range(_STEPS):
        s2 = np.exp(log)
        slope, information = now.slope * s2, now.information * np.outer(s2, s2)
        moving = ~((log <= low) & (slope < 0.0))
        if not moving.any():
            break
        step = np.zeros(len(log))
        step[moving] = np.linalg.lstsq(information[np.ix_(moving, moving)], slope[moving], rcond=None)[0]
        there = np.maximum(log + np.clip(step / factor, -_LONGEST, _LONGEST), low)
        change, trial = there - log, score(np.exp(there))
        fall = change @ (slope - trial.slope * np.exp(there))
        measured = float(fall / max(change @ information @ change, 1e-300))
        if trial.value >= now.value:
            log, now, factor = there, trial, max(measured, 1.0) if factor > 1.0 else 1.0
        else:
            factor = max(2.0 * factor, measured)
        if np.abs(change).max() < _SETTLED:
            break
    return Highest(np.exp(log), now, now.value - first)


def degrees(spread: Array | float) -> Array:
    """Degrees of freedom, one or more, of variances whose logarithms have these variances: 2 over them."""
    return np.asarray(np.maximum(2.0 / np.asarray(spread), 1.0))


def weighed(logs: Array) -> Array:
    """Weights (..., g) of sizes, of sum 1, by the logarithms (..., g) of their likelihood times their prior."""
    weights = np.exp(logs - logs.max(axis=-1, keepdims=True))
    return np.asarray(weights / weights.sum(axis=-1, keepdims=True))


def second_moment(weights: Array, covariances: Array, offsets: Array) -> Array:
    """Second moment (p, p) over sizes of ``weights`` (g,): that of ``covariances`` (g, p, p) and of values that are
    ``offsets`` (g, p) away."""
    return np.asarray(
        np.einsum("g,gab->ab", weights, covariances) + np.einsum("g,ga,gb->ab", weights, offsets, offsets)
    )
