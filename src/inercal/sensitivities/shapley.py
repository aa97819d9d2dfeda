"""Shapley effects of independent errors from their total variances, without going through all subsets."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from inercal.arrays import Array


def shapley_effects(totals: Callable[[float], Array], factors: int) -> Array:
    """Shapley effects (..., k), shares that sum to one; NaN where there is no variance.

    A Shapley effect shares the variance V_A of every set A of errors equally among its members (Owen 2014,
    "Sobol' indices and Shapley value", SIAM/ASA J. Uncertainty Quantification 2). With the variance of every part
    of every error multiplied by z the total of an error is the sum of z^|A| V_A over the sets it is in, so that
    the integral of total / z from 0 to 1 divides by |A|. It is a polynomial of degree k - 1: Gauss-Legendre
    quadrature with ceil(k/2) nodes is exact, and no term is negative.

    Parameters
    ----------
    totals : callable
        VT_i (..., k) with all variances multiplied by its argument.
    factors : int
        Number k of errors.
    """
    x, w = np.polynomial.legendre.leggauss(max(1, (factors + 1) // 2))
    effects = sum(0.5 * weight / z * totals(z) for z, weight in zip(0.5 * (x + 1.0), w, strict=True))
    whole = np.sum(effects, axis=-1, keepdims=True)
    with np.errstate(invalid="ignore"):
        return np.where(whole > 0.0, effects / whole, np.nan)
