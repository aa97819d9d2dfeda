"""The temperature that goes with a result."""

from __future__ import annotations

import numpy as np

from inercal.records.record import Record


def recorded_temperature(record: Record) -> str | None:
    """The mean of the temperature that was recorded, in words; None where there is none."""
    column = record.columns.get("temperature")
    if column is None or column.unit.dimension != "temperature" or not np.isfinite(column.values).any():
        return None
    return f"{np.nanmean(column.si()):.1f} degC"
