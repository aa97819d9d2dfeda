"""HDF5 files, and those that are HDF5 inside: NetCDF-4 and MATLAB v7.3."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.errors import QuantityError, RecordError
from inercal.foundation.records.places import counted_names
from inercal.foundation.records.read.arrays import ArrayFormat, Contents, NamedArray
from inercal.foundation.records.read.limits import FIELDS, NESTING, TITLE
from inercal.foundation.units import parse_unit, shown

_BLOCK = 1 << 17
"""Numbers that are read at a time."""

_CELSIUS = re.compile(r"(?:deg(?:ree)?s?[ _]?)?c(?:elsius)?", re.IGNORECASE)


def imported(_: Path) -> object:
    """The library of the format."""
    import h5py

    return h5py


@contextmanager
def opened(path: Path) -> Iterator[Contents]:
    """The datasets of an HDF5 file by their paths (``imu/acc_x``), with their units and clocks."""
    import h5py

    with h5py.File(path, "r") as file:
        datasets = islice(_datasets(file, set()), FIELDS)
        arrays = {name: array for dataset in datasets for name, array in _arrays(dataset)}
        yield Contents({name: _with_clock(array, name, file, arrays) for name, array in arrays.items()})


def stated_unit(attributes: Mapping[str, Any]) -> str | None:
    """The unit in the attributes ``units`` or ``unit`` of a variable, also as the CF conventions write it."""
    for key in ("units", "unit"):
        text = _text(attributes.get(key))
        if text and len(text) <= TITLE:
            text = re.sub(r"\s+since\s.*", "", text.strip())
            return "degC" if _CELSIUS.fullmatch(text) else re.sub(r"(?<=[A-Za-z])(-?\d)(?!\w)", r"^\1", text)
    return None


def unpacked(column: NDArray[Any], attributes: Mapping[str, Any]) -> NDArray[Any]:
    """Numbers from the packed ones of the CF conventions: NaN for fill values, then scale and offset."""
    packing = [attributes.get(key) for key in ("_FillValue", "missing_value", "scale_factor", "add_offset")]
    if column.dtype.kind not in "iuf" or all(value is None for value in packing):
        return column
    *fills, scale, offset = (None if value is None else np.ravel(value)[0] for value in packing)
    numbers = column.astype(np.float64)
    for fill in fills:
        if fill is not None:
            numbers[column == fill] = np.nan
    return numbers * (1.0 if scale is None else float(scale)) + (0.0 if offset is None else float(offset))


def characters(rows: NDArray[Any]) -> NDArray[Any]:
    """Rows of single bytes (n, width) as text (n,)."""
    return np.array([row.tobytes().rstrip(b"\0 ").decode("utf-8", "replace") for row in rows])


def _datasets(group: Any, seen: set[Any], depth: int = 0) -> Iterator[Any]:
    """All datasets below a group, in the order of the file; links to other files are not followed.

    Groups that lie deeper than `NESTING` are left out.
    """
    import h5py

    seen.add(group.id)
    for name in group:
        if name.startswith("#") or not isinstance(group.get(name, getlink=True), h5py.HardLink):
            continue
        item = group[name]
        if isinstance(item, h5py.Dataset):
            yield item
        elif isinstance(item, h5py.Group) and item.id not in seen and depth < NESTING:
            yield from _datasets(item, seen, depth + 1)


def _stored(dataset: Any) -> Any:
    """The dataset, whose values are in its own file; raises `RecordError` for values elsewhere, which no checksum of
    the file covers, and which read as fill values where they are gone."""
    elsewhere = dataset.external or dataset.is_virtual
    if elsewhere:
        names = (
            [source.file_name for source in dataset.virtual_sources()]
            if dataset.is_virtual
            else ([name for name, *_ in dataset.external])
        )
        there = counted_names([shown(name) for name in dict.fromkeys(names)], 3)
        raise RecordError(
            dataset.file.filename,
            f"{shown(dataset.name)} keeps its values elsewhere ({there}), expected a copy of the file that holds all",
        )
    return dataset


def _arrays(dataset: Any) -> Iterator[tuple[str, NamedArray]]:
    """The array of a dataset, or one for each field of a compound; MATLAB keeps its arrays transposed."""
    name, attributes = dataset.name.strip("/"), dataset.attrs
    shape, dtype = dataset.shape, dataset.dtype
    matlab = _text(attributes.get("MATLAB_class"))
    if not shape or 0 in shape or "MATLAB_empty" in attributes or _is_bare_dimension(attributes):
        return
    if dtype.names is not None:
        for field in dtype.names:
            if len(shape) == 1 and dtype[field].kind in "fiub" and not dtype[field].shape:
                yield f"{name}/{field}", NamedArray(shape[0], 1, partial(_field, dataset, field))
    elif (read_text := _reader_of_text(dataset, matlab)) is not None:
        yield name, NamedArray(shape[-1] if matlab else shape[0], 1, read_text, text=True)
    elif dtype.kind in "fiub" and len(shape) <= 2:
        rows, columns = (*shape, 1)[:2] if matlab is None else shape[::-1]
        single = rows == 1
        load = partial(_column, dataset, attributes, along=int((matlab is not None) != single))
        unit = stated_unit(attributes)
        several = (
            partial(_columns, dataset, attributes) if matlab is None and columns > 1 and not single else None
        )
        yield (
            name,
            NamedArray(
                columns if single else rows, 1 if single else columns, load, False, unit, None, several
            ),
        )


def _is_bare_dimension(attributes: Mapping[str, Any]) -> bool:
    """True for what NetCDF-4 keeps in place of a dimension without values."""
    return (_text(attributes.get("NAME")) or "").startswith("This is a netCDF dimension but not")


def _columns(dataset: Any, attributes: Mapping[str, Any], columns: Sequence[int]) -> list[NDArray[Any]]:
    """Some columns of numbers (rows, columns), by blocks of rows: a column alone is read element by element."""
    numbers = [np.empty(len(dataset), dataset.dtype) for _ in columns]
    chunk = dataset.chunks[0] if dataset.chunks else 1  # unpacked once
    step = chunk * max(1, _BLOCK // (dataset.shape[1] * chunk))
    stored = _stored(dataset)
    for start in range(0, len(dataset), step):
        block = stored[start : start + step]
        for column, out in zip(columns, numbers, strict=True):
            out[start : start + step] = block[:, column]
    return [unpacked(each, attributes) for each in numbers]


def _column(dataset: Any, attributes: Mapping[str, Any], column: int, along: int) -> NDArray[Any]:
    """A column of numbers, whose rows are along that axis."""
    if len(dataset.shape) == 1:
        numbers = _stored(dataset)[()]
    else:
        numbers = _stored(dataset)[column, :] if along else _stored(dataset)[:, column]
    return unpacked(numbers, attributes)


def _field(dataset: Any, field: str, _: int) -> NDArray[Any]:
    """A field of a compound."""
    values: NDArray[Any] = _stored(dataset)[field]
    return values


def _reader_of_text(dataset: Any, matlab: str | None) -> Callable[[int], NDArray[Any]] | None:
    """The reader of the strings of a dataset; None if the dataset holds no strings."""
    import h5py

    shape, dtype = dataset.shape, dataset.dtype
    if matlab == "char" and len(shape) == 2:
        return lambda _: _decoded(_stored(dataset)[()])
    if matlab == "cell" and len(shape) == 2 and 1 in shape and h5py.check_ref_dtype(dtype):
        return lambda _: np.array(
            ["".join(_decoded(_stored(dataset.file[cell])[()])) for cell in _stored(dataset)[()].ravel()]
        )
    if matlab is not None or h5py.check_string_dtype(dtype) is None:
        return None
    if len(shape) == 2 and dtype == "S1":
        return lambda _: characters(_stored(dataset)[()])
    return (lambda _: _stored(dataset).asstr(errors="replace")[()]) if len(shape) == 1 else None


def _decoded(codes: NDArray[Any]) -> NDArray[Any]:
    """A character array of MATLAB (width, n) as text (n,)."""
    return np.array(["".join(map(chr, row)).strip() for row in codes.T.tolist()])


def _with_clock(array: NamedArray, name: str, file: Any, arrays: Mapping[str, NamedArray]) -> NamedArray:
    """The array with the name of its clock: the scale of its first dimension, where that is one of time."""
    import h5py

    item = file.get(name)
    # through the attribute: the functions for dimension scales crash on a damaged one
    scales = item.attrs.get("DIMENSION_LIST") if isinstance(item, h5py.Dataset) else None
    for reference in () if scales is None else scales[0]:
        clock = file[reference].name.strip("/")
        if clock in arrays and arrays[clock].rows == array.rows and is_time(arrays[clock].unit):
            return replace(array, clock=clock)
    return array


def is_time(unit: str | None) -> bool:
    """True for a unit of time."""
    try:
        return unit is not None and parse_unit(unit).dimension == "time"
    except QuantityError:
        return False


def _text(attribute: Any) -> str | None:
    """The text of an attribute; None if it is none."""
    if isinstance(attribute, np.ndarray) and attribute.size == 1:
        attribute = attribute.ravel()[0]
    if isinstance(attribute, bytes):
        return attribute.decode("utf-8", "replace")
    return attribute if isinstance(attribute, str) else None


_FORMAT = ArrayFormat("an HDF5 file", opened, imported)
read, header, peek = _FORMAT.read, _FORMAT.header, _FORMAT.peek
