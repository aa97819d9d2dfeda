"""A record as an xarray Dataset."""

from __future__ import annotations

from typing import TYPE_CHECKING

from inercal.errors import MissingExtraError
from inercal.records.clocks import clocks

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
    time = clocks(record, "time")
    return xarray.Dataset(
        {
            column.name: (
                time.of_column[column.name],
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
            for column in record.columns.values()
        },
        coords={name: (name, t, {"units": "s"}) for name, t in time.axes.items()},
        attrs={"findings": "; ".join(f"{finding.code}: {finding.message}" for finding in record.findings)},
    )
