"""Parquet: columns named as in a canonical header; needs the extra ``files``."""

from __future__ import annotations

from collections.abc import Callable
from typing import IO, Any

from inercal.errors import MissingExtraError
from inercal.records.clocks import Clocks
from inercal.records.record import Record
from inercal.records.write import attributes, origin, titles

TABLE = True


def write(record: Record, axes: Clocks, file: IO[bytes], progress: Callable[[int, int], None] | None) -> None:
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
    for title, column in zip(titles(record), record.columns.values(), strict=True):
        fields.append(pyarrow.field(title, number, metadata=attributes(column)))
        arrays.append(column.values)
    if axes.labels is not None:
        fields.append(pyarrow.field("label", pyarrow.string()))
        arrays.append(list(record.labels))
    schema = pyarrow.schema(fields, metadata=origin(record))
    parquet.write_table(pyarrow.table(arrays, schema=schema), file)
