"""The values of a column as numbers or text, from whatever type a file keeps them in."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.records.read.table import LARGEST


def numbers(column: NDArray[Any]) -> Array:
    """As float64, dates as seconds since 1970; NaN where infinite or beyond `LARGEST`."""
    if column.dtype.kind in "Mm":
        dated = ~np.isnat(column)
        kind = "datetime64[ns]" if column.dtype.kind == "M" else "timedelta64[ns]"
        whole, rest = np.divmod(column.astype(kind).astype(np.int64), 10**9)
        return np.where(dated, whole + 1e-9 * rest, np.nan)
    numbers = np.ascontiguousarray(column, dtype=np.float64)
    if numbers.size and numbers.min() > -LARGEST and numbers.max() < LARGEST:
        return numbers
    return np.where(np.abs(numbers) < LARGEST, numbers, np.nan)


def rounded(column: NDArray[Any]) -> NDArray[np.int64]:
    """Places of the integers that float64 cannot hold: they have more than 53 bits between the first and last 1."""
    if column.dtype.kind not in "iu" or column.dtype.itemsize < 8:
        return np.empty(0, np.int64)
    size = np.abs(column).astype(np.uint64)
    far = np.flatnonzero(size > np.uint64(2**53))
    lowest = size[far] & (~size[far] + np.uint64(1))
    beyond: NDArray[np.int64] = far[size[far] // lowest > np.uint64(2**53)]
    return beyond


def texts(column: NDArray[Any]) -> tuple[str, ...]:
    """As text: bytes decoded, whole numbers without a point, nothing for what is missing."""
    if column.dtype.kind in "biuf":
        return tuple(f"{value:.15g}" if value == value else "" for value in column.tolist())
    texts = (value.decode("utf-8", "replace") if isinstance(value, bytes) else value for value in column)
    return tuple("" if text is None else str(text).strip() for text in texts)
