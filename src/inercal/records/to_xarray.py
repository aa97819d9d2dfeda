"""A record as an xarray Dataset."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

from inercal.errors import MissingExtraError

if TYPE_CHECKING:
    import xarray

    from inercal.records.record import Record


def to_xarray(record: Record) -> xarray.Dataset:
    """Columns as variables with units, sensor, axis and source as attributes; a dimension for each clock.

    The dimension is ``time`` when all columns share one clock, else ``time_<sensor>`` of the clock's first
    column (``time_<sensor>_2`` for another clock of that sensor). Raises
    `MissingExtraError` where xarray is not installed.
    """
    try:
        import xarray
    except ImportError as error:
        raise MissingExtraError("Record.to_xarray", "xarray") from error
    columns = record.columns.values()
    one_clock = len({id(column.t) for column in columns}) <= 1
    clocks: dict[int, str] = {}
    for column in columns:
        name = "time" if one_clock else f"time_{column.sensor}"
        numbered = (f"{name}_{number}" for number in itertools.count(2))
        free = next(each for each in itertools.chain([name], numbered) if each not in clocks.values())
        clocks.setdefault(id(column.t), free)
    return xarray.Dataset(
        {
            column.name: (
                clocks[id(column.t)],
                column.values,
                {
                    "units": column.unit.symbol,
                    "sensor": column.sensor,
                    "axis": column.axis,
                    "frame": column.frame,
                    "source": column.source.path,
                    "sha256": column.source.sha256,
                },
            )
            for column in columns
        },
        coords={clocks[id(column.t)]: (clocks[id(column.t)], column.t, {"units": "s"}) for column in columns},
        attrs={"findings": "; ".join(f"{finding.code}: {finding.message}" for finding in record.findings)},
    )
