"""NetCDF: the classic format through SciPy, NetCDF-4 as the HDF5 it is."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from inercal.foundation.errors import RecordError
from inercal.foundation.records.read import hdf5
from inercal.foundation.records.read.arrays import ArrayFormat, Contents, NamedArray
from inercal.foundation.units import shown

_OWN = {
    *("data", "dimensions", "maskandscale", "_typecode", "_size", "_shape", "_attributes"),
    *("variables", "fp", "filename", "use_mmap", "mode", "version_byte"),
    *("_dims", "_recs", "_recsize", "_mm", "_mm_buf"),
}
"""Names of SciPy's own in its variables and files, where it puts attributes of a file too."""


def _is_classic(path: Path) -> bool:
    """True for a file of NetCDF-3."""
    with path.open("rb") as file:
        return file.read(3) == b"CDF"


def _library(path: Path) -> object:
    """The library that reads a file."""
    if not _is_classic(path):
        return hdf5.imported(path)
    import scipy.io

    return scipy.io


def _check_attributes(item: Any, path: Path, name: str) -> None:
    """Refuse attributes that take the place of values in SciPy; raises `RecordError`."""
    attributes = item._attributes
    hidden = _OWN & attributes.keys() if isinstance(attributes, dict) else ["_attributes"]
    if hidden:
        raise RecordError(
            path,
            f"{shown(name)} has an attribute called {', '.join(sorted(hidden))}, expected another name of it",
        )


@contextmanager
def _opened(path: Path) -> Iterator[Contents]:
    """The variables, with their units; the coordinate of the first dimension is the clock."""
    if not _is_classic(path):
        with hdf5.opened(path) as contents:
            yield contents
        return
    from scipy.io import netcdf_file

    with netcdf_file(path, "r", mmap=False) as root:
        _check_attributes(root, path, "the file")
        variables: dict[str, Any] = dict(root.variables)
        for name, variable in variables.items():
            _check_attributes(variable, path, name)
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


_FORMAT = ArrayFormat("a NetCDF file", _opened, _library)
read, header, peek = _FORMAT.read, _FORMAT.header, _FORMAT.peek
