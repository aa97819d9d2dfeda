"""Levels of noise of one sensor, by its residuals: white noise at rest and in turns, the walk of its bias in both."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.inference.variances import Solved, degrees, weighed
from inercal.systems.imu.aided.walk import whiten
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
