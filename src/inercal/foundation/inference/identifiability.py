"""Identifiability from data: rank, condition, null vectors and weak combinations, in terms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array

UNSEEN = 0.9
"""Part of its prior standard deviation above which the data say nothing about a parameter."""

HALF_SEEN = 0.5
"""Part of its prior above which a parameter counts as left at it where the motion is planned: plan better."""

WORST_BY_SIZE = 50.0
"""Condition number beyond which a fit is ill-conditioned, its parameters scaled by their typical sizes (`identify`)."""

WORST_BY_LENGTH = 100.0
"""The same where columns are scaled to unit length, as those of polynomials in positions, whose powers go alike."""


@dataclass(frozen=True)
class Identifiability:
    """Singular value decomposition of a Jacobian (n, p) with scaled columns.

    ``singular_values`` (p,) descending; ``directions`` (p, p), row i the combination of *scaled* parameters
    that belongs to value i; ``left`` (n, min(n, p)) the combinations of observations; ``scale`` (p,) the
    reciprocal typical sizes of the parameters, or the column lengths where none were given. A combination v of
    scaled parameters is v / scale in the parameters' own units.
    """

    names: tuple[str, ...]
    singular_values: Array
    directions: Array
    left: Array
    scale: Array
    rank: int

    @property
    def condition(self) -> float:
        """Largest over smallest singular value of the scaled Jacobian; inf when rank-deficient."""
        if self.rank < len(self.names):
            return float("inf")
        return float(self.singular_values[0] / self.singular_values[-1])

    @property
    def null_vectors(self) -> Array:
        """Combinations (p - rank, p) of scaled parameters of which the data say nothing."""
        return self.directions[self.rank :]

    @property
    def unit_covariance(self) -> Array:
        """(p, p) covariance of the parameters for observations of unit variance (pseudo-inverse)."""
        root = self._root()
        return np.asarray(root @ root.T)

    def solution(self, y: Array) -> Array:
        """(p,) least-squares solution for whitened observations ``y`` (n,), of minimum scaled length.

        Never by way of the covariance: that would square the condition number.
        """
        return np.asarray(self._root() @ (self.left[:, : self.rank].T @ y))

    def _root(self) -> Array:
        """(p, rank) root of the unit covariance, in the parameters' own units."""
        return self.directions[: self.rank].T / self.singular_values[: self.rank] / self.scale[:, None]

    def weakest(self) -> str:
        """The worst-known combination in words, for example ``M_xy - 0.86 K1_y``."""
        return in_words(self.directions[-1], self.names)

    def leading_term(self) -> str:
        """The term with the largest part in the worst-known combination."""
        return self.names[int(np.argmax(np.abs(self.directions[-1])))]


def identify(J: Array, names: Sequence[str], sizes: Array | None = None) -> Identifiability:
    """Decompose a whitened Jacobian.

    Parameters
    ----------
    J : (n, p)
        Derivative of the whitened residuals.
    names : sequence of str, length p
    sizes : (p,), optional
        Typical sizes of the parameters: a change by that much would be a large one. They make the condition
        number independent of units, and show a column that is nearly zero as what it is. Without them columns
        are scaled to unit length, which hides that; only a column within rounding of the longest (cos 90 deg
        is 6e-17, not 0) then counts as zero.
    """
    n, p = J.shape
    if sizes is None:
        length = np.linalg.norm(J, axis=0)
        longest = length.max(initial=0.0)
        scale = np.where(length > longest * max(n, p) * np.finfo(float).eps, length, longest or 1.0)
    else:
        scale = 1.0 / sizes
    u, s, vt = np.linalg.svd(J / scale, full_matrices=n < p)  # all p directions, but never an n by n matrix
    values = np.concatenate([s, np.zeros(p - len(s))])
    tolerance = values[0] * max(n, p) * np.finfo(float).eps if p else 0.0
    return Identifiability(tuple(names), values, vt, u, scale, int(np.sum(values > tolerance)))


@dataclass(frozen=True)
class Learned:
    """Information of data beside a prior: principal axes of the covariance in units of the prior.

    ``left`` (p,) descending, the part of its prior standard deviation that is left of a combination; ``directions``
    (p, p), row i the combination of parameters, each over its own prior, that belongs to part i; ``ratio`` (p,) the
    part left of each parameter by itself.
    """

    names: tuple[str, ...]
    left: Array
    directions: Array
    ratio: Array

    @property
    def singular_values(self) -> Array:
        """(p,) rising: those of the whitened Jacobian of the data, with parameters in units of the prior."""
        return np.sqrt(np.maximum(1.0 / np.square(self.left) - 1.0, 0.0))

    @property
    def condition(self) -> float:
        """Part left of the worst-known combination over that of the best-known."""
        return float(self.left[0] / self.left[-1])

    def at_prior(self, part: float = HALF_SEEN) -> dict[str, float]:
        """Parameters of which more than this part of the prior is left, and what is left of it."""
        ratios = zip(self.names, self.ratio.tolist(), strict=True)
        return {name: ratio for name, ratio in ratios if ratio > part}

    def weakest(self, count: int = 1) -> tuple[str, ...]:
        """The worst-known combinations in words; terms count by their size over the prior."""
        return tuple(in_words(direction, self.names) for direction in self.directions[:count])


def learned(covariance: Array, prior: Array, names: Sequence[str]) -> Learned:
    """Set the ``covariance`` (p, p) after the data against ``prior`` (p,) standard deviations."""
    scaled = covariance / np.outer(prior, prior)
    values, vectors = np.linalg.eigh(scaled)
    # smaller ones are lost in rounding
    least = max(float(np.finfo(float).eps * values[-1]), float(np.finfo(float).tiny))
    left = np.sqrt(np.maximum(values[::-1], least))
    return Learned(tuple(names), left, vectors.T[::-1], np.sqrt(np.diag(scaled)))


def in_words(direction: Array, names: Sequence[str], smallest: float = 0.3) -> str:
    """A combination in words: its terms by size, those of at least ``smallest`` of the largest."""
    order = np.argsort(-np.abs(direction))
    top = direction[order[0]]
    kept = [k for k in order if abs(direction[k]) >= smallest * abs(top)]
    signed = [f"{direction[k] / top:+.2f} {names[k]}" for k in kept[1:]]
    return " ".join([names[kept[0]], *signed]).replace("+", "+ ").replace("-", "- ")


def few_terms(vectors: Array) -> Array:
    """Null vectors (k, p) that span the same space with as few terms as they can have: reduced row echelon form,
    largest pivots first."""
    rows = vectors.copy()
    for k in range(len(rows)):
        j = int(np.argmax(np.abs(rows[k:]).max(axis=0)))
        i = k + int(np.argmax(np.abs(rows[k:, j])))
        rows[[k, i]] = rows[[i, k]]
        rows[k] /= rows[k, j]
        others = np.arange(len(rows)) != k
        rows[others] -= rows[others, j][:, None] * rows[k]
    rows[np.abs(rows) < 1e-9] = 0.0
    return rows
