"""NetCDF-3: a variable for each column, with attributes, and the clocks as coordinate variables."""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import IO, Any

import numpy as np

from inercal.records.clocks import Clocks
from inercal.records.record import Record
from inercal.records.write import attributes, origin

TABLE = False


def write(record: Record, axes: Clocks, file: IO[bytes], progress: Callable[[int, int], None] | None) -> None:
    """Write variables such as ``acc_x`` on the dimension ``t``; labels as rows of characters (UTF-8)."""
    from scipy.io import netcdf_file

    buffer = io.BytesIO()
    root: Any = netcdf_file(buffer, "w", version=2)
    for key, text in origin(record).items():
        setattr(root, key, text)
    for name, t in axes.axes.items():
        root.createDimension(name, len(t))
        variable = root.createVariable(name, "d", (name,))
        variable[:] = t
        variable.units = "s"
    for name, column in record.columns.items():
        variable = root.createVariable(name, "d", (axes.of_column[name],))
        variable[:] = column.values
        for key, text in attributes(column).items():
            setattr(variable, key, text)
    if axes.labels is not None:
        rows = np.char.encode(np.array(record.labels), "utf-8")
        width = max(1, rows.dtype.itemsize)
        root.createDimension("characters", width)
        variable = root.createVariable("label", "c", (axes.labels, "characters"))
        variable[:] = rows.astype(f"S{width}").view("S1").reshape(-1, width)
        variable._Encoding = "utf-8"
    root.flush()
    file.write(buffer.getbuffer())
