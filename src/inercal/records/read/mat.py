"""MAT files (MATLAB v4 to v7), through SciPy."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inercal.errors import RecordError
from inercal.records.channels import Channel
from inercal.records.checks import missing
from inercal.records.read.table import FileOptions, Sample, Table
from inercal.records.record import Array

_HDF5 = (b"MATLAB 7.3", b"\x89HDF\r\n\x1a\n")


def read(
    path: Path,
    options: FileOptions,
    channels: tuple[Channel, ...] | None,
    progress: Callable[[int], None],
) -> Table:
    """Read the mapped columns of the arrays in a MAT file."""
    if channels is None:
        raise RecordError(path, "a MAT file names no units, expected a column map")
    arrays = _arrays(path)
    values: dict[str, Array] = {}
    for channel in channels:
        column = None if channel.name == "label" else _column(channel, arrays, options, path)
        if column is not None:
            values[channel.name] = np.where(np.isfinite(column), column, np.nan)
    rows = {name: len(column) for name, column in values.items()}
    if len(set(rows.values())) > 1:
        counts = ", ".join(f"{count} rows of {name}" for name, count in rows.items())
        raise RecordError(path, f"found {counts}, expected as many of each")
    if values and all(np.isnan(column).all() for column in values.values()):
        raise RecordError(path, "no row of numbers in the mapped columns, expected numbers")
    progress(path.stat().st_size)
    found = tuple(channel for channel in channels if channel.name in values)
    return Table(found, values, _contents(arrays), max(rows.values(), default=0), (), missing(values))


def peek(path: Path) -> list[Sample]:
    """Look at each array of a MAT file."""
    return [
        Sample(_real(array), (), FileOptions(), name)
        for name, array in _arrays(path).items()
        if len(array) > 1
    ]


def _arrays(path: Path) -> dict[str, NDArray[Any]]:
    """The two-dimensional arrays of numbers, by name; a single row is turned into a column."""
    with path.open("rb") as file:
        start = file.read(16)
    if start.startswith(_HDF5):
        raise RecordError(path, "found MAT v7.3 (HDF5), which is not read yet, expected v7 (save with -v7)")
    from scipy.io import loadmat

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            content = loadmat(path, appendmat=False)
    except Exception as error:  # whatever SciPy trips over in a damaged file
        raise RecordError(path, f"cannot be read as a MAT file ({error or type(error).__name__})") from error
    arrays = {
        name: array.T if array.shape[0] == 1 else array
        for name, array in content.items()
        if isinstance(array, np.ndarray) and array.ndim == 2 and array.size and array.dtype.kind in "fiub"
    }
    if not arrays:
        raise RecordError(path, "holds no two-dimensional array of numbers, expected one at least")
    return arrays


def _column(
    channel: Channel, arrays: Mapping[str, NDArray[Any]], options: FileOptions, path: Path
) -> Array | None:
    """The column a channel comes from, None if this file has none such."""
    match channel.origin:
        case int(number):
            array, index = _single(arrays, options, path), number
        case str(name):
            array, index = arrays.get(name), 0
            if array is not None and array.shape[1] > 1:
                raise RecordError(path, f'{name} has {array.shape[1]} columns, expected ["{name}", column]')
        case (variable, number):
            array, index = arrays.get(variable), number
    return None if array is None or index >= array.shape[1] else _real(array[:, index])


def _single(arrays: Mapping[str, NDArray[Any]], options: FileOptions, path: Path) -> NDArray[Any] | None:
    """The array a plain column number refers to."""
    if options.variable is not None:
        return arrays.get(options.variable)
    tables = [array for array in arrays.values() if min(array.shape) > 1]
    if len(tables) != 1:
        raise RecordError(path, f"holds {_contents(arrays)}, expected `variable` under [file] to name one")
    return tables[0]


def _real(array: NDArray[Any]) -> Array:
    """As float64; integers beyond 2^53 lose their last digits."""
    return np.ascontiguousarray(array, dtype=np.float64)


def _contents(arrays: Mapping[str, NDArray[Any]]) -> str:
    """What the file holds, in words."""
    return "the arrays " + ", ".join(
        f"{name} ({array.shape[0]} x {array.shape[1]})" for name, array in arrays.items()
    )
