"""Rows of ``sections.csv`` and tables ``[[imu.section]]``: which stretch is a section, and what is known of it.

A blank cell is not known. Units are written out, uncertainties as in ``-360.000(3) deg``; SI and radians inside.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from inercal.foundation._files import read_bytes, replacing
from inercal.foundation.arrays import Array
from inercal.foundation.errors import QuantityError, StudyError
from inercal.foundation.units import Quantity, parse_quantity, parse_unit, shown
from inercal.systems.imu.sections.section import Kind
from inercal.systems.imu.settings import SectionsSettings

RowKind = Literal[Kind, "move", "swing"]

_DIMENSIONS = {
    "begin": ("time", "s"), "end": ("time", "s"), "rate": ("rate", "deg/s"), "angle": ("angle", "deg"),
    "placing": ("angle", "deg"), "level": ("angle", "deg"), "temperature": ("temperature", "degC"),
}  # fmt: skip
_LETTERS = "xyz"
_KELVIN = parse_unit("K")


@dataclass(frozen=True, eq=False)
class SectionRow:
    """One row: a section by name, its stretch of a file, and what is known of it; None or empty: not known.

    SI; directions are unit vectors on the axes of the case, the temperature is in K. The texts of the fields are those
    of the columns, for people.
    """

    section: str
    """Its name; that of a label of the recording, where begin and end are blank, is the stretch of that label."""
    file: str = ""
    """Recording that it is in; blank where there is only one."""
    begin: float | None = None
    """Time of its begin in the recording, such as 25.8 s; blank: the first."""
    end: float | None = None
    """Time of its end; blank: the last."""
    kind: RowKind = "rest"
    """One of rest, rate, turn (from rest to rest), move (between two rests, nobody knows by what), swing."""
    up: Array | None = None
    """Axis of the case that points up, such as +x, or three numbers; blank: not known."""
    force: Array | tuple[str, str, str] | None = None
    """Specific force as another instrument measured it: three numbers and a unit, or three channels."""
    axis: Array | None = None
    """Axis of the rotation by the right-hand rule, such as +z; blank: not known."""
    rate: Quantity | None = None
    """Rate about it, with its standard uncertainty: 30.000(3) deg/s."""
    angle: Quantity | None = None
    """Angle of a turn about it: -360.0(5) deg."""
    placing: float | None = None
    """Standard uncertainty of up and axis, in either direction across; blank: that of the study, else found."""
    level: float | None = None
    """The axis is vertical within this."""
    setup: str = ""
    """Word that sections share between which nobody touched the unit: they share its placing."""
    session: str = ""
    """Word that sections of one turn-on share: they share its biases."""
    rate_group: str = ""
    """Word that sections share whose rates have one error."""
    scatter: str = ""
    """Word that sections share whose means scatter alike."""
    temperature: float | None = None
    """Temperature of the unit."""
    why: str = ""
    """Source of what is known: name, label, row, how it was detected; or what is to be answered."""


COLUMNS = tuple(field.name for field in fields(SectionRow))
"""Columns of the table, in order; keys of ``[[imu.section]]`` are the same."""

_WRITTEN = ("section", "file", "begin", "end", "kind", "up", "axis", "rate", "angle", "setup")
"""Columns that are written also where no row says anything."""


def stated_rows(options: SectionsSettings) -> tuple[SectionRow, ...]:
    """The rows that a study states, in a table or by itself; none where names and recordings are to tell them.

    Raises `StudyError`.
    """
    return read_table(options.table) if options.table is not None else of_tables(options.rows)


def read_table(path: str | Path) -> tuple[SectionRow, ...]:
    """The rows of a ``sections.csv``.

    Raises `StudyError` naming file, line and column for what cannot be understood, and for one name of two sections.
    """
    expected = "expected a table of sections with a first line such as section,file,begin,end,kind,up,axis,rate,angle"
    try:
        text = read_bytes(path).decode("utf-8-sig")
    except (OSError, UnicodeDecodeError, ValueError) as error:
        why = getattr(error, "strerror", None) or "not UTF-8 text"
        raise StudyError(path, f"cannot be read ({why}), {expected}") from error
    # lines that begin with # are remarks; blank ones keep the numbers of the others
    said = ["" if line.startswith("#") else line for line in text.splitlines()]
    lines = csv.reader(said, strict=True)
    tables: list[dict[str, str]] = []
    places: list[str] = []
    try:
        head = [cell.strip() for cell in next((cells for cells in lines if cells), [])]
        for name in head:
            if name not in COLUMNS or head.count(name) > 1:
                found = f"found the column {shown(name)}{' a second time' if name in COLUMNS else ''}"
                raise StudyError(f"{path}, line 1", f"{found}, expected each once of {', '.join(COLUMNS)}")
        if "section" not in head:
            raise StudyError(f"{path}, line 1", f"found no column 'section', {expected}")
        for cells in lines:
            if any(cell.strip() for cell in cells):
                places.append(f"{path}, line {lines.line_num}")
                if len(cells) != len(head):
                    found = f"found {len(cells)} cells, expected {len(head)} as in the first line"
                    raise StudyError(places[-1], found)
                tables.append(dict(zip(head, cells, strict=True)))
    except csv.Error as error:
        raise StudyError(f"{path}, line {lines.line_num}", f"{error}, {expected}") from error
    return of_tables(tables, places)


def of_tables(
    tables: Sequence[Mapping[str, object]], lines: Sequence[str] | None = None
) -> tuple[SectionRow, ...]:
    """The rows that the tables ``[[imu.section]]`` of a study are; errors name the key, as ``imu.section[2].rate``.

    ``lines``: places of rows of a file, whose columns are named in errors. Raises `StudyError` for what cannot be
    understood, and where two sections have one name.
    """
    places = (
        lines if lines is not None else [f"imu.section[{number}]" for number in range(1, len(tables) + 1)]
    )
    first: dict[str, str] = {}
    rows = []
    for table, place in zip(tables, places, strict=True):
        row = row_of(table, place, "key" if lines is None else "column")
        if row.section in first:
            found = f"found the section {shown(row.section)} again, which is that of {first[row.section]}"
            raise StudyError(place, f"{found}, expected a name of its own")
        first[row.section] = place
        rows.append(row)
    return tuple(rows)


def row_of(cells: Mapping[str, object], place: str, noun: str) -> SectionRow:
    """A row by its cells, texts or numbers and lists of TOML; ``noun``: what errors call a cell, column or key.

    Raises `StudyError`.
    """
    values: dict[str, object] = {}
    for name, cell in cells.items():
        where = f"{place}, column {name}" if noun == "column" else f"{place}.{name}"
        if name not in COLUMNS:
            raise StudyError(where, f"no such {noun}, expected one of {', '.join(COLUMNS)}")
        text = " ".join(map(str, cell)) if isinstance(cell, list | tuple) else str(cell).strip()
        if text:
            values[name] = _value(name, text, where)
    where = f"{place}, column " if noun == "column" else f"{place}."
    if "section" not in values:
        raise StudyError(f"{where}section", "found no name of the section, expected one, such as x_up")
    row = SectionRow(**values)  # type: ignore[arg-type]
    _fitting(row, where)
    return row


def _value(name: str, text: str, where: str) -> object:
    """The value of a cell."""
    if name == "kind":
        kinds = [kind for one in get_args(RowKind) for kind in (get_args(one) or (one,))]
        if text not in kinds:
            raise StudyError(where, f"found {shown(text)}, expected one of {', '.join(kinds)}")
        return text
    if name in ("up", "axis"):
        return direction_of(text, where)
    if name == "force":
        return _force(text, where)
    if name in _DIMENSIONS:
        dimension, unit = _DIMENSIONS[name]
        quantity = _quantity(text, dimension, where, f"20 {unit}")
        if name in ("rate", "angle"):
            return quantity
        return quantity.value - (_KELVIN.zero if name == "temperature" else 0.0)
    return text


def _quantity(text: str, dimension: str, where: str, example: str) -> Quantity:
    """A quantity, by the errors of a study."""
    try:
        return parse_quantity(text, dimension, where, example)
    except QuantityError as error:
        raise StudyError(error.where, error.message) from error


def direction_of(text: str, where: str) -> Array:
    """``+x``, ``-z`` or three numbers as a unit vector (3,)."""
    if re.fullmatch(r"[+-]?[xyz]", text):
        return np.asarray(np.eye(3)[_LETTERS.index(text[-1])] * (-1.0 if text[0] == "-" else 1.0))
    try:
        vector = np.array([float(word) for word in re.split(r"[\s,;]+", text.strip("[]() "))])
    except ValueError:
        vector = np.zeros(0)
    size = float(np.linalg.norm(vector)) if np.isfinite(vector).all() else 0.0
    if vector.shape != (3,) or size == 0.0:
        raise StudyError(where, f"found {shown(text)}, expected an axis such as +x or -z, or three numbers")
    return np.asarray(vector / size)


def _force(text: str, where: str) -> Array | tuple[str, str, str]:
    """Three numbers and a unit as a specific force (3,) [m/s^2]; else the names of three channels."""
    words = re.split(r"[\s,;]+", text.strip())
    try:
        numbers = [float(word) for word in words[:3]]
    except ValueError:
        numbers = []
    if len(numbers) == 3 and len(words) > 3:
        unit = parse_unit(" ".join(words[3:]), where, "acceleration")
        if unit.dimension == "acceleration" and np.isfinite(numbers).all():
            return np.asarray(np.array(numbers) * unit.factor)
    if len(words) == 3 and all(re.fullmatch(r"[^\W\d][\w.]*", word) for word in words):
        return words[0], words[1], words[2]
    raise StudyError(
        where, f"found {shown(text)}, expected a force such as 0 0 9.81 m/s^2, or three channels"
    )


def _fitting(row: SectionRow, where: str) -> None:
    """Raise `StudyError` for cells that contradict each other."""
    if row.begin is not None and row.end is not None and row.end <= row.begin:
        raise StudyError(
            f"{where}end", f"found {row.end:g} s, expected an end after its begin, {row.begin:g} s"
        )
    for name, kind in (("rate", "rate"), ("angle", "turn")):
        if getattr(row, name) is not None and row.kind != kind:
            raise StudyError(
                f"{where}{name}", f"found one for a section of kind {row.kind}, expected kind {kind}"
            )
    for name in ("placing", "level"):
        if (getattr(row, name) or 0.0) < 0.0:
            raise StudyError(f"{where}{name}", "found a negative uncertainty, expected 0 deg or more")


def table_text(rows: Iterable[SectionRow]) -> str:
    """The rows as the text of a ``sections.csv``: `read_table` gives the same rows again."""
    cells = [{name: _cell(row, name) for name in COLUMNS} for row in rows]
    kept = [name for name in COLUMNS if name in (*_WRITTEN, "why") or any(row[name] for row in cells)]
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(kept)
    writer.writerows([row[name] for name in kept] for row in cells)
    return out.getvalue()


def write_table(rows: Iterable[SectionRow], path: str | Path) -> None:
    """Write a ``sections.csv``, whole or not at all; raises `InputError` where that is not possible."""
    with replacing(path) as file:
        file.write(table_text(rows).encode())


def _cell(row: SectionRow, name: str) -> str:
    """A cell as a user would write it."""
    value = getattr(row, name)
    if value is None or isinstance(value, str):
        return value or ""
    if name in ("up", "axis"):
        return side_of(value) or " ".join(f"{number:.9g}" for number in value)
    if name == "force":
        return " ".join(value) if isinstance(value, tuple) else f"{' '.join(f'{f:.9g}' for f in value)} m/s^2"
    if isinstance(value, Quantity):
        return value.text
    factor = parse_unit(_DIMENSIONS[name][1]).factor
    return (
        f"{(value + (_KELVIN.zero if name == 'temperature' else 0.0)) / factor:.12g} {_DIMENSIONS[name][1]}"
    )


def side_of(direction: Array) -> str:
    """``+x`` of a direction (3,) that is an axis; empty for any other."""
    k = int(np.argmax(np.abs(direction)))
    whole = np.flatnonzero(direction).tolist() == [k] and abs(direction[k]) == 1.0
    return f"{'-' if direction[k] < 0.0 else '+'}{_LETTERS[k]}" if whole else ""


def quantity_of(value: float, u: float, unit: str) -> Quantity:
    """A quantity by its SI value and u, as it is written: ``-360.000(3) deg``; u in one digit, or in two."""
    factor = parse_unit(unit).factor
    value, u = value / factor, u / factor
    text = f"{value:.12g} {unit}"
    if u > 0.0:
        last = int(np.floor(np.log10(u) + 1e-9))
        digits = round(u / 10.0**last, 1)
        places = max(-last if digits == int(digits) else 1 - last, 0)
        text = f"{value:.{places}f}({round(u * 10.0**places)}) {unit}"
    return Quantity(value * factor, u * factor, parse_unit(unit), text)
