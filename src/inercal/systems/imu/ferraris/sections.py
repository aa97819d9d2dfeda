"""The nine sections of a Ferraris recording: six positions and three turns, labelled, named or detected.

Choice of the turn among the motions about each axis, with findings that speak against it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.errors import RecordError, StudyError
from inercal.foundation.findings import EVERYTHING, Finding
from inercal.foundation.records.column import Triad
from inercal.foundation.records.places import counted, counted_names, places
from inercal.foundation.records.record import Record
from inercal.foundation.units import shown
from inercal.systems.imu.ferraris.detection import Detected, detect
from inercal.systems.imu.ferraris.gravity_transfer import Carried, carry
from inercal.systems.imu.ferraris.motions import SectionMotion
from inercal.systems.imu.ferraris.names import NAMES, POSITIONS, TURNS
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.settings import FerrarisSettings

ASK = "label it, or state it under imu.ferraris.sections"


@dataclass(frozen=True, eq=False)
class Choice:
    """The turns ``motions`` by axis; the ``doubt`` (3,) about their angles [rad], by what else they may have been; what
    speaks ``against`` the result, and other ``findings``."""

    motions: dict[int, SectionMotion]
    doubt: Array
    against: tuple[Finding, ...]
    findings: tuple[Finding, ...]


def choose(acc: Triad, gyro: Triad, detected: Detected, options: FerrarisSettings) -> Choice:
    """The turn about each axis, as far as there is a motion that can be it.

    It gives the scale factor by which gravity is carried from rest to rest, where that is known; else one near the
    nominal, or of counts one like those of the other axes. Of motions that cannot be told apart one in the stated
    sense is taken, of a single stretch between holds, and the likeliest; the others make the doubt about its angle.
    """
    carried = carry(acc, gyro, detected) if all(name in detected.positions for name in POSITIONS) else None
    about = {axis: [m for m in detected.motions if m.axis == axis] for axis in range(3)}
    turns: dict[int, SectionMotion] = {}
    doubt, graded, untold = np.zeros(3), list[tuple[bool, Finding]](), []
    for axis, motions in about.items():
        gains = np.array([_gain(m, axis, carried, options.turn) for m in motions])
        off, u = np.abs(gains), math.inf
        if carried is not None and carried.u[axis] < LIMITS.transfer_scale_u:
            off = off / carried.scale[axis] - 1.0
            u = math.hypot(options.turn_u / options.turn, LIMITS.turn_scale_u, float(carried.u[axis]))
        elif gyro.unit.dimension == "rate":
            off = off * gyro.unit.factor - 1.0
        else:
            own = _largest({axis: motions})
            off = (
                off * abs(options.turn) / own - 1.0
                if own > LIMITS.turn_size * _largest(about)
                else np.inf * off
            )
        rows = [k for k in range(len(motions)) if abs(off[k]) < LIMITS.turn_deviation]
        if not rows:
            continue
        least = float(np.min(np.abs(off[rows]))) / u
        rows = [k for k in rows if (off[k] / u) ** 2 <= least**2 + LIMITS.turn_chi2]
        rows = [k for k in rows if gains[k] > 0.0] or rows
        best = min(rows, key=lambda k: (not motions[k].single, abs(off[k]), motions[k].stop))
        other = max(rows, key=lambda k: abs(gains[k] - gains[best]))
        turns[axis], where = motions[best], _where(acc, motions[best])
        apart = abs(abs(float(gains[other] / gains[best])) - 1.0)
        doubt[axis] = apart * abs(options.turn)
        if least > LIMITS.turn_sigmas:
            by = math.degrees(abs(options.turn) * (1.0 + float(off[best])))
            message = (
                f"gravity, carried through the motion between the rests, says that the turn {TURNS[axis]} found was "
                f"by {by:.1f} deg, not by {math.degrees(abs(options.turn)):g} deg: {ASK}, and check imu.ferraris.turn"
            )
            graded.append((True, Finding("contradiction", message, where, EVERYTHING)))
        if apart > max(LIMITS.slight_turn_difference, abs(options.turn_u / options.turn)):
            message = (
                f"which motion is the turn {TURNS[axis]} is not certain: the one taken and the one from "
                f"{_where(acc, motions[other])} differ by {100 * apart:.2g} %: {ASK}"
            )
            graded.append((apart > LIMITS.grave_turn_difference, Finding("turn_doubtful", message, where)))
        if math.isinf(u):
            untold.append(TURNS[axis])
    if untold:
        message = (
            "the motion between the rests does not tell by what angle the instrument was turned: that the motions "
            f"found are the whole of {', '.join(untold)} is taken for granted"
        )
        graded.append((False, Finding("turn_doubtful", message)))
    against, findings = (tuple(f for grave, f in graded if grave is each) for each in (True, False))
    return Choice(turns, doubt, against, findings)


def _gain(motion: SectionMotion, axis: int, carried: Carried | None, turn: float) -> float:
    """The scale factor [output per rad/s] if this was the turn; bias and g-sensitivity are those in the positions."""
    if carried is None:
        return float(motion.rotation[axis] / turn)
    bias = carried.at_rest.rate_bias + carried.at_rest.apparent_g @ motion.up
    return float((motion.integral - motion.duration * bias)[axis] / turn)


def _largest(about: Mapping[int, list[SectionMotion]]) -> float:
    """The largest rotation [output s] of a single stretch about one of the axes."""
    return max(
        (abs(m.rotation[k]) for k, each in about.items() for m in each if m.stretches == 1), default=0.0
    )


def _where(acc: Triad, motion: SectionMotion) -> str:
    """Begin and end of a motion, in words."""
    return f"t {acc.t[motion.start]:.2f} to {acc.t[motion.stop - 1]:.2f} s"


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
