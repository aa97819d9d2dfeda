"""Spreadsheets: .xlsx, .xlsm, .xls and .ods. Every sheet is a table; formulas have the values that were saved."""

from __future__ import annotations

import datetime
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.errors import MissingExtraError
from inercal.foundation.records.read.arrays import ArrayFormat, Contents, NamedArray, held
from inercal.foundation.records.read.limits import FIELDS
from inercal.foundation.records.recognise.lines import row_of_units

Cell = Any
"""A cell of python-calamine: float, int, str, bool, a date or time, a duration; "" where a cell is empty."""

_MOST_ROWS_ABOVE = 6
"""Rows above the first row of numbers that may name the columns."""


def _library(_: Path) -> Any:
    """The class of python-calamine that reads a file; raises `MissingExtraError`."""
    try:
        from python_calamine import CalamineWorkbook
    except ImportError as error:
        raise MissingExtraError("Reading spreadsheets", "files") from error
    return CalamineWorkbook


@contextmanager
def _opened(path: Path) -> Iterator[Contents]:
    """The columns of each sheet as ``"Sheet1/acc_x [m/s^2]"``."""
    book = _library(path).from_path(str(path))
    arrays: dict[str, NamedArray] = {}
    for sheet in book.sheet_names:
        rows = book.get_sheet_by_name(sheet).to_python(skip_empty_area=True)
        arrays |= _columns(sheet, rows)
    yield Contents(arrays)


def _columns(sheet: str, rows: Sequence[Sequence[Cell]]) -> dict[str, NamedArray]:
    """The columns of a sheet, from the first row in which each column that is usually a number is one."""
    first = _first_row(rows)
    if first is None:
        return {}
    body = rows[first:]
    names, units = _titles(rows[:first], body)
    columns: dict[str, NamedArray] = {}
    for index, (name, unit) in enumerate(zip(names, units, strict=True)):
        values = _values([row[index] for row in body])
        if index < FIELDS and name and len(values):
            place = f"{sheet}/{name}"
            columns[place if place not in columns else f"{place} ({index + 1})"] = held(values, unit)
    return columns


def _first_row(rows: Sequence[Sequence[Cell]]) -> int | None:
    """Index of the first row of numbers; None where no column is one of numbers."""
    numeric = [
        index
        for index in range(len(rows[0]) if rows else 0)
        if 2 * sum(_is_number(row[index]) for row in rows) > sum(row[index] != "" for row in rows) > 0
    ]
    if not numeric:
        return None
    return next((k for k, row in enumerate(rows) if all(_is_number(row[index]) for index in numeric)), None)


def _titles(
    above: Sequence[Sequence[Cell]], body: Sequence[Sequence[Cell]]
) -> tuple[list[str], list[str | None]]:
    """Names of the columns, by the nearest row of words above the numbers, and units by a row of units if there is
    one; a column without a name goes by its number, counted from 1."""
    width = len(body[0])
    filled = [index for index in range(width) if any(row[index] != "" for row in body)]
    units: list[str | None] = [None] * width
    names = [f"column {index + 1}" if index in filled else "" for index in range(width)]
    for row in reversed(above[-_MOST_ROWS_ABOVE:]):
        words = [" ".join(cell.split()) if isinstance(cell, str) else "" for cell in row]
        said = [words[index] for index in filled if words[index]]
        if 2 * len(said) < len(filled):
            continue
        if not any(units) and (found := row_of_units(words)) is not None:
            units = list(found)
            continue
        names = [words[index] or names[index] for index in range(width)]
        break
    return names, units


def _is_number(cell: Cell) -> bool:
    """True for a number, a date, a time or a duration."""
    return not isinstance(cell, str | bool) and cell is not None


def _values(cells: Sequence[Cell]) -> NDArray[Any]:
    """A column as numbers, dates, durations or text, by what most of its cells are."""
    counts = Counter(_sort(cell) for cell in cells if cell != "")
    if not counts:
        return np.full(len(cells), np.nan)
    sort = counts.most_common(1)[0][0]
    if sort == "text":
        return np.array([str(cell) for cell in cells])
    if sort == "date":
        stamps = [cell if isinstance(cell, datetime.datetime) else None for cell in map(_midnight, cells)]
        return np.array(stamps, dtype="datetime64[us]")
    if sort == "duration":
        return np.array([_seconds(cell) for cell in cells], dtype="timedelta64[us]")
    return np.array([float(cell) if _sort(cell) == "number" else np.nan for cell in cells])


def _sort(cell: Cell) -> str:
    """The kind of what a cell holds, in a word."""
    if isinstance(cell, str):
        return "text"
    if isinstance(cell, datetime.datetime | datetime.date):
        return "date"
    return "duration" if isinstance(cell, datetime.time | datetime.timedelta) else "number"


def _midnight(cell: Cell) -> Cell:
    """A date as its first moment."""
    if isinstance(cell, datetime.date) and not isinstance(cell, datetime.datetime):
        return datetime.datetime.combine(cell, datetime.time())
    return cell


def _seconds(cell: Cell) -> datetime.timedelta | None:
    """A time of day as what has gone of the day; None for anything else than times and durations."""
    if isinstance(cell, datetime.time):
        return datetime.datetime.combine(datetime.date.min, cell) - datetime.datetime.min
    return cell if isinstance(cell, datetime.timedelta) else None


_FORMAT = ArrayFormat("a spreadsheet", _opened, _library)
read, header, peek = _FORMAT.read, _FORMAT.header, _FORMAT.peek
