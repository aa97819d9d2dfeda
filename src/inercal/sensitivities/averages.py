"""Indices averaged over positions and outputs, and the positions where first order does not tell the whole."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inercal.arrays import Array
from inercal.sensitivities.indices import SINGULAR, Indices


@dataclass(frozen=True, eq=False)
class Averages:
    """Indices ``first``, ``total`` and ``total_minus_first``: by output and factor (o, k), or by factor (k,)."""

    first: Array
    total: Array
    total_minus_first: Array


@dataclass(frozen=True)
class Flag:
    """A position (``angles`` [rad] by joint) where the first-order indices of an ``output`` sum to less than 0.99."""

    output: str
    angles: tuple[float, ...]
    sum_first: float


def mean(indices: Indices) -> Averages:
    """The mean of the indices over positions, (o, k), as in Zhao et al. 2023; null indices are left out."""
    return Averages(_mean(indices.first), _mean(indices.total), _mean(indices.total_minus_first))


def weighted(indices: Indices) -> Averages:
    """Sum of the parts over sum of the variances over positions, (o, k).

    The aggregated index of Gamboa et al. 2014 ("Sensitivity analysis for multidimensional and functional
    outputs", Electronic Journal of Statistics 8); positions without variance do not disturb it.
    """
    return _shares(
        indices.variance.sum(axis=1),
        indices.first_variance.sum(axis=1),
        indices.interaction_variance.sum(axis=1),
    )


def aggregate(indices: Indices) -> Averages:
    """Indices (k,) of all outputs and positions together, each output divided by its scale first."""
    weight = 1.0 / np.square(indices.scales)
    return _shares(
        np.asarray(weight @ indices.variance.sum(axis=1)),
        weight @ indices.first_variance.sum(axis=1),
        weight @ indices.interaction_variance.sum(axis=1),
    )


def flagged(indices: Indices) -> tuple[Flag, ...]:
    """Outputs and positions whose first-order indices sum to less than 0.99, by output, then position."""
    sums = indices.first.sum(axis=2)
    with np.errstate(invalid="ignore"):
        places = np.argwhere(sums < SINGULAR)
    return tuple(
        Flag(indices.outputs[o], tuple(indices.angles[n].tolist()), float(sums[o, n])) for o, n in places
    )


def _mean(values: Array) -> Array:
    """Mean over positions (o, k) of (o, n, k) without NaN; NaN where nothing is left."""
    finite = np.isfinite(values)
    count = finite.sum(axis=1)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(finite, values, 0.0).sum(axis=1) / np.where(count > 0, count, np.nan))


def _shares(variance: Array, first: Array, interaction: Array) -> Averages:
    """Parts over their variance; NaN where there is none."""
    whole = np.where(variance > 0.0, variance, np.nan)[..., None]
    return Averages(first / whole, (first + interaction) / whole, interaction / whole)
