"""JSON as one document: an array of objects, or objects of arrays, however they are nested and written."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from inercal.foundation.errors import RecordError
from inercal.foundation.records.read.arrays import ArrayFormat, Contents, NamedArray, held
from inercal.foundation.records.read.limits import FIELDS, NESTING
from inercal.foundation.records.read.rewriting import flat

_FEWEST = 2  # rows


@contextmanager
def _opened(path: Path) -> Iterator[Contents]:
    """The arrays by their names, joined by points; objects in an array are the rows of a table."""
    try:
        value = json.loads(path.read_bytes().decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        raise RecordError(path, "is no UTF-8 text, as JSON is") from error
    except RecursionError as error:
        raise RecordError(path, "is JSON nested too deeply, expected arrays of numbers") from error
    except ValueError as error:
        raise RecordError(path, f"is damaged JSON ({error}), expected one document") from error
    arrays: dict[str, NamedArray] = {}
    for name, array in _arrays(value, "", 0):
        if len(arrays) < FIELDS:
            arrays.setdefault(name, array)
    if not arrays:
        raise RecordError(path, "is JSON without an array of numbers, expected rows")
    yield Contents(arrays)


def _arrays(value: Any, name: str, depth: int) -> Iterator[tuple[str, NamedArray]]:
    """The arrays in a value of JSON."""
    if isinstance(value, Mapping) and depth < NESTING:
        for key, inner in value.items():
            yield from _arrays(inner, f"{name}.{key}" if name else str(key), depth + 1)
    elif isinstance(value, list) and len(value) >= _FEWEST:
        if all(isinstance(row, Mapping) for row in value):
            yield from _table(value, name)
        elif all(isinstance(row, list) for row in value):
            width = {len(row) for row in value}
            if len(width) == 1 and 0 < next(iter(width)) <= FIELDS:
                yield name or "rows", held(np.array([[_number(cell) for cell in row] for row in value]))
        elif any(isinstance(cell, int | float) and not isinstance(cell, bool) for cell in value):
            yield name or "values", held(np.array([_number(cell) for cell in value]))
        elif all(isinstance(cell, str) for cell in value):
            yield name or "values", held(np.array(value))


def _table(rows: Sequence[Mapping[str, Any]], name: str) -> Iterator[tuple[str, NamedArray]]:
    """The columns of objects that are rows: those names that most of them have."""
    flattened = [flat(row) for row in rows]
    counts: dict[str, int] = {}
    for row in flattened:
        for key in row:
            counts[key] = counts.get(key, 0) + 1
    for key, count in counts.items():
        if 2 * count > len(rows):
            cells = [row.get(key, "") for row in flattened]
            numbers = np.array([_number(cell) for cell in cells])
            texts = np.isnan(numbers).mean() > 0.5
            yield f"{name}.{key}" if name else key, held(np.array(cells) if texts else numbers)


def _number(cell: Any) -> float:
    """The number in a cell, NaN where it is none."""
    if isinstance(cell, bool) or not isinstance(cell, int | float | str):
        return np.nan
    try:
        return float(cell)
    except (ValueError, OverflowError):
        return np.nan


_FORMAT = ArrayFormat("JSON", _opened)
read, header, peek = _FORMAT.read, _FORMAT.header, _FORMAT.peek
