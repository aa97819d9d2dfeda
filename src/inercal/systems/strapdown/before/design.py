"""Design of a test: what the turns of a plan tell, and a better path of the same time."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.designs.search import Designed
from inercal.foundation.errors import StudyError
from inercal.foundation.findings import Finding
from inercal.foundation.geometry.rotations import elementary
from inercal.foundation.inference.identifiability import HALF_SEEN, UNSEEN
from inercal.foundation.instruments.terms import TERMS, shown_unit
from inercal.foundation.records.places import counted, counted_names
from inercal.foundation.results.remarks import at_prior_together
from inercal.foundation.results.shown import Table, heads, short
from inercal.systems.strapdown.before.bounds import Pieces, PlanBounds, bounds
from inercal.systems.strapdown.before.path_search import Path, TurnGround, attitudes, search
from inercal.systems.strapdown.limits import LIMITS
from inercal.systems.strapdown.model.coefficients import ALWAYS, group_of
from inercal.systems.strapdown.settings import StrapdownSettings, TurnPlan
from inercal.systems.strapdown.simulate import AXES, start_attitude

REFERENCES: Final = (
    "H. L. Van Trees, Detection, Estimation, and Modulation Theory, Part I, Wiley (1968), section 2.4",
    "V. V. Fedorov, Theory of Optimal Experiments, Academic Press (1972): exchange",
)

_QUARTER: Final = 0.5 * math.pi

NINETEEN: Final = tuple(
    ("xyz".index(turn[-1]), -_QUARTER if turn[0] == "-" else _QUARTER)
    for turn in [
        "y",
        "y",
        "y",
        "-y",
        "-y",
        "-y",
        "z",
        "x",
        "x",
        "x",
        "-x",
        "-x",
        "-x",
        "z",
        "z",
        "-z",
        "-z",
        "-z",
    ]
)
"""Turns of the path of 19 positions, which begins with pitch 0, roll -90 deg."""

_NINETEEN_START = (0.0, -_QUARTER, 0.0)

_TOLD = 3
"""Coefficients that the table names beside a turn."""


@dataclass(frozen=True, eq=False)
class ComparedPlan:
    """A plan, its bounds, and the ``ratio`` (q,) of their u to the goal."""

    name: str
    plan: TurnPlan
    bounds: PlanBounds
    ratio: Array

    @property
    def mean(self) -> float:
        """Geometric mean of the ratios."""
        return float(np.exp(np.mean(np.log(self.ratio))))


@short_repr
@dataclass(frozen=True, eq=False)
class DesignedTurns(Designed[ComparedPlan]):
    """A plan beside others of the same time: ``goal`` (q,) [SI] of each coefficient; ``tried`` paths, 0 without a
    search."""

    goal: Array
    tried: int

    @property
    def bounds(self) -> PlanBounds:
        """Bounds along it."""
        return self.compare[0].bounds

    @property
    def result(self) -> dict[str, Any]:
        """The command's part of the JSON result: u in SI; turns as a study states them."""
        first, names = self.bounds, self.bounds.names
        entries = [_entry(each) for each in self.compare]
        return {
            **{key: value for key, value in entries[0].items() if key != "name"},
            "start": [f"{math.degrees(angle):.10g} deg" for angle in self.plan.start],
            "prior": dict(zip(names, first.prior.tolist(), strict=True)),
            "goal": dict(zip(names, self.goal.tolist(), strict=True)),
            "by_turn": [
                {"turn": turn, "tells": dict(told)}
                for turn, told in zip(stated_turns(self.plan), _told(first), strict=True)
            ],
            "tried": self.tried,
            "compare": entries,
        }

    def tables(self) -> list[Table]:
        """Turns and what each tells, the bounds, and the comparison."""
        return [_turns(self.plan, self.bounds), _bounds(self), _comparison(self)]


