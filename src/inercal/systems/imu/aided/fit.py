"""The generalised least-squares fit of all sensors together, with the levels of noise that the data show.

Levels of noise of one sensor, by its residuals: white noise at rest and in turns, the walk of its bias in both.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.inference.identifiability import Identifiability, identify
from inercal.foundation.inference.variances import Solved, degrees, weighed
from inercal.systems.imu.aided.blocks import BlockMotion, reference
from inercal.systems.imu.aided.model import Equation, Side, Unknowns, equations
from inercal.systems.imu.aided.table import TableMotion
from inercal.systems.imu.aided.walk import WhitenedColumns, whiten
from inercal.systems.imu.limits import LIMITS

Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class Levels:
    """Noise of one sensor.

    ``resting`` and ``moving`` N [output sqrt(s)] of the white noise; ``walk`` K [output/sqrt(s)] of the bias at rest,
    ``walk_moving`` in turns, the same unless the data contradict it; degrees of freedom of the white noise and of the
    walk; ``drift`` twice the gain of the log likelihood by a bias that wanders, ``excess`` that by a larger K in
    turns.
    """

    resting: float
    moving: float
    walk: float
    walk_moving: float
    dof: float
    walk_dof: float
    drift: float
    excess: float = 0.0

    def white(self, length: Array, resting: Flags) -> Array:
        """Variances (n,) of means over blocks of those lengths [s]."""
        return np.where(resting, self.resting, self.moving) ** 2 / length

    def wander(self, t: Array, length: Array, resting: Flags) -> Array:
        """K (n,) of the time before each block."""
        return np.where(turning(t, length, resting), self.walk_moving, self.walk)


def turning(t: Array, length: Array, resting: Flags) -> Flags:
    """True (n,) where the table turns between the middles of a block and the one before; False for the first."""
    still = resting[1:] & resting[:-1] & (np.diff(t) < 1.5 * length[1:])
    return np.append(False, ~still)


def levels(
    residual: Array,
    columns: Array,
    prior: Array,
    t: Array,
    length: Array,
    resting: Flags,
    floor: float,
) -> tuple[Levels, Levels]:
    """Noise of a sensor by its residuals: with one K, and with another in turns where that is likelier.

    White noise from differences of neighbouring blocks, at rest and in motion apart (a table shakes when it turns).
    The walk by the restricted likelihood of all blocks: the mean of K over its likelihood, which is never zero as the
    most likely value often is. An error of the table that is not stated, an output that is not linear, a clock that
    drifts: all shift the output when the table turns and leave it alone when it rests, which no bias does. Where that
    is certain (see `chosen`), K has another value in turns, so that the uncertainties know of it.

    Parameters
    ----------
    residual : (n,)
        Of a preliminary fit.
    columns : (n, p)
        Changes of the residuals by unknowns of unit prior variance.
    prior : (p,)
        Prior means of these unknowns, beside the preliminary fit.
    t, length : (n,) s
        Middles and lengths of the blocks.
    resting : (n,)
    floor : float
        Least standard deviation of a block [output]; smaller ones count as this.
    """
    near = np.diff(t) < 1.5 * length[1:]
    each = np.square(np.diff(residual)) / (1.0 / length[1:] + 1.0 / length[:-1])
    both, none = resting[1:] & resting[:-1], ~(resting[1:] | resting[:-1])
    parts = [each[near & kind] for kind in (both, none)]
    fallback = each[near] if near.any() else each
    least = floor**2 * float(np.median(length))
    still, moving = (max(float(np.mean(part if len(part) >= 10 else fallback)), least) for part in parts)
    n_rest, n_turn = math.sqrt(still), math.sqrt(moving)
    white = np.where(resting, still, moving) / length
    turns = turning(t, length, resting)
    span, typical = float(t[-1] - t[0]), float(np.median(length))
    grid = np.r_[0.0, n_rest * np.geomspace(0.03 / span, 3.0 / typical, 24)]
    wide = np.r_[0.0, n_rest * np.geomspace(0.1 / span, 300.0 / typical, 20)]

    with_residual = np.column_stack([columns, residual])

    def likely(at_rest: Array, in_turns: Array) -> Array:
        pairs = np.broadcast(at_rest, in_turns)
        return np.array(
            [_restricted(with_residual, prior, t, white, np.where(turns, b, a)) for a, b in pairs]
        )

    dof = 2.0 * np.count_nonzero(near) / 3.0
    one = likely(grid, grid)
    walk, walk_dof = _mean(grid, one)
    same = Levels(n_rest, n_turn, walk, walk, dof, walk_dof, 2.0 * float(one.max() - one[0]))
    if turns[1:].all() or not turns.any():
        return same, same
    most = int(np.argmax(one))
    quiet = grid[3 * int(np.argmax(likely(grid[: most + 1 : 3], grid[most])))]
    if 2.0 * float(likely(quiet, wide[::3]).max() - one.max()) < -6.0:
        return same, same
    apart = likely(quiet, wide)
    larger = wide[int(np.argmax(apart))]
    gain = 2.0 * float(apart.max() - one.max())
    if gain < LIMITS.counted_gain or larger <= quiet:
        return same, same
    at_rest = likely(grid, larger)
    walk, walk_dof = _mean(grid, at_rest)
    moving, moving_dof = _mean(wide, apart)
    drift = 2.0 * float(at_rest.max() - at_rest[0])
    return same, Levels(n_rest, n_turn, walk, moving, dof, min(walk_dof, moving_dof), drift, gain)


def chosen(triad: Sequence[tuple[Levels, Levels]]) -> list[Levels]:
    """Levels of the sensors of a triad, with another K in turns only where the data are certain of it."""
    together = sum(apart.excess for _, apart in triad) > LIMITS.turning_walk_gain_of_triad
    return [apart if together or apart.excess > LIMITS.turning_walk_gain else same for same, apart in triad]


def _mean(grid: Array, likelihood: Array) -> tuple[float, float]:
    """Mean of K over its likelihood (log, on the grid), and the degrees of freedom by its spread."""
    weight = weighed(likelihood + np.log(np.gradient(grid)))
    mean = float(weight @ grid)
    spread = 4.0 * float(weight @ (grid - mean) ** 2) / mean**2  # of the logarithm of its square
    return mean, float(degrees(spread)) if spread > 0.0 else np.inf


def _restricted(columns: Array, prior: Array, t: Array, white: Array, walk: Array) -> float:
    """Log of the restricted likelihood of one walk; the residual is the last column."""
    done = whiten(columns, t, white, walk)
    rows = np.vstack([done.rows, np.column_stack([np.eye(len(prior)), prior])])
    gram = rows.T @ rows
    length = np.sqrt(np.diag(gram))
    root = np.linalg.cholesky(gram / np.outer(length, length) + 1e-12 * np.eye(len(length))).T * length
    return float(Solved(root).likelihood(np.log(done.size[1:]).sum()))


STEPS = 12
"""Gauss-Newton steps at most, with first and with last levels of noise; two to four do."""

DONE = 1e-3
"""A step that is smaller than this part of every standard uncertainty ends the iteration."""

LEAST = 1e-8
"""A step that is smaller than this part of the unknowns' typical sizes ends it too."""

