"""Turn plans as data, and the motion that they command: angles, rates of the platform, time."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from inercal.arrays import Array, short_repr
from inercal.selfcal.platform.rig import JOINTS, World

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


@short_repr
@dataclass(frozen=True)
class Plan:
    """Moves one after the other from the angles ``start`` [rad], with rows every ``step`` [s].

    A move takes a whole number of rows: its rate is lowered where it does not come out even.
    """

    moves: tuple[Move, ...]
    rate: float = math.radians(1.0)
    step: float = 0.2
    start: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def steps(self, move: Move) -> int:
        """Number of rows that a move takes."""
        duration = move.duration if isinstance(move, Rest) else abs(move.angle) / (move.rate or self.rate)
        return math.ceil(min(duration / self.step - 1e-9, sys.maxsize))  # so many are refused, but counted

    @property
    def duration(self) -> float:
        """Time of all moves [s]."""
        return self.step * sum(map(self.steps, self.moves))

    def angles(self) -> Array:
        """(n, 3) nominal gimbal angles [rad] at each row, the first at the start."""
        at, rows = np.array(self.start), [np.array([self.start])]
        for move in self.moves:
            n, by = self.steps(move), np.zeros(3)
            if isinstance(move, Turn):
                by["xyz".index(move.joint)] = move.angle
            rows.append(at + by * (np.arange(1, n + 1) / max(n, 1))[:, None])
            at = at + by
        return np.concatenate(rows)

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


@dataclass(frozen=True, eq=False)
class CommandedMotion:
    """Motion that a plan commands: ``t`` (n,) [s], nominal ``angles`` (n, 3) [rad], and the ``rate`` (n - 1, 3) [rad/s]
    of the platform against inertial space, in p, held from each row to the next."""

    t: Array
    angles: Array
    rate: Array


def motion(plan: Plan, world: World) -> CommandedMotion:
    """The commanded motion of a plan: ``w_c = J(th) th' + C_pb w_Ib^b`` at the middle of each step."""
    from inercal.selfcal.platform.kinematics import (
        commanded_rates,  # here, so that reading a study loads no compiler
    )

    angles = plan.angles()
    rate = np.empty((len(angles) - 1, 3))
    commanded_rates(angles, plan.step, world.earth, world.axes, world.signs, rate)
    return CommandedMotion(plan.step * np.arange(len(angles), dtype=float), angles, rate)


#: name -> pairs of joint and angle [deg], all at 1 deg/s
PATHS: Mapping[str, tuple[tuple[JointName, float], ...]] = {
    "paper": (("z", 180.0), ("x", 90.0), ("z", -180.0), ("x", 90.0)),
    "paper two turns": (("z", 180.0), ("x", 180.0)),
    "best": (("x", -90.0), ("z", -210.0), ("x", -60.0), ("z", 90.0), ("x", -90.0)),
    "plain": (("x", 90.0), ("z", 180.0), ("x", 90.0), ("z", -90.0), ("x", 90.0)),
}


def path(name: str, step: float = 0.2) -> Plan:
    """A named path at 1 deg/s; raises KeyError for an unknown name."""
    return Plan(tuple(Turn(joint, math.radians(angle)) for joint, angle in PATHS[name]), step=step)
