"""Turn plans as data, and the motion that they command: angles, rates of the platform, time."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.keys import RATE, TIME, quantity
from inercal.systems.selfcal.platform.rig import JOINTS, World

JointName = Literal["x", "y", "z"]


@dataclass(frozen=True)
class Turn:
    """A turn of one joint (``x`` outer, ``y`` inner, ``z`` platform) by ``angle`` [rad] at ``rate`` [rad/s], None for
    that of the plan."""

    joint: JointName
    angle: float
    rate: float | None = None


@dataclass(frozen=True)
class Rest:
    """A pause of ``duration`` [s]; the platform goes on turning against earth rate."""

    duration: float


Move: TypeAlias = Turn | Rest

NO_LIMIT = (math.inf, math.inf, math.inf)
"""Of each joint."""


def of_joints(values: Iterable[float]) -> tuple[float, float, float]:
    """The three values of the joints x, y, z."""
    x, y, z = values
    return x, y, z


@short_repr
@dataclass(frozen=True)
class PlatformPlan:
    """Moves one after the other from the angles ``start`` [rad], with rows every ``step`` [s].

    A move takes a whole number of rows: its rate is lowered where it does not come out even. A turn gains and loses its
    rate at the ``acceleration`` (3,) [rad/s^2] of its joint, at once where that is infinite.
    """

    moves: tuple[Move, ...]
    rate: float = quantity("of the turns", "rate", "1 deg/s", bounds=RATE)
    step: float = quantity("from row to row", "time", "0.2 s", bounds=TIME)
    start: tuple[float, float, float] = quantity(
        "angles of the joints x, y, z at the start; 0 if absent", "angle", (0.0, 0.0, 0.0),
        example=["0 deg", "0 deg", "0 deg"], of="x, y, z",
    )  # fmt: skip
    acceleration: tuple[float, float, float] = NO_LIMIT

    def steps(self, move: Move) -> int:
        """Number of rows that a move takes."""
        duration = move.duration if isinstance(move, Rest) else self._turning(move)
        return math.ceil(min(duration / self.step - 1e-9, sys.maxsize))  # so many are refused, but counted

    @property
    def duration(self) -> float:
        """Time of all moves [s]."""
        return self.step * sum(map(self.steps, self.moves))

    def angles(self, parts: int = 1) -> Array:
        """(n, 3) nominal gimbal angles [rad] at each row, the first at the start; between two rows at the ends of
        ``parts`` as long as each other."""
        at, rows = np.array(self.start), [np.array([self.start])]
        for move in self.moves:
            n, by = self.steps(move) * parts, np.zeros(3)
            done = np.zeros((n, 1))
            if isinstance(move, Turn):
                joint = "xyz".index(move.joint)
                by[joint] = move.angle
                lasts = self.step * n / parts
                done = _gained(
                    np.arange(1, n + 1) / max(n, 1), self.acceleration[joint], abs(move.angle), lasts
                )[:, None]
            rows.append(at + by * done)
            at = at + by
        return np.concatenate(rows)

    def _turning(self, turn: Turn) -> float:
        """Time [s] of a turn."""
        rate, angle = turn.rate or self.rate, abs(turn.angle)
        most = self.acceleration["xyz".index(turn.joint)]
        if angle * most < rate**2:  # it never comes to its rate
            return 2.0 * math.sqrt(angle / most)
        return angle / rate + rate / most

    def beyond(self, limits: Mapping[str, tuple[float, float]]) -> list[str]:
        """Names of the joints that the plan takes beyond their ``limits`` [rad]."""
        angles = self.angles()
        low, high = angles.min(axis=0), angles.max(axis=0)
        slack = 1e-9
        return [
            name
            for k, name in enumerate(JOINTS)
            if name in limits and (low[k] < limits[name][0] - slack or high[k] > limits[name][1] + slack)
        ]

    def words(self) -> str:
        """The moves in words: ``(z +180 deg), (rest 60 s)``."""
        return ", ".join(
            f"(rest {move.duration:g} s)"
            if isinstance(move, Rest)
            else f"({move.joint} {math.degrees(move.angle):+g} deg)"
            for move in self.moves
        )


def _gained(part: Array, acceleration: float, angle: float, lasts: float) -> Array:
    """Parts of a turn of ``angle`` [rad] that are done after a ``part`` (n,) of its time, which is ``lasts`` [s]: a
    trapezoid of rate."""
    need = 4.0 * angle / acceleration if lasts > 0.0 else 0.0  # of the square of the time, at least
    rate = (
        2.0 / (1.0 + math.sqrt(max(1.0 - need / lasts**2, 0.0))) if lasts > 0.0 else 1.0
    )  # over the mean one
    ramp = rate * angle / (acceleration * lasts**2) if lasts > 0.0 else 0.0  # part of the time
    up, down = np.maximum(ramp - part, 0.0), np.maximum(part - (1.0 - ramp), 0.0)
    bent = (np.square(up) - np.square(down)) / (2.0 * ramp) if ramp > 0.0 else 0.0
    return np.asarray(rate * (part - 0.5 * ramp + bent))


@dataclass(frozen=True, eq=False)
class CommandedMotion:
    """Motion that a plan commands: ``t`` (n,) [s], nominal ``angles`` (n, 3) [rad], and the ``rate`` (n - 1, 3) [rad/s]
    of the platform against inertial space, in p, held from each row to the next."""

    t: Array
    angles: Array
    rate: Array


def motion(plan: PlatformPlan, world: World) -> CommandedMotion:
    """The commanded motion of a plan: ``w_c = J(th) th' + C_pb w_Ib^b`` at the middle of each step."""
    from inercal.systems.selfcal.platform.kinematics import (
        commanded_rates,  # here, so that reading a study loads no compiler
    )

    angles = plan.angles()
    rate = np.empty((len(angles) - 1, 3))
    commanded_rates(angles, np.full(len(rate), plan.step), world.earth, world.axes, world.signs, rate)
    return CommandedMotion(plan.step * np.arange(len(angles), dtype=float), angles, rate)


#: name -> pairs of joint and angle [deg], all at 1 deg/s
PATHS: Mapping[str, tuple[tuple[JointName, float], ...]] = {
    "paper": (("z", 180.0), ("x", 90.0), ("z", -180.0), ("x", 90.0)),
    "paper two turns": (("z", 180.0), ("x", 180.0)),
    "best": (("x", -90.0), ("z", -210.0), ("x", -60.0), ("z", 90.0), ("x", -90.0)),
    "plain": (("x", 90.0), ("z", 180.0), ("x", 90.0), ("z", -90.0), ("x", 90.0)),
}


def path(name: str, step: float = 0.2) -> PlatformPlan:
    """A named path at 1 deg/s; raises KeyError for an unknown name."""
    return PlatformPlan(tuple(Turn(joint, math.radians(angle)) for joint, angle in PATHS[name]), step=step)
