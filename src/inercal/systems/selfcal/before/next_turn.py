"""The turns to make next: those after which the goals that are missing are met soonest."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.systems.selfcal.before.bounds import bounds
from inercal.systems.selfcal.filters.problem import FilterProblem
from inercal.systems.selfcal.platform.coefficients import divisor, to_product
from inercal.systems.selfcal.platform.joint_limits import beyond
from inercal.systems.selfcal.platform.plan import JointName, PlatformPlan, Turn, motion, of_joints
from inercal.systems.selfcal.platform.rig import JOINTS
from inercal.systems.selfcal.settings import SelfcalSettings

_ANGLES = (math.radians(90.0), math.radians(-90.0), math.radians(180.0), math.radians(-180.0))
"""Angles that a turn is tried with."""

_JOINT_NAMES: tuple[JointName, ...] = ("x", "y", "z")


@dataclass(frozen=True)
class NextTurns:
    """Turns in words, the time [s] after which they have met all goals, NaN where they do not, and ``worst``, the
    largest u over its goal at their end."""

    words: str
    time: float
    worst: float

    def sentence(self) -> str:
        """Advice: the turns, and what they bring."""
        if math.isfinite(self.time):
            return f"turn {self.words}: all goals are met after {self.time:.3g} s"
        return f"turn {self.words}: the worst is then {self.worst:.2g} times its goal"


def next_turns(
    settings: SelfcalSettings,
    problem: FilterProblem,
    coefficients: Array,
    covariance: Array,
    th: Array,
    wanted: Array,
) -> NextTurns | None:
    """The best of one or two turns by 90 and 180 deg from the gimbal angles ``th`` (3,) [rad]; None where none is
    possible.

    ``coefficients`` (p,), linear form, with their ``covariance`` (p, p) are what is known so far; ``wanted`` (p,)
    standard uncertainties [SI], inf without a goal. Turns that meet all goals come first, by their time; others by
    their worst coefficient. The attitude is taken as known from one reading of the encoders.
    """
    plan = settings.plan or PlatformPlan(())
    truth = to_product(problem.states.full(coefficients))
    by = np.abs(divisor(coefficients))
    found = []
    for moves in _sequences({JOINTS.index(name) for name in settings.fixed}):
        tried = settings.joints.kept(replace(plan, moves=moves, start=of_joints(th.tolist())))
        if beyond(tried, settings.limits, settings.joints):
            continue
        along = motion(tried, problem.world)
        u = bounds(along, problem, truth, history=True, known=covariance).history / by
        ratio = (u / wanted).max(axis=1)
        met = np.flatnonzero(ratio <= 1.0)
        time = float(along.t[met[0]]) if len(met) else math.nan
        found.append(NextTurns(tried.words(), time, float(ratio[-1])))
    in_time = [of for of in found if math.isfinite(of.time)]
    if in_time:
        return min(in_time, key=lambda of: of.time)
    return min(found, key=lambda of: of.worst, default=None)


def _sequences(fixed: set[int]) -> Iterator[tuple[Turn, ...]]:
    """One turn, and two about different joints."""
    turns = [
        Turn(joint, angle) for k, joint in enumerate(_JOINT_NAMES) if k not in fixed for angle in _ANGLES
    ]
    for turn in turns:
        yield (turn,)
    for first, second in itertools.product(turns, turns):
        if first.joint != second.joint:
            yield first, second
