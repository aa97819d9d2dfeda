"""The gyro of a swing: what turns gravity in the axes of the accelerometers.

A direction u that is fixed in space changes by du/dt = u x w on the axes of the instrument. With w = A y + b, of
outputs y, its change over a window is linear in the twelve unknowns A and b. Then S T = A^-1, and D_F = -A^-1 b. Pushes
of the hand tilt u, and so no better than some 1 % is claimed.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from inercal.foundation.arrays import Array, short_repr
from inercal.systems.imu.sections.limits import LIMITS
from inercal.systems.imu.sections.readings import Flags
from inercal.systems.imu.sections.unknowns import OFF

NAMES: Final = (
    *(f"D_F_{i}" for i in "xyz"),
    *(f"S_{i}" for i in "xyz"),
    *(f"T_{'xyz'[i]}{'xyz'[j]}" for i, j in OFF),
)
"""Coefficients of a gyro in their order."""

_LENGTHS: Final = (10, 30, 100)
"""Samples between two looks at gravity."""

_LONGEST_STEP: Final = 5.0
"""Step of time in a window, in sample intervals, at most."""


@short_repr
@dataclass(frozen=True, eq=False)
class GravityTurns:
    """Rate of turn on the axes of the accelerometers by outputs of a gyro, ``matrix`` y + ``bias``, in rad/s."""

    x: Array
    """The matrix row by row, and the bias (12,)."""
    covariance: Array
    """That of x (12, 12)."""
    axes: tuple[int, ...]
    """Axis about which each channel measures, from 1 on, negative where reversed; 0 where gravity does not show it, as
    for turns about the vertical alone."""
    share: float
    """Share of the motion of gravity that this explains."""

    @property
    def matrix(self) -> Array:
        """(3, 3) [rad/s per unit of the output]; a column for each channel."""
        return self.x[:9].reshape(3, 3)


@short_repr
@dataclass(frozen=True, eq=False)
class SwingGyro:
    """A gyro by the turns of gravity: ``x`` (12,) with ``u`` and ``covariance`` (12, 12), by `NAMES`, in outputs and
    SI. Its axes are those of the accelerometers but for misalignments T."""

    x: Array
    u: Array
    covariance: Array


class _TurnFit(NamedTuple):
    """Unknowns (12,), their covariance, and the share of the motion explained."""

    x: Array
    covariance: Array
    share: float

    @property
    def length(self) -> Array:
        """Lengths (3,) of the columns."""
        return np.asarray(np.linalg.norm(self.x[:9].reshape(3, 3), axis=0))

    @property
    def spread(self) -> Array:
        """Standard uncertainty (3,) of each column over its length."""
        sd = np.sqrt(np.diag(self.covariance)[:9]).reshape(3, 3).max(axis=0)
        return np.asarray(sd / np.maximum(self.length, 1e-300))


def gravity_turns(force: Array, gyro: Array, t: Array) -> GravityTurns | None:
    """Fit outputs of a gyro to the turns of gravity; None where hardly anything turns.

    Parameters
    ----------
    force : (n, 3)
        Specific force, in any unit; rows with NaN do not count.
    gyro : (n, 3)
        Outputs of the gyro.
    t : (n,)
        Time [s].
    """
    usable = np.isfinite(force).all(axis=1) & np.isfinite(gyro).all(axis=1) & np.isfinite(t)
    force, gyro, t = force[usable], gyro[usable], t[usable]
    step = np.clip(np.diff(t), 0.0, None)
    scale = float(np.std(gyro)) if len(gyro) else 0.0
    if not (step > 0.0).any() or scale == 0.0:
        return None
    typical = float(np.median(step[step > 0.0]))
    size = np.linalg.norm(force, axis=1)
    middle = float(np.median(size))
    u = force / np.maximum(size, 1e-9 * middle)[:, None]
    calm = np.abs(size / middle - 1.0) < LIMITS.calm_share
    # what moves u in a step by each unknown: u x e_i y_j and u x e_i, by trapezoids
    across = np.stack([np.cross(u, axis) for axis in np.eye(3)], axis=2)
    by = np.concatenate(
        [(across[..., None] * (gyro / scale)[:, None, None, :]).reshape(-1, 3, 9), across], axis=2
    )
    by = 0.5 * (by[:-1] + by[1:]) * (step / typical)[:, None, None]
    unit = np.repeat([1.0 / (scale * typical), 1.0 / typical], [9, 3])
    fits = []
    for length in _LENGTHS:
        fit = _fitted(by, u, calm, step / typical, length)
        if fit is not None:
            fits.append(_TurnFit(fit.x * unit, fit.covariance * np.outer(unit, unit), fit.share))
    if not fits:
        return None
    best, *others = sorted(
        fits, key=lambda fit: float(np.sort(fit.spread)[1])
    )  # its best two axes are known best
    columns = [np.linalg.norm((fit.x - best.x)[:9].reshape(3, 3), axis=0) for fit in others]
    confirmed = np.min(columns, axis=0, initial=np.inf) < LIMITS.alike_columns * best.length
    return GravityTurns(best.x, best.covariance, _axes(best, confirmed), best.share)


def _fitted(by: Array, u: Array, calm: Flags, step: Array, length: int) -> _TurnFit | None:
    """A fit over windows of a number of samples that begin and end where nothing pushes, and hold no gap."""
    edges = np.arange(0, len(u), length)
    if len(edges) < 15:
        return None
    sums = np.add.reduceat(by, edges[:-1], axis=0)
    sums[-1] = by[edges[-2] : edges[-1]].sum(axis=0)
    moved = np.diff(u[edges], axis=0)
    longest = np.array([step[i:j].max() for i, j in pairwise(edges)])
    use = calm[edges[1:]] & calm[edges[:-1]] & (longest < _LONGEST_STEP)
    if use.sum() < 12 or np.sum(np.linalg.norm(moved[use], axis=1) > 0.05) < 4:
        return None
    A, b = sums[use].reshape(-1, 12), moved[use].ravel()
    x, _, rank, _ = np.linalg.lstsq(A, b, rcond=1e-9)
    if rank < 12:
        return None
    left = b - A @ x
    covariance = np.linalg.inv(A.T @ A) * float(left @ left) / (len(b) - 12)
    return _TurnFit(np.asarray(x, dtype=float), covariance, 1.0 - float(left @ left) / float(b @ b))


def _axes(fit: _TurnFit, confirmed: Flags) -> tuple[int, ...]:
    """The axis of each channel, 0 where it is not told; none where channels share one or differ in their scale."""
    matrix, length = fit.x[:9].reshape(3, 3), np.maximum(fit.length, 1e-300)
    place = np.argmax(np.abs(matrix), axis=0)
    along = matrix[place, range(3)]
    good = confirmed & (fit.spread < LIMITS.told_column) & (np.abs(along) > LIMITS.told_axis * length)
    alike = not good.any() or length[good].max() <= (1.0 + LIMITS.alike_columns) * length[good].min()
    if not alike or len(set(place[good])) < good.sum():
        return (0, 0, 0)
    return tuple(((place + 1) * np.sign(along) * good).astype(int).tolist())


def swing_gyro(turns: GravityTurns) -> SwingGyro | None:
    """Scale factors, misalignments and biases; None where an axis is not told, or is not the accelerometers' own."""
    if turns.axes != (1, 2, 3):
        return None
    gain = np.linalg.inv(turns.matrix)
    S = np.diag(gain)
    T = [gain[i, j] / S[i] for i, j in OFF]
    x = np.concatenate([-gain @ turns.x[9:], S, T])
    J = np.zeros((12, 12))
    J[:3, 9:] = -gain
    for i in range(3):
        for j in range(3):  # a change of an element of the matrix, d, changes the gain by -gain d gain
            change = -np.outer(gain[:, i], gain[j])
            J[:3, 3 * i + j] = -change @ turns.x[9:]
            J[3:6, 3 * i + j] = np.diag(change)
            J[6:, 3 * i + j] = [(change[k, m] - gain[k, m] / S[k] * change[k, k]) / S[k] for k, m in OFF]
    covariance = J @ turns.covariance @ J.T
    least = LIMITS.swing_gyro_u * np.concatenate([np.zeros(3), np.abs(S), np.ones(6)])
    grown = np.maximum(least / np.sqrt(np.diag(covariance)), 1.0)
    covariance *= np.outer(grown, grown)
    return SwingGyro(x, np.sqrt(np.diag(covariance)), covariance)
