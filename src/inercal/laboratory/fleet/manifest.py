"""Manifests: which units there are, which files are of each, and which keys of the study are its own."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from inercal.foundation._files import input_text
from inercal.foundation.addresses import shown_address
from inercal.foundation.errors import InputError
from inercal.foundation.records.read import FORMATS
from inercal.foundation.units import shown

_EXPECTED = "a CSV with the header serial,files and a row for each unit, or a folder of recordings"
_LONGEST = 80
"""Characters of a serial number: it is the name of a file."""

_KEY = re.compile(r"[A-Za-z_][\w-]*(\.[\w-]+)*")


@dataclass(frozen=True)
class FleetUnit:
    """A unit: its ``serial`` number, its ``files`` (paths or URLs), and its own ``keys`` of the study as ``--set``
    takes them."""

    serial: str
    files: tuple[str, ...] = field(repr=False)
    keys: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """The files as they may be shown, each name once: addresses without their secrets."""
        names: list[str] = []
        for shown_file in map(shown_address, self.files):
            names.append(shown_file if shown_file not in names else f"{shown_file} ({len(names) + 1})")
        return tuple(names)

    @property
    def overrides(self) -> tuple[str, ...]:
        """All keys that are set over those of the study: its own, and its serial number."""
        return (f"item.serial={json.dumps(self.serial)}", *self.keys)


def read_manifest(path: str | Path) -> tuple[FleetUnit, ...]:
    """The units of a manifest, in its order.

    Parameters
    ----------
    path : str or Path
        A CSV with the columns ``serial`` and ``files`` (several divided by ``;``, relative to the manifest, or URLs);
        every other column is a key of the study, an empty cell leaves it as it is. Or a folder: each recording in it is
        a unit, each folder in it that holds recordings a unit of these files; the name is the serial number.

    Returns
    -------
    tuple of Unit
        One at least.

    Raises
    ------
    InputError
        Naming the line and column: no such file, no units, a cell that is empty, a serial number twice.
    """
    path = Path(path)
    units = list(_of_folder(path) if path.is_dir() else _of_rows(path))
    if not units:
        raise InputError(path, f"holds no unit, expected {_EXPECTED}")
    first: dict[str, FleetUnit] = {}
    for unit in units:
        if unit.serial in first:
            raise InputError(
                path, f"found the serial number {shown(unit.serial)} twice, expected a row for each unit"
            )
        first[unit.serial] = unit
    return tuple(units)


def _of_folder(folder: Path) -> Iterator[FleetUnit]:
    """Each recording of a folder, and each folder of recordings in it."""
    for each in sorted(folder.iterdir()):
        if each.is_dir():
            files = sorted(inner for inner in each.iterdir() if _is_recording(inner))
            if files:
                yield FleetUnit(each.name, tuple(map(str, files)))
        elif _is_recording(each):
            yield FleetUnit(each.name[: -len(_suffix(each))], (str(each),))


def _suffix(path: Path) -> str:
    """The suffix by which a recording is read; empty if none."""
    return next((path.name[-len(s) :] for s in FORMATS if path.name.lower().endswith(s)), "")


def _is_recording(path: Path) -> bool:
    """True for a file that can be read as one."""
    return path.is_file() and not path.name.startswith(".") and len(_suffix(path)) not in (0, len(path.name))


def _of_rows(path: Path) -> Iterator[FleetUnit]:
    """Each row of a manifest."""
    rows = csv.reader(input_text(path, _EXPECTED).splitlines(), strict=True)
    try:
        head = [cell.strip() for cell in next(rows, [])]
        _check_head(head, path)
        for cells in rows:
            if any(cell.strip() for cell in cells):
                yield _of_row(head, [cell.strip() for cell in cells], path, rows.line_num)
    except csv.Error as error:
        raise InputError(path, f"line {rows.line_num}: {error}, expected {_EXPECTED}") from error


def _check_head(head: list[str], path: Path) -> None:
    """Refuse a header without the two columns, with one twice, or with one that is no key."""
    for name in ("serial", "files"):
        if name not in head:
            raise InputError(path, f"line 1: found no column {name!r}, expected {_EXPECTED}")
    for name in head:
        if head.count(name) > 1:
            raise InputError(path, f"line 1: found the column {shown(name)} twice, expected it once")
        if not _KEY.fullmatch(name):
            raise InputError(
                path,
                f"line 1: found the column {shown(name)}, expected a key of the study such as imu.method",
            )


def _of_row(head: list[str], cells: list[str], path: Path, line: int) -> FleetUnit:
    """The unit of a row."""
    if len(cells) != len(head):
        raise InputError(
            path, f"line {line}: found {len(cells)} cells, expected {len(head)} as in the header"
        )
    row = dict(zip(head, cells, strict=True))
    serial, files = row.pop("serial"), [name.strip() for name in row.pop("files").split(";")]
    for name, text in (("serial", serial), *(("files", each) for each in files)):
        if not text.isprintable():
            raise InputError(
                path, f"line {line}, column {name}: found {shown(text)}, expected text that can be printed"
            )
    if len(serial) > _LONGEST:
        raise InputError(
            path, f"line {line}, column serial: found {len(serial)} characters, expected {_LONGEST} at most"
        )
    if not serial:
        raise InputError(path, f"line {line}, column serial: found nothing, expected a serial number")
    if not all(files):
        raise InputError(
            path, f"line {line}, column files: found an empty name, expected files divided by ';'"
        )
    places = tuple(name if "://" in name else str(path.parent / name) for name in files)
    return FleetUnit(serial, places, tuple(f"{key}={value}" for key, value in row.items() if value))
