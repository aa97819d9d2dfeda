"""Designing the path of a self-calibration: the path found beside named ones of the same time, by their bounds."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.computing.executors import Executor
from inercal.foundation.designs.search import Designed
from inercal.foundation.findings import Finding
from inercal.systems.selfcal.before.bounds import BAYESIAN_BOUNDS, PathBounds, bounds
from inercal.systems.selfcal.before.observability import Observability, observability
from inercal.systems.selfcal.before.path_search import criterion, search, shifts, unmodelled
from inercal.systems.selfcal.filters.problem import problem
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.joint_limits import beyond
from inercal.systems.selfcal.platform.plan import PATHS, Move, PlatformPlan, Rest, Turn, motion, path
from inercal.systems.selfcal.settings import Search, SelfcalSettings
from inercal.systems.selfcal.still_joints import without_fixed

Mask: TypeAlias = NDArray[np.bool_]

REFERENCES = (BAYESIAN_BOUNDS,)
"""Publications behind the judgement of a path."""


@dataclass(frozen=True, eq=False)
class ComparedPath:
    """A plan judged by its bounds and its ``criterion``, what it takes ``beyond`` limits, and how far each error that
    is ``unmodelled``, as large as stated or usual, shifts the coefficients (p,)."""

    name: str
    plan: PlatformPlan
    observability: Observability
    criterion: float
    beyond: tuple[str, ...]
    unmodelled: Mapping[str, Array] = field(default_factory=dict)

    @property
    def shifted(self) -> Array:
        """(p,) shift of the coefficients by the errors left out, all together."""
        return np.sqrt(
            sum(
                (np.square(each) for each in self.unmodelled.values()),
                np.zeros(len(self.observability.bounds.u)),
            )
        )

    def worst_shift(self) -> str:
        """The largest shift over u by errors left out, in words."""
        bounds = self.observability.bounds
        ratio = self.shifted / bounds.u
        k = int(np.argmax(ratio))
        by = max(self.unmodelled, key=lambda name: abs(float(self.unmodelled[name][k])))
        return f"{ratio[k]:.3g} u of {bounds.names[k]}, most by {by}"


@short_repr
@dataclass(frozen=True, eq=False)
class DesignedPath(Designed[ComparedPath]):
    """A path that was searched for, beside the study's own and the named ones that take no more than its time, each
    with a rest at its end. The findings: coefficients that the path cannot see, and gimbal lock where it comes
    close."""

    @property
    def bounds(self) -> PathBounds:
        """Bounds along it."""
        return self.compare[0].observability.bounds

    @property
    def result(self) -> dict[str, Any]:
        """The command's part of the JSON result: u in SI; turns as a study states them."""
        least = min(map(_log_volume, self.compare))
        entries = [_entry(each, least) for each in self.compare]
        return {**{key: value for key, value in entries[0].items() if key != "name"}, "compare": entries}

    def table(self) -> str:
        """The moves, the bounds of the path found, and the comparison, as aligned text."""
        first = self.compare[0]
        numbered = enumerate(stated_moves(first.plan.moves), start=1)
        moves = [f"{k:4d}  {what:<4}  {by:>10}" for k, (what, by, *_) in numbered]
        wide = max(len(each.name) for each in self.compare)
        lines = [f"{'path':<{wide}}  {'time [s]':>8}  {'criterion':>9}  {'worst u of prior':>23}  at prior"]
        for each in self.compare:
            learned = each.observability.learned
            k = int(np.argmax(learned.ratio))
            worst = f"{100 * learned.ratio[k]:.3g} % {learned.names[k]}"
            remark = ", ".join(each.observability.at_prior) or "none"
            beyond = f"; beyond the limits of {', '.join(each.beyond)}" if each.beyond else ""
            if each.unmodelled:
                beyond += f"; errors left out: {each.worst_shift()}"
            figures = f"{each.plan.duration:8.6g}  {each.criterion:9.3g}  {worst:>23}"
            lines.append(f"{each.name:<{wide}}  {figures}  {remark}{beyond}")
        return "\n".join(["   #  move", *moves, "", first.observability.table(), "", *lines])


def design(
    settings: SelfcalSettings,
    progress: Callable[[int, int], None] = lambda done, total: None,
    executor: Executor | None = None,
) -> DesignedPath:
    """Search for a path within rate, time and limits of the study, and set it beside others.

    Bounds are those of the nominal path: the prior of the coefficients is enough. ``progress`` is told (done, total)
    of the starts, which the ``executor`` computes.

    Raises StudyError where no time is stated, or no turn fits into time and limits.
    """
    settings = without_fixed(settings)[0]
    best = search(settings, progress, executor)
    asked = settings.search
    plans = {"found": best}
    if settings.plan is not None:
        plans["study"] = lasting(settings.plan, best.duration)
    for name in PATHS:
        other = settings.joints.kept(replace(path(name, best.step), rate=best.rate, start=best.start))
        left = best.duration - other.duration
        if any(isinstance(move, Turn) and f"th_{move.joint}" in settings.fixed for move in other.moves):
            continue
        if left > -best.step / 2.0 and (settings.plan is None or other.moves != settings.plan.moves):
            plans[name] = lasting(other, best.duration)
    judged = tuple(_compared(name, plan, settings) for name, plan in plans.items())
    lock = float(np.abs(np.cos(best.angles()[:, 1])).min())
    near = []
    if lock < LIMITS.path_cosine:
        text = f"|cos| of the inner gimbal angle goes down to {lock:.2g} on the path found"
        near = [Finding("gimbal_lock", text, harm=())]
    by = {"worst": "largest u", "mean": "geometric mean of u"}[asked.criterion]
    return DesignedPath(
        judged,
        f"up to {asked.turns} turns of multiples of {math.degrees(asked.angle):g} deg in {best.duration:g} s, by the "
        f"{by} over {'goal or prior' if settings.goal else 'prior'}{_counted(asked)}: {best.words()}",
        (*judged[0].observability.findings(), *near),
    )