SAME = 1e-8
"""Change of a time shift [s] for which the reference is not computed anew."""

SMALL = 0.1
"""Part of its noise that a combination of unknowns has to move a sensor's output by to count for the noise levels."""

FIRST_WALK = 0.02
"""Wander of a bias [1/s] over its white noise, before the data have told it."""


@dataclass(frozen=True, eq=False)
class Sensor:
    """One sensor in the fit: its whitened equations, noise, and residuals (n,) of its blocks less its mean bias."""

    side: Side
    equation: Equation
    noise: Levels
    whitened: WhitenedColumns

    @property
    def axis(self) -> int:
        """Its number in the triad."""
        return self.equation.axis

    @property
    def name(self) -> str:
        """As the record calls it: ``acc_x``."""
        return f"{self.side.sensor}_{'xyz'[self.axis]}"

    @property
    def bias(self) -> float:
        """Mean of its bias over the test [output]."""
        return float(self.whitened.mean[-1])

    @property
    def residual(self) -> Array:
        """Residuals (n,) [output]."""
        return np.asarray(self.equation.residual - self.bias)


@dataclass(frozen=True, eq=False)
class AidedFit:
    """Unknowns ``x`` (P,), their ``covariance`` (P, P), and the sensors behind it, those of a triad together.

    ``references`` by triad; ``identified`` by triad the identifiability of its gains on a perfect table.
    """

    unknowns: Unknowns
    x: Array
    covariance: Array
    sensors: Sequence[Sensor]
    references: Mapping[str, BlockMotion]
    identified: Mapping[str, Identifiability]
    converged: bool


