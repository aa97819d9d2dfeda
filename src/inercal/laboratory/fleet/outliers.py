"""Units that are unlike the others: robust distance in the space of all coefficients.

Middle and scatter of the fleet are those of its three quarters that lie closest together (minimum covariance
determinant, found by the steps of Rousseeuw and Van Driessen 1999 from two starts of Hubert, Rousseeuw and Verdonck
2012), so that a quarter of strange units does not move them. Where there are few units for the number of coefficients,
the distance is that of the coefficient that is farthest off, in robust standard deviations. How far a sound unit may
lie is found by simulated fleets of the same size.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array

RISK = 0.05
"""Probability that a sound fleet has any unit named."""

FEWEST = 10
"""Units below which none can be told to be strange."""

_CORE = 0.75
"""Share of the units that the scatter is of."""

_FLEETS = 200
_MANY = 200
"""Units from which on the simulated fleets are no larger."""


def distances(values: Array) -> Array:
    """Robust distances (n,) of units from the middle of the fleet, by ``values`` (n units, p coefficients).

    A coefficient in which more than half of the units are equal tells nothing and is left out.
    """
    z = standardised(values)
    z = z[:, np.isfinite(z).all(axis=0)]
    if z.shape[1] == 0:
        return np.zeros(len(values))
    if not _joint(*z.shape):
        farthest: Array = np.abs(z).max(axis=1)
        return farthest
    size = int(_CORE * len(z))
    norm = np.linalg.norm(z, axis=1, keepdims=True)
    signs = z / np.where(norm > 0.0, norm, 1.0)
    turned = z @ np.linalg.eigh(signs.T @ signs)[1]
    starts = (z**2, standardised(turned) ** 2)
    cores = [_concentrated(z, np.argsort(np.nansum(each, axis=1))[:size]) for each in starts]
    return min(cores, key=lambda found: found[1])[0]


def standardised(values: Array) -> Array:
    """Values (n, p) less their median, over 1.4826 times the median absolute deviation; NaN where that is zero."""
    from_middle = values - np.median(values, axis=0)
    scale = 1.4826022 * np.median(np.abs(from_middle), axis=0)
    return from_middle / np.where(scale > 0.0, scale, np.nan)


def _joint(units: int, coefficients: int) -> bool:
    """True if the units are enough for the covariance of the coefficients."""
    return units >= max(FEWEST, 3 * coefficients)


def _concentrated(z: Array, core: NDArray[np.intp]) -> tuple[Array, float]:
    """Distances (n,) from the core after steps that draw it together, and the logarithm of its determinant."""
    for _ in range(30):
        middle, factor = z[core].mean(axis=0), np.cov(z[core], rowvar=False).reshape(z.shape[1], -1)
        values, axes = np.linalg.eigh(factor)
        values = np.maximum(values, 1e-12 * values[-1])
        found = np.sqrt(np.sum(((z - middle) @ axes) ** 2 / values, axis=1))
        closer = np.argsort(found)[: len(core)]
        if set(closer) == set(core):
            break
        core = closer
    return found, float(np.log(values).sum())


def limit(units: int, coefficients: int) -> float:
    """The distance that the farthest of so many sound units exceeds with the probability `RISK`."""
    from scipy.special import chdtri

    found = _limit(min(units, _MANY), coefficients)
    if units <= _MANY:
        return found
    # the distribution of many units is that of chi-square: its quantiles say how much farther the farthest of more lies
    p = coefficients if _joint(units, coefficients) else 1
    far = [float(chdtri(p, -np.expm1(np.log1p(-RISK) / n))) for n in (units, _MANY)]
    return found * float(np.sqrt(far[0] / far[1]))


@cache
def _limit(units: int, coefficients: int) -> float:
    """The limit, by simulated fleets."""
    rng = np.random.default_rng(20261123)
    farthest = [distances(rng.standard_normal((units, coefficients))).max() for _ in range(_FLEETS)]
    return float(np.quantile(farthest, 1.0 - RISK))
