"""The temperature that goes with a result."""

from __future__ import annotations

import numpy as np

from inercal.records.record import Record
from inercal.units import Quantity


def temperature_words(record: Record, stated: Quantity | None) -> str | None:
    """The temperature of the instrument: as stated, else the mean of what was recorded; None where neither is known."""
    if stated is not None:
        return stated.text
    column = record.columns.get("temperature")
    if column is None or column.unit.dimension != "temperature" or not np.isfinite(column.values).any():
        return None
    return f"{np.nanmean(column.si()):.1f} degC"
