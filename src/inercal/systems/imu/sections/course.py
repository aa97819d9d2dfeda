"""The course of a test: how a unit stands and turns through sections, one after the other, as somebody places it.

Attitudes q_nb have n with x north and z up. Rotations are finite ones, so that rates are exact at every sample. Nothing
of the fit is used here.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Final

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import StudyError
from inercal.foundation.geometry.rotations import conjugate, exp, log, multiply, rotate
from inercal.systems.imu.sections.cutting.table import SectionRow
from inercal.systems.imu.simulate import hand_poses

_SWING: Final = 0.6
"""Rate of a swing [rad/s], standard deviation of each component."""

_SWAY: Final = 1.0
"""Time [s] for which a swing turns about one axis."""


@dataclass(frozen=True)
class Pace:
    """Lengths [s] of a rest, of a motion, and the standard uncertainty [rad] of directions that state none."""

    hold: float
    turning: float
    placing: float
    level: float | None = None


@dataclass(frozen=True, eq=False)
class CoursePiece:
    """A stretch of ``length`` [s] by a name, empty for the way between sections, from the attitude ``q`` (4,) on.

    It turns by the rotation vector ``step`` (3,) of the body, from rest to rest where ``smooth``, else at a steady
    rate. ``force`` (3,) [m/s^2] is what is felt in the place of gravity, ``session`` that of its section.
    """

    name: str
    length: float
    q: Array
    step: Array = field(default_factory=lambda: np.zeros(3))
    smooth: bool = True
    force: Array | None = None
    session: str = ""

    @property
    def end(self) -> Array:
        """Attitude (4,) at its end."""
        return np.asarray(multiply(self.q, exp(self.step)))

    def at(self, part: Array) -> tuple[Array, Array, Array]:
        """Attitudes (n, 4), rates and angular accelerations (n, 3) at these parts (n,) of its length."""
        if self.smooth:
            angle = part**3 * (10.0 - 15.0 * part + 6.0 * part**2)
            speed = 30.0 * part**2 * (1.0 - part) ** 2
            change = 60.0 * part * (1.0 - part) * (1.0 - 2.0 * part)
        else:
            angle, speed, change = part, np.ones_like(part), np.zeros_like(part)
        q = multiply(self.q, exp(angle[:, None] * self.step))
        return q, speed[:, None] * self.step / self.length, change[:, None] * self.step / self.length**2


def course(rows: Sequence[SectionRow], pace: Pace, rng: np.random.Generator | None) -> list[CoursePiece]:
    """The pieces of sections one after the other, with the ways between them.

    A section lasts as long as its times say, else as the pace has it. Directions, rates and angles are off by what is
    said of their uncertainty; without a generator they are as stated. Directions that nobody knows are spread over the
    sphere.

    Raises
    ------
    StudyError
        A turn without an angle, a rate without one, or a force of another recording.
    """
    pieces: list[CoursePiece] = []
    moves: list[SectionRow] = []
    placed = _Placed(pace, rng, sum(_lost(row) for row in rows))
    for row in rows:
        if row.kind == "move":
            moves.append(row)
            continue
        made = list(_of(row, pace, placed))
        if pieces:
            pieces.append(_way(pieces[-1], made[0], moves, pace))
        pieces += made
        moves = []
    return pieces


def _lost(row: SectionRow) -> bool:
    """True of a rest in a direction that nobody knows."""
    return row.kind == "rest" and row.up is None and row.force is None


def _way(before: CoursePiece, after: CoursePiece, moves: Sequence[SectionRow], pace: Pace) -> CoursePiece:
    """The way from a section to the next, by the name of the move that stands between them."""
    step = log(multiply(conjugate(before.end), after.q))
    move = moves[0] if moves else SectionRow("", kind="move")
    return CoursePiece(move.section, _length(move, pace.turning), before.end, step, session=after.session)


def _length(row: SectionRow, usual: float) -> float:
    """Length [s] of a section by its times."""
    return usual if row.begin is None or row.end is None else row.end - row.begin


def _of(row: SectionRow, pace: Pace, placed: _Placed) -> Iterator[CoursePiece]:
    """The pieces of a section."""
    where = f"section {row.section}"
    if isinstance(row.force, tuple):
        raise StudyError(where, "found channels as force, expected a direction to simulate, or three numbers")
    piece = CoursePiece(
        row.section, _length(row, pace.hold), np.zeros(4), force=row.force, session=row.session
    )
    if row.kind == "rest":
        yield replace(piece, q=placed.upright(placed.up(row)))
        return
    if row.kind == "swing":
        q = placed.upright(placed.up(row))
        count = max(round(_length(row, 20.0 * pace.hold) / _SWAY), 1)
        for _ in range(count):
            one = replace(piece, length=_SWAY, q=q, step=_SWAY * placed.normal(_SWING), smooth=False)
            yield one
            q = one.end
        return
    axis, up = placed.axis_and_up(row)
    q = placed.upright(up)
    if row.kind == "rate":
        if row.rate is None or row.rate.value == 0.0:
            raise StudyError(f"{where}, rate", "found none, expected one to simulate, such as 30 deg/s")
        rate = placed.rate(row)
        whole = 2.0 * np.pi / abs(rate)
        length = _length(row, whole * np.ceil(pace.hold / whole))
        yield replace(piece, length=length, q=q, step=rate * length * axis, smooth=False)
        return
    if row.angle is None:
        raise StudyError(f"{where}, angle", "found none, expected one to simulate, such as 360 deg")
    step = axis * (row.angle.value + placed.normal(row.angle.u)[0])
    turning = pace.turning if row.begin is None or row.end is None else 0.5 * (row.end - row.begin)
    rest = pace.hold if row.begin is None or row.end is None else 0.5 * turning
    yield replace(piece, length=rest, q=q)
    yield replace(piece, length=turning, q=q, step=step)
    yield replace(piece, length=rest, q=np.asarray(multiply(q, exp(step))))


class _Placed:
    """Somebody who places a unit: directions and rates as they are, each as often off as is said of it.

    Sections of one setup are off alike, and so are rates of one group.
    """

    def __init__(self, pace: Pace, rng: np.random.Generator | None, lost: int) -> None:
        self.pace, self.rng = pace, rng
        self.drawn: dict[str, Array] = {}
        poses = hand_poses(rng or np.random.default_rng(0), lost) if lost else np.zeros((0, 4))
        self.ways = iter(rotate(conjugate(poses), np.array([0.0, 0.0, 1.0])))

    def normal(self, size: float) -> Array:
        """Errors (3,) of this standard deviation."""
        return np.zeros(3) if self.rng is None else self.rng.normal(0.0, size, 3)

    def up(self, row: SectionRow) -> Array:
        """The direction (3,) that points up."""
        if row.up is None:
            return next(self.ways, np.array([0.0, 0.0, 1.0])) if _lost(row) else np.array([0.0, 0.0, 1.0])
        return self._tilted(row.up, row, "up")

    def axis_and_up(self, row: SectionRow) -> tuple[Array, Array]:
        """The axis (3,) of a rotation, and the direction that points up, along it where nothing is said of that."""
        axis = self._way(row) if row.axis is None else self._tilted(row.axis, row, "axis")
        level = row.level if row.level is not None else self.pace.level
        top = row.up if row.up is not None else row.axis if row.axis is not None else axis
        if level is not None:
            end = axis if axis @ top >= 0.0 else -axis
            return axis, _off(end, self._error(row, "level", level))
        return axis, self._tilted(top, row, "up")

    def rate(self, row: SectionRow) -> float:
        """The rate of a section [rad/s]."""
        assert row.rate is not None
        value, u = row.rate.value, row.rate.u
        if not row.rate_group:
            return float(value + self.normal(u)[0])
        error = self.drawn.setdefault(f"rate {row.rate_group}", self.normal(u / abs(value)))
        return float(value * (1.0 + error[0]))

    def upright(self, up: Array) -> Array:
        """An attitude (4,) in which a direction of the body points up, at any heading."""
        across = np.cross(up, [0.0, 0.0, 1.0])
        size = float(np.linalg.norm(across))
        level = np.array([1.0, 0.0, 0.0, 0.0] if up[2] > 0.0 else [0.0, 1.0, 0.0, 0.0])
        if size > 1e-12:
            level = exp(across / size * np.arctan2(size, up[2]))
        heading = 0.0 if self.rng is None else self.rng.uniform(-np.pi, np.pi)
        return np.asarray(multiply(exp(np.array([0.0, 0.0, heading])), level))

    def _way(self, row: SectionRow) -> Array:
        """Any direction (3,), the same in all sections of a setup."""
        drawn = self.drawn.setdefault(f"way {row.setup or row.section}", self.normal(1.0))
        return drawn / np.linalg.norm(drawn) if drawn.any() else np.array([0.0, 0.0, 1.0])

    def _tilted(self, direction: Array, row: SectionRow, what: str) -> Array:
        """A direction (3,) as it is."""
        return _off(
            direction, self._error(row, what, self.pace.placing if row.placing is None else row.placing)
        )

    def _error(self, row: SectionRow, what: str, size: float) -> Array:
        """The error (3,) [rad] of a direction, the same in all sections of a setup."""
        if not row.setup:
            return self.normal(size)
        return self.drawn.setdefault(f"{what} {row.setup}", self.normal(size))


def _off(direction: Array, error: Array) -> Array:
    """A direction (3,) turned by the part of an error across it."""
    return np.asarray(rotate(exp(error - direction * (direction @ error)), direction))


def sampled(pieces: Sequence[CoursePiece], rate: float) -> Iterator[tuple[CoursePiece, Array, Array, Array]]:
    """Each piece with attitudes (n, 4), rates and angular accelerations (n, 3) at its samples, ``rate`` [Hz]; samples
    of a sequence of pieces are evenly spaced."""
    ends = np.cumsum([0.0, *(piece.length for piece in pieces)])
    for piece, (begin, end) in zip(pieces, pairwise(ends), strict=True):
        t = np.arange(np.ceil(begin * rate - 1e-9), np.ceil(end * rate - 1e-9)) / rate
        yield piece, *piece.at((t - begin) / piece.length)
