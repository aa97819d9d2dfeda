"""Headings of texts: the line with which the numbers begin, and the lines above that name columns and units."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from inercal.foundation.errors import QuantityError
from inercal.foundation.records.recognise.words import unit_of
from inercal.foundation.units import parse_unit

_SAMPLE = 100
_LOOKED_AT = 400
_FEWEST = 20  # lines of numbers
_ABOVE = 6  # lines above the first row that may name its columns
_MARKS = ("\t", ";", ",", None)
_NUMBER = {
    ".": re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"),
    ",": re.compile(r"[+-]?\d+(?:,\d+)?(?:[eE][+-]?\d+)?"),
}


@dataclass(frozen=True)
class Heading:
    """Lines above the rows of a text: ``first`` is the line (from 0) of the first row, ``names`` (k,) are those
    of its columns, and ``units`` (k,) the units in a line of their own, empty where there is none."""

    first: int
    names: tuple[str, ...]
    units: tuple[str | None, ...] = ()


def heading(lines: Sequence[str]) -> Heading | None:
    """The heading of a text whose first lines are given; None where no line names as many columns as a row has.

    The first row is the first line in which every column that is usually a number is one, so that preambles, rows of
    units and values of X0 are passed over. Its names may stand in a comment.
    """
    body = [line for line in lines[:_LOOKED_AT] if line.strip()][-_SAMPLE:]
    if len(body) < _FEWEST:
        return None
    best = max(
        ((mark, decimal) for mark in _MARKS for decimal in ".," if (mark, decimal) != (",", ",")),
        key=lambda how: sum(len(_numbers(line, *how)) for line in body),
    )
    mark, decimal = best
    width = Counter(len(_cells(line, mark)) for line in body).most_common(1)[0][0]
    rows = [cells for line in body if len(cells := _cells(line, mark)) == width]
    usual = [
        column
        for column in range(width)
        if sum(_is_number(cells[column], decimal) for cells in rows) > 0.9 * len(rows)
    ]
    if len(usual) < 2 or len(rows) < 0.8 * len(body):
        return None
    first = next(
        (index for index, line in enumerate(lines) if _is_row(line, mark, decimal, width, usual)), None
    )
    if first is None:
        return None
    above = [lines[index] for index in reversed(range(max(first - _ABOVE, 0), first)) if lines[index].strip()]
    names = next((names for line in above if (names := _names(line, mark, width)) is not None), None)
    if names is None:
        return None
    units = next((units for line in above if (units := _units(line, mark, width)) is not None), ())
    return Heading(first, names, units)


def _cells(line: str, mark: str | None) -> list[str]:
    """The cells of a line, quotes taken off; a mark at its end begins no further one."""
    cells = [cell.strip().strip('"') for cell in line.strip("\r\n ").split(mark)]
    return cells[:-1] if len(cells) > 1 and not cells[-1] else cells


def _is_number(cell: str, decimal: str) -> bool:
    """True for a number, or NaN."""
    return _NUMBER[decimal].fullmatch(cell) is not None or cell.lower() == "nan"


def _numbers(line: str, mark: str | None, decimal: str) -> list[str]:
    """The cells of a line that are numbers."""
    return [cell for cell in _cells(line, mark) if _is_number(cell, decimal)]


def _is_row(line: str, mark: str | None, decimal: str, width: int, usual: Sequence[int]) -> bool:
    """True for a line of that width whose usual numbers are there."""
    cells = _cells(line, mark)
    return len(cells) == width and all(_is_number(cells[column], decimal) for column in usual)


def _names(line: str, mark: str | None, width: int) -> tuple[str, ...] | None:
    """The names in a line, however it is parted, if they are as many as columns."""
    plain = re.sub(r"^\s*(?:#+|%+|//)\s*", "", line)
    if mark == "," and mark not in line:
        return None
    for parted in (
        _cells(plain, mark),
        _cells(plain, ","),
        re.split(r"\s{2,}", plain.strip()),
        re.findall(r"[^\s(\[]+(?:\s*[(\[][^)\]]*[)\]])?", plain),
    ):
        names = [name.strip() for name in parted]
        if len(names) == width + 1 and names[-1] in ("", "Comment"):
            names.pop()
        worded = sum(re.search(r"[^\W\d_]", name) is not None for name in names)
        if len(names) == width and worded > 0.6 * width and _units(plain, mark, width) is None:
            return tuple(names)
    return None


def _units(line: str, mark: str | None, width: int) -> tuple[str | None, ...] | None:
    """The units in a line of as many cells, if it is a row of units."""
    cells = _cells(re.sub(r"^\s*(?:#+|%+|//)\s*", "", line), mark)
    return row_of_units(cells) if len(cells) == width else None


def row_of_units(cells: Sequence[str]) -> tuple[str | None, ...] | None:
    """The units in a row of cells (k,) above numbers, in brackets or not, None where a cell is empty or words.

    None for the row if fewer than two thirds of its cells but the first are units.
    """
    bare = [cell.strip("[]() ") for cell in cells]
    units = [unit_of(cell) or (cell if len(cell) > 1 and _is_unit(cell) else None) for cell in bare]
    filled = [unit for cell, unit in zip(bare[1:], units[1:], strict=True) if cell]
    if not filled or 3 * sum(unit is not None for unit in filled) < 2 * len(filled):
        return None
    return tuple(units)


def _is_unit(text: str) -> bool:
    """True for a unit of any quantity."""
    try:
        parse_unit(text)
    except QuantityError:
        return False
    return True
