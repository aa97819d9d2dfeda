"""Searching for a path (`inercal.foundation.designs.search`): sequences of turns, whole multiples of one angle.

A sequence is judged by its bounds at coarser steps, with the noise of a sample taken down accordingly. The changes
tried: a turn reversed, given to another joint, shortened or lengthened, two exchanged, one divided.

Errors of the rig that are no states, before the test: how far those of usual size shift coefficients.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Final, NamedTuple, TypeAlias

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.computing.executors import Executor
from inercal.foundation.designs.search import from_starts, improved
from inercal.foundation.errors import StudyError
from inercal.systems.selfcal.before.bounds import PathBounds, bounds, nominal_attitudes
from inercal.systems.selfcal.before.considered import sensitivities
from inercal.systems.selfcal.filters.problem import FilterProblem, problem
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.coefficients import product_slope
from inercal.systems.selfcal.platform.joint_limits import JointLimits, spans
from inercal.systems.selfcal.platform.plan import CommandedMotion, PlatformPlan, Rest, Turn, motion
from inercal.systems.selfcal.platform.recording import Recording
from inercal.systems.selfcal.platform.rig import JOINTS
from inercal.systems.selfcal.platform.states import ALL, KIND_OF, WAVE
from inercal.systems.selfcal.settings import Search, SelfcalSettings


class UnmodelledErrors(NamedTuple):
    """Names (m,) of errors that are no states, and their standard deviations ``sizes`` (m,) [SI]."""

    names: tuple[str, ...]
    sizes: Array


def unmodelled(settings: SelfcalSettings) -> UnmodelledErrors:
    """The errors of ``design.robust``, as large as stated, else as usual; raises `StudyError` for one that is a
    state."""
    states, sizes = settings.states, settings.priors
    for kind in settings.search.robust:
        if kind in settings.kinds:
            text = f"found {kind}, which is among the states, expected errors that are left out of them"
            raise StudyError("design.robust", text)
    named = ALL[18 : WAVE + 2 * len(states.harmonics)]
    hidden = {*states.names, *settings.model.left_out}
    names = tuple(name for name in named if KIND_OF[name] in settings.search.robust and name not in hidden)
    return UnmodelledErrors(names, np.array([sizes[ALL.index(name)] for name in names]))


def shifts(
    motion: CommandedMotion, problem: FilterProblem, of: UnmodelledErrors, warm: Array | None = None
) -> Array:
    """Shifts (p, m) of the coefficients, product form, by one standard deviation of each error along a nominal path.

    ``warm`` (n,) [K] as of `inercal.systems.selfcal.before.bounds.bounds`.
    """
    if not of.names:
        return np.zeros((len(problem.prior), 0))
    n, c = len(motion.t), problem.mean
    q = nominal_attitudes(motion, problem, c, warm)
    recording = Recording(motion.t, motion.rate, motion.angles, np.zeros((n, 3)), warm=warm)
    return np.asarray(product_slope(c) @ sensitivities(recording, problem, q, c, of.names) * of.sizes)


Sequence: TypeAlias = tuple[tuple[int, int], ...]
"""Turns as joint 0, 1, 2 and signed number of angles."""

_EVEN: Final = 1e-6
"""Part of a row that is rounding."""


def criterion(
    bounds: PathBounds, goal: Mapping[str, float], kind: str, shifted: Array | float = 0.0
) -> float:
    """Largest (``worst``) or geometric mean (``mean``) ratio of each u to its goal, or to its prior without one; u with
    the variance ``shifted`` (p,) by errors left out."""
    wanted = [goal.get(name, prior) for name, prior in zip(bounds.names, bounds.prior, strict=True)]
    ratio = np.sqrt(bounds.u**2 + shifted) / wanted
    return float(ratio.max() if kind == "worst" else np.exp(np.mean(np.log(ratio))))


def search(
    settings: SelfcalSettings,
    progress: Callable[[int, int], None] = lambda done, total: None,
    executor: Executor | None = None,
) -> PlatformPlan:
    """The best path that the search finds within rate, time, number of turns, and limits of the joints.

    Time that no turn fills is a rest at the end. Rate, step and start are those of the study's plan, rates no more than
    joints can. A path that is to end where it began goes back joint by joint. An inner gimbal without limits
    keeps `LIMITS.path_cosine` from lock. ``progress`` is told (done, total) of the random starts, which
    the ``executor`` computes: with the same digits in any.

    Raises StudyError where no time is stated, or no turn fits into time and limits.
    """
    ground = _ground(settings)
    streams = np.random.default_rng(settings.search.seed).spawn(LIMITS.path_starts)
    found = from_starts(partial(_from_start, ground), streams, executor, progress)
    return ground.plan(min(found)[1])


def _from_start(ground: PathGround, rng: np.random.Generator) -> tuple[float, Sequence]:
    """The best sequence from a random start, after its criterion."""
    return improved(ground, rng, {})


@dataclass(frozen=True, eq=False)
class PathGround:
    """The ground of a search: a plan without moves as ``model``; ``low`` and ``high`` (3,), limits of each joint in
    steps of the angle from the start; the ``number`` of steps that the time allows; the interval ``coarse`` [s] of its
    rows, and the ``problem`` with the noise of rows so far apart; the errors ``unmodelled`` that count in u."""

    asked: Search
    model: PlatformPlan
    low: Array
    high: Array
    time: float
    number: int
    coarse: float
    problem: FilterProblem
    goal: Mapping[str, float]
    unmodelled: UnmodelledErrors
    joints: JointLimits

    def plan(self, turns: Sequence) -> PlatformPlan:
        """The plan of a sequence, with a rest at its end."""
        turning, step = self._turning(self.whole(turns)), self.model.step
        last = Rest(step * math.floor((self.time - turning.duration) / step + _EVEN))
        if self.asked.rest > 0.0:
            last = Rest(last.duration + turning.moves[-1].duration)  # type: ignore[union-attr]
            turning = replace(turning, moves=turning.moves[:-1])
        return replace(turning, moves=(*turning.moves, last)) if last.duration > 0.0 else turning

    def _turning(self, turns: Sequence) -> PlatformPlan:
        """The turns, each with its rest."""
        rests = (Rest(self.asked.rest),) if self.asked.rest > 0.0 else ()
        moves = (
            (Turn("xyz"[joint], count * self.asked.angle), *rests)  # type: ignore[arg-type]
            for joint, count in turns
        )
        return self.joints.kept(replace(self.model, moves=tuple(itertools.chain(*moves))))

    def whole(self, turns: Sequence) -> Sequence:
        """The sequence with the turns back to its start where it is to be closed: in the first order of the joints that
        no forbidden region bars."""
        if not self.asked.closed:
            return turns
        off = [sum(count for of, count in turns if of == joint) for joint in range(3)]
        back = [(joint, -off[joint]) for joint in range(3) if off[joint]]
        orders = (_merged((*turns, *order)) for order in itertools.permutations(back))
        return next((each for each in orders if self.clear(each)), _merged((*turns, *back)))

    def filled(self, turns: Sequence) -> float:
        """Time that a sequence turns, in angles of the fastest joint."""
        rates = [min(self.model.rate, of_joint) for of_joint in self.joints.rate]
        return sum(abs(count) * max(rates) / rates[joint] for joint, count in self.whole(turns))

    def clear(self, turns: Sequence) -> bool:
        """True for a sequence that no forbidden region bars."""
        regions = self.joints.forbidden
        return not regions or not any(
            region.meets(*span) for span in spans(self._turning(turns)) for region in regions
        )

    def fits(self, turns: Sequence) -> bool:
        """True for a sequence that keeps to number, limits and time; each turn takes whole rows."""
        if not turns:
            return False
        turns = self.whole(turns)
        if not 0 < len(turns) <= self.asked.turns:
            return False
        if self._turning(turns).duration > self.time + _EVEN * self.model.step:
            return False
        at = [0, 0, 0]
        for joint, count in turns:
            at[joint] += count
            if not self.low[joint] <= at[joint] <= self.high[joint]:
                return False
        return self.clear(turns)

    def value(self, turns: Sequence) -> float:
        """Criterion of a sequence at coarse steps."""
        path = motion(replace(self.plan(turns), step=self.coarse), self.problem.world)
        shifted = np.square(shifts(path, self.problem, self.unmodelled)).sum(axis=1)
        return criterion(bounds(path, self.problem), self.goal, self.asked.criterion, shifted)

    def first(self, rng: np.random.Generator) -> Sequence:
        """A random sequence that fits; of many tries the first that fills the time, or that fills it most."""
        best: Sequence = ()
        filled = 0.0
        for _ in range(200):
            ends = np.sort(rng.integers(0, self.number + 1, self.asked.turns - 1))
            lengths = np.diff(ends, prepend=0, append=self.number)
            turns: Sequence = ()
            for length in lengths:
                turns = _merged((*turns, (int(rng.integers(3)), int(length) * int(rng.choice((-1, 1))))))
                while turns and not self.fits(turns):
                    joint, count = turns[-1]
                    turns = _merged((*turns[:-1], (joint, count - int(np.sign(count)))))
            total = self.filled(turns)
            if total > filled:
                best, filled = turns, total
            if filled == self.number:
                break
        return best

    def changes(self, turns: Sequence) -> Iterator[Sequence]:
        """Sequences that differ by one small change; not all of them fit."""
        for i, (joint, count) in enumerate(turns):
            before, after, sign = turns[:i], turns[i + 1 :], int(np.sign(count))
            others = ((joint + 1) % 3, (joint + 2) % 3)
            yield _merged((*before, (joint, -count), *after))
            yield _merged((*before, (joint, count + sign), *after))
            yield _merged((*before, (joint, count - sign), *after))
            for other in others:
                yield _merged((*before, (other, count), *after))
            for j, (to, more) in enumerate(turns):
                if j != i:
                    longer = list(turns)
                    longer[i], longer[j] = (joint, count - sign), (to, more + int(np.sign(more)))
                    yield _merged(tuple(longer))
                if j > i:
                    exchanged = list(turns)
                    exchanged[i], exchanged[j] = turns[j], turns[i]
                    yield _merged(tuple(exchanged))
            for first in range(1, abs(count)):
                for other in others:
                    for way in (1, -1):
                        rest = way * (abs(count) - first)
                        yield _merged((*before, (joint, sign * first), (other, rest), *after))


def _ground(settings: SelfcalSettings) -> PathGround:
    """The ground of a study's search."""
    x, y, z = settings.fixed_angles.tolist()
    asked, model = settings.search, replace(settings.plan or PlatformPlan((), start=(x, y, z)), moves=())
    if asked.time is None and settings.plan is None:
        raise StudyError("design.time", "missing, expected a time or a plan that is as long")
    time = settings.plan.duration if asked.time is None and settings.plan else float(asked.time or 0.0)
    if time / model.step > LIMITS.most_rows:
        text = f"found {time / model.step:.6g} steps of {model.step:g} s"
        raise StudyError("design.time", f"{text}, expected at most {LIMITS.most_rows:,}")
    rates = [min(model.rate, of_joint) for of_joint in settings.joints.rate]
    unit = asked.angle / max(rates)
    number = math.floor(time / unit + 1e-9)
    if number > LIMITS.path_angles:
        text = f"found {number} turns of {math.degrees(asked.angle):g} deg within {time:g} s"
        raise StudyError(
            "design.angle", f"{text}, expected at most {LIMITS.path_angles}: a larger angle, or less time"
        )
    low, high = _limits(settings, model)
    made = PathGround(
        asked, model, low, high, time, number, *_coarse(settings, model, unit), settings.goal, unmodelled(settings),
        settings.joints,
    )  # fmt: skip
    if not made.clear(()):
        raise StudyError(
            "rig.forbidden", "found the start of the path in a forbidden region, expected it outside"
        )
    if not any(made.fits(((joint, sign),)) for joint in range(3) for sign in (1, -1)):
        raise StudyError(
            "design.angle",
            f"found no turn of {math.degrees(asked.angle):g} deg within {time:g} s and the limits of the gimbals, "
            "expected a smaller angle, more time or wider limits",
        )
    return made


