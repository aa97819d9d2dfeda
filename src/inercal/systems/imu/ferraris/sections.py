"""The nine sections of a Ferraris recording: six positions and three turns, labelled, named or detected."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.errors import RecordError, StudyError
from inercal.foundation.records.column import Triad
from inercal.foundation.records.places import counted, counted_names, places
from inercal.foundation.records.record import Record
from inercal.foundation.units import shown
from inercal.systems.imu.ferraris.detection import detect
from inercal.systems.imu.ferraris.names import NAMES, TURNS
from inercal.systems.imu.ferraris.which_turn import Choice, choose
from inercal.systems.imu.settings import FerrarisSettings

Integers = NDArray[np.int64]

_SIGNED = re.compile(r"([+-])([xyz])")


@dataclass(frozen=True, eq=False)
class Sections:
    """The rows of each section, by name, for the accelerometers and for the gyro; ``found_by`` says how: labels,
    study or detection, and ``turns`` in the last case what there is to say of the choice; ``strange`` are labels of
    the record that name no section."""

    acc: Mapping[str, Integers]
    gyro: Mapping[str, Integers]
    found_by: str
    turns: Choice | None = None
    strange: tuple[str, ...] = ()

    @property
    def missing(self) -> tuple[str, ...]:
        """Names of the sections there are not."""
        return tuple(name for name in NAMES if name not in self.acc)


def find_sections(record: Record, acc: Triad, gyro: Triad, options: FerrarisSettings) -> Sections:
    """Find the sections: as the study names them, else by the labels of the record, else by the data.

    Raises
    ------
    StudyError
        A section that lies outside the record.
    RecordError
        Labels that do not belong to the rows, a turn labelled in several places, or a section without samples.
    """
    turns = None
    if options.sections:
        rows = {
            name: _named(name, at, record.labels, acc) if isinstance(at, str) else _rows(name, at, acc)
            for name, at in options.sections.items()
        }
        found_by = "study"
    elif any(_canonical(label) for label in set(record.labels)):
        rows, found_by = _labelled(record.labels, acc), "labels"
    else:
        found_by = "detection"
        seen = detect(acc, gyro)
        turns = choose(acc, gyro, seen, options)
        spans = seen.positions | {TURNS[axis]: (m.start, m.stop) for axis, m in turns.motions.items()}
        rows = {name: np.arange(start, stop) for name, (start, stop) in spans.items()}
    of_acc = {name: _recorded(name, span, acc) for name, span in rows.items()}
    of_gyro = {name: _recorded(name, _on(gyro, acc, span), gyro) for name, span in of_acc.items()}
    strange = () if options.sections else tuple(sorted(filter(_is_strange, set(record.labels))))
    return Sections(of_acc, of_gyro, found_by, turns, strange)


def _canonical(label: str) -> str:
    """The name of a section by its label: ``X_P``, ``+x`` and ``x_p`` are one; empty for any other."""
    plain = label.strip().lower()
    signed = _SIGNED.fullmatch(plain)
    if signed:
        plain = f"{signed[2]}_{'p' if signed[1] == '+' else 'a'}"
    return plain if plain in NAMES else ""


def _is_strange(label: str) -> bool:
    """True for a label that names no section."""
    return bool(label.strip()) and not _canonical(label)


def _named(name: str, label: str, labels: Sequence[str], acc: Triad) -> Integers:
    """Rows of a label that the study states for a section."""
    if len(labels) == len(acc.t):
        rows = np.flatnonzero(np.array([each.strip() for each in labels]) == label.strip())
        if rows.size:
            return rows
    there = counted_names(sorted({each.strip() for each in labels} - {""})) if labels else "no labels"
    raise StudyError(
        f"imu.ferraris.sections.{name}", f"found no row labelled {shown(label)}, the record has {there}"
    )


def _labelled(labels: Sequence[str], acc: Triad) -> dict[str, Integers]:
    """Rows by label."""
    path = acc.source.path
    if len(labels) != len(acc.t):
        raise RecordError(
            path, f"has {len(acc.t)} rows and {len(labels)} labels, expected the labels in the file of acc_x"
        )
    canonical = {label: _canonical(label) for label in set(labels)}
    names = np.array([canonical[label] for label in labels])
    rows_by_name = {}
    for name in NAMES:
        rows = np.flatnonzero(names == name)
        starts = rows[np.flatnonzero(np.diff(rows, prepend=-2) > 1)]
        if name.endswith("_rot") and len(starts) > 1:
            raise RecordError(path, f"found {name} in several {places('row', starts + 1)}, expected one turn")
        if len(rows):
            rows_by_name[name] = rows
    return rows_by_name


def _rows(name: str, ends: tuple[float, float], acc: Triad) -> Integers:
    """Rows between two times or two sample numbers."""
    start, end = ends
    key = f"imu.ferraris.sections.{name}"
    if isinstance(start, int) and isinstance(end, int):
        if end > len(acc.t):
            raise StudyError(key, f"found samples {start} to {end}, expected at most {len(acc.t)}")
        return np.arange(start, end)
    inside = np.flatnonzero((acc.t >= start) & (acc.t < end))
    if not inside.size or end > acc.t[-1] + 1.0 / acc.rate or start < acc.t[0]:
        raise StudyError(
            key, f"found {start:g} s to {end:g} s, expected times within {acc.t[0]:g} s to {acc.t[-1]:g} s"
        )
    return inside


def _recorded(name: str, rows: Integers, triad: Triad) -> Integers:
    """Rows of a section that hold numbers; raises `RecordError` where there are hardly any."""
    recorded = rows[np.isfinite(triad.values[rows]).all(axis=1) & np.isfinite(triad.t[rows])]
    if len(recorded) < 2:
        raise RecordError(
            triad.source.path,
            f"section {name} has {counted(len(recorded), 'row')} of {triad.sensor} with numbers, expected a recording",
        )
    return recorded


def _on(gyro: Triad, acc: Triad, rows: Integers) -> Integers:
    """The rows of the gyro at the times of rows of the accelerometers."""
    if gyro.t is acc.t:
        return rows
    half = 0.5 / acc.rate
    covered = np.zeros(len(gyro.t), dtype=bool)
    edges = np.flatnonzero(np.diff(rows) > 1)
    for first, last in zip(rows[np.r_[0, edges + 1]], rows[np.r_[edges, -1]], strict=True):
        covered |= (gyro.t >= acc.t[first] - half) & (gyro.t < acc.t[last] + half)
    return np.flatnonzero(covered)
