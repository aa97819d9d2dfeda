"""Rows in safe pieces: files of some seconds each, every one whole or not there, so that a kill takes the last.

A row is a line, its values, and these as quantities with unit and uncertainty.
"""

from __future__ import annotations

import io
import json
import math
import re
import time
from collections.abc import Sequence
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np

from inercal.bench.live.address import PieceFolder
from inercal.foundation._files import replacing
from inercal.foundation.errors import InputError, MissingExtraError
from inercal.foundation.records.titles import name_and_unit


class EstimatorRow(NamedTuple):
    """A row of an estimator: its line, its values (NaN and texts as they are), and when its sample came [s]."""

    text: str
    values: Sequence[float | str]
    at: float


def payload(columns: Sequence[str], values: Sequence[float | str]) -> bytes:
    """A row as JSON: by name its value, its standard uncertainty u where a column has it, and their unit."""
    quantities = quantities_of(columns, values)
    return json.dumps(quantities, separators=(",", ":"), ensure_ascii=False).encode()


def quantities_of(
    columns: Sequence[str], values: Sequence[float | str]
) -> dict[str, dict[str, float | str | None]]:
    """Value, u and unit of each quantity of a row, by name; None for a value that is not known."""
    named = {
        name: (value if isinstance(value, str) or math.isfinite(value) else None, unit or "1")
        for (name, unit), value in zip(map(name_and_unit, columns), values, strict=True)
    }
    quantities: dict[str, dict[str, float | str | None]] = {}
    for name, (value, unit) in named.items():
        if name.startswith("u_") and name[2:] in named:
            continue
        quantity: dict[str, float | str | None] = {"value": value}
        if f"u_{name}" in named:
            quantity["u"] = named[f"u_{name}"][0]
        quantities[name] = quantity | {"unit": unit}
    return quantities


SPAN, MOST = 10.0, 100_000
"""A piece holds the rows of that time [s], at most so many."""

GOODBYE = 60.0


class PieceFiles:
    """Writes rows to ``00000001.parquet`` and so on in a folder, or ``.h5``; numbers go on from those that are there.

    Raises `InputError` where the folder cannot be made, `MissingExtraError` for Parquet without pyarrow.
    """

    def __init__(self, sink: PieceFolder) -> None:
        self._folder = sink.folder
        self._columns: Sequence[str] = ()
        self._suffix, self._form = (".parquet", _parquet) if sink.form == "parquet" else (".h5", _hdf5)
        try:  # now, for that takes its time
            import_module("pyarrow.parquet" if sink.form == "parquet" else "h5py")
        except ImportError as error:
            raise MissingExtraError("Parquet", "files") from error
        try:
            self._folder.mkdir(exist_ok=True)
            there = [path.stem for path in self._folder.iterdir() if path.suffix == self._suffix]
        except OSError as error:
            raise InputError(self._folder, f"cannot be written ({error.strerror or error})") from error
        self._number = max((int(stem) for stem in there if re.fullmatch(r"\d{8}", stem)), default=0)
        self._rows: list[Sequence[float | str]] = []
        self._begun = 0.0

    @property
    def goodbye(self) -> float:
        """Time [s] for the last piece: a disk may be slow, but it is not stuck."""
        return GOODBYE

    @property
    def held(self) -> int:
        """Rows of the piece that is not written yet."""
        return len(self._rows)

    def begin(self, columns: Sequence[str]) -> None:
        """Take the titles."""
        self._columns = columns

    def write(self, rows: Sequence[EstimatorRow]) -> int:
        """Hold rows until a piece is full."""
        if rows and not self._rows:
            self._begun = time.monotonic()
        self._rows += [row.values for row in rows]
        if self._rows and (len(self._rows) >= MOST or time.monotonic() - self._begun >= SPAN):
            self.settle()
        return len(rows)

    def settle(self) -> None:
        """Write a piece of what is held."""
        if not self._rows:
            return
        arrays = {
            title: np.array([value if isinstance(value, str) else float(value) for value in column])
            for title, column in zip(self._columns, zip(*self._rows, strict=True), strict=True)
        }
        path = self._folder / f"{self._number + 1:08d}{self._suffix}"
        with replacing(path) as file:
            file.write(self._form(arrays))
        self._number += 1
        self._rows = []

    def close(self) -> None:
        """Write the last piece."""
        self.settle()


def _parquet(arrays: dict[str, Any]) -> bytes:
    """A table, units as metadata of its fields."""
    import pyarrow
    from pyarrow import parquet

    fields = [
        pyarrow.field(
            title,
            pyarrow.string() if column.dtype.kind == "U" else pyarrow.float64(),
            metadata={"units": name_and_unit(title)[1] or "1"},
        )
        for title, column in arrays.items()
    ]
    buffer = io.BytesIO()
    table = pyarrow.table([column.tolist() for column in arrays.values()], schema=pyarrow.schema(fields))
    parquet.write_table(table, buffer, write_page_checksum=True)
    return buffer.getvalue()


def _hdf5(arrays: dict[str, Any]) -> bytes:
    """Datasets in the root, such as ``theta`` with its unit beside it."""
    import h5py

    buffer = io.BytesIO()
    with h5py.File(buffer, "w", track_order=True) as root:
        for title, column in arrays.items():
            name, unit = name_and_unit(title)
            text = column.dtype.kind == "U"
            data = column.astype(object) if text else column
            root.create_dataset(name, data=data, dtype=h5py.string_dtype() if text else None)
            root[name].attrs["units"] = unit or "1"
    return buffer.getvalue()
