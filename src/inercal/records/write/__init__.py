"""Writing: a record out as a file that `inercal.records.read` gives back; each format has a module of its own."""

from __future__ import annotations

import importlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import IO, Protocol, cast

from inercal._files import replacing
from inercal.errors import InputError
from inercal.records.clocks import Clocks, clocks
from inercal.records.column import Column
from inercal.records.record import Record

#: suffix -> module of this package that writes it
_FORMATS = {".csv": "text", ".npz": "npz", ".h5": "hdf5", ".parquet": "parquet", ".nc": "netcdf"}

#: the suffixes of files that `write_record` writes
SUFFIXES: tuple[str, ...] = tuple(_FORMATS)


class _Format(Protocol):
    """A module that writes one file format."""

    #: True where a file is one table, which has one clock
    TABLE: bool

    def write(
        self, record: Record, axes: Clocks, file: IO[bytes], progress: Callable[[int, int], None] | None
    ) -> None:
        """Write a record with at least one column to an open file."""


def write_record(
    record: Record, path: str | Path, progress: Callable[[int, int], None] | None = None
) -> None:
    """Write a record in the format of the path's suffix, one of `SUFFIXES`; whole or not at all.

    Values, units, time stamps and labels read back the same. HDF5 and NetCDF files hold columns of any number
    of clocks, ``t`` or ``t_<sensor>`` each, and as attributes the sources and findings of the record; the
    others are tables, of one clock.

    Parameters
    ----------
    record : Record
        Its columns must have one clock between them for CSV, NPZ and Parquet.
    path : str or Path
    progress : callable, optional
        Told (rows done, rows in all) of a CSV file, which is the only slow one.

    Raises
    ------
    InputError
        An unknown suffix, no columns, columns on different clocks, or a file that cannot be written.
    MissingExtraError
        Parquet, where pyarrow is not installed.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in _FORMATS:
        raise InputError(path, f"found the suffix {suffix!r}, expected one of {', '.join(SUFFIXES)}")
    if not record.columns:
        raise InputError(path, "the record has no columns to write")
    form = cast(_Format, importlib.import_module(f"{__name__}.{_FORMATS[suffix]}"))
    axes = clocks(record.columns, "t", len(record.labels))
    if form.TABLE and len(axes.axes) > 1:
        first, *others = axes.of_column
        other = next(name for name in others if axes.of_column[name] != axes.of_column[first])
        raise InputError(
            path, f"{other} has another clock than {first}, expected one for a table, or a .h5 or .nc file"
        )
    with replacing(path) as file:
        form.write(record, axes, file, progress)


def titles(record: Record) -> list[str]:
    """Names with units, as a canonical header has them: ``acc_x [m/s^2]``."""
    return [f"{column.name} [{column.unit.symbol}]" for column in record.columns.values()]


def attributes(column: Column) -> dict[str, str]:
    """The attributes of a column in a file, beside its values."""
    return {
        "units": column.unit.symbol,
        "sensor": column.sensor,
        "axis": column.axis,
        "frame": column.frame,
    }


def origin(record: Record) -> dict[str, str]:
    """The origin of a record, for the attributes of a file: plain ASCII, the lists as JSON."""
    from inercal import __version__

    return {
        "inercal": __version__,
        "sources": json.dumps([vars(source) for source in record.sources]),
        "findings": json.dumps([vars(finding) for finding in record.findings]),
    }