def _coarse(settings: SelfcalSettings, model: PlatformPlan, unit: float) -> tuple[float, FilterProblem]:
    """Coarse step [s] for turns of ``unit`` [s], and the problem with the noise of a mean over such a step."""
    rows = min(
        max(1, round(unit / model.step)), max(1, math.ceil(settings.search.angle / LIMITS.search_turn))
    )
    coarse, exact = unit / rows, problem(settings)
    less = math.sqrt(model.step / coarse)
    noise = replace(
        exact.noise, accelerometer=exact.noise.accelerometer * less, encoder=exact.noise.encoder * less
    )
    return coarse, replace(exact, noise=noise)


def _limits(settings: SelfcalSettings, model: PlatformPlan) -> tuple[Array, Array]:
    """Limits (3,), (3,) of the angles from the start, in angles of the search."""
    level = math.pi * round(model.start[1] / math.pi)
    reach = math.acos(LIMITS.path_cosine)
    limits = {"th_y": (level - reach, level + reach)} | dict(settings.limits)
    free = (-math.inf, math.inf)
    limits |= {joint: (angle, angle) for joint, angle in settings.fixed.items()}
    ends = np.array([limits.get(joint, free) for joint in JOINTS]) - np.array(model.start)[:, None]
    slack = 1e-9
    return ends[:, 0] / settings.search.angle - slack, ends[:, 1] / settings.search.angle + slack


def _merged(turns: Sequence) -> Sequence:
    """The sequence without empty turns, and with turns one after the other of one joint the same way as one."""
    merged: list[tuple[int, int]] = []
    for joint, count in turns:
        if count == 0:
            continue
        if merged and merged[-1][0] == joint and (merged[-1][1] > 0) == (count > 0):
            merged[-1] = (joint, merged[-1][1] + count)
        else:
            merged.append((joint, count))
    return tuple(merged)
