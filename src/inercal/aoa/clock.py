"""Rows that go on in time, and those that do not."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from inercal.errors import RecordError

Array = NDArray[np.float64]

PATIENCE = 1000
"""Rows in a row without a later stamp that are left out; more are no accident."""


def later(t: Array, last: float = -math.inf, where: object = "t") -> NDArray[np.int64]:
    """Rows of ``t`` (n,) [s] that are later than all before them and than ``last``.

    Raises
    ------
    RecordError
        So many rows in a row are not that the clock was set back.
    """
    before = np.maximum.accumulate(np.append(last, np.where(np.isnan(t), -np.inf, t)))
    taken = np.flatnonzero(t > before[:-1])
    left = np.diff(np.concatenate([[-1], taken, [len(t)]])) - 1
    if left.size and left.max() >= PATIENCE:
        row = int(np.concatenate([[-1], taken])[int(np.argmax(left))]) + 1
        raise RecordError(
            where,
            f"t: {int(left.max())} rows in a row from row {row + 1} on are not later than {before[row]:.10g} s, the "
            f"first at {t[row]:.10g} s, expected time to increase",
        )
    return taken
