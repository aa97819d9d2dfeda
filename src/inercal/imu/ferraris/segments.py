"""Ways from rest to rest, and whether the gyro saw the whole of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from inercal.imu.recording import LOST
from inercal.records.column import Triad

LONGEST = 60.0
"""Longest way that is followed [s]."""

SHORTEST = 0.25
"""Shortest way that can be one [s]: in a recording cut down to its sections there is none left between them."""


def followed(gyro: Triad, clipped: NDArray[np.bool_], start: int, stop: int) -> bool:
    """Whether the gyro saw the whole way from sample ``start`` to ``stop``; ``clipped`` are the rows that saturate."""
    part = slice(start, stop + 1)
    steps = np.diff(gyro.t[part])
    whole = start < stop and bool(np.all((steps > 0.0) & (steps <= LOST / gyro.rate)))
    known = bool(np.isfinite(gyro.values[part]).all()) and not clipped[part].any()
    return whole and known and SHORTEST < float(steps.sum()) < LONGEST
