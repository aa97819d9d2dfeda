"""Numbers of a signal for captions, from its finite values."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from inercal.arrays import Array

SETTLED = 2.0
"""Time [s] that a filter is given to settle: what comes before does not count where axes are spanned."""


def settled(t: Array) -> NDArray[np.bool_]:
    """Rows (n,) later than the first 2 s; all of a shorter record."""
    late = t - t[0] >= SETTLED
    return late if late.any() else np.ones(len(t), dtype=bool)


def known(x: Array) -> Array:
    """The finite values."""
    return x[np.isfinite(x)]


def span(x: Array) -> str:
    """The range, in words."""
    numbers = known(x)
    return f"{numbers.min():.4g} to {numbers.max():.4g}" if len(numbers) else "no number"


def largest(x: Array) -> float:
    """The largest size; 0 without any."""
    return float(np.max(np.abs(known(x)), initial=0.0))


def middle(x: Array) -> float:
    """The median; NaN without any."""
    numbers = known(x)
    return float(np.median(numbers)) if len(numbers) else math.nan


def rms(x: Array) -> float:
    """The root mean square; NaN without any."""
    numbers = known(x)
    return float(np.sqrt(np.mean(numbers**2))) if len(numbers) else math.nan
