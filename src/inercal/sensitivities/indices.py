"""The result of every sensitivity analysis of a rig: parts of variance by output, position and factor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from inercal.arrays import Array, short_repr

SINGULAR = 0.99
"""Sum of the first-order indices below which a position is flagged: interactions rule there."""


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
