"""NetCDF: the classic format through SciPy, NetCDF-4 as the HDF5 it is."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from inercal.records.read import hdf5
from inercal.records.read.arrays import ArrayFormat, Contents, NamedArray


@contextmanager
def _opened(path: Path) -> Iterator[Contents]:
    """The variables, with their units; the coordinate of the first dimension is the clock."""
    with path.open("rb") as file:
        classic = file.read(3) == b"CDF"
    if not classic:
        with hdf5.opened(path) as contents:
            yield contents
        return
    from scipy.io import netcdf_file

    with netcdf_file(path, "r", mmap=False) as root:
        variables: dict[str, Any] = dict(root.variables)
        units = {name: hdf5.stated_unit(vars(variable)) for name, variable in variables.items()}
        arrays = {}
        for name, variable in variables.items():
            shape, text = variable.data.shape, variable.data.dtype.kind == "S"
            if not shape or 0 in shape or len(shape) > 2 or (text and len(shape) == 1):
                continue
            first = variable.dimensions[0]
            clock = first if first != name and first in units and hdf5.is_time(units[first]) else None
            columns = 1 if text else (*shape, 1)[1]
            arrays[name] = NamedArray(shape[0], columns, partial(_column, variable), text, units[name], clock)
        yield Contents(arrays)


def _column(variable: Any, column: int) -> NDArray[Any]:
    """A column of numbers, or the text of a variable of characters."""
    data: NDArray[Any] = variable.data
    if data.dtype.kind == "S":
        return hdf5.characters(data)
    numbers = data if data.ndim == 1 else data[:, column]
    return hdf5.unpacked(numbers.astype(numbers.dtype.newbyteorder("=")), vars(variable))


_FORMAT = ArrayFormat("a NetCDF file", _opened)
read, header, peek = _FORMAT.read, _FORMAT.header, _FORMAT.peek
