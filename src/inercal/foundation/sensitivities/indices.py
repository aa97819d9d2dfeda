"""The result of every sensitivity analysis of a rig: parts of variance by output, position and factor."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.rigs.chain import Chain

SINGULAR = 0.99
"""Sum of the first-order indices below which a position is flagged: interactions rule there."""

FALSE_FLAG = 0.01
"""Probability that sampling alone flags some position of an analysis."""


@dataclass(frozen=True, eq=False)
class Resampled:
    """Parts of variance from b resamples of the rows (bootstrap), whose spread is the uncertainty of the indices.

    ``variance`` (b, o, n), ``first_variance`` and ``interaction_variance`` (b, o, n, k); without n for one position.
    """

    variance: Array
    first_variance: Array
    interaction_variance: Array


class VarianceParts(NamedTuple):
    """Variance and bias (o, n) of each output, V_i and VT_i - V_i (o, n, k) of each error."""

    variance: Array
    bias: Array
    first: Array
    interaction: Array


@short_repr
@dataclass(frozen=True, eq=False)
class Indices:
    """Variances of outputs and their parts, at each position of a rig.

    Attributes
    ----------
    factors : (k,) names of the errors
    outputs : (o,) names of the outputs
    units : (o,) units of the outputs
    scales : (o,) size of each output [its unit], by which outputs of different units are divided
    angles : (n, joints) positions [rad]
    variance : (o, n) variance of the error of each output [unit^2]
    bias : (o, n) its expectation [unit]
    first_variance : (o, n, k) V_i, caused by a factor alone [unit^2]
    interaction_variance : (o, n, k) VT_i - V_i, caused by it together with others [unit^2]
    shapley : (o, n, k) Shapley effects, shares that sum to one; None where not asked for
    second_variance : (o, n, k, k) V_ij, symmetric with zero diagonal [unit^2]; None where not asked for
    resampled : the parts of resampled rows; None where the indices are exact
    method : mapping, how it was computed: name, samples, seed, ...

    An output without variance at a position has null indices (NaN) there.
    """

    factors: tuple[str, ...]
    outputs: tuple[str, ...]
    units: tuple[str, ...]
    scales: Array
    angles: Array
    variance: Array
    bias: Array
    first_variance: Array
    interaction_variance: Array
    method: Mapping[str, Any]
    shapley: Array | None = None
    second_variance: Array | None = None
    resampled: Resampled | None = None

    @property
    def first(self) -> Array:
        """First-order Sobol indices S_i (o, n, k)."""
        return share(self.first_variance, self.variance)

    @property
    def total_minus_first(self) -> Array:
        """ST_i - S_i (o, n, k), from its own sum and not by subtraction where the analysis is exact."""
        return share(self.interaction_variance, self.variance)

    @property
    def total(self) -> Array:
        """Total-order Sobol indices ST_i (o, n, k)."""
        return share(self.first_variance + self.interaction_variance, self.variance)

    @property
    def second(self) -> Array | None:
        """Second-order indices S_ij (o, n, k, k)."""
        if self.second_variance is None:
            return None
        return share(self.second_variance, self.variance[..., None])

    @property
    def u_first(self) -> Array | None:
        """Standard uncertainties of `first` by sampling (o, n, k); None where that is exact."""
        return self._spread(lambda of: of.first_variance)

    @property
    def u_total(self) -> Array | None:
        """Standard uncertainties of `total` by sampling (o, n, k)."""
        return self._spread(lambda of: of.first_variance + of.interaction_variance)

    @property
    def u_total_minus_first(self) -> Array | None:
        """Standard uncertainties of `total_minus_first` by sampling (o, n, k)."""
        return self._spread(lambda of: of.interaction_variance)

    @property
    def u_sum_first(self) -> Array | None:
        """Standard uncertainty of the sum of the first-order indices (o, n)."""
        made = self._spread(lambda of: of.first_variance.sum(axis=-1, keepdims=True))
        return None if made is None else made[..., 0]

    def _spread(self, part: Callable[[Resampled], Array]) -> Array | None:
        """Standard deviation of a share over the resamples; NaN where there is no variance."""
        if self.resampled is None:
            return None
        shares = share(part(self.resampled), self.resampled.variance)
        return np.where(self.variance[..., None] > 0.0, spread(shares), np.nan)


def share(part: Array, variance: Array) -> Array:
    """A part (..., k) over the variance (...); NaN where there is none."""
    whole = np.where(variance > 0.0, variance, np.nan)[..., None]
    return np.asarray(part / whole)


def spread(resampled: Array) -> Array:
    """Standard deviation over the resamples (b, ...)."""
    return np.asarray(np.std(resampled, axis=0, ddof=1))


_OVER_POSITIONS = (
    *("variance", "bias", "first_variance", "interaction_variance"),
    *("shapley", "second_variance"),
)
"""Fields that have the positions in their second axis, where they are there."""


def by_position(analyse: Callable[[Chain, Array], Indices], chain: Chain, angles: Array) -> Indices:
    """The indices at ``angles`` (n, joints) [rad] by an analysis of chains in which no error follows an angle.

    Positions at which the errors are of one size are analysed together.
    """
    followed = angles[:, chain.followed]
    _, numbers = np.unique(followed, axis=0, return_inverse=True)
    numbers = numbers.reshape(-1)
    count = int(numbers.max(initial=0)) + 1
    rows = [np.flatnonzero(numbers == k) for k in range(count)]
    first = [angles[at[0]] if len(at) else np.zeros(len(chain.joints)) for at in rows]
    parts = [analyse(chain.standing(at), angles[own]) for at, own in zip(first, rows, strict=True)]
    if count == 1:
        return parts[0]
    return joined(parts, axis=1, order=np.argsort(np.concatenate(rows), kind="stable"), angles=angles)


def joined(
    parts: Sequence[Indices], axis: int, order: NDArray[np.intp] | slice = slice(None), **changed: Any
) -> Indices:
    """Several indices as one, along outputs (``axis`` 0) or positions (1) in an ``order``; other fields ``changed``."""
    fields: dict[str, Any] = {}
    for name in _OVER_POSITIONS:
        values = [getattr(part, name) for part in parts]
        if all(value is not None for value in values):
            whole = np.concatenate(values, axis=axis)
            fields[name] = whole[:, order] if axis else whole[order]
    return replace(parts[0], **fields, **changed)


def shapley_effects(totals: Callable[[float], Array], factors: int) -> Array:
    """Shapley effects (..., k) of independent errors, shares that sum to one; NaN where there is no variance.

    ``totals`` gives VT_i (..., k) with all variances multiplied by its argument; ``factors`` is the number k of errors.

    A Shapley effect shares the variance V_A of every set A of errors equally among its members (Owen 2014,
    "Sobol' indices and Shapley value", SIAM/ASA J. Uncertainty Quantification 2). With the variance of every part
    of every error multiplied by z the total of an error is the sum of z^|A| V_A over the sets it is in, so that
    the integral of total / z from 0 to 1 divides by |A|. It is a polynomial of degree k - 1: Gauss-Legendre
    quadrature with ceil(k/2) nodes is exact, and no term is negative.
    """
    x, w = np.polynomial.legendre.leggauss(max(1, (factors + 1) // 2))
    effects = sum(0.5 * weight / z * totals(z) for z, weight in zip(0.5 * (x + 1.0), w, strict=True))
    whole = np.sum(effects, axis=-1, keepdims=True)
    with np.errstate(invalid="ignore"):
        return np.where(whole > 0.0, effects / whole, np.nan)
