"""Samples of a column as the checks look at them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from inercal.arrays import Array

SAMPLE = 100_000


def known(values: Array) -> tuple[Array, NDArray[np.int64]]:
    """The numbers of a column without its NaN, and the rows (from 0) they stand in."""
    rows = np.flatnonzero(np.isfinite(values))
    return (values if rows.size == values.size else values[rows]), rows


def thinned(values: Array) -> Array:
    """Every so many-th value, about a hundred thousand in all."""
    return values[:: values.size // SAMPLE + 1]


def plateaus(step: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First and last samples of each run of three or more equal ones."""
    equal = np.concatenate([[False], step == 0, [False]]).astype(np.int8)
    change = np.diff(equal)
    starts, ends = np.flatnonzero(change == 1), np.flatnonzero(change == -1)
    long = ends - starts >= 2
    return starts[long], ends[long]
