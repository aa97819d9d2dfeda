"""Parquet tables, through pyarrow; only the wanted columns are read."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from inercal.foundation.errors import MissingExtraError
from inercal.foundation.records.read.arrays import ArrayFormat, Contents, NamedArray


def _library(_: Path) -> Any:
    """The library of the format; raises `MissingExtraError`."""
    try:
        from pyarrow import parquet
    except ImportError as error:
        raise MissingExtraError("Reading Parquet files", "files") from error
    return parquet


@contextmanager
def _opened(path: Path) -> Iterator[Contents]:
    """The columns, with the units in the metadata of their fields; members of structures are ``imu.acc_x``."""
    parquet = _library(path)
    with parquet.ParquetFile(path, page_checksum_verification=True) as file:
        rows = file.metadata.num_rows
        columns = [leaf for field in file.schema_arrow for leaf in _leaves(field)]
        yield Contents(
            {
                name: NamedArray(rows, 1, partial(_column, file, name), text, unit)
                for name, text, unit in columns
                if rows
            },
            tabular=True,
        )


def _leaves(field: Any, above: str = "") -> Iterator[tuple[str, bool, str | None]]:
    """Path of each column of numbers, dates or text; whether it is text; its unit."""
    from pyarrow import types

    name, kind = f"{above}{field.name}", field.type
    kind = kind.value_type if types.is_dictionary(kind) else kind
    if types.is_struct(kind):
        for index in range(kind.num_fields):
            yield from _leaves(kind.field(index), f"{name}.")
        return
    text = types.is_string(kind) or types.is_large_string(kind)
    dates = types.is_timestamp(kind) or types.is_duration(kind)
    numbers = (
        types.is_integer(kind) or types.is_floating(kind) or types.is_boolean(kind) or types.is_decimal(kind)
        or types.is_null(kind)
    )  # fmt: skip
    if text or dates or numbers:
        metadata = field.metadata or {}
        unit = metadata.get(b"units") or metadata.get(b"unit")
        yield name, text, "s" if dates else unit.decode("utf-8", "replace") if unit else None


def _column(file: Any, name: str, _: int) -> NDArray[Any]:
    """A column as NumPy's; what is missing is NaN, NaT or None."""
    import pyarrow

    table = file.read(columns=[name], use_threads=False)
    while pyarrow.types.is_struct(table.schema.field(0).type):
        table = table.flatten()
    column = table.column(0)
    if pyarrow.types.is_dictionary(column.type):
        column = column.cast(column.type.value_type)
    types = pyarrow.types
    if types.is_boolean(column.type) or types.is_decimal(column.type) or types.is_null(column.type):
        column = column.cast(pyarrow.float64())
    values: NDArray[Any] = column.to_numpy()
    return values


_FORMAT = ArrayFormat("a Parquet file", _opened, _library)
read, header, peek = _FORMAT.read, _FORMAT.header, _FORMAT.peek