def lasting(plan: PlatformPlan, time: float) -> PlatformPlan:
    """The plan with a rest at the end that makes it last ``time`` [s]."""
    left = time - plan.duration
    return replace(plan, moves=(*plan.moves, Rest(left))) if left > plan.step / 2.0 else plan


def with_stops(plan: PlatformPlan, angle: float, rate: float) -> PlatformPlan:
    """Multi-position calibration on the same path and of the same time: turns in parts of at most ``angle`` [rad] at a
    higher ``rate`` [rad/s], and rests of equal length after each. Raises ValueError where the turns alone take longer.
    """
    parts = []
    for move in plan.moves:
        if isinstance(move, Turn):
            number = math.ceil(abs(move.angle) / angle - 1e-9)
            parts += [Turn(move.joint, move.angle / number, rate)] * number
    rest = (plan.duration - replace(plan, moves=tuple(parts)).duration) / len(parts)
    if rest < 0.0:
        raise ValueError(f"found turns at {rate:g} rad/s longer than the plan, expected a higher rate")
    rest = plan.step * math.floor(rest / plan.step + 1e-9)
    stopping = replace(plan, moves=tuple(move for part in parts for move in (part, Rest(rest))))
    return lasting(stopping, plan.duration)


def at_rest(plan: PlatformPlan) -> Mask:
    """Rows (n, 4) measured at rest alone, for `inercal.systems.selfcal.before.bounds`."""
    resting = [isinstance(move, Rest) for move in plan.moves]
    rows = np.repeat([False, *resting], [1, *map(plan.steps, plan.moves)])
    return np.repeat(rows[:, None], 4, axis=1)


def stated_moves(moves: tuple[Move, ...]) -> list[list[str]]:
    """Moves as a study states them: joint, angle and, unless it is the plan's, the rate; or a rest."""
    texts = []
    for move in moves:
        if isinstance(move, Rest):
            texts.append(["rest", f"{move.duration:.10g} s"])
        else:
            rate = [] if move.rate is None else [f"{math.degrees(move.rate):.10g} deg/s"]
            texts.append([move.joint, f"{math.degrees(move.angle):.10g} deg", *rate])
    return texts


def _compared(name: str, plan: PlatformPlan, settings: SelfcalSettings) -> ComparedPath:
    """A plan judged by its bounds."""
    commanded = motion(plan, settings.world)
    temperature = settings.simulated_temperature(len(commanded.t))
    warm = None if temperature is None else settings.warm(temperature)
    along = bounds(commanded, problem(settings), warm=warm)
    of = unmodelled(settings)
    moved = shifts(commanded, problem(settings), of, warm)
    value = criterion(along, settings.goal, settings.search.criterion, np.square(moved).sum(axis=1))
    by_error = dict(zip(of.names, moved.T, strict=True))
    return ComparedPath(
        name,
        plan,
        observability(along, settings.goal),
        value,
        tuple(beyond(plan, settings.limits, settings.joints)),
        by_error,
    )


def _counted(asked: Search) -> str:
    """Errors that count beside the bound, in words."""
    return f", with what {', '.join(asked.robust)} left out do to it" if asked.robust else ""


def _log_volume(judged: ComparedPath) -> float:
    """Mean logarithm of the share of its prior that is left of each combination."""
    return float(np.mean(np.log(judged.observability.learned.left)))


def _entry(judged: ComparedPath, least: float) -> dict[str, Any]:
    """A path for JSON; ``d_efficiency`` is 1 for the one of the comparison with the smallest confidence ellipsoid."""
    learned = judged.observability.learned
    return {
        "name": judged.name,
        "turns": stated_moves(judged.plan.moves),
        "time": judged.plan.duration,
        "rank": judged.observability.rank,
        "condition": learned.condition,
        "d_efficiency": math.exp(least - _log_volume(judged)),
        "criterion": judged.criterion,
        "predicted": dict(
            zip(judged.observability.bounds.names, judged.observability.bounds.u.tolist(), strict=True)
        ),
        "at_prior": list(judged.observability.at_prior),
        "worst_combinations": judged.observability.worst(),
        "beyond": list(judged.beyond),
        "left_out": dict(zip(judged.observability.bounds.names, judged.shifted.tolist(), strict=True))
        if judged.unmodelled
        else {},
    }
