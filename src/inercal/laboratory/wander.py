"""Wandering of a coefficient from calibration to calibration: drift, random walk, noise of the calibrations.

The value x at time t, and what a calibration finds of it, are

    x(t) = a + b t + w(t),        w a random walk of variance q t (a Wiener process),
    y_k  = x(t_k) + c_k + v_k + e_k,

with c_k the part of u that all calibrations have in common (gravity, a table), v_k the rest of u, and e_k noise of
variance s^2 beyond u (mounting, switching on). a and b have no prior: the likelihood of the variances q and s^2 is the
restricted one (`inercal.foundation.inference.variances`), and values are best linear unbiased predictions, as of a
Kalman smoother with a diffuse start. On few points q and s^2 are hardly known. Hence they are not chosen but averaged
over: on a grid, by their restricted likelihood times a prior density (1 + x)^-p of x, s or the random walk over the
time that is covered, each in units of the median of u: below u all sizes are alike. With p = 5/3 intervals of simulated
instruments hold as often as stated; with p = 1, as for charts, all orders of magnitude above u are alike, and where
there are few calibrations intervals are too wide. Intervals are those of the mixture, wider where little is known.

Sources: G. Robinson, Statistical Science 6 (1991) 15
(prediction); J. O. Berger, V. De Oliveira, B. Sanso, J. Am. Stat. Assoc. 96 (2001) 1361 (why not to choose).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import ndtr

from inercal.foundation.arrays import Array
from inercal.foundation.inference.variances import solved, weighed
from inercal.foundation.results.result import COVERAGE

_GRID = 25
"""Sizes of each variance that are tried."""

_SMALLEST = 0.03
"""Smallest standard deviation of the grid, over the scale of its prior."""

_POWER = 5.0 / 3.0
"""Power p of the prior."""

_NEGLIGIBLE = 1e-7
"""Weight of a point of the grid below which it is left out."""


@dataclass(frozen=True, eq=False)
class CalibrationSeries:
    """Calibrations of a coefficient in the order of time.

    ``t`` (n,) in years, ``y`` (n,) values, ``own`` (n,) standard uncertainty that is each calibration's own, ``common``
    (n,) that which all have in common.
    """

    t: Array
    y: Array
    own: Array
    common: Array

    @property
    def u(self) -> Array:
        """Standard uncertainties (n,)."""
        return np.hypot(self.own, self.common)

    @cached_property
    def scale(self) -> float:
        """Size of what is certain to scatter: the median of ``own``, or the scatter itself where that is 0."""
        size = float(np.median(self.own))
        return size or float(np.std(self.y)) or 1.0


@dataclass(frozen=True)
class Interval:
    """A value with the half-width of its interval of 95.45 %."""

    value: float
    U: float


@dataclass(frozen=True, eq=False)
class Wandering:
    """Wandering of a coefficient: a mixture over the sizes of both variances.

    ``weights`` (g,) of the grid; ``walk`` (g,) sqrt(q) per square root of a year and ``noise`` (g,) s; at each of them
    ``trend`` (g, 2) and its covariance (g, 2, 2) are a at the mean time and b per year, and ``inverse`` (g, n, n) is
    that of the covariance of the values.
    """

    series: CalibrationSeries
    weights: Array
    walk: Array
    noise: Array
    trend: Array
    trend_covariance: Array
    inverse: Array

    def at(self, t: float) -> Interval:
        """The value at a time [year], before, between or after the calibrations."""
        series, t0 = self.series, float(self.series.t.min())
        x, X = np.array([1.0, t - series.t.mean()]), _regressors(series)
        q = self.walk**2
        # the walk is 0 at the first calibration, and runs backward from there, independent of what came after
        cross = q[:, None] * np.clip(np.minimum(series.t, t) - t0, 0.0, None)
        solved = np.einsum("gij,gj->gi", self.inverse, cross)
        left = x - solved @ X
        residual = series.y - self.trend @ X.T
        means = self.trend @ x + (solved * residual).sum(axis=1)
        variances = q * abs(t - t0) - (cross * solved).sum(axis=1)
        variances += np.einsum("gi,gij,gj->g", left, self.trend_covariance, left)
        return _interval(self.weights, means, np.sqrt(np.maximum(variances, 0.0)))

    @property
    def drift(self) -> Interval:
        """Drift b per year."""
        return _interval(self.weights, self.trend[:, 1], np.sqrt(self.trend_covariance[:, 1, 1]))

    def range_of(self, sizes: Array) -> tuple[float, float, float]:
        """Median and interval of 95 % of ``walk`` or ``noise``."""
        order = np.argsort(sizes, kind="stable")
        below = np.cumsum(self.weights[order])
        at = np.minimum(np.searchsorted(below, (0.025, 0.5, 0.975)), len(order) - 1)
        low, middle, high = sizes[order][at].tolist()
        return middle, low, high


def wandering(series: CalibrationSeries) -> Wandering:
    """The wandering of a coefficient from three or more calibrations at two or more times.

    Raises `ValueError` for fewer.
    """
    if len(series.y) < 3 or np.ptp(series.t) == 0.0:
        raise ValueError("needs three calibrations at two times")
    X, span = _regressors(series), float(np.ptp(series.t))
    largest = 30.0 * max(series.scale, float(np.std(series.y))) / series.scale
    sizes = np.concatenate([[0.0], np.geomspace(_SMALLEST, largest, _GRID - 1)]) * series.scale
    prior = np.log(prior_of(sizes / series.scale, _POWER))
    begun = series.t - series.t.min()
    walked = np.minimum.outer(begun, begun) / span
    # results without an uncertainty, or nearly all of it in common
    floor = (1e-6 * np.hypot(series.scale, series.common.max())) ** 2 * np.eye(len(series.y))
    certain = np.diag(series.own**2) + np.outer(series.common, series.common) + floor
    walk, noise = (size.ravel() for size in np.meshgrid(sizes, sizes, indexing="ij"))
    V = certain + walk[:, None, None] ** 2 * walked + noise[:, None, None] ** 2 * np.eye(len(series.y))
    whiten = np.linalg.inv(np.linalg.cholesky(V))
    fit = solved(whiten @ np.column_stack([X, series.y]))
    size = -2.0 * np.log(np.einsum("gii->gi", whiten)).sum(axis=1)
    logs = fit.likelihood(size) + np.add.outer(prior, prior).ravel()
    kept = weighed(logs) > _NEGLIGIBLE
    whiten, of_trend = whiten[kept], fit.inverse[kept]
    return Wandering(
        series,
        weighed(logs[kept]),
        walk[kept] / np.sqrt(span),
        noise[kept],
        fit.x[kept],
        of_trend @ np.swapaxes(of_trend, 1, 2),
        np.swapaxes(whiten, 1, 2) @ whiten,
    )


def _regressors(series: CalibrationSeries) -> Array:
    """Derivatives (n, 2) by a, at the mean time, and b."""
    return np.column_stack([np.ones(len(series.t)), series.t - series.t.mean()])


def prior_of(x: Array, power: float) -> Array:
    """Prior weights (g,) of a grid ``x`` (g,) that begins with 0: of the density (1 + x)^-power around each point."""
    edges = np.concatenate([[0.0, 0.5 * x[1]], np.sqrt(x[1:-1] * x[2:]), [x[-1] ** 1.5 / x[-2] ** 0.5]])
    weight: Array = np.diff(np.log1p(edges) if power == 1.0 else -((1.0 + edges) ** (1.0 - power)))
    return weight


def _interval(weights: Array, means: Array, sigmas: Array) -> Interval:
    """Mean of a mixture of normal distributions, and the half-width about it that holds 95.45 %."""
    value = float(weights @ means)
    sigmas = np.maximum(sigmas, 1e-300)

    def inside(half: float) -> float:
        return float(
            weights @ (ndtr((value + half - means) / sigmas) - ndtr((value - half - means) / sigmas))
        )

    return Interval(
        value, rising(inside, COVERAGE, 0.0, float(np.max(np.abs(means - value) + 10.0 * sigmas)))
    )


def rising(function: Callable[[float], float], level: float, low: float, high: float) -> float:
    """The argument at which a rising function reaches a level, by bisection to 1e-12 of the span.

    (`scipy.optimize` would do it in fewer steps, and takes longer to load than all of a history.)
    """
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if function(middle) < level else (low, middle)
    return 0.5 * (low + high)
