"""Limits of the joints of a rig beside their angles: rates, accelerations, and regions that they keep out of."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from inercal.foundation.errors import InputError
from inercal.foundation.keys import RATE, above_zero, quantity, table
from inercal.systems.selfcal.platform.plan import NO_LIMIT, PlatformPlan, Turn, of_joints
from inercal.systems.selfcal.platform.rig import JOINTS

Range = tuple[float, float]

ANY: Range = (-math.inf, math.inf)
"""The range of a joint that a region says nothing about."""

_SLACK = 1e-9
"""Angle [rad] that is rounding."""


_ENDS = "the lowest, the highest angle"


@dataclass(frozen=True)
class JointRanges:
    """Ranges within which the gimbals turn; no limits if absent."""

    x: Range | None = quantity(
        "lowest and highest outer angle", "angle", example=["-180 deg", "180 deg"], of=_ENDS
    )
    y: Range | None = quantity("of the inner joint", "angle", example=["-80 deg", "80 deg"], of=_ENDS)
    z: Range | None = quantity(
        "of the joint of the platform", "angle", example=["-360 deg", "360 deg"], of=_ENDS
    )

    def __post_init__(self) -> None:
        """Refuse ends out of order."""
        for name, (low, high) in self.by_joint.items():
            if not low < high:
                found = f"found {math.degrees(low):.6g} deg to {math.degrees(high):.6g} deg"
                raise InputError(name[-1], f"{found}, expected the lower end first")

    @property
    def by_joint(self) -> dict[str, Range]:
        """Ranges of the joints that have one, by name of the angle."""
        return {name: ends for name in JOINTS if (ends := getattr(self, name[-1])) is not None}


@dataclass(frozen=True)
class ForbiddenAngles(JointRanges):
    """Angles that the joints may not have together, whole turns aside; any angle of a joint that is absent."""

    def __post_init__(self) -> None:
        """Refuse a region without angles."""
        super().__post_init__()
        if not self.by_joint:
            raise InputError("", "found no angles, expected those of a joint")

    @property
    def ranges(self) -> tuple[Range, Range, Range]:
        """Range of each joint."""
        return self.x or ANY, self.y or ANY, self.z or ANY

    def meets(self, low: tuple[float, float, float], high: tuple[float, float, float]) -> bool:
        """True where angles between ``low`` and ``high`` (3,) [rad] of each joint lie in the region; its edges do not
        belong to it."""
        return all(
            _overlap((begin, end), asked) for begin, end, asked in zip(low, high, self.ranges, strict=True)
        )


def _overlap(part: Range, asked: Range) -> bool:
    """True where angles (begin, end), or one and the same, lie within a range but for whole turns."""
    low, high = asked[0] + _SLACK, asked[1] - _SLACK
    if math.isinf(low) or math.isinf(high):
        return part[1] > low and part[0] < high
    turns = math.ceil((part[0] - high) / (2.0 * math.pi))
    while turns * 2.0 * math.pi + high <= part[0]:
        turns += 1
    return turns * 2.0 * math.pi + low < part[1]


@dataclass(frozen=True)
class FixedJoints:
    """Joints that do not turn, of a rig of one or two axes; a record needs no column of their angles."""

    x: float | None = quantity("outer angle", "angle", example="0 deg", exact=True)
    y: float | None = quantity("of the inner joint", "angle", example="0 deg", exact=True)
    z: float | None = quantity("of the joint of the platform", "angle", example="0 deg", exact=True)

    def __post_init__(self) -> None:
        """Refuse a rig of which nothing turns."""
        if len(self.by_joint) == len(JOINTS):
            raise InputError("", "found all joints, expected one that turns")

    @property
    def by_joint(self) -> dict[str, float]:
        """Angle [rad] of the joints that do not turn, by name."""
        return {name: angle for name in JOINTS if (angle := getattr(self, name[-1])) is not None}


_JOINTS = "the joints x, y, z"


@dataclass(frozen=True)
class JointLimits:
    """Limits of the joints x, y, z: rates and accelerations (3,), and regions."""

    rate: tuple[float, float, float] = quantity(
        "largest rate of the joints, one for all or x, y, z; those of the plan if absent", "rate", NO_LIMIT,
        example=["5 deg/s", "2 deg/s", "5 deg/s"], bounds=RATE, name="joint_rate", of=_JOINTS, one=True,
    )  # fmt: skip
    acceleration: tuple[float, float, float] = quantity(
        "by which turns begin and end, one for all or x, y, z; at once if absent", "rate ramp", NO_LIMIT,
        example=["2 deg/s^2", "1 deg/s^2", "2 deg/s^2"], bounds=above_zero("an acceleration"),
        name="joint_acceleration", of=_JOINTS, one=True,
    )  # fmt: skip
    forbidden: tuple[ForbiddenAngles, ...] = table(
        "regions that no path of the rig may touch, such as where something is in the way", (),
        example=[{"x": ["80 deg", "100 deg"], "y": ["20 deg", "60 deg"]}],
    )  # fmt: skip

    def kept(self, plan: PlatformPlan) -> PlatformPlan:
        """The plan with turns that state no rate as slow as their joint, and with the accelerations of the joints."""
        moves = tuple(
            replace(move, rate=self.rate["xyz".index(move.joint)])
            if isinstance(move, Turn) and move.rate is None and self.rate["xyz".index(move.joint)] < plan.rate
            else move
            for move in plan.moves
        )
        return replace(plan, moves=moves, acceleration=self.acceleration)


def beyond(plan: PlatformPlan, angles: Mapping[str, Range], limits: JointLimits) -> list[str]:
    """Limits that a plan breaks: names of joints whose ``angles`` [rad] do, in words what else does."""
    fast = {
        f"rate of th_{move.joint}"
        for move in plan.moves
        if isinstance(move, Turn)
        and (move.rate or plan.rate) > limits.rate["xyz".index(move.joint)] * (1.0 + _SLACK)
    }
    steep = [
        f"acceleration of {name}"
        for name, of_plan, most in zip(JOINTS, plan.acceleration, limits.acceleration, strict=True)
        if of_plan > most
    ]
    regions = [
        f"forbidden region {k}"
        for k, region in enumerate(limits.forbidden, 1)
        if any(region.meets(*span) for span in spans(plan))
    ]
    return [*plan.beyond(angles), *sorted(fast), *steep, *regions]


def spans(plan: PlatformPlan) -> Iterator[tuple[tuple[float, float, float], tuple[float, float, float]]]:
    """Lowest and highest angles (3,) [rad] of each move; those of the start alone where there is none."""
    at = plan.start
    for move in plan.moves:
        if isinstance(move, Turn):
            to = of_joints(
                angle + (move.angle if k == "xyz".index(move.joint) else 0.0) for k, angle in enumerate(at)
            )
            yield of_joints(map(min, at, to)), of_joints(map(max, at, to))
            at = to
        else:
            yield at, at
    if not plan.moves:
        yield at, at
