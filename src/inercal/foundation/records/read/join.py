"""Tables of one or several files joined into the columns of a record, each with its time axis.

Where a test on a table states no time, rows are counted: the axis is 0, 1, 2, ...
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import MapError, RecordError
from inercal.foundation.inputs import Source
from inercal.foundation.records.channels import Channel, of_a_table
from inercal.foundation.records.column import Column
from inercal.foundation.records.read.table import FileShare, RawTable
from inercal.foundation.units import Unit, parse_unit, shown

if TYPE_CHECKING:
    from inercal.foundation.records.maps import RecordMap


@dataclass(frozen=True)
class FileTable:
    """A file that was read: the part of the map it was read by, and a table found; one for each of its clocks."""

    path: Path
    source: Source
    part: FileShare
    table: RawTable


@np.errstate(over="ignore", invalid="ignore")
def joined(
    files: Sequence[FileTable], record_map: RecordMap | None, counted: bool = False
) -> dict[str, Column]:
    """Columns by name, sign, scale and unit applied; tables whose time stamps are equal share one time axis.

    ``counted``: rows without times are counted, as means of poses. Raises `MapError` where a mapped column is in none
    of the files, `RecordError` where two files hold the same channel, or one has no time axis.
    """
    if record_map is not None:
        check_present(files, record_map.path)
    rate = None if record_map is None else record_map.rate
    _check_once(files)
    columns: dict[str, Column] = {}
    axes: list[Array] = []
    for file in files:
        t = _time_axis(file, files, 1.0 if rate is None and counted else rate)
        t = next((axis for axis in axes if np.array_equal(axis, t, equal_nan=True)), t)
        axes.append(t)
        stamped = any("t" in other.table.values for other in files if other.part is file.part)
        for channel in file.table.channels:
            if channel.name not in ("t", "label"):
                columns[channel.name] = _column(channel, file, t, None if stamped else rate)
    return columns


def check_present(files: Sequence[FileTable], map_path: Path) -> None:
    """Each mapped column must be in one file at least, and each file must hold one at least."""
    for part in {id(file.part): file.part for file in files}.values():
        read = [file for file in files if file.part is part]
        present = {channel.name for file in read for channel in file.table.channels}
        for channel in part.channels or ():
            if channel.name not in present:
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
    """Sample times [s] of a table: its own column or clock, that of another table of its part, or from the rate."""
    table = file.table
    if table.clock is not None and rate is None:
        return table.clock
    timed = [other for other in files if other.part is file.part and "t" in other.table.values]
    if file in timed:
        timed = [file]
    same = [other for other in timed if other.table.rows == table.rows]
    if len(same) == 1:
        return _seconds(same[0])
    if timed:
        stamps = " and ".join(f"{other.table.rows} in {other.path}" for other in timed)
        raise RecordError(
            file.path,
            f"found {table.rows} rows without t, and stamps for {stamps}, expected one with as many rows, or a "
            "[file.NAME] for each file with its own t",
        )
    lengths = sorted({other.table.rows for other in files if other.source == file.source})
    if len(lengths) > 1:
        raise RecordError(
            file.path,
            f"found columns of {' and '.join(map(str, lengths))} rows, expected as many of each where one rate is "
            "stated for all",
        )
    return np.arange(table.rows) / row_rate(table.channels, rate, file.path)


def row_rate(channels: Sequence[Channel], rate: float | None, path: Path) -> float:
    """Rows a second of a file without time stamps: the stated ``rate`` [Hz], 1 where a test on a table states none.

    Raises `RecordError` for any other file.
    """
    if rate is not None:
        return rate
    if of_a_table(channel.name for channel in channels) and not any(each.increment for each in channels):
        return 1.0
    raise RecordError(
        path,
        'found no time column t, expected one, or the sample rate: [time] rate = "100 Hz" (say) in a '
        'column map, or --answer "rate=100 Hz"',
    )


def _seconds(file: FileTable) -> Array:
    """The time column in seconds."""
    channel = next(channel for channel in file.table.channels if channel.name == "t")
    t = file.table.values["t"]
    if np.isnan(t).all():
        raise RecordError(file.path, f"found no number in the time column of {t.size} rows, expected seconds")
    if channel.stamps is not None and channel.stamps.wrap:
        t = unwrapped(t, channel.stamps.wrap)
    (factor,), _ = conversion(channel)
    return t if factor == 1.0 else t * factor


def unwrapped(t: Array, wrap: float) -> Array:
    """A counter (n,) that falls to zero at ``wrap``, going on instead."""
    known = np.flatnonzero(np.isfinite(t))
    whole = t.copy()
    whole[known] += wrap * np.cumsum(np.diff(t[known], prepend=t[known[:1]]) < -0.5 * wrap)
    return whole


def conversion(channel: Channel, interval: float = 0.0) -> tuple[tuple[float, ...], Unit]:
    """Factors of the raw values of a channel, applied one after the other, and the unit that results.

    The time becomes seconds, increments over an ``interval`` [s] become rates; other units are kept.
    """
    unit = channel.unit
    if channel.name == "t":
        return (channel.factor * unit.factor,), parse_unit("s")
    if not channel.increment:
        return (channel.factor,), unit
    rate = parse_unit("m/s^2" if unit.dimension == "velocity" else "rad/s")
    return (channel.factor, unit.factor / interval), rate


def _column(channel: Channel, file: FileTable, t: Array, rate: float | None) -> Column:
    """One channel in its unit, increments turned into rates by the stated or the median sample interval."""
    interval = 0.0
    if channel.increment:
        interval = _interval(t, file.path) if rate is None else 1.0 / rate
    factors, unit = conversion(channel, interval)
    values = file.table.values[channel.name]
    for factor in factors:
        if factor != 1.0:
            values = values * factor
    gained = channel.increment
    return Column(channel.name, unit, values, t, file.source, increment=gained)


def _interval(t: Array, path: Path) -> float:
    """Median sample interval [s]."""
    steps = np.diff(t[np.isfinite(t)])
    interval = float(np.median(steps)) if steps.size else 0.0
    if interval <= 0:
        raise RecordError(
            path, f"found a sample interval of {interval} s, expected one above 0 for increments"
        )
    return interval
