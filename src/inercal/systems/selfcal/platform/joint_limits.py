"""Limits of the joints of a rig beside their angles: rates, accelerations, and regions that they keep out of."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from inercal.systems.selfcal.platform.plan import NO_LIMIT, PlatformPlan, Turn, of_joints
from inercal.systems.selfcal.platform.rig import JOINTS

Range = tuple[float, float]

ANY: Range = (-math.inf, math.inf)
"""The range of a joint that a region says nothing about."""

_SLACK = 1e-9
"""Angle [rad] that is rounding."""


@dataclass(frozen=True)
class ForbiddenAngles:
    """Angles that the joints may not have together: a range (low, high) [rad] of each, a whole turn more or less the
    same place; `ANY` where a joint does not matter."""

    ranges: tuple[Range, Range, Range] = (ANY, ANY, ANY)

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
class JointLimits:
    """Largest ``rate`` (3,) [rad/s] and ``acceleration`` (3,) [rad/s^2] of the joints x, y, z, and the regions that are
    ``forbidden``."""

    rate: tuple[float, float, float] = NO_LIMIT
    acceleration: tuple[float, float, float] = NO_LIMIT
    forbidden: tuple[ForbiddenAngles, ...] = ()

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
