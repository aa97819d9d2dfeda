"""Scale factors of the gyro without the turns: by gravity, carried from rest to rest through all motion between.

Where several motions may have been the turn, the transfer of gravity tells which. The verticals are those of the
accelerometers, whose misalignments are as uncertain as the positions: the misalignments of both triads are unknowns
with a prior.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.rotations import angle_between
from inercal.foundation.inference.least_squares import NonlinearFit, solve
from inercal.foundation.instruments.triad import TriadModel
from inercal.foundation.records.column import Triad
from inercal.foundation.records.dwells import Dwell
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.recording import clipped_rows
from inercal.systems.imu.sections.cutting.motions import SectionMotion, part
from inercal.systems.imu.turns import Turns, carried_with_derivatives, cut_turns, first_guess

MISALIGNMENT = 0.03
"""Prior standard deviation of each misalignment of either triad [rad]."""

MISS, MISS_DOF = 3e-3, 3.0
"""Miss of a carried vertical [rad] to be expected, and the degrees of freedom that this is worth beside the data."""

_ACROSS = [(i, j) for i in range(3) for j in range(3) if i != j]
_NAMES = (*(f"S_{i}" for i in "xyz"), *(f"{s}_{i}{j}" for s in "TM" for i in "xyz" for j in "xyz" if i != j))


@dataclass(frozen=True, eq=False)
class AtRest:
    """Level of the accelerometers, bias (3,) of the gyro [output], and its g-sensitivity (3, 3) [output per g]."""

    accelerometer: TriadModel
    rate_bias: Array
    by_g: Array

    @staticmethod
    def of(acc: Triad, gyro: Triad, sides: Mapping[str, Dwell]) -> AtRest | None:
        """By the six sides, by name as ``+x``; None without all of them."""
        names = [f"{sign}{letter}" for letter in "xyz" for sign in "+-"]
        if not all(name in sides for name in names):
            return None
        spans = [sides[name] for name in names]
        force = np.array([np.nanmean(span.of(acc.values), axis=0) for span in spans])
        rate = np.array([np.nanmean(part(gyro, acc, span.start, span.stop)[1], axis=0) for span in spans])
        gain = 0.5 * (force[0::2] - force[1::2]).T
        scale, bias = np.diag(gain), np.diagonal(0.5 * (force[0::2] + force[1::2]))
        model = TriadModel(scale, gain / scale[:, None], bias)
        return AtRest(model, rate.mean(axis=0), 0.5 * (rate[0::2] - rate[1::2]).T)


@dataclass(frozen=True, eq=False)
class Carried:
    """``scale`` (3,) [output per rad/s] and ``u`` (3,), its standard uncertainty as a part of it, inf where nothing is
    known."""

    scale: Array
    u: Array


def carry(
    acc: Triad, gyro: Triad, holds: Sequence[Dwell], at_rest: AtRest, motions: Sequence[SectionMotion]
) -> Carried:
    """Fit scale factors and misalignments to the verticals in all holds; ``motions`` may be turns about an axis."""
    nothing = Carried(np.ones(3), np.full(3, np.inf))
    model = at_rest.accelerometer
    f = np.array([model.correct(hold.of(acc.values).mean(axis=0)) for hold in holds])
    f /= np.linalg.norm(f, axis=1, keepdims=True)
    spans, clipped = [], clipped_rows(gyro)
    for k, (here, there) in enumerate(itertools.pairwise(holds)):
        start, stop = (int(np.searchsorted(gyro.t, acc.t[row])) for row in (here.stop - 1, there.start))
        if _is_recorded(gyro, clipped, start, stop):
            spans.append((k, start, stop))
    tilted = [k for k, _, _ in spans if float(angle_between(f[k], f[k + 1])) > LIMITS.transfer_tilt]
    if len(tilted) < LIMITS.fewest_transfers:
        return nothing
    force = model.correct(acc.values)
    if gyro.t is not acc.t:
        force = np.column_stack([np.interp(gyro.t, acc.t, column) for column in force.T])
    if not all(np.isfinite(force[start : stop + 1]).all() for _, start, stop in spans):
        return nothing
    ways = cut_turns(gyro.t, gyro.values, force, spans)
    guesses = [(*first_guess(ways, f, at_rest.rate_bias, sign * np.eye(3)), sign) for sign in (1.0, -1.0)]
    scale, _, sign = min(guesses, key=lambda guess: guess[1])
    problem = _Transfer(ways, f, at_rest, _directions(motions), sign)
    x, miss = np.concatenate([np.full(3, scale), np.zeros(12)]), 0.05
    for _ in range(4):
        fit = problem.solved(x, miss)
        x, miss = fit.x, problem.miss(fit, miss)
    if not fit.converged or np.any(x[:3] <= 0.0):
        return nothing
    return Carried(x[:3], np.sqrt(np.diag(fit.unit_covariance)[:3]) / x[:3])


def _directions(motions: Sequence[SectionMotion]) -> Array:
    """(3, 3): responses of the outputs to a turn about each axis (column), over that of its own, by the motions."""
    T = np.eye(3)
    for axis in range(3):
        own = [motion for motion in motions if motion.axis == axis]
        if own:
            largest = max(own, key=lambda motion: abs(motion.rotation[axis])).rotation
            T[:, axis] = largest / largest[axis]
    return T


@dataclass(frozen=True, eq=False)
class _Transfer:
    """Unknowns: scale factors, errors of the gyro's and of the accelerometers' misalignments."""

    ways: Turns
    f: Array
    at_rest: AtRest
    T: Array
    sign: float

    def solved(self, x: Array, miss: float) -> NonlinearFit:
        """The fit for that standard deviation of a miss [rad]."""
        prior = np.hstack([np.zeros((12, 3)), np.eye(12) / MISALIGNMENT])
        typical = np.concatenate([x[:3], np.full(12, MISALIGNMENT)])

        def residuals(x: Array) -> Array:
            return np.concatenate([self._misses(x)[0].ravel() / miss, prior @ x])

        def jacobian(x: Array) -> Array:
            return np.vstack([self._misses(x)[1].reshape(-1, 15) / miss, prior])

        return solve(residuals, jacobian, x, _NAMES, typical)

    def miss(self, fit: NonlinearFit, miss: float) -> float:
        """Standard deviation of a miss by the residuals, and that to be expected."""
        rows = 3 * len(self.ways)
        J, left = fit.jacobian[:rows], miss * fit.residuals[:rows]
        # a miss has two dimensions; the fit takes what the data determine of the parameters
        dof = max(2.0 * len(self.ways) - float(np.sum((J @ fit.unit_covariance) * J)), 0.0)
        return float(np.sqrt((left @ left + MISS_DOF * MISS**2) / (dof + MISS_DOF)))

    def _misses(self, x: Array) -> tuple[Array, Array]:
        """Carried less measured verticals (m, 3), and their derivatives (m, 3, 15)."""
        T, M = self.T.copy(), np.eye(3)
        for k, (i, j) in enumerate(_ACROSS):
            T[i, j] += x[3 + k]
            M[i, j] += x[9 + k]
        model = TriadModel(x[:3], self.sign * T, self.at_rest.rate_bias)
        tilted = self.f @ M.T
        size = np.linalg.norm(tilted, axis=1)
        up = tilted / size[:, None]
        end, by, through = carried_with_derivatives(self.ways, up, model, self.at_rest.by_g)
        by_up = np.zeros((len(up), 3, 6))
        for k, (i, j) in enumerate(_ACROSS):
            moved = self.f[:, j, None] * np.eye(3)[i]
            by_up[:, :, k] = (moved - up * np.sum(moved * up, axis=1, keepdims=True)) / size[:, None]
        first, last = self.ways.first, self.ways.last
        of_gyro = np.concatenate([by[:, :, 3:6], self.sign * by[:, :, 6:12]], axis=2)
        return end - up[last], np.concatenate([of_gyro, through @ by_up[first] - by_up[last]], axis=2)


def _is_recorded(gyro: Triad, clipped: NDArray[np.bool_], start: int, stop: int) -> bool:
    """True if the gyro recorded a whole transfer, from sample ``start`` to ``stop``.

    ``clipped`` (n,) are the rows in which the gyro saturates.
    """
    part = slice(start, stop + 1)
    steps = np.diff(gyro.t[part])
    whole = start < stop and bool(np.all((steps > 0.0) & (steps <= LIMITS.motion_gap / gyro.rate)))
    sound = bool(np.isfinite(gyro.values[part]).all()) and not clipped[part].any()
    return whole and sound and LIMITS.shortest_transfer < float(steps.sum()) < LIMITS.longest_transfer