def fit(
    sides: Sequence[Side],
    motion: TableMotion,
    layout: Unknowns,
    gravity: float,
    names: Mapping[str, tuple[str, ...]],
) -> AidedFit:
    """Fit all sensors.

    Parameters
    ----------
    sides : sequence of Side
        The triads.
    motion : Motion
    layout : Unknowns
    gravity : float
        Of the site [m/s^2].
    names : mapping
        By triad, of its gains (9,) row by row, and of the g-sensitivities where they are estimated.
    """
    x = layout.mean.copy()
    late = {side.sensor: layout.places[f"time shift of {side.sensor}"][0] for side in sides}
    references = {side.sensor: reference(side.blocks, motion.seen_by(side.sensor), 0.0) for side in sides}
    converged = False
    for rough in (True, False):
        noise: list[Levels] = []
        for _ in range(STEPS):
            pairs = [
                (side, each)
                for side in sides
                for each in equations(side, references[side.sensor], layout, x, gravity)
            ]
            noise = noise or [
                level
                for triad in sides
                for level in chosen(
                    [noise_of(side, each, layout, x, rough) for side, each in pairs if side is triad]
                )
            ]
            sensors = [
                Sensor(side, each, level, _whiten(side, each, level))
                for (side, each), level in zip(pairs, noise, strict=True)
            ]
            R, right = _stacked(sensors, layout, layout.mean - x)
            inverse = np.linalg.inv(R)
            dx = layout.sd * (inverse @ right)
            done = DONE * np.linalg.norm(inverse, axis=1) + LEAST
            converged = bool(np.all(np.abs(dx) <= layout.sd * done))
            if converged:
                break
            x = x + dx
            for side in sides:
                shift = float(x[late[side.sensor]])
                if abs(shift - references[side.sensor].shift) > SAME:
                    references[side.sensor] = reference(side.blocks, motion.seen_by(side.sensor), shift)
    root = layout.sd[:, None] * inverse
    identified = {side.sensor: _identified(sensors, layout, side.sensor, names) for side in sides}
    return AidedFit(layout, x, root @ root.T, sensors, references, identified, converged)


def noise_of(
    side: Side, equation: Equation, layout: Unknowns, x: Array, rough: bool = False
) -> tuple[Levels, Levels]:
    """Noise of a sensor; ``rough`` from its steps at rest alone, while the fit is far off."""
    blocks = side.blocks
    sd = layout.sd[equation.index]
    y = equation.residual
    floor = 1e-12 * max(float(np.max(np.abs(blocks.y))), 1e-290)
    if rough:
        both = blocks.resting[1:] & blocks.resting[:-1]
        steps = np.diff(y)[both] if np.count_nonzero(both) >= 10 else np.diff(y)
        n = float(np.sqrt(max(0.5 * np.median(steps**2) / 0.455, floor**2) * np.median(blocks.length)))
        level = Levels(n, n, FIRST_WALK * n, FIRST_WALK * n, np.inf, np.inf, 0.0)
        return level, level
    U, s, Vt = np.linalg.svd(equation.columns * sd, full_matrices=False)
    some = s > SMALL * np.std(np.diff(y))
    prior = Vt[some] @ ((layout.mean - x)[equation.index] / sd)
    return levels(y, U[:, some] * s[some], prior, blocks.middle, blocks.length, blocks.resting, floor)


