"""The temperature that goes with a result."""

from __future__ import annotations

import numpy as np

from inercal.records.record import Record
from inercal.units import Quantity


def recorded_temperature(record: Record) -> str | None:
    """The mean of the temperature that was recorded, in words; None where there is none."""
    column = record.columns.get("temperature")
    if column is None or column.unit.dimension != "temperature" or not np.isfinite(column.values).any():
        return None
    return f"{np.nanmean(column.si()):.1f} degC"


def temperature_words(stated: Quantity | None, recorded: str | None) -> str | None:
    """The temperature of the instrument: as stated, else as `recorded_temperature` has it."""
    return recorded if stated is None else stated.text
