"""The table of runs: a CSV with a row for each recording and its role.

    file,role,angle,begin,amplitude,frequency
    off1.csv,wind-off,0.000(2) deg,0 min,,
    polar1.csv,up,,5 min,,
    polar2.csv,down,,10 min,,
    sine1.csv,run,,15 min,10 deg,1 Hz
    off2.csv,wind-off,0.000(2) deg,20 min,,

``angle`` is the known one of a wind-off, with its standard uncertainty; ``begin`` the time at which the recording
began; ``amplitude`` and ``frequency`` those of a driven oscillation. A unit may stand in the head of its column,
``amplitude [deg]``, in the place of the cells.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Literal

from inercal.foundation.errors import InputError, QuantityError
from inercal.foundation.inputs import Source
from inercal.foundation.records.read import source_of
from inercal.foundation.units import Quantity, parse_quantity, shown

Role = Literal["wind-off", "up", "down", "run"]
ROLES: tuple[Role, ...] = ("wind-off", "up", "down", "run")

_COLUMNS = ("file", "role", "angle", "begin", "amplitude", "frequency")


@dataclass(frozen=True)
class Run:
    """A row of the table: the ``path`` of a recording and its ``role``.

    ``angle`` of a wind-off [rad], with its standard uncertainty; ``begin`` [s], None where the table has no times;
    ``amplitude`` [rad] and ``frequency`` [Hz] of a driven oscillation, NaN where not stated.
    """

    path: Path
    role: Role
    angle: Quantity | None = None
    begin: float | None = None
    amplitude: float = math.nan
    frequency: float = math.nan

    @property
    def name(self) -> str:
        """Name of the file."""
        return self.path.name


@dataclass(frozen=True)
class RunTable:
    """The ``runs`` in the order of their rows, and the file that lists them."""

    runs: tuple[Run, ...]
    source: Source


def read_runs_table(path: str | Path) -> RunTable:
    """Read a table of runs; files lie beside it, or are given with their folder.

    Raises `InputError`, naming file and row: an unknown column or role, no such file, a wind-off without its angle, a
    value that is none, times in some rows alone or out of order.
    """
    source = source_of(path)
    try:
        text = Path(path).read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(path, "cannot be read as text, expected a table such as file,role") from error
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    rows = list(csv.DictReader(io.StringIO("\n".join(lines)), skipinitialspace=True))
    written = [name.strip() for name in lines[0].split(",")] if lines else []
    for title in written:
        if ("[" in title) != title.endswith("]"):
            raise InputError(
                path, f"found the head {shown(title)}, expected a unit in brackets, as amplitude [deg]"
            )
    titles = [_titled(title) for title in written]
    heads = [name for name, _ in titles]
    for name, unit in titles:
        if heads.count(name) > 1:
            raise InputError(path, f"found the column {shown(name)} twice, expected it once")
        if unit and name in ("file", "role"):
            raise InputError(path, f"found {shown(unit)} as unit of the column {name}, expected none")
        if name not in _COLUMNS:
            raise InputError(path, f"found the column {shown(name)}, expected {', '.join(_COLUMNS)}")
    for needed in ("file", "role"):
        if needed not in heads:
            raise InputError(path, f"found no column {needed}, expected a header such as file,role")
    runs = tuple(_run(row, Path(path), f"{path}, row {k}") for k, row in enumerate(rows, start=1))
    if all(run.role == "wind-off" for run in runs):
        raise InputError(path, "found no run with the wind on, expected one with the role up, down or run")
    begins = [run.begin for run in runs if run.begin is not None]
    if begins and len(begins) != len(runs):
        raise InputError(
            path, f"begin: found {len(begins)} of {len(runs)} rows, expected all of them or none"
        )
    if any(later <= before for before, later in pairwise(begins)):
        raise InputError(path, "begin: found rows that do not go on in time, expected them in order")
    return RunTable(runs, source)


def _titled(title: str) -> tuple[str, str]:
    """Name and unit of a column, empty where its head has none."""
    name, _, unit = title.strip().rstrip("]").partition("[")
    return name.strip(), unit.strip()


def _run(row: Mapping[str | None, object], table: Path, where: str) -> Run:
    """One row."""
    if None in row:
        raise InputError(where, "found more values than columns, expected one for each")
    cells = {}
    for title, cell in row.items():
        name, unit = _titled(str(title))
        text = str(cell or "").strip()
        cells[name] = f"{text} {unit}" if text and unit else text
    if not cells["file"]:
        raise InputError(where, "file: missing, expected the name of a recording")
    path = table.parent / cells["file"]
    if not path.is_file():
        raise InputError(where, f"file: found {cells['file']}, which is not there, expected a recording")
    if cells["role"] not in ROLES:
        raise InputError(where, f"role: found {shown(cells['role'])}, expected {', '.join(ROLES)}")
    role = cells["role"]
    angle = _quantity(cells, "angle", "angle", where, "0.000(2) deg")
    if role == "wind-off" and (angle is None or not angle.u > 0.0):
        found = "missing" if angle is None else f"found {shown(angle.text)}"
        raise InputError(
            where, f"angle: {found}, expected that of the wind-off with its u, such as '0.000(2) deg'"
        )
    if role != "wind-off" and angle is not None:
        raise InputError(where, f"angle: found with the role {role}, expected it with wind-off only")
    begin = _quantity(cells, "begin", "time", where, "5 min")
    amplitude = _quantity(cells, "amplitude", "angle", where, "10 deg")
    frequency = _quantity(cells, "frequency", "frequency", where, "1 Hz")
    return Run(
        path,
        role,
        angle,
        None if begin is None else begin.value,
        math.nan if amplitude is None else amplitude.value,
        math.nan if frequency is None else frequency.value,
    )


def _quantity(
    cells: Mapping[str, str], name: str, dimension: str, where: str, example: str
) -> Quantity | None:
    """A quantity of a row; None where its cell is empty."""
    if not cells.get(name):
        return None
    try:
        return parse_quantity(cells[name], dimension, name, example)
    except QuantityError as error:
        raise InputError(where, str(error)) from error