def design(
    settings: StrapdownSettings, progress: Callable[[int, int], None] = lambda done, total: None
) -> DesignedTurns:
    """Judge the plan of a study by its bounds, and search for a better one where it has a ``design``.

    ``progress`` is told (done, total) of the random starts. Raises `StudyError` without turns and without a search, and
    where the time is too short for the turns.
    """
    asked, given = settings.design, settings.plan or TurnPlan()
    if asked is None and not given.turns:
        raise StudyError("plan.turns", "missing, expected turns, or a table [design] to search for them")
    pieces = Pieces(settings)
    of_nineteen = replace(given, turns=NINETEEN, start=_NINETEEN_START)
    goal = _goal(settings, _sound(bounds(pieces, of_nineteen)))
    plans, tried = dict[str, TurnPlan](), 0
    if asked is not None:
        ground = _ground_of(pieces, given, goal)
        path, tried = search(ground, np.random.default_rng(asked.seed), progress)
        plans["found"] = _plan_of(ground, path, given)
    if given.turns:
        plans["study"] = given
    time = next(iter(plans.values())).duration
    plans["19 positions"] = of_nineteen
    compared = list[ComparedPlan]()
    for name, plan in plans.items():
        lasting = _lasting(plan, time)
        if not compared or lasting.dwell >= _shortest(settings):
            along = _sound(bounds(pieces, lasting))
            compared.append(ComparedPlan(name, lasting, along, along.u / goal))
    best = compared[0]
    of = "path" if tried else "plan"
    message = (
        f"{of} of {counted(len(best.plan.turns), 'turn')} in {best.plan.duration:.4g} s: u is "
        f"{best.mean:.3g} times the goal in the geometric mean, and at most {best.ratio.max():.3g} times "
        f"({best.bounds.names[int(np.argmax(best.ratio))]})"
    )
    return DesignedTurns(tuple(compared), message, _findings(best.bounds), goal, tried)


def _sound(along: PlanBounds) -> PlanBounds:
    """The bounds; raises `StudyError` where they are lost in rounding."""
    if not np.all(np.isfinite(along.history)):
        raise StudyError(
            "plan", "found times, noise or priors whose bounds are lost in rounding, expected usual ones"
        )
    return along


def _ground_of(pieces: Pieces, given: TurnPlan, goal: Array) -> TurnGround:
    """The ground of a study's search; ``goal`` (q,). Raises `StudyError` where the turns leave no time for rests."""
    asked = pieces.settings.design
    assert asked is not None
    angles = sorted(asked.angles or (_QUARTER, 2.0 * _QUARTER))
    moves = tuple((axis, sign * angle) for axis in range(3) for angle in angles for sign in (1.0, -1.0))
    starts = attitudes(given) if asked.start == "free" else (start_attitude(given),)
    least = given.time_of(angles[0])
    time = given.first_dwell + asked.turns * (given.dwell + least) if asked.time is None else asked.time
    ground = TurnGround(pieces, starts, moves, asked.turns, goal, time, given.turn_time, given.first_dwell)
    if not ground.fits((0, ((0, angles[0]),) * asked.turns)):
        needed = given.first_dwell + asked.turns * (least + _shortest(pieces.settings))
        raise StudyError(
            "design.time",
            f"found {time:g} s for {counted(asked.turns, 'turn')}, expected {needed:.4g} s or more: the first rest "
            f"takes {given.first_dwell:g} s, a turn {least:g} s, and a rest {_shortest(pieces.settings):g} s at least",
        )
    return ground


def _plan_of(ground: TurnGround, path: Path, given: TurnPlan) -> TurnPlan:
    """A path as a plan."""
    start, turns = path
    return replace(given, turns=turns, start=angles_of(ground.starts[start]), dwell=ground.times(turns).dwell)


