"""Clocks that go forward: stray stamps are left out, a clock that falls back is refused."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from inercal.arrays import Array
from inercal.errors import RecordError

LONGEST = 5
"""Rows in a row that run backward and are left out; more are a clock that was set back."""


def forward(t: Array, name: str, path: str) -> NDArray[np.int64]:
    """Rows of stamps ``t`` (n,) [s] that are numbers and do not run backward; equal ones stay.

    Of two stamps in the wrong order the first is stray if the second goes with the one before both, else the second.

    Raises
    ------
    RecordError
        The clock falls back; ``name`` says what it belongs to, ``path`` where it was read.
    """
    rows = np.flatnonzero(np.isfinite(t))
    for _ in range(LONGEST + 1):
        stamps = t[rows]
        back = np.flatnonzero(np.diff(stamps) < 0.0)
        if not back.size:
            return rows
        ahead = stamps[back + 1] >= stamps[np.maximum(back - 1, 0)]
        rows = np.delete(rows, np.where(ahead | (back == 0), back, back + 1))
    row = int(back[0])
    raise RecordError(
        path,
        f"the clock of {name} falls back from {stamps[row]:.6g} s to {stamps[row + 1]:.6g} s, expected one that goes "
        "forward",
    )
