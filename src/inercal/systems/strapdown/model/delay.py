"""The delay of one triad behind the other: means over intervals moved in time, without compiled code."""

from __future__ import annotations

import numpy as np

from inercal.foundation.arrays import Array


def delayed(x: Array, samples: float) -> Array:
    """Means (n, 3) over intervals that lie earlier by so many ``samples``, by a cubic through four of the running
    sums; the first and the last mean stand for those beyond."""
    whole = int(np.floor(samples))
    part = whole + 1.0 - samples  # 0 < part <= 1, after the second of the four points
    weights = (
        -part * (part - 1.0) * (part - 2.0) / 6.0,
        (part + 1.0) * (part - 1.0) * (part - 2.0) / 2.0,
        -(part + 1.0) * part * (part - 2.0) / 2.0,
        (part + 1.0) * part * (part - 1.0) / 6.0,
    )
    rows = np.arange(len(x)) - whole - 2
    out = np.zeros_like(x)
    for k, weight in enumerate(weights):  # steps of the sums are the means
        out += weight * x[np.clip(rows + k, 0, len(x) - 1)]
    return out
