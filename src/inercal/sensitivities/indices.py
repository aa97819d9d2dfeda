"""The result of every sensitivity analysis of a rig: parts of variance by output, position and factor."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inercal.arrays import Array
from inercal.rigs.chain import Chain

SINGULAR = 0.99
"""Sum of the first-order indices below which a position is flagged: interactions rule there."""


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
    u_first, u_total : (o, n, k) standard uncertainties of `first` and `total`; None where these are exact
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
    u_first: Array | None = None
    u_total: Array | None = None

    @property
    def first(self) -> Array:
        """First-order Sobol indices S_i (o, n, k)."""
        return self._share(self.first_variance)

    @property
    def total_minus_first(self) -> Array:
        """ST_i - S_i (o, n, k), from its own sum and not by subtraction where the analysis is exact."""
        return self._share(self.interaction_variance)

    @property
    def total(self) -> Array:
        """Total-order Sobol indices ST_i (o, n, k)."""
        return self._share(self.first_variance + self.interaction_variance)

    @property
    def second(self) -> Array | None:
        """Second-order indices S_ij (o, n, k, k)."""
        return None if self.second_variance is None else self._share(self.second_variance)

    def _share(self, part: Array) -> Array:
        """A part over the variance; NaN where there is none."""
        whole = self.variance.reshape(*self.variance.shape, *(1,) * (part.ndim - 2))
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(whole > 0.0, part / whole, np.nan)


_OVER_POSITIONS = (
    *("variance", "bias", "first_variance", "interaction_variance"),
    *("shapley", "second_variance", "u_first", "u_total"),
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
