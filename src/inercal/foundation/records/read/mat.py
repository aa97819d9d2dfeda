"""MAT files: MATLAB v4 to v7 through SciPy, v7.3 as the HDF5 they are."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.errors import RecordError
from inercal.foundation.records.channels import Channel
from inercal.foundation.records.read.arrays import ArrayFormat, Contents, NamedArray, held
from inercal.foundation.records.read.limits import NESTING
from inercal.foundation.records.read.table import FileOptions, RawTable
from inercal.foundation.units import shown

_HEAD = 128
_ORDERS = {b"IM": "<", b"MI": ">"}
_KINDS, _MATRIX, _PACKED = range(1, 19), 14, 15
_HDF5 = (b"MATLAB 7.3", b"\x89HDF\r\n\x1a\n")


def read(
    path: Path,
    options: FileOptions,
    channels: tuple[Channel, ...] | None,
    progress: Callable[[int], None],
) -> list[RawTable]:
    """Read the mapped columns of the arrays in a MAT file; members of structures are ``"imu/acc"``."""
    if channels is None:
        header(path)
    return _FORMAT.read(path, options, channels, progress)


def header(path: Path) -> NoReturn:
    """A MAT file has nothing to say units with: raises `RecordError`."""
    raise RecordError(path, "a MAT file names no units, expected a column map")


def _is_hdf5(path: Path) -> bool:
    """True for a file of MATLAB v7.3."""
    with path.open("rb") as file:
        return file.read(16).startswith(_HDF5)


def _library(path: Path) -> object:
    """The library that reads a file."""
    if _is_hdf5(path):
        import h5py

        return h5py
    import scipy.io

    return scipy.io


@contextmanager
def _opened(path: Path) -> Iterator[Contents]:
    """The arrays of numbers and text; a single row is turned into a column."""
    if _is_hdf5(path):
        from inercal.foundation.records.read import hdf5

        with hdf5.opened(path) as contents:
            yield contents
        return
    from scipy.io import loadmat

    _check_structure(path)
    content = loadmat(path, appendmat=False)
    members = {name: value for name, value in content.items() if not name.startswith("__")}
    objects = {name: found for name, value in members.items() if (found := _object(value))}
    arrays = dict(_arrays((name, value) for name, value in members.items() if name not in objects))
    if objects and not arrays:
        name, kind = next(iter(objects.values()))
        writer = "writetimetable" if kind == "timetable" else "writetable"
        raise RecordError(
            path,
            f"{shown(name)} is a MATLAB {kind}, which only MATLAB reads: run {writer}({name}, '{name}.csv'), "
            "and give that file",
        )
    yield Contents(arrays)


def _object(value: Any) -> tuple[str, str] | None:
    """Name and class of an object of MATLAB, such as a timetable; None for anything else."""
    fields = getattr(getattr(value, "dtype", None), "names", None) or ()
    if not {"s0", "s2"} <= set(fields) or not value.size:
        return None
    name, kind = (value[field].flat[0] for field in ("s0", "s2"))
    return name.decode("latin-1"), kind.decode("latin-1")


def _check_structure(path: Path) -> None:
    """Refuse a file of MATLAB v5 to v7 whose parts do not fit into each other; raises `RecordError`.

    SciPy crashes on some such files. What is packed is not looked into. Source: MathWorks, "MAT-File Format", 1-5 f.
    """
    with path.open("rb") as file:
        order = file.read(_HEAD)[-2:]
        if order not in _ORDERS:  # v4
            return
        _check_parts(file, path, _HEAD, path.stat().st_size, struct.Struct(_ORDERS[order] + "II"))


def _check_parts(file: IO[bytes], path: Path, at: int, end: int, tag: struct.Struct, depth: int = 0) -> None:
    """Refuse parts from one byte to another that are of no known type or end elsewhere; raises `RecordError`."""
    while (start := at) + tag.size <= end:
        file.seek(at)
        kind, length = tag.unpack(file.read(tag.size))
        inside = at + tag.size
        if kind >> 16:  # a small part has its length, and up to four bytes of content, in the tag
            kind, length, inside = kind & 0xFFFF, kind >> 16, inside - 4
        if kind not in _KINDS:
            raise RecordError(
                path, f"byte {at}: found a part of type {kind}, expected one of 1 to 18: it is damaged"
            )
        if inside + length > end:
            after = inside + length - end
            raise RecordError(
                path, f"byte {at}: found a part that ends {after} bytes too late: it is damaged or cut"
            )
        if kind == _MATRIX and depth < 2 * NESTING:
            _check_parts(file, path, inside, inside + length, tag, depth + 1)
        at = inside + length
        at += 0 if kind == _PACKED else (start - at) % 8


def _arrays(members: Iterable[tuple[str, Any]], depth: int = 0) -> Iterator[tuple[str, NamedArray]]:
    """Variables, and members of structures by their path; what lies deeper than `NESTING` is left out."""
    for name, value in members:
        if not isinstance(value, np.ndarray) or not value.size:
            continue
        if value.dtype.names is not None:
            if value.size == 1 and depth < NESTING:
                parts = ((f"{name}/{part}", value[part].flat[0]) for part in value.dtype.names)
                yield from _arrays(parts, depth + 1)
        elif value.ndim == 2 and value.dtype.kind in "fiub":
            numbers = value.T if value.shape[0] == 1 else value
            yield name, held(numbers)
        elif (texts := _texts(value)) is not None:
            yield name, held(texts)


def _texts(value: NDArray[Any]) -> NDArray[Any] | None:
    """The rows of a character array, or the strings of a cell array; None for anything else."""
    if value.dtype.kind == "U":
        return value.ravel()
    cells = value.ravel().tolist()
    if value.dtype.kind == "O" and all(
        isinstance(cell, np.ndarray) and cell.dtype.kind == "U" for cell in cells
    ):
        return np.array(["".join(cell.ravel()) for cell in cells])
    return None


_FORMAT = ArrayFormat("a MAT file", _opened, _library)
peek = _FORMAT.peek
