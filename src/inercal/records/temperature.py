"""The temperature that goes with a result."""

from __future__ import annotations

import numpy as np

from inercal.records.record import Record
from inercal.units import Quantity, parse_unit


def recorded_temperature(record: Record) -> Quantity | None:
    """The mean of the temperature channel [degC], with the standard deviation as its u; None without such a channel."""
    column = record.columns.get("temperature")
    if column is None or column.unit.dimension != "temperature" or not np.isfinite(column.values).any():
        return None
    known = column.si()
    mean, u = float(np.nanmean(known)), float(np.nanstd(known))
    return Quantity(mean, u, parse_unit("degC"), f"{mean:.1f} degC")
