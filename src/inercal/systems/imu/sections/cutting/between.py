"""Moves between rests of a log, and swings of a log in which nothing rests, by rows of sections."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from inercal.foundation.arrays import Array
from inercal.systems.imu.sections.carried import Move
from inercal.systems.imu.sections.cutting.cut import TriadSamples
from inercal.systems.imu.sections.cutting.log import on_clock
from inercal.systems.imu.sections.cutting.table import SectionRow
from inercal.systems.imu.sections.section import Section


@dataclass(frozen=True, eq=False)
class NamedMove:
    """A move between two rests by name, and where it is."""

    name: str
    where: str
    move: Move


@dataclass(frozen=True, eq=False)
class SwingStretch:
    """A stretch in which nothing needs to rest: times ``t`` (n,) [s], outputs ``acc`` (n, 3), and ``gyro`` (n, 3) at
    the same times, None where there is none."""

    name: str
    where: str
    t: Array
    acc: Array
    gyro: Array | None


def moves_of(
    rows: Sequence[SectionRow],
    sections: Sequence[Section],
    files: Mapping[str, tuple[TriadSamples | None, TriadSamples | None]],
) -> tuple[tuple[NamedMove, ...], dict[str, str]]:
    """Moves by rows of that kind, each from the end of the rest before it to the begin of the one after it; and those
    of no use, by name, with the reason. ``files``: accelerometers and gyro of recordings by name."""
    place = {section.name: k for k, section in enumerate(sections) if section.acc is not None}
    found: list[NamedMove] = []
    unused: dict[str, str] = {}
    for row in (row for row in rows if row.kind == "move"):
        acc, gyro = files.get(row.file, (None, None))
        if acc is None or gyro is None:
            unused[row.section] = "a move without accelerometers and gyro says nothing"
            continue
        begin = row.begin if row.begin is not None else -np.inf
        end = row.end if row.end is not None else np.inf
        if _told(rows, row.file, begin, end):
            unused[row.section] = "its turn, or its steady rate, is stated"
            continue
        step = max(acc.step, gyro.step)
        rests = [one for one in rows if one.kind == "rest" and one.file == row.file]
        before = [one for one in rests if one.end is not None and one.end <= begin + step]
        after = [one for one in rests if one.begin is not None and one.begin >= end - step]
        if not before or not after:
            unused[row.section] = "no rest is known before and after it"
            continue
        first = max(before, key=lambda one: one.end or 0.0)
        last = min(after, key=lambda one: one.begin or 0.0)
        if first.section not in place or last.section not in place:
            unused[row.section] = "the rest before or after it is not used"
            continue
        assert first.end is not None
        assert last.begin is not None
        there = (gyro.t >= first.end - 1e-9) & (gyro.t <= last.begin + 1e-9)
        t = gyro.t[there]
        force = on_clock(acc, gyro.t)[there]
        moved = Move(place[first.section], place[last.section], t, gyro.values[there], force)
        found.append(NamedMove(row.section, f"{row.file}, {first.end:.2f} s to {last.begin:.2f} s", moved))
    found.sort(key=lambda one: one.move.first)
    return tuple(found), unused


def swings_of(
    rows: Sequence[SectionRow], files: Mapping[str, tuple[TriadSamples | None, TriadSamples | None]]
) -> tuple[SwingStretch, ...]:
    """Stretches of the rows of kind ``swing`` that have accelerometers."""
    found = []
    for row in (row for row in rows if row.kind == "swing"):
        acc, gyro = files.get(row.file, (None, None))
        if acc is None:
            continue
        low = -np.inf if row.begin is None else row.begin
        high = np.inf if row.end is None else row.end
        there = (acc.t >= low) & (acc.t <= high)
        values = np.where(acc.clipped[there, None], np.nan, acc.values[there])
        rate = None if gyro is None else on_clock(gyro, acc.t)[there]
        where = (
            f"{row.file}, {acc.t[there][0]:.2f} s to {acc.t[there][-1]:.2f} s" if there.any() else row.file
        )
        found.append(SwingStretch(row.section, where, acc.t[there], values, rate))
    return tuple(found)


def with_moves_between(rows: Sequence[SectionRow]) -> list[SectionRow]:
    """The rows of one log with a move between each two rests that follow each other, unless a steady rate lies
    between. A turn whose angle is not known counts as a move until somebody states it."""
    rests = sorted((row for row in rows if row.kind == "rest"), key=lambda row: row.begin or 0.0)
    turning = [row for row in rows if row.kind == "rate"]
    moves = []
    for number, (first, last) in enumerate(pairwise(rests), 1):
        begin, end = first.end or 0.0, last.begin or 0.0
        if not any((one.begin or 0.0) < end and (one.end or np.inf) > begin for one in turning):
            moves.append(SectionRow(f"move {number}", first.file, begin, end, "move", why="detected"))
    return sorted([*rows, *moves], key=lambda row: (row.begin or 0.0, row.kind))


def _told(rows: Sequence[SectionRow], file: str, begin: float, end: float) -> bool:
    """True where a turn by a known angle, or a known rate, lies between two times [s] of a file."""
    told = [row for row in rows if row.file == file and (row.angle is not None or row.rate is not None)]
    return any((row.begin or 0.0) < end and (row.end or np.inf) > begin for row in told)


def as_a_swing(file: str, t: Array) -> SectionRow:
    """The row of a log in which nothing rests."""
    times = t[np.isfinite(t)]
    return replace(
        SectionRow("swing", file, kind="swing", why="detected, nothing rests"),
        begin=float(times.min()),
        end=float(times.max()),
    )
