"""Sections that are planned, with the outputs that a sound unit in physical units has, and moves between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.rotations import conjugate, log, multiply, rotate
from inercal.systems.imu.sections.carried import Move
from inercal.systems.imu.sections.course import CoursePiece, Pace, course
from inercal.systems.imu.sections.cutting.cut import section_of
from inercal.systems.imu.sections.cutting.table import SectionRow
from inercal.systems.imu.sections.priors import Priors
from inercal.systems.imu.sections.section import SENSED, Section
from inercal.systems.imu.settings import Simulation

_SAMPLES: Final = 60
"""Samples of a planned move."""


@dataclass(frozen=True, eq=False)
class Planned:
    """Sections in order with the attitudes ``ends`` (2, 4) at their begin and end, and moves between rests."""

    sections: tuple[Section, ...]
    ends: tuple[Array, ...]
    moves: tuple[Move, ...]


def planned(rows: Sequence[SectionRow], pace: Pace, priors: Priors, of: Simulation) -> Planned:
    """Sections and moves of rows, without any error, with the noise of a simulation. Swings are left aside.

    Raises `StudyError` for a row that cannot be planned, such as a turn without an angle.
    """
    pieces = course([row for row in rows if row.kind != "swing"], pace, None)
    sections: list[Section] = []
    ends: list[Array] = []
    between: list[bool] = []
    carried = False
    for row in rows:
        if row.kind == "move":
            carried = True
        elif row.kind != "swing":
            own = [piece for piece in pieces if piece.name == row.section]
            sections.append(_section(row, own, priors, of))
            ends.append(np.stack([own[0].q, own[-1].end]))
            between.append(carried)
            carried = False
    moves = [
        move_between(k - 1, k, (ends[k - 1][1], ends[k][0]), pace.turning, priors)
        for k in range(1, len(sections))
        if between[k] and sections[k - 1].kind == sections[k].kind == "rest"
    ]
    return Planned(tuple(sections), tuple(ends), tuple(moves))


def move_between(first: int, last: int, q: tuple[Array, Array], length: float, priors: Priors) -> Move:
    """The move from a rest to another one, by their places and attitudes, of ``length`` [s]."""
    piece = CoursePiece("", length, q[0], log(multiply(conjugate(q[0]), q[1])))
    part = np.linspace(0.0, 1.0, _SAMPLES)
    attitude, rate, _ = piece.at(part)
    up = rotate(conjugate(attitude), np.array([0.0, 0.0, 1.0]))
    return Move(first, last, length * part, rate + priors.site.vertical_rate * up, priors.site.gravity * up)


def _section(row: SectionRow, pieces: Sequence[CoursePiece], priors: Priors, of: Simulation) -> Section:
    """A section with its outputs and their noise, white over its length, and what the biases wander."""
    up = rotate(conjugate(np.stack([pieces[0].q, pieces[-1].end])), np.array([0.0, 0.0, 1.0]))
    force = (
        priors.site.gravity * up if row.force is None else np.stack([np.asarray(row.force, dtype=float)] * 2)
    )
    piece = max(pieces, key=lambda one: float(np.linalg.norm(one.step)))
    rate = piece.step / piece.length
    rest = pieces[0].length
    acc_var = of.accelerometer_noise**2 / rest + of.accelerometer_wander**2
    gyro_var = of.gyro_noise**2 / piece.length + of.gyro_wander**2
    section = replace(section_of(row), duration=piece.length)
    sensed = SENSED[section.kind]
    if "gyro" in sensed:
        gyro = rate + priors.site.vertical_rate * up[0]
        section = replace(section, gyro=gyro, gyro_var=np.full(3, gyro_var))
    if "acc" in sensed:
        section = replace(section, acc=force[0], acc_var=np.full(3, acc_var))
    return replace(section, acc_after=force[1]) if row.kind == "turn" else section
