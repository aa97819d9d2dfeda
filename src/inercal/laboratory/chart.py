"""Control charts of a coefficient: is it what it was, but for its uncertainty and the scatter between calibrations?

*Individuals* (Shewhart): a calibration against those before it. Its limits are the quantiles, at the probabilities of
three standard deviations, of what it should find if the coefficient had stayed: by u and by the scatter s beyond u,
which is learned from the calibrations before and averaged over (see `inercal.laboratory.wander`).

*EWMA* (Roberts 1959), for what drifts slowly: deviations as standard normal numbers z_k, by their place in that same
distribution, are smoothed, e_k = (1 - L) e_(k-1) + L z_k with L = 0.2, and compared with three standard deviations of
e_k. Where nothing changes each point of each chart alarms with a probability of 0.27 %, or less.

Sources: ISO 7870-2:2013 and 7870-6:2016; S. W. Roberts, Technometrics 1 (1959) 239.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from inercal.foundation.arrays import Array
from inercal.foundation.inference.variances import solved, weighed
from inercal.laboratory.wander import CalibrationSeries, prior_of

Mask: TypeAlias = NDArray[np.bool_]

LIMIT = 3.0
"""Limit of both charts, in standard deviations."""

WEIGHT = 0.2
"""Weight L of the newest deviation in the EWMA."""

FIRST = 2
"""Calibrations before the first that is judged: the scatter is not known from one."""

_GRID = 40


@dataclass(frozen=True, eq=False)
class Chart:
    """Both charts; NaN at the first two calibrations, which teach the scatter.

    ``centre``, ``low`` and ``high`` (n,) in the unit of the coefficient; ``z`` (n,) deviations as standard normal
    numbers, ``ewma`` (n,) and the limit ``ewma_limit`` (n,) of its size.
    """

    centre: Array
    low: Array
    high: Array
    z: Array
    ewma: Array
    ewma_limit: Array

    @property
    def alarms(self) -> Mask:
        """Calibrations (n,) outside the limits of the chart of individuals."""
        return np.abs(self.z) > LIMIT

    @property
    def drift_alarms(self) -> Mask:
        """Calibrations (n,) outside the limits of the EWMA."""
        return np.abs(self.ewma) > self.ewma_limit


def chart(series: CalibrationSeries) -> Chart:
    """The control charts of a coefficient that should not change."""
    n = len(series.y)
    centre, low, high, z = (np.full(n, np.nan) for _ in range(4))
    if n > FIRST:
        expected = [_expected(series, k) for k in range(FIRST, n)]
        weights, means, sigmas = (np.array(each) for each in zip(*expected, strict=True))
        below = (weights * ndtr((series.y[FIRST:, None] - means) / sigmas)).sum(axis=1)
        with np.errstate(divide="ignore"):
            z[FIRST:] = np.clip(ndtri(np.clip(below, 0.0, 1.0)), -40.0, 40.0)
        centre[FIRST:] = (weights * means).sum(axis=1)
        low[FIRST:], high[FIRST:] = (
            _quantiles(weights, means, sigmas, float(ndtr(side * LIMIT))) for side in (-1.0, 1.0)
        )
    ewma, limit = np.full(n, np.nan), np.full(n, np.nan)
    smoothed = 0.0
    for k in range(FIRST, n):
        smoothed = (1.0 - WEIGHT) * smoothed + WEIGHT * z[k]
        ewma[k] = smoothed
        limit[k] = LIMIT * np.sqrt(WEIGHT / (2.0 - WEIGHT) * (1.0 - (1.0 - WEIGHT) ** (2 * (k - FIRST + 1))))
    return Chart(centre, low, high, z, ewma, limit)


def _expected(series: CalibrationSeries, k: int) -> tuple[Array, Array, Array]:
    """Distribution of calibration k by those before it: weights, means and sigmas of a mixture over s.

    The common part of u is the same in all, and cancels.
    """
    y, own = series.y[:k], series.own[:k]
    largest = 30.0 * max(series.scale, float(np.std(y)))
    sizes = np.concatenate([[0.0], np.geomspace(0.03 * series.scale, largest, _GRID)])
    prior = prior_of(sizes / series.scale, 1.0)
    variances = np.maximum(own**2 + sizes[:, None] ** 2, 1e-300)
    fit = solved(np.stack(np.broadcast_arrays(1.0, y), axis=-1) / np.sqrt(variances)[..., None])
    weights = weighed(fit.likelihood(np.log(variances).sum(axis=1)) + np.log(prior))
    sigmas = np.sqrt(fit.inverse[:, 0, 0] ** 2 + series.own[k] ** 2 + sizes**2)
    return weights, fit.x[:, 0], sigmas


def _quantiles(weights: Array, means: Array, sigmas: Array, p: float) -> Array:
    """Quantiles (m,) of mixtures (m, g) of normal distributions, by bisection to 1e-12 of their span."""
    low, high = (means - 40.0 * sigmas).min(axis=1), (means + 40.0 * sigmas).max(axis=1)
    for _ in range(40):
        middle = 0.5 * (low + high)
        under = (weights * ndtr((middle[:, None] - means) / sigmas)).sum(axis=1) < p
        low, high = np.where(under, middle, low), np.where(under, high, middle)
    found: Array = 0.5 * (low + high)
    return found
