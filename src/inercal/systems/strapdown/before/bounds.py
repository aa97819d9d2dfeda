"""Bounds before a test: what the rests and turns of a plan can tell at best.

The covariance of the batch estimator along the planned motion of a perfect unit is the bound of Cramer and Rao. Its
normal equations are those of `inercal.systems.strapdown.fit.arrow`, put together in another order: of each turn and of
each rest alone all states but the first and the last are eliminated once, which leaves the information on these two and
the coefficients; a plan is a chain of such pieces. Plans of quarter turns are made of few different pieces, so that
thousands of plans are judged in seconds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.geometry.rotations import elementary, from_matrix
from inercal.systems.strapdown.fit.batch import (
    add_turns,
    empty_shot,
    inverse,
    start_information,
    variances_of,
    world_of,
)
from inercal.systems.strapdown.fit.start import start_u
from inercal.systems.strapdown.limits import LIMITS
from inercal.systems.strapdown.model.coefficients import SIZE, free_places, names, slope, stated
from inercal.systems.strapdown.model.kernels import BodyMotion, NodeState, increments, shoot
from inercal.systems.strapdown.model.samples import PAIRS, gains
from inercal.systems.strapdown.settings import StrapdownSettings, TurnPlan
from inercal.systems.strapdown.simulate import AXES, UnitTurn, start_attitude, truth


class Times(NamedTuple):
    """Times [s] of a turn by 90 deg, of a rest, and of the first."""

    turn: float
    dwell: float
    first: float


class Step(NamedTuple):
    """Information (m + p, m + p) on the state at the end of a rest and the coefficients, and the attitude C_nb
    (3, 3)."""

    information: Array
    C_nb: Array


@short_repr
@dataclass(frozen=True, eq=False)
class PlanBounds:
    """Bounds along a plan: ``covariance`` (q, q) of the stated coefficients ``names`` at its end, ``prior`` (q,) before
    it, ``history`` (rests, q) standard uncertainties after each rest, and ``up`` (rests, 3) the vertical in b."""

    names: tuple[str, ...]
    covariance: Array
    prior: Array
    history: Array
    up: Array

    @property
    def u(self) -> Array:
        """(q,) standard uncertainties at the end."""
        return np.sqrt(np.diag(self.covariance))


class Pieces:
    """Information of turns and rests of a unit, computed when first asked for.

    Arrays are of m errors of the state (6, or 12 where biases walk) at both ends, then p coefficients in units of their
    prior.
    """

    def __init__(self, settings: StrapdownSettings) -> None:
        self.settings = settings
        self.free = free_places(settings.terms, settings.gravity_u > 0.0, settings.site.latitude_u > 0.0)
        self.prior = settings.deviations()[self.free]
        self.m = 12 if settings.noise.walks else 6
        self._kept: dict[tuple[object, ...], Array] = {}

    @cached_property
    def slope(self) -> Array:
        """Derivative (q, p) of the stated coefficients by those that are estimated, of a perfect unit."""

        def in_words(free: Array) -> Array:
            c = np.zeros(SIZE)
            c[self.free] = free
            return stated(c, self.settings.terms, self.settings.frame)

        return slope(in_words, np.zeros(len(self.free)))

    def covariance(self, information: Array) -> Array:
        """Covariance (q, q) of the stated coefficients, of the information (m + p, m + p) at the end of a rest; NaN
        where it is lost in rounding."""
        try:
            of_free = inverse(_condensed(information, self.m), np.ones(len(self.free)))
        except np.linalg.LinAlgError:
            of_free = np.full((len(self.free), len(self.free)), np.nan)
        by = self.slope * self.prior
        return np.asarray(by @ of_free @ by.T)

    def steps(self, start: Array, turns: Sequence[tuple[int, float]], times: Times) -> list[Step]:
        """The plan that begins with the attitude ``start`` (3, 3), after each of its rests."""
        m, C = self.m, start
        H = self._rest(C, times.first).copy()
        H[range(m), range(m)] += start_information(
            start_u(self.settings), variances_of(self.settings.noise), m
        )
        H[range(2 * m, len(H)), range(2 * m, len(H))] += 1.0
        steps = [Step(_condensed(H, m), C)]
        for axis, angle in turns:
            steps.append(self.after(steps[-1], axis, angle, times))
        return steps

    def after(self, step: Step, axis: int, angle: float, times: Times) -> Step:
        """The end of the rest that follows a turn."""
        m, J = self.m, step.information
        H = self._leg(step.C_nb, axis, angle, times).copy()
        H[:m, :m] += J[:m, :m]
        H[:m, 2 * m :] += J[:m, m:]
        H[2 * m :, :m] += J[m:, :m]
        H[2 * m :, 2 * m :] += J[m:, m:]
        return Step(_condensed(H, m), step.C_nb @ elementary(AXES[axis], angle))

    def _leg(self, C: Array, axis: int, angle: float, times: Times) -> Array:
        """Information (2 m + p, 2 m + p) of a turn from the attitude ``C`` (3, 3) and the rest after it."""
        key = (*_of(C), axis, round(angle, 6), times.turn, round(times.dwell, 6))
        if key not in self._kept:
            after = self._rest(C @ elementary(AXES[axis], angle), times.dwell)
            self._kept[key] = joined(self._turn(C, axis, angle, times.turn), after, self.m)
        return self._kept[key]

    def _turn(self, C: Array, axis: int, angle: float, turn_time: float) -> Array:
        """Information of a turn, with the margins of the rests at both ends."""
        key = (*_of(C), axis, round(angle, 6), turn_time)
        if key not in self._kept:
            margin, time = self.settings.rests.margin, turn_time * abs(angle) / (0.5 * np.pi)
            count = int(np.ceil(2.0 * abs(angle) / LIMITS.block_angle))
            turn = UnitTurn(margin, time, C, axis, angle, np.zeros(3))
            self._kept[key] = self._interval(turn, time + 2.0 * margin, max(count, 10), True)
        return self._kept[key]

    def _rest(self, C: Array, dwell: float) -> Array:
        """Information of a rest of an attitude ``C`` (3, 3), without its margins."""
        key = (*_of(C), round(dwell, 6))
        if key not in self._kept:
            rests, m = self.settings.rests, self.m
            time = max(dwell - 2.0 * rests.margin, LIMITS.shortest_rest)
            pieces = max(1, int(np.ceil(time / rests.node - 1e-6)))
            turn = UnitTurn(2.0 * time, 1.0, C, 0, 0.0, np.zeros(3))
            one = self._interval(turn, time / pieces, LIMITS.block_samples)
            # errors at both ends, three angles of the reference, coefficients
            wide = np.zeros((len(one) + 3, len(one) + 3))
            places = np.r_[0 : 2 * m, 2 * m + 3 : len(wide)]
            wide[np.ix_(places, places)] = one
            known = rests.velocity**-2, 0.0 if rests.attitude is None else rests.attitude**-2
            _know(wide, m, 2 * m, *known)
            whole = _repeated(wide, pieces, m)
            _know(whole, 0, 2 * m, *known)
            angles = np.arange(2 * m, 2 * m + 3)
            others = np.delete(np.arange(len(wide)), angles)
            held = rests.attitude is not None
            order = np.concatenate([angles, others])
            self._kept[key] = (
                _condensed(whole[np.ix_(order, order)], 3) if held else whole[np.ix_(others, others)]
            )
        return self._kept[key]

    def _interval(self, turn: UnitTurn, time: float, count: int, turns: bool = False) -> Array:
        """Information (2 m + p, 2 m + p) of an interval of ``time`` [s] in ``count`` steps, one that ``turns`` or
        not."""
        settings, m, c = self.settings, self.m, np.zeros(SIZE)
        ts = time / count
        world = world_of(settings, c, ts)
        at: Array = ts * (np.arange(count, dtype=float) + 0.5)
        moved = truth(turn, at, settings.motion, world.earth, world.gravity)
        motion = BodyMotion(moved.w, moved.wd, moved.f, moved.f, np.empty((count, 3)), np.empty((count, 3)))
        increments(motion.w, motion.f, PAIRS, ts, motion.turn, motion.gain)
        state = NodeState(from_matrix(turn.C_nb[None]), np.zeros((1, 3)), np.zeros((1, 6)))
        shot = empty_shot(1, m)
        cuts, first = np.arange(count + 1), np.array([0, count])
        variances = variances_of(settings.noise)
        shoot(motion, cuts, first, state, gains(c), world, variances, shot)
        if turns:
            add_turns(shot.Q, np.zeros(1, dtype=np.int64), variances)
        G = np.zeros((m, len(self.free)))
        G[:6] = shot.G[0][:, self.free] * self.prior
        rows = np.hstack([-shot.F[0], np.eye(m), -G])
        return np.asarray(rows.T @ np.linalg.solve(shot.Q[0], rows))


def _of(C: Array) -> tuple[object, ...]:
    """A key of an attitude."""
    return ((np.round(C, 6) + 0.0).tobytes(),)  # no -0


def _know(H: Array, at: int, angles: int, velocity: float, attitude: float) -> None:
    """Add the information of a node, whose state begins ``at``, on its velocity and its attitude to ``H``."""
    for i in range(3):
        H[at + 3 + i, at + 3 + i] += velocity
        a, b = at + i, angles + i
        H[a, a] += attitude
        H[b, b] += attitude
        H[a, b] -= attitude
        H[b, a] -= attitude


def _condensed(H: Array, count: int) -> Array:
    """Information without the first ``count`` unknowns, which are eliminated."""
    right = H[:count, count:]
    return np.asarray(H[count:, count:] - right.T @ np.linalg.solve(H[:count, :count], right))


def joined(first: Array, second: Array, m: int) -> Array:
    """Information of two pieces (2 m + p, 2 m + p), one after the other, without the state between them."""
    n = len(first)
    H = np.zeros((n + m, n + m))
    # the state between, then those at the ends, then the rest
    one = np.r_[m : 2 * m, 0:m, 3 * m : n + m]
    two = np.r_[0:m, 2 * m : 3 * m, 3 * m : n + m]
    H[np.ix_(one, one)] += first
    H[np.ix_(two, two)] += second
    return _condensed(H, m)


def _repeated(piece: Array, number: int, m: int) -> Array:
    """Information of so many like pieces one after the other."""
    if number == 1:
        return piece.copy()
    half = _repeated(piece, number // 2, m)
    twice = joined(half, half, m)
    return joined(twice, piece, m) if number % 2 else twice


def _times_of(plan: TurnPlan) -> Times:
    """Times of a plan."""
    return Times(plan.turn_time, plan.dwell, plan.first_dwell)


def bounds(pieces: Pieces, plan: TurnPlan) -> PlanBounds:
    """Bounds along a plan, and after each of its rests."""
    settings = pieces.settings
    steps = pieces.steps(start_attitude(plan), plan.turns, _times_of(plan))
    covariances = [pieces.covariance(each.information) for each in steps]
    return PlanBounds(
        names(settings.terms, settings.frame),
        covariances[-1],
        np.sqrt(np.sum(np.square(pieces.slope * pieces.prior), axis=1)),
        np.sqrt([np.diag(each) for each in covariances]),
        np.array([each.C_nb[2] for each in steps]),
    )
