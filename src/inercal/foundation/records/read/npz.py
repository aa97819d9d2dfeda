"""NPZ: NumPy arrays in an archive. Pickled objects are never loaded."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache, partial
from pathlib import Path
from typing import Any
from zipfile import ZipFile

from numpy.lib import format as npy
from numpy.typing import NDArray

from inercal.foundation.records.read.arrays import ArrayFormat, Contents, NamedArray

_TEXT = "SU"
_KINDS = "fiubMm" + _TEXT


@contextmanager
def _opened(path: Path) -> Iterator[Contents]:
    """The arrays by their keys; fields of structured arrays are ``"key/field"``."""
    with ZipFile(path) as archive:
        names = [name for name in archive.namelist() if name.endswith(".npy")]
        yield Contents({key: array for name in names for key, array in _arrays(archive, name)})


def _arrays(archive: ZipFile, name: str) -> Iterator[tuple[str, NamedArray]]:
    """The array of a member, told by its header alone; loaded once, when its first column is wanted."""
    with archive.open(name) as file:
        version = npy.read_magic(file)
        header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        shape, _, dtype = header(file)

    @cache
    def whole() -> NDArray[Any]:
        with archive.open(name) as member:
            array = npy.read_array(member, allow_pickle=False)
            if member.read(1):  # at the end the checksum is compared, too
                raise ValueError("more bytes than the array has")
            return array

    key = name.removesuffix(".npy")
    fields: Mapping[str, Any] = dtype.fields or {}
    if not shape or 0 in shape or len(shape) > 2:
        return
    if len(shape) == 1:
        for field, (kind, *_) in fields.items():
            if kind.kind in _KINDS:
                load = partial(_column, whole, field)
                yield f"{key}/{field}", NamedArray(shape[0], 1, load, kind.kind in _TEXT, _unit(kind))
    if dtype.kind in _KINDS and (dtype.kind not in _TEXT or len(shape) == 1):
        columns = 1 if len(shape) == 1 else shape[1]
        load = partial(_column, whole, None)
        yield key, NamedArray(shape[0], columns, load, dtype.kind in _TEXT, _unit(dtype))


def _unit(dtype: Any) -> str | None:
    """The unit of dates and durations, which are read in seconds."""
    return "s" if dtype.kind in "Mm" else None


def _column(whole: Callable[[], NDArray[Any]], field: str | None, column: int) -> NDArray[Any]:
    """A column, or a field, of an array that is loaded now."""
    array = whole()
    if field is not None:
        return array[field]
    return array if array.ndim == 1 else array[:, column]


_FORMAT = ArrayFormat("an NPZ file", _opened)
read, header, peek = _FORMAT.read, _FORMAT.header, _FORMAT.peek
