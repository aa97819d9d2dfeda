"""Rotations of moves by the samples of a gyro, all moves side by side, with their derivatives.

Over a sample interval the rate integrates to phi = T^-1 [(Y - D_F dt) / S - G X - b dt], with Y and X the integrals of
the outputs and of specific force, and b what a session adds to the bias. Y is that of a cubic through four samples, and
what the axis turns within an interval adds phi x (phi_next - phi_before) / 24 (Bortz 1971, IEEE Trans. Aerospace and
Electronic Systems 7(1)): at 20 Hz trapezoids alone are off by 10 mrad in a fast move. A change d of phi_i turns what
was before the move by R_i J(phi_i) d, R_i the rotation before it and J the left Jacobian of the rotation group (Sola,
Deray, Atchuthan, arXiv:1812.01537). So sums of R_i J times dt, phi and X are all that is needed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from inercal.foundation.arrays import Array
from inercal.systems.imu.sections.unknowns import (
    CLOCK,
    COMMON,
    D_F,
    K0,
    K1,
    OFF,
    G,
    M,
    S,
    T,
    cross,
    matrix,
)

_EVEN: Final = 1.2
"""Ratio of neighbouring steps of time up to which a cubic is laid through their samples."""


@dataclass(frozen=True, eq=False)
class Move:
    """A motion between two rests: samples from the last of section ``first`` to the first of section ``last``.

    ``t`` (L,) [s], outputs ``gyro`` (L, 3) and ``acc`` (L, 3), None where there are none. ``turn`` (3,) is the rotation
    vector [rad] on the axes of the case by which it turned in all, None where nobody knows it, within the standard
    uncertainty ``turn_u`` [rad] about each axis.
    """

    first: int
    last: int
    t: Array
    gyro: Array
    acc: Array | None = None
    turn: Array | None = None
    turn_u: float = 0.0

    @property
    def duration(self) -> float:
        """From its first to its last sample [s]."""
        return float(self.t[-1] - self.t[0])


@dataclass(frozen=True, eq=False)
class Increments:
    """Integrals over the intervals of m moves, padded with zeros to the longest: ``dt`` (L, m) [s], of outputs ``gyro``
    (L, m, 3) and ``acc`` (L, m, 3)."""

    dt: Array
    gyro: Array
    acc: Array

    @property
    def durations(self) -> Array:
        """Of each move (m,) [s]."""
        return np.asarray(self.dt.sum(axis=0))


@dataclass(frozen=True, eq=False)
class Rotations:
    """Rotations ``R`` (m, 3, 3) from the axes at the end of each move to those at its begin, at the ``unknowns`` (43,)
    and biases ``session`` (m, 3) [rad/s]; small rotations before the move ``by_unknowns`` (m, 3, 43) and ``by_session``
    (m, 3, 3) by them."""

    unknowns: Array
    session: Array
    R: Array
    by_unknowns: Array
    by_session: Array

    def near(self, unknowns: Array, session: Array, reach: float) -> Rotations | None:
        """Those at other unknowns by the derivatives, None where a rotation changes by more than ``reach`` [rad]."""
        change = self.by_unknowns @ (unknowns - self.unknowns)
        change += (self.by_session @ (session - self.session)[..., None])[..., 0]
        if np.max(np.abs(change), initial=0.0) > reach:
            return None
        if not change.any():
            return Rotations(unknowns, session, self.R, self.by_unknowns, self.by_session)
        bent = np.eye(3) + 0.5 * skews(change)  # the left Jacobian, else the search would not settle
        by = (bent @ self.by_unknowns, bent @ self.by_session)
        return Rotations(unknowns, session, exponentials(change) @ self.R, *by)


def increments(moves: Sequence[Move]) -> Increments:
    """The integrals of moves."""
    longest = max((len(move.t) - 1 for move in moves), default=0)
    dt = np.zeros((longest, len(moves)))
    gyro, acc = np.zeros((2, longest, len(moves), 3))
    for k, move in enumerate(moves):
        step = np.diff(move.t)
        dt[: len(step), k] = step
        for padded, y in ((gyro, move.gyro), (acc, move.acc)):
            if y is not None:
                padded[: len(step), k] = _mean_outputs(y, step) * step[:, None]
    return Increments(dt, gyro, acc)


def _mean_outputs(y: Array, step: Array) -> Array:
    """Means (L - 1, 3) over the intervals of outputs y (L, 3): of cubics, at the ends and about uneven steps of
    straight lines."""
    mean = 0.5 * (y[1:] + y[:-1])
    if len(step) > 2:
        even = np.maximum(step[2:], step[:-2]) < _EVEN * np.minimum(step[2:], step[:-2])
        even &= np.abs(np.log(step[1:-1] / step[2:])) < np.log(_EVEN)
        mean[1:-1] -= np.where(even[:, None], (y[3:] - y[2:-1] - y[1:-2] + y[:-3]) / 24.0, 0.0)
    return np.asarray(mean)


def rotations(moved: Increments, unknowns: Array, session: Array) -> Rotations:
    """Rotations of moves at the unknowns (43,) and biases of their sessions (m, 3), with derivatives."""
    x, dt = unknowns, moved.dt[..., None]
    t, s, g = matrix(x[T]), x[S], x[G].reshape(3, 3)
    A = np.linalg.inv(t) / s
    force = (moved.acc - dt * x[K0]) / x[K1] @ np.linalg.inv(matrix(x[M])).T
    drift = force @ g.T
    phi = (moved.gyro - dt * x[D_F] - s * (drift + dt * session)) @ A.T
    phi += _turning_axes(phi)
    steps, L, m = exponentials(phi), *moved.dt.shape
    R = np.empty((L + 1, m, 3, 3))
    R[0] = np.eye(3)
    for i in range(L):
        np.matmul(R[i], steps[i], out=R[i + 1])
    # the left Jacobian to third order: the angle of a sample interval is small
    turned = R[:-1] @ _polynomial(phi, 1.0 - np.sum(phi**2, axis=-1) / 6.0, 0.5, 1.0 / 6.0)
    factors = np.concatenate([dt, phi, force], axis=-1).transpose(1, 0, 2)
    sums = (turned.reshape(L, m, 9).transpose(1, 2, 0) @ factors).reshape(m, 3, 3, 7)
    by = sums.transpose(3, 0, 1, 2) @ A  # (7, m, 3, channel)
    out = np.zeros((m, 3, COMMON))
    out[:, :, D_F] = -by[0]
    out[:, :, S] = -np.einsum("kmij,jk->mij", by[1:4], t) - np.einsum("kmij,jk->mij", by[4:7], g)
    out[:, :, T] = np.stack([-s[j] * by[1 + k, :, :, j] for j, k in OFF], axis=-1)
    out[:, :, G] = np.stack([-s[j] * by[4 + k, :, :, j] for j in range(3) for k in range(3)], axis=-1)
    # a clock that is fast makes intervals too long
    out[:, :, CLOCK] = -np.einsum("mikk->mi", sums[..., 1:4])
    return Rotations(x.copy(), session.copy(), R[-1], out, -by[0] * s)


def _turning_axes(phi: Array) -> Array:
    """Additions of the turning of their axes to the rotation vectors (L, m, 3) of intervals."""
    change = np.zeros_like(phi)
    change[:-1] += phi[1:]
    change[1:] -= phi[:-1]
    return np.asarray(cross(phi, change) / 24.0)


def net_rotations(phi: Array) -> Array:
    """Products (m, 3, 3) of exp(phi) (L, m, 3): of neighbours, then of their products, and so on."""
    R = exponentials(phi)
    while len(R) > 1:
        pairs = len(R) // 2
        R = np.concatenate([R[: 2 * pairs : 2] @ R[1 : 2 * pairs : 2], R[2 * pairs :]])
    return np.asarray(R[0])


def exponentials(v: Array) -> Array:
    """Rotations (..., 3, 3) by the angles and axes of vectors (..., 3)."""
    angle = np.sqrt(np.sum(v * v, axis=-1))
    return _polynomial(v, np.cos(angle), np.sinc(angle / np.pi), 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2)


def skews(v: Array) -> Array:
    """Matrices (..., 3, 3) of the vector product with v (..., 3)."""
    return _polynomial(v, np.zeros(v.shape[:-1]), 1.0, 0.0)


def _polynomial(v: Array, one: Array, first: Array | float, second: Array | float) -> Array:
    """``one`` I + ``first`` [v x] + ``second`` v v^T (..., 3, 3)."""
    out = (np.asarray(second)[..., None] * v)[..., :, None] * v[..., None, :]
    w = np.asarray(first)[..., None] * v
    for i, j, k in ((2, 1, 0), (0, 2, 1), (1, 0, 2)):
        out[..., i, j] += w[..., k]
        out[..., j, i] -= w[..., k]
        out[..., k, k] += one
    return np.asarray(out)
