"""Indices averaged over positions and outputs, and the positions where first order does not tell the whole."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.sensitivities.indices import FALSE_FLAG, SINGULAR, Indices, share, spread

_Three: TypeAlias = tuple[Array, Array, Array]


@dataclass(frozen=True, eq=False)
class Averages:
    """Indices ``first``, ``total`` and ``total_minus_first``: by output and factor (o, k), or by factor (k,).

    ``u_first``, ``u_total``, ``u_total_minus_first`` their standard uncertainties by sampling; None where they are
    exact.
    """

    first: Array
    total: Array
    total_minus_first: Array
    u_first: Array | None = None
    u_total: Array | None = None
    u_total_minus_first: Array | None = None


@dataclass(frozen=True)
class Flag:
    """A position (``angles`` [rad] by joint) where the first-order indices of an ``output`` sum to less than 0.99.

    ``u`` of the sum, 0 where it is exact.
    """

    output: str
    angles: tuple[float, ...]
    sum_first: float
    u: float = 0.0


def mean(indices: Indices) -> Averages:
    """The mean of the indices over positions, (o, k), as in Zhao et al. 2023; null indices are left out."""

    def shares(variance: Array, first: Array, interaction: Array) -> _Three:
        parts = (first, first + interaction, interaction)
        one, two, three = (_mean(share(part, variance)) for part in parts)
        return one, two, three

    return _averages(indices, shares)


def weighted(indices: Indices) -> Averages:
    """Sum of the parts over sum of the variances over positions, (o, k).

    The aggregated index of Gamboa et al. 2014 ("Sensitivity analysis for multidimensional and functional
    outputs", Electronic Journal of Statistics 8); positions without variance do not disturb it.
    """

    def shares(variance: Array, first: Array, interaction: Array) -> _Three:
        return _shares(variance.sum(axis=-1), first.sum(axis=-2), interaction.sum(axis=-2))

    return _averages(indices, shares)


def aggregate(indices: Indices) -> Averages:
    """Indices (k,) of all outputs and positions together, each output divided by its scale first."""
    weight = 1.0 / np.square(indices.scales)

    def shares(variance: Array, first: Array, interaction: Array) -> _Three:
        return _shares(
            np.einsum("o,...on->...", weight, variance),
            np.einsum("o,...onk->...k", weight, first),
            np.einsum("o,...onk->...k", weight, interaction),
        )

    return _averages(indices, shares)


def flagged(indices: Indices) -> tuple[Flag, ...]:
    """Outputs and positions whose first-order indices sum to less than 0.99, by output, then position.

    Sampled sums are below it by more than their own error: the risk that sampling alone flags any is 1 %.
    """
    sums, u = indices.first.sum(axis=2), indices.u_sum_first
    own = np.zeros_like(sums) if u is None else u
    with np.errstate(invalid="ignore"):
        places = np.argwhere(sums + _sigmas(sums.size) * own < SINGULAR)
    return tuple(
        Flag(indices.outputs[o], tuple(indices.angles[n].tolist()), float(sums[o, n]), float(own[o, n]))
        for o, n in places
    )


def _sigmas(tests: int) -> float:
    """Standard deviations that one of so many tests exceeds with a probability of ``FALSE_FLAG`` in all."""
    from scipy.special import ndtri

    return float(-ndtri(FALSE_FLAG / max(tests, 1)))


def _averages(indices: Indices, shares: Callable[[Array, Array, Array], _Three]) -> Averages:
    """Averages of the indices, and their spread over the resamples."""
    central = shares(indices.variance, indices.first_variance, indices.interaction_variance)
    again = indices.resampled
    if again is None:
        return Averages(*central)
    there = indices.variance > 0.0  # scatter by rounding is none
    scattered = shares(
        np.where(there, again.variance, 0.0),
        np.where(there[..., None], again.first_variance, 0.0),
        np.where(there[..., None], again.interaction_variance, 0.0),
    )
    return Averages(*central, *map(spread, scattered))


def _mean(values: Array) -> Array:
    """Mean over positions (..., o, k) of (..., o, n, k) without NaN; NaN where nothing is left."""
    finite = np.isfinite(values)
    count = finite.sum(axis=-2)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(finite, values, 0.0).sum(axis=-2) / np.where(count > 0, count, np.nan))


def _shares(variance: Array, first: Array, interaction: Array) -> _Three:
    """Parts over their variance; NaN where there is none."""
    return share(first, variance), share(first + interaction, variance), share(interaction, variance)