def angles_of(C_nb: Array) -> tuple[float, float, float]:
    """Pitch, roll, yaw [rad] of an attitude (3, 3), as `inercal.systems.strapdown.simulate.start_attitude` takes
    them."""
    pitch = math.asin(min(max(C_nb[2, 1], -1.0), 1.0))
    if abs(C_nb[2, 1]) > 1.0 - 1e-12:  # y is vertical: yaw and roll turn about it
        return pitch, 0.0, math.atan2(C_nb[1, 0], C_nb[0, 0])
    yaw = math.atan2(-C_nb[0, 1], C_nb[1, 1])
    return pitch, math.atan2(-C_nb[2, 0], C_nb[2, 2]), yaw


def stated_turns(plan: TurnPlan) -> list[list[str]]:
    """Turns as a study states them."""
    return [[AXES[axis], f"{math.degrees(angle):.10g} deg"] for axis, angle in plan.turns]


def nineteen() -> list[list[str]]:
    """Turns of the path of 19 positions, as a study states them."""
    return stated_turns(TurnPlan(NINETEEN))


def _shortest(settings: StrapdownSettings) -> float:
    """Shortest rest [s] with its margins."""
    return LIMITS.shortest_rest + 2.0 * settings.rests.margin


def _lasting(plan: TurnPlan, time: float) -> TurnPlan:
    """The plan with rests that make it last ``time`` [s]."""
    return replace(plan, dwell=plan.dwell + (time - plan.duration) / len(plan.turns))


def _goal(settings: StrapdownSettings, usual: PlanBounds) -> Array:
    """Goal (q,) of each coefficient: as stated, or the largest of its kind along the ``usual`` path."""
    kinds = [group_of(name) for name in usual.names]
    largest: dict[str, float] = {}
    for kind, u in zip(kinds, usual.u.tolist(), strict=True):
        largest[kind] = max(largest.get(kind, 0.0), u)
    stated = {kind: getattr(settings.goal, kind) for kind in largest}
    # S_asym is the whole of the difference of which the study states the half
    factor = {"asymmetry": 2.0}
    return np.array(
        [largest[kind] if stated[kind] is None else stated[kind] * factor.get(kind, 1.0) for kind in kinds]
    )


def _left(along: PlanBounds) -> Array:
    """Part (q,) of the prior that is left of each coefficient."""
    return np.asarray(along.u / along.prior)


def _at_prior(along: PlanBounds) -> list[str]:
    """Coefficients of which more than half of the prior is left."""
    return [name for name, left in zip(along.names, _left(along).tolist(), strict=True) if left > HALF_SEEN]


def _findings(along: PlanBounds) -> tuple[Finding, ...]:
    """``at_prior``, and in words where a calibration would end as unobservable."""
    at_prior = _at_prior(along)
    unseen = [
        name
        for name, left in zip(along.names, _left(along).tolist(), strict=True)
        if group_of(name) in ALWAYS and left > UNSEEN
    ]
    more = (
        f"; the turns say nothing about {counted_names(unseen, 6)}: a calibration would be unobservable"
        if unseen
        else ""
    )
    return tuple(at_prior_together(at_prior, more))


def _told(along: PlanBounds) -> list[list[tuple[str, float]]]:
    """For each turn the coefficients whose u it lowers by `LIMITS.told` or more, and the factor, largest first."""
    factors = along.history[:-1] / along.history[1:]
    return [
        [(along.names[k], float(row[k])) for k in np.argsort(-row) if row[k] >= LIMITS.told]
        for row in factors
    ]


def _entry(judged: ComparedPlan) -> dict[str, Any]:
    """A plan for JSON."""
    return {
        "name": judged.name,
        "turns": stated_turns(judged.plan),
        "time": judged.plan.duration,
        "dwell": judged.plan.dwell,
        "geometric_mean": judged.mean,
        "largest": float(judged.ratio.max()),
        "predicted": dict(zip(judged.bounds.names, judged.bounds.u.tolist(), strict=True)),
        "at_prior": _at_prior(judged.bounds),
    }


