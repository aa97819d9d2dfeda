"""Writing: a record out as a file that `inercal.foundation.records.read` gives back."""

from __future__ import annotations

import io
import json
import math
import re
from collections.abc import Callable
from itertools import repeat
from pathlib import Path
from typing import IO, Any

import numpy as np

from inercal.foundation._files import replacing
from inercal.foundation.errors import InputError, MissingExtraError
from inercal.foundation.records.column import Clocks, Column, clocks
from inercal.foundation.records.record import Record

#: suffixes of the files that `write_record` writes
SUFFIXES = (".csv", ".npz", ".h5", ".parquet", ".nc")

_Progress = Callable[[int, int], None] | None


def write_record(
    record: Record, path: str | Path, progress: Callable[[int, int], None] | None = None
) -> None:
    """Write a record in the format of the path's suffix, one of `SUFFIXES`; whole or not at all.

    Values, units, time stamps and labels read back the same. HDF5 and NetCDF files hold columns of any number
    of clocks, ``t`` or ``t_<sensor>`` each, and as attributes the sources and findings of the record; the
    others are tables, of one clock. ``progress`` is told (rows done, rows in all) of a CSV file, the only slow one.

    Raises `InputError` for an unknown suffix, no columns, columns on different clocks, or a file that cannot be
    written, `MissingExtraError` for Parquet without pyarrow.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(path, f"found the suffix {suffix!r}, expected one of {', '.join(SUFFIXES)}")
    if not record.columns:
        raise InputError(path, "the record has no columns to write")
    form = _FORMATS[suffix]
    axes = clocks(record.columns, "t", len(record.labels))
    if form in _TABLES and len(axes.axes) > 1:
        first, *others = axes.of_column
        other = next(name for name in others if axes.of_column[name] != axes.of_column[first])
        raise InputError(
            path, f"{other} has another clock than {first}, expected one for a table, or a .h5 or .nc file"
        )
    with replacing(path) as file:
        form(record, axes, file, progress)


def _titles(record: Record) -> list[str]:
    """Names with units, as a canonical header has them: ``acc_x [m/s^2]``."""
    return [f"{column.name} [{column.unit.symbol}]" for column in record.columns.values()]


def _attributes(column: Column) -> dict[str, str]:
    """The attributes of a column in a file, beside its values."""
    return {
        "units": column.unit.symbol,
        "sensor": column.sensor,
        "axis": column.axis,
        "frame": column.frame,
    }


def _origin(record: Record) -> dict[str, str]:
    """The origin of a record, for the attributes of a file: plain ASCII, the lists as JSON."""
    from inercal import __version__

    return {
        "inercal": __version__,
        "sources": json.dumps([vars(source) for source in record.sources]),
        "findings": json.dumps([finding.to_json() for finding in record.findings]),
    }


_ROWS = 50_000


def _text(record: Record, axes: Clocks, file: IO[bytes], progress: _Progress) -> None:
    """Write a row for each sample, numbers in the fewest digits that read back the same, nothing for NaN.

    Raises `InputError` for a label of several lines.
    """
    (t,) = axes.axes.values()
    labelled = axes.labels is not None
    lines = io.TextIOWrapper(file, encoding="utf-8", newline="\n", write_through=True)
    lines.write(",".join(["t [s]", *_titles(record), *(["label"] if labelled else [])]) + "\n")
    for start in range(0, len(t), _ROWS):
        rows = slice(start, start + _ROWS)
        block = np.column_stack([t[rows], *(column.values[rows] for column in record.columns.values())])
        ends = (f",{quoted(label)}" for label in record.labels[rows]) if labelled else repeat("")
        lines.writelines(
            f"{','.join(map(number, row))}{end}\n" for row, end in zip(block.tolist(), ends, strict=False)
        )
        if progress is not None:
            progress(min(start + _ROWS, len(t)), len(t))
    lines.detach()


def number(value: float) -> str:
    """A number in the fewest digits that read back the same; nothing for what is no number, or lost in overflow."""
    return repr(value) if math.isfinite(value) else ""


def quoted(label: str) -> str:
    """A label as a field of a row."""
    if not re.search('[,"\r\n]', label):
        return label
    if len(label.splitlines()) > 1:
        raise InputError("label", f"found {label[:60]!r}, expected one line for a .csv file")
    return '"' + label.replace('"', '""') + '"'


def _npz(record: Record, axes: Clocks, file: IO[bytes], _: _Progress) -> None:
    """Write the arrays ``t [s]``, those of the columns, and ``label``."""
    (t,) = axes.axes.values()
    arrays: dict[str, Any] = {"t [s]": t}
    arrays |= zip(_titles(record), (column.values for column in record.columns.values()), strict=True)
    if axes.labels is not None:
        arrays["label"] = np.array(record.labels)
    np.savez(file, **arrays)


def _hdf5(record: Record, axes: Clocks, file: IO[bytes], _: _Progress) -> None:
    """Write datasets in the root, such as ``acc_x`` on the scale ``t``; labels as strings."""
    import h5py

    buffer = io.BytesIO()  # HDF5 moves about in its file, which a pipe cannot
    with h5py.File(buffer, "w", track_order=True) as root:
        root.attrs.update(_origin(record))
        for name, t in axes.axes.items():
            root.create_dataset(name, data=t).make_scale(name)
            root[name].attrs["units"] = "s"
        for name, column in record.columns.items():
            root.create_dataset(name, data=column.values).attrs.update(_attributes(column))
            root[name].dims[0].attach_scale(root[axes.of_column[name]])
        if axes.labels is not None:
            root.create_dataset(
                "label", data=np.array(record.labels, dtype=object), dtype=h5py.string_dtype()
            )
            root["label"].dims[0].attach_scale(root[axes.labels])
    file.write(buffer.getbuffer())


def _parquet(record: Record, axes: Clocks, file: IO[bytes], _: _Progress) -> None:
    """Write a table of ``t [s]``, the columns, and ``label``; units and sensors as metadata of the fields."""
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError as error:
        raise MissingExtraError("Parquet", "files") from error
    (t,) = axes.axes.values()
    number = pyarrow.float64()
    fields: list[Any] = [pyarrow.field("t [s]", number, metadata={"units": "s"})]
    arrays: list[Any] = [t]
    for title, column in zip(_titles(record), record.columns.values(), strict=True):
        fields.append(pyarrow.field(title, number, metadata=_attributes(column)))
        arrays.append(column.values)
    if axes.labels is not None:
        fields.append(pyarrow.field("label", pyarrow.string()))
        arrays.append(list(record.labels))
    schema = pyarrow.schema(fields, metadata=_origin(record))
    parquet.write_table(pyarrow.table(arrays, schema=schema), file, write_page_checksum=True)


def _netcdf(record: Record, axes: Clocks, file: IO[bytes], _: _Progress) -> None:
    """Write variables such as ``acc_x`` on the dimension ``t``; labels as rows of characters (UTF-8)."""
    from scipy.io import netcdf_file

    buffer = io.BytesIO()
    root: Any = netcdf_file(buffer, "w", version=2)
    for key, text in _origin(record).items():
        setattr(root, key, text)
    for name, t in axes.axes.items():
        root.createDimension(name, len(t))
        variable = root.createVariable(name, "d", (name,))
        variable[:] = t
        variable.units = "s"
    for name, column in record.columns.items():
        variable = root.createVariable(name, "d", (axes.of_column[name],))
        variable[:] = column.values
        for key, text in _attributes(column).items():
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


#: suffix -> its writer
_FORMATS = dict(zip(SUFFIXES, (_text, _npz, _hdf5, _parquet, _netcdf), strict=True))

#: writers of one table, which has one clock
_TABLES = (_text, _npz, _parquet)
