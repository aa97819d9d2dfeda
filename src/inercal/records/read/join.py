"""Tables of one or several files joined into the columns of a record, each with its time axis.

Where a test on a table states no time, rows are counted: the axis is 0, 1, 2, ...
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from inercal.errors import MapError, RecordError
from inercal.records.channels import Channel, of_a_table
from inercal.records.read.table import Part, Table
from inercal.records.record import Array, Column, Source
from inercal.units import parse_unit, shown

if TYPE_CHECKING:
    from inercal.records.maps import RecordMap


@dataclass(frozen=True)
class FileTable:
    """A file that was read: the part of the map it was read by, and the table found."""

    path: Path
    source: Source
    part: Part
    table: Table


@np.errstate(over="ignore", invalid="ignore")
def join(files: Sequence[FileTable], record_map: RecordMap | None) -> dict[str, Column]:
    """Columns by name, sign, scale and unit applied; files whose time stamps are equal share one time axis.

    Raises
    ------
    MapError
        A mapped column is in none of the files.
    RecordError
        Two files hold the same channel, or a file has no time axis.
    """
    if record_map is not None:
        _check_present(files, record_map.path)
    rate = None if record_map is None else record_map.rate
    _check_once(files)
    columns: dict[str, Column] = {}
    axes: list[Array] = []
    for file in files:
        t = _time_axis(file, files, rate)
        t = next((axis for axis in axes if np.array_equal(axis, t, equal_nan=True)), t)
        axes.append(t)
        for channel in file.table.channels:
            if channel.name not in ("t", "label"):
                columns[channel.name] = _column(channel, file, t)
    return columns


def _check_present(files: Sequence[FileTable], map_path: Path) -> None:
    """Each mapped column must be in one file at least, and each file must hold one at least."""
    for part in {id(file.part): file.part for file in files}.values():
        read = [file for file in files if file.part is part]
        found = {channel.name for file in read for channel in file.table.channels}
        for channel in part.channels or ():
            if channel.name not in found:
                table = f"file.{part.name}.columns" if part.name else "columns"
                held = "; ".join(f"{file.path} ({file.table.contents})" for file in read)
                origin = list(channel.origin) if isinstance(channel.origin, tuple) else channel.origin
                raise MapError(
                    f"{map_path}: {table}.{channel.name}.from",
                    f"found no {shown(origin)} in {held}, expected it there",
                )
    for file in files:
        if not file.table.channels:
            raise RecordError(file.path, f"found {file.table.contents}, expected a mapped column at least")


def _check_once(files: Sequence[FileTable]) -> None:
    """No channel but the time may be in two files."""
    seen: dict[str, Path] = {}
    for file in files:
        for channel in file.table.channels:
            if channel.name != "t" and channel.name in seen:
                raise RecordError(
                    file.path,
                    f"found {channel.name} as in {seen[channel.name]}, expected each channel in one file",
                )
            seen[channel.name] = file.path


def _time_axis(file: FileTable, files: Sequence[FileTable], rate: float | None) -> Array:
    """Sample times [s] of a file: its own column, that of another file of its part, or from the rate."""
    table = file.table
    timed = [other for other in files if other.part is file.part and "t" in other.table.values]
    if file in timed:
        timed = [file]
    same = [other for other in timed if other.table.rows == table.rows]
    if len(same) == 1:
        return _seconds(same[0])
    if timed:
        found = " and ".join(f"{other.table.rows} in {other.path}" for other in timed)
        raise RecordError(
            file.path,
            f"found {table.rows} rows without t, and stamps for {found}, expected one with as many rows, or a "
            "[file.NAME] for each file with its own t",
        )
    if rate is not None:
        return np.arange(table.rows) / rate
    if of_a_table(table.values) and not any(channel.increment for channel in table.channels):
        return np.arange(table.rows, dtype=np.float64)
    raise RecordError(
        file.path, 'found no time column t, expected one, or [time] rate = "100 Hz" (say) in a column map'
    )


def _seconds(file: FileTable) -> Array:
    """The time column in seconds."""
    channel = next(channel for channel in file.table.channels if channel.name == "t")
    t = file.table.values["t"]
    if np.isnan(t).all():
        raise RecordError(file.path, f"found no number in the time column of {t.size} rows, expected seconds")
    factor = channel.factor * channel.unit.factor
    return t if factor == 1.0 else t * factor


def _column(channel: Channel, file: FileTable, t: Array) -> Column:
    """One channel in its unit, increments turned into rates by the median sample interval."""
    values, unit = file.table.values[channel.name], channel.unit
    if channel.factor != 1.0:
        values = values * channel.factor
    if channel.increment:
        values = values * (unit.factor / _interval(t, file.path))
        unit = parse_unit("m/s^2" if unit.dimension == "velocity" else "rad/s")
    return Column(channel.name, channel.sensor, channel.axis, unit, values, t, file.source)


def _interval(t: Array, path: Path) -> float:
    """Median sample interval [s]."""
    steps = np.diff(t[np.isfinite(t)])
    interval = float(np.median(steps)) if steps.size else 0.0
    if interval <= 0:
        raise RecordError(
            path, f"found a sample interval of {interval} s, expected one above 0 for increments"
        )
    return interval