def _turns(plan: TurnPlan, along: PlanBounds) -> Table:
    """The turns, and what each tells."""
    rows = []
    C = start_attitude(plan)
    for k, ((axis, angle), told) in enumerate(zip(plan.turns, _told(along), strict=True), start=1):
        slope = math.degrees(math.asin(min(abs(C[2, axis]), 1.0)))
        near = LIMITS.level_axis
        lies = "level" if slope < near else "vertical" if slope > 90.0 - near else "slanting"
        C = C @ elementary(AXES[axis], angle)
        words = ", ".join(f"{name} /{factor:.3g}" for name, factor in told[:_TOLD]) or "nothing new"
        rows.append((str(k), AXES[axis], f"{math.degrees(angle):g} deg", lies, words))
    start = ", ".join(f"{math.degrees(angle):.4g}" for angle in plan.start)
    return Table(
        f"Turns, from pitch, roll, yaw {start} deg; rests of {plan.dwell:.4g} s",
        "Each turn with the rest after it: how its axis lies, and the coefficients whose u falls most.",
        heads("#", "axis", "by", "lies", "tells"),
        tuple(rows),
        words=5,
    )


def _bounds(designed: DesignedTurns) -> Table:
    """Bounds of each coefficient."""
    along, rows = designed.bounds, []
    for name, u, prior, goal in zip(
        along.names, along.u.tolist(), along.prior.tolist(), designed.goal.tolist(), strict=True
    ):
        unit, size = unit_of(name)
        rows.append((name, short(u / size), unit, f"{100.0 * u / prior:.3g} %", f"{u / goal:.3g}"))
    return Table(
        "Bounds",
        "Standard uncertainty at the end, the best that any estimator can reach with the stated noise and prior.",
        heads("coefficient", "bound u", "unit", "of prior", "of goal"),
        tuple(rows),
    )


def unit_of(name: str) -> tuple[str, float]:
    """The unit of a coefficient for people, and how many of the SI unit it is."""
    unit, size = shown_unit(TERMS[name].unit_for("m/s^2" if name.startswith("K") else "rad/s"))
    of_itself = "(rad/s)/(rad/s)" in unit or "(m/s^2)/(m/s^2)" in unit
    return shown_unit("1") if of_itself else (unit, size)


def _comparison(designed: DesignedTurns) -> Table:
    """Plans side by side."""
    rows = tuple(
        (
            each.name,
            str(len(each.plan.turns)),
            f"{each.plan.duration:.4g}",
            f"{each.plan.dwell:.3g}",
            f"{each.mean:.3g}",
            f"{each.ratio.max():.3g} {each.bounds.names[int(np.argmax(each.ratio))]}",
            str(len(_at_prior(each.bounds))),
        )
        for each in designed.compare
    )
    return Table(
        "Plans of the same time",
        "u over the goal: geometric mean of all coefficients, and the largest.",
        heads("plan", "turns", "time [s]", "dwell [s]", "mean u/goal", "largest", "at prior"),
        rows,
    )


def by_kind(designed: DesignedTurns) -> Mapping[str, Array]:
    """Largest u over the goal of each kind of coefficient after each rest (rests,)."""
    ratio, kinds = designed.bounds.history / designed.goal, [group_of(name) for name in designed.bounds.names]
    return {kind: np.max(ratio[:, [each == kind for each in kinds]], axis=1) for kind in dict.fromkeys(kinds)}


def study_table(designed: DesignedTurns) -> str:
    """The plan as a table of a study."""
    plan = designed.plan
    turns = "".join(f'    ["{axis}", "{angle}"],\n' for axis, angle in stated_turns(plan))
    start = ", ".join(f'"{math.degrees(angle):.10g} deg"' for angle in plan.start)
    return (
        f"# {designed.message}\n[plan]\nstart = [{start}]\nturns = [\n{turns}]\n"
        f'turn_time = "{plan.turn_time:.10g} s"\ndwell = "{plan.dwell:.10g} s"\n'
        f'first_dwell = "{plan.first_dwell:.10g} s"\nsample_rate = "{plan.sample_rate:.10g} Hz"\n'
    )
