"""The nine sections of a session after Ferraris, six sides and three turns, as rows of sections.

They are where the study says, else where labels of the record say, else where the data show them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.errors import RecordError, StudyError
from inercal.foundation.findings import Finding
from inercal.foundation.records.column import Triad
from inercal.foundation.records.places import counted_names, places
from inercal.foundation.records.record import Record
from inercal.foundation.units import shown
from inercal.systems.imu.ferraris.names import NAMES, POSITIONS, TURNS, UP
from inercal.systems.imu.sections.cutting.table import SectionRow, quantity_of
from inercal.systems.imu.sections.cutting.which_turn import found_in_log
from inercal.systems.imu.sections.cutting.words import claim
from inercal.systems.imu.settings import FerrarisSettings

Rows = NDArray[np.int64]


@dataclass(frozen=True)
class NineSections:
    """Rows of sections; ``spans`` are the samples of the accelerometers in each, by name of the nine; ``found_by``
    says how: study, labels or detection; ``strange`` are labels that name no section."""

    rows: tuple[SectionRow, ...]
    spans: Mapping[str, tuple[Rows, ...]]
    found_by: str
    strange: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = ()
    """Findings about the choice of the turns, where they were found in the data."""

    @property
    def missing(self) -> tuple[str, ...]:
        """Names of the sections there are not."""
        return tuple(name for name in NAMES if name not in self.spans)


def nine_sections(record: Record, file: str, options: FerrarisSettings) -> NineSections:
    """The sections of a record, whose ``file`` is so called.

    Raises
    ------
    StudyError
        A section that lies outside the record.
    RecordError
        Labels that do not belong to the rows, or a turn labelled in several places.
    """
    acc, gyro = record.triad("acc"), record.triad("gyro")
    strange = tuple(sorted(label for label in set(record.labels) if label.strip() and not _canonical(label)))
    if options.sections:
        spans = {name: _stated(name, at, record.labels, acc) for name, at in options.sections.items()}
        return NineSections(_rows(spans, {}, acc, file, options, "study"), spans, "study")
    if any(_canonical(label) for label in set(record.labels)):
        spans = _labelled(record.labels, acc)
        return NineSections(_rows(spans, {}, acc, file, options, "label"), spans, "labels", strange)
    found = found_in_log(acc, gyro, (options.turn, options.turn_u))
    spans = {_side(way): (np.arange(start, stop),) for way, (start, stop) in found.sides.items()}
    spans |= {TURNS[axis]: (np.arange(*ends),) for axis, ends in found.turns.items()}
    doubts = {TURNS[axis]: float(found.doubt[axis]) for axis in found.turns}
    rows = _rows(spans, doubts, acc, file, options, "detected")
    return NineSections(rows, spans, "detection", strange, found.findings)


def _side(way: str) -> str:
    """``x_p`` of ``+x``."""
    return f"{way[1]}_{'p' if way[0] == '+' else 'a'}"


def _canonical(label: str) -> str:
    """The name of a section by its label: ``X_P``, ``+x``, ``x up`` and ``x_p`` are one; empty for any other."""
    said = claim(label.strip())
    if said.kind == "rest" and said.up:
        return _side(said.up)
    return f"{said.axis[1]}_rot" if said.kind == "turn" and said.axis else ""


def _stated(name: str, at: tuple[float, float] | str, labels: Sequence[str], acc: Triad) -> tuple[Rows, ...]:
    """Samples of a section by what the study says: a label, two times or two sample numbers."""
    key = f"imu.ferraris.sections.{name}"
    if isinstance(at, str):
        if len(labels) == len(acc.t):
            rows = np.flatnonzero(np.array([label.strip() for label in labels]) == at.strip())
            if rows.size:
                return _runs(name, rows, acc)
        kinds = sorted({label.strip() for label in labels} - {""})
        there = counted_names(kinds) if labels else "no labels"
        raise StudyError(key, f"found no row labelled {shown(at)}, the record has {there}")
    start, end = at
    if isinstance(start, int) and isinstance(end, int):
        if end > len(acc.t):
            raise StudyError(key, f"found samples {start} to {end}, expected at most {len(acc.t)}")
        return (np.arange(start, end),)
    inside = np.flatnonzero((acc.t >= start) & (acc.t < end))
    if not inside.size or end > acc.t[-1] + 1.0 / acc.rate or start < acc.t[0]:
        raise StudyError(
            key, f"found {start:g} s to {end:g} s, expected times within {acc.t[0]:g} s to {acc.t[-1]:g} s"
        )
    return (inside,)


def _labelled(labels: Sequence[str], acc: Triad) -> dict[str, tuple[Rows, ...]]:
    """Samples by label."""
    if len(labels) != len(acc.t):
        raise RecordError(
            acc.source.path,
            f"has {len(acc.t)} rows and {len(labels)} labels, expected the labels in the file of acc_x",
        )
    canonical = {label: _canonical(label) for label in set(labels)}
    names = np.array([canonical[label] for label in labels])
    return {name: _runs(name, rows, acc) for name in NAMES if len(rows := np.flatnonzero(names == name))}


def _runs(name: str, rows: Rows, acc: Triad) -> tuple[Rows, ...]:
    """Samples of one label, run by run; of a turn there is one."""
    runs = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)
    if name in TURNS and len(runs) > 1:
        starts = np.array([run[0] + 1 for run in runs])
        raise RecordError(
            acc.source.path, f"found {name} in several {places('row', starts)}, expected one turn"
        )
    return tuple(runs)


def _rows(
    spans: Mapping[str, tuple[Rows, ...]],
    doubts: Mapping[str, float],
    acc: Triad,
    file: str,
    options: FerrarisSettings,
    why: str,
) -> tuple[SectionRow, ...]:
    """A row for each run of samples; ``doubts`` are errors of angles [rad] at most, by turn."""
    out: list[SectionRow] = []
    for name, runs in spans.items():
        k = "xyz".index(name[0])
        for number, run in enumerate(runs, 1):
            t = acc.t[run][np.isfinite(acc.t[run])]
            if len(t) < 2:
                raise RecordError(
                    acc.source.path,
                    f"section {name} has {len(t)} rows with time stamps, expected a recording",
                )
            row = {"file": file, "begin": float(t.min()), "end": float(t.max()), "placing": options.alignment}
            call = name if number == 1 else f"{name} {number}"
            if name in POSITIONS:
                out.append(SectionRow(call, up=UP[POSITIONS.index(name)], why=why, **row))  # type: ignore[arg-type]
            else:
                u = float(np.hypot(options.turn_u, doubts.get(name, 0.0) / np.sqrt(3.0)))
                angle, up = quantity_of(options.turn, u, "deg"), _upright(k, run, spans, acc)
                out.append(
                    SectionRow(call, kind="turn", up=up, axis=np.eye(3)[k], angle=angle, why=why, **row)  # type: ignore[arg-type]
                )
    return tuple(out)


def _upright(k: int, run: Rows, spans: Mapping[str, tuple[Rows, ...]], acc: Triad) -> Array:
    """Direction (3,) of specific force in a turn about axis k: the end of it that is up shows in the accelerometers."""
    ends = [spans.get(f"{'xyz'[k]}_{end}") for end in "pa"]
    if None in ends:
        return np.asarray(np.eye(3)[k])
    here, up, down = (
        np.nanmean(acc.values[rows], axis=0) for rows in (run, *(end[0] for end in ends if end))
    )
    nearer = np.linalg.norm(here - up) <= np.linalg.norm(here - down)
    return np.asarray(np.eye(3)[k] * (1.0 if nearer else -1.0))
