"""Moves: the gyro carries the vertical of one rest onto the next, whatever the rotation between them.

With u the directions of specific force in two rests, R the rotation of the gyro between them, tau its duration and e
earth rate on the axes of the first rest,

    R^T (u_first - tau u_first x e) - u_last = 0        in both directions across u_last.

Its variance is w^2 tau, w found by restricted likelihood, and tilts of the rests are unknowns. Where the whole rotation
is known, K, two rows more tie u_last to K^T u_first, and one says that log(K^T R) - tau R^T e is 0 about u_last: what
is left of it across u_last is the same as the other rows. The level part of earth rate is one unknown for each unbroken
run of moves, carried along by R.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.rotations import from_matrix, inverse_left_jacobian, log
from inercal.systems.imu.sections.carried import (
    Increments,
    Move,
    Rotations,
    exponentials,
    increments,
    rotations,
    skews,
)
from inercal.systems.imu.sections.limits import LIMITS
from inercal.systems.imu.sections.outputs import effective, verticals
from inercal.systems.imu.sections.priors import Priors, Size
from inercal.systems.imu.sections.problem import Iterate, Problem, RowBlock
from inercal.systems.imu.sections.readings import Places
from inercal.systems.imu.sections.unknowns import (
    COMMON,
    EARTH_UP,
    LOCAL,
    MOUNTING,
    RATE,
    across,
    cross,
)

SOURCE = "noise of the gyro in moves"
"""Its name in budgets."""


@dataclass(frozen=True, eq=False)
class MoveRows:
    """Rows of moves beside those of means, and the earth rate of their runs; an `Extra` of a problem."""

    moves: tuple[Move, ...]
    labels: tuple[str, ...]
    mean: Array
    sd: Array
    sizes: dict[str, Size]
    runs: Places
    increments: Increments
    rotates: bool = True
    _latest: list[Rotations] = field(default_factory=list)
    """The rotations that were integrated last: others near them follow by their derivatives."""

    @property
    def ends(self) -> tuple[Places, Places]:
        """Sections (m,) before and after each move."""
        ends = np.array([(move.first, move.last) for move in self.moves])
        return ends[:, 0], ends[:, 1]

    def rotations(self, problem: Problem, x: Array) -> Rotations:
        """Rotations of the moves at the unknowns x (p,)."""
        session = problem.readings.session[self.ends[0]]
        places = problem.sessions_at + 6 * session[:, None] + 3 + np.arange(3)
        bias = np.where(session[:, None] >= 0, x[np.where(session[:, None] >= 0, places, 0)], 0.0)
        for base in self._latest:
            there = base.near(x[:COMMON], bias, LIMITS.integrated_anew)
            if there is not None:
                return there
        self._latest[:] = [rotations(self.increments, x[:COMMON], bias)]
        return self._latest[0]

    def centred(self, problem: Problem, point: Iterate) -> Iterate:
        """The point with level axes that the gyro carries from rest to rest."""
        R, level = self.rotations(problem, point.x).R, point.level.copy()
        for k, move in enumerate(self.moves):
            up = point.up[move.last]
            a = R[k].T @ level[move.first, :, 0]
            a = a - up * (a @ up)
            size = float(np.linalg.norm(a))
            if size > LIMITS.level_axis:  # else R is far off yet, and any axis will do
                level[move.last] = np.column_stack([a / size, cross(up, a / size), up])
        return replace(point, level=level)

    def blocks(self, problem: Problem, point: Iterate) -> tuple[RowBlock, ...]:
        """Two rows of each move, and three more where its rotation is known."""
        moved, x, m = self.rotations(problem, point.x), point.x, len(self.moves)
        first, last = self.ends
        tau, RT = self.increments.durations, np.swapaxes(moved.R, 1, 2)
        u, by_mounting, by_local = _directions(problem, point)
        before, after = u[first], u[last]
        basis = np.swapaxes(across(point.up[last]), 1, 2)
        level = point.level[first]
        run = problem.runs[first][:, None] + np.arange(3)
        earth = x[EARTH_UP] * before + problem.north[first] + (level @ x[run][..., None])[..., 0]
        lever = RT @ skews(before)  # what a small rotation before the move does to the vertical after it
        end = (RT @ before[..., None] - tau[:, None, None] * (lever @ earth[..., None]))[..., 0]

        told = np.array([move.turn is not None for move in self.moves])
        vectors = np.array([np.zeros(3) if move.turn is None else move.turn for move in self.moves])
        mounting = exponentials(x[MOUNTING])
        known = np.swapaxes(mounting @ exponentials(vectors) @ mounting.T, 1, 2)
        off = np.where(told[:, None], log(from_matrix(known @ moved.R)), 0.0)
        bent = inverse_left_jacobian(-off)
        off = off - tau[:, None] * (RT @ earth[..., None])[..., 0]
        miss = np.zeros((m, 5))
        miss[:, :2] = (basis @ (end - after)[..., None])[..., 0]
        miss[:, 2:4] = (basis @ ((known @ before[..., None])[..., 0] - after)[..., None])[..., 0]
        miss[:, 4] = np.sum(after * off, axis=1)

        shared = np.zeros((m, 5, problem.shared))
        turned, about = basis @ lever, after[:, None] @ RT
        twisted = after[:, None] @ bent @ RT
        shared[:, :2, :COMMON] = turned @ moved.by_unknowns
        shared[:, 4:, :COMMON] = twisted @ moved.by_unknowns
        shared[:, :2, MOUNTING] = basis @ (RT @ by_mounting[first] - by_mounting[last])
        shared[:, 2:4, MOUNTING] = -basis @ skews((known @ before[..., None])[..., 0] - after)
        shared[:, 4:, MOUNTING] = after[:, None] @ np.swapaxes(bent, 1, 2) @ (np.eye(3) - known)
        shared[:, 4, MOUNTING] += cross(after, off)
        shared[:, 4, EARTH_UP] = -tau * (about @ before[..., None])[:, 0, 0]
        session = problem.readings.session[first]
        for k in range(m):
            shared[k, :2, run[k]] = (-tau[k] * turned[k] @ level[k]).T
            shared[k, 4, run[k]] = -tau[k] * (about[k] @ level[k])[0]
            if session[k] >= 0:
                at = problem.sessions_at + 6 * session[k] + 3 + np.arange(3)
                shared[k, :2, at] = (turned[k] @ moved.by_session[k]).T
                shared[k, 4, at] = (twisted[k] @ moved.by_session[k])[0]

        lead = problem.readings.leader
        local = np.zeros((m, 5, 2 * RATE))
        local[:, :2, :RATE], local[:, :2, RATE:] = basis @ RT @ by_local[first], -basis @ by_local[last]
        local[:, 2:4, :RATE], local[:, 2:4, RATE:] = basis @ known @ by_local[first], -basis @ by_local[last]
        local[:, 4, RATE:] = (off[:, None] @ by_local[last])[:, 0]
        at = problem.shared + LOCAL * np.stack([lead[first], lead[last]], axis=1)[..., None] + np.arange(RATE)
        at = at.reshape(m, 2 * RATE)
        same = lead[first] == lead[last]  # of one setup: one placing
        local[same, :, :RATE] += local[same, :, RATE:]
        local[same, :, RATE:] = 0.0
        at[same, RATE:] = (problem.shared + LOCAL * first[same] + RATE)[
            :, None
        ]  # the rate of a rest is no unknown
        seen = np.column_stack([np.ones((m, 2), dtype=bool), np.repeat(told[:, None], 3, axis=1)])
        stated = np.array([move.turn_u**2 for move in self.moves])
        variance = stated[:, None] * [0.0, 0.0, 1.0, 1.0, 1.0]
        walk = tau[:, None] * np.array([1.0, 1.0, 0.0, 0.0, 1.0])
        sources = (SOURCE, SOURCE, "known rotations", "known rotations", "known rotations")
        return (RowBlock(-miss, shared, local, at, variance, {"moves": walk}, seen, sources),)


def move_rows(sections: int, moves: Sequence[Move], priors: Priors) -> MoveRows:
    """Rows of at least one move between some of a number of ``sections``, all of them rests; in the order of time."""
    begin = {k: k for k in range(sections)}
    for move in moves:
        begin[move.last] = begin[move.first]
    joined = sorted({begin[move.first] for move in moves})
    moving = {k for move in moves for k in (move.first, move.last)}
    runs = np.array([3 * joined.index(begin[k]) if k in moving else -1 for k in range(sections)])
    level = priors.site.horizontal_rate_u
    return MoveRows(
        moves=tuple(moves),
        labels=("earth rate, level part",) * (3 * len(joined)),
        mean=np.zeros(3 * len(joined)),
        sd=np.tile([level, level, 0.0], len(joined)),
        sizes={"moves": Size(LIMITS.move_walk, LIMITS.move_walk_spread)},
        runs=runs,
        increments=increments(moves),
    )


def _directions(problem: Problem, point: Iterate) -> tuple[Array, Array, Array]:
    """Verticals (n, 3), and their derivatives by the mounting (n, 3, 3) and by tilts and axes (n, 3, 4)."""
    common = np.tile(point.x[:COMMON].astype(complex), (7, 1))
    local = np.tile(effective(problem, point.x).astype(complex), (7, 1, 1))
    common[range(3), range(MOUNTING.start, MOUNTING.stop)] += 1e-30j
    local[range(3, 7), :, range(RATE)] += 1e-30j
    u = verticals(problem, point, common, local)
    by = np.moveaxis(u.imag / 1e-30, 0, 2)
    return np.asarray(u[0].real), by[..., :3], by[..., 3:]