def _whiten(side: Side, equation: Equation, level: Levels) -> WhitenedColumns:
    """Whitened columns of a sensor, the residual last."""
    blocks = side.blocks
    columns = np.column_stack([equation.columns, equation.residual])
    t, length, resting = blocks.middle, blocks.length, blocks.resting
    return whiten(columns, t, level.white(length, resting), level.wander(t, length, resting))


def _stacked(sensors: Sequence[Sensor], layout: Unknowns, from_mean: Array) -> tuple[Array, Array]:
    """Triangular factor (P, P) of all equations and priors, in units of the prior's sd, and its right-hand side."""
    P = len(layout.sd)
    rows = [np.column_stack([np.eye(P), from_mean / layout.sd])]
    for sensor in sensors:
        small = _triangle(sensor.whitened.rows[1:])
        wide = np.zeros((len(small), P + 1))
        index = sensor.equation.index
        wide[:, index] = small[:, :-1] * layout.sd[index]
        wide[:, -1] = small[:, -1]
        rows.append(wide)
    R = _triangle(np.vstack(rows))
    return R[:P, :P], R[:P, -1]


def _identified(
    sensors: Sequence[Sensor], layout: Unknowns, triad: str, names: Mapping[str, tuple[str, ...]]
) -> Identifiability:
    """Identifiability of the gains of a triad, the other unknowns free within their priors.

    Errors of the table do not count: a large one, such as that of the mounting, which turns the frame of all sensors,
    makes the uncertainties large, but no motion would help.
    """
    axes = sorted({sensor.axis for sensor in sensors if sensor.side.sensor == triad})
    groups = [layout.places[f"gain {each}"].reshape(3, -1) for each in _gains(triad, layout)]
    main = np.concatenate([group[axes].ravel() for group in groups])
    numbers = np.split(np.arange(len(names[triad])), np.cumsum([group.size for group in groups])[:-1])
    kept = [number.reshape(3, -1)[axes].ravel() for number in numbers]
    own_names = tuple(names[triad][k] for k in np.concatenate(kept))
    of_table = [layout.places[name] for name in layout.stated if name != "earth rate"]
    whole = np.concatenate([group.ravel() for group in groups])
    others = np.setdiff1d(np.arange(len(layout.sd)), np.concatenate([whole, *of_table]))
    rows = [np.zeros((len(others), len(layout.sd)))]
    rows[0][range(len(others)), others] = 1.0
    for sensor in sensors:
        if sensor.side.sensor != triad:
            continue
        index = sensor.equation.index
        wide = np.zeros((len(sensor.whitened.rows) - 1, len(layout.sd)))
        wide[:, index] = sensor.whitened.rows[1:, :-1] * layout.sd[index]
        rows.append(_triangle(wide))
    R = _triangle(np.vstack(rows)[:, np.r_[others, main]])
    own = R[len(others) :, len(others) :]
    return identify(own, own_names, np.ones(len(main)))


def _gains(triad: str, layout: Unknowns) -> tuple[str, ...]:
    """Groups of gains of a triad."""
    more = "K2" if triad == "acc" else "G"
    return (triad, more) if f"gain {more}" in layout.places else (triad,)


def _triangle(rows: Array) -> Array:
    """Triangular factor (q, p) of rows (n, p), the same in all that least squares asks."""
    return np.asarray(np.linalg.qr(rows, mode="r"))
