"""NPZ: an array for each column, named as in a canonical header: ``acc_x [m/s^2]``."""

from __future__ import annotations

from collections.abc import Callable
from typing import IO, Any

import numpy as np

from inercal.records.clocks import Clocks
from inercal.records.record import Record
from inercal.records.write import titles

TABLE = True


def write(record: Record, axes: Clocks, file: IO[bytes], progress: Callable[[int, int], None] | None) -> None:
    """Write the arrays ``t [s]``, those of the columns, and ``label``."""
    (t,) = axes.axes.values()
    arrays: dict[str, Any] = {"t [s]": t}
    arrays |= zip(titles(record), (column.values for column in record.columns.values()), strict=True)
    if axes.labels is not None:
        arrays["label"] = np.array(record.labels)
    np.savez(file, **arrays)
