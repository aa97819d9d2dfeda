"""Compiled covariance of the platform's errors: a step of the error state, and rows of a measurement.

With dtheta and the states as in `inercal.systems.selfcal.platform.model`,

    dtheta+ = exp(-[w dt]x) dtheta + Jr(w dt) dt dw,   dw = dkg0 + dM w_c + sum dc v,   df = f x dtheta = [f]x dtheta,

Jr the right Jacobian of rotations.

Compiled linearisation of whole recordings, for batch estimators.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from inercal.foundation._jit import allocating, kernel, merged
from inercal.foundation.arrays import Array
from inercal.foundation.geometry.kernels import Quaternion, Vector, exp, right_jacobian, rotate
from inercal.foundation.inference.kalman import SlopeRow
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.kinematics import Axes, joint_axes, unit
from inercal.systems.selfcal.platform.layout import StateLayout
from inercal.systems.selfcal.platform.model import (
    AXIS,
    PLACE,
    STILL,
    Rates,
    Room,
    Vectors,
    accelerometers,
    base_of,
    encoders,
    force_within,
    propagate,
    room,
    turned_by_beta,
    turning,
)
from inercal.systems.selfcal.platform.recording import Steps
from inercal.systems.selfcal.platform.rig import World
from inercal.systems.selfcal.platform.states import BETA, WALK


class LinearisedRows(NamedTuple):
    """Model of m rows: attitude ``of_encoders`` (m, 4), outputs of the accelerometers ``expected`` (m, 3) [m/s^2], and
    the changes ``by`` (m, 6, 3 + p) of outputs and attitude [rad, about the axes of p] per change of the error state.
    """

    of_encoders: Array
    expected: Array
    by: Array


@allocating
def linearise_rows(
    q: Array, th: Array, steps: Steps, c: Array, layout: StateLayout, world: World, out: LinearisedRows
) -> None:
    """Linearise encoders which read ``th`` (m, 3) [rad], and accelerometers, at attitudes ``q`` (m, 4) after ``steps``;
    ``c`` is the full vector, linear form. ``by`` comes in as zeros."""
    own, base, columns = room(), base_of(c, layout.based, world), layout.columns
    for k in range(len(q)):
        w, later = steps.rate[k], steps.later[k]
        later = w if math.isnan(later[0]) else later
        read = Rates((w[0], w[1], w[2]), (later[0], later[1], later[2]))
        angles = (th[k, 0], th[k, 1], th[k, 2])
        at = encoders(angles, read, base, c, layout, world, own)
        for i in range(4):
            out.of_encoders[k, i] = at[i]
        for a in range(len(columns)):
            for i in range(3):
                out.by[k, 3 + i, columns[a]] = own.axes[a, i]
        at = (q[k, 0], q[k, 1], q[k, 2], q[k, 3])
        expected, _ = accelerometers(at, read, steps.warm[k], base, c, layout, own)
        for i in range(3):
            out.expected[k, i] = expected[i]
            for a in range(layout.sizes[i]):
                out.by[k, i, layout.rows[i, a]] = own.entries[i, a]


@allocating
def linearise_steps(
    q: Array, steps: Steps, c: Array, layout: StateLayout, world: World, turn: Array, slope: Array
) -> None:
    """Put rotation vectors ``turn`` (m, 3) [rad] of the platform against inertial space in each step from attitude
    ``q`` (m, 4), and the change ``slope`` (m, 3, p) of the attitude after it, about the axes of p."""
    own, base, p = room(), base_of(c, layout.based, world), slope.shape[2]
    each, work = np.zeros((3 + p, p)), np.empty((3, p))  # an error of each state alone
    for a in range(p):
        each[3 + a, a] = 1.0
    for k in range(len(q)):
        w, dt = (steps.rate[k, 0], steps.rate[k, 1], steps.rate[k, 2]), steps.dt[k]
        at = (q[k, 0], q[k, 1], q[k, 2], q[k, 3])
        f = force_within(at, w, 0.5 * dt, base.up, layout.by_force)
        rate = turning(w, f, steps.warm[k], c, layout, own)
        for i in range(3):
            turn[k, i] = rate[i] * dt
        at = propagate(at, rate, base.earth, dt)
        F = transition(w, rate, dt, at, base.earth, c, layout.based)
        times(F, each, layout, own, slope[k], work)


FLOOR = LIMITS.encoder_floor
"""As kernels take it."""

STIFF = LIMITS.stiff_share
"""As kernels take it."""

AXES = LIMITS.axes_known
"""As kernels take it [rad]."""

WALK_TIME = LIMITS.walk_time
"""As kernels take it [s]."""

Places: TypeAlias = NDArray[np.int64]
"""Place (K,) of each parameter of the full vector in the error state, -1 where it is no state."""


class Transition(NamedTuple):
    """The transition of the attitude's error in a step of ``dt`` [s] commanded at ``w`` (3,) [rad/s], by columns:
    ``back`` by itself, ``gain`` by an error of the rate, ``by_base`` by one of beta."""

    w: Vector
    dt: float
    back: Vectors
    gain: Vectors
    by_base: Vectors


@merged
def transition(
    w: Vector, rate: Vector, dt: float, q: Quaternion, earth: Vector, c: Array, based: bool
) -> Transition:
    """The transition of a step at a ``rate`` (3,) [rad/s] to attitude ``q`` (4,); ``earth`` (3,) [rad/s] is in the
    frame of the encoders."""
    turn = (rate[0] * dt, rate[1] * dt, rate[2] * dt)
    back, j = exp((-turn[0], -turn[1], -turn[2])), right_jacobian(turn)
    by_base = turned_by_beta(earth, q, c) if based else (STILL, STILL, STILL)
    gain = (
        (dt * j[0][0], dt * j[1][0], dt * j[2][0]),
        (dt * j[0][1], dt * j[1][1], dt * j[2][1]),
        (dt * j[0][2], dt * j[1][2], dt * j[2][2]),
    )
    axes = (rotate(back, unit(0, 1.0)), rotate(back, unit(1, 1.0)), rotate(back, unit(2, 1.0)))
    return Transition(w, dt, axes, gain, by_base)


@merged
def times(F: Transition, X: Array, layout: StateLayout, own: Room, top: Array, work: Array) -> None:
    """Put the first three rows of ``F X`` into ``top`` (3, m), ``X`` (n, m) a covariance, or sensitivities of attitude
    and states; quantities of the rate as `turning` left them in ``own``; ``work`` (3, m) is used up."""
    n, m, terms, w, dt = X.shape[0], X.shape[1], layout.terms, F.w, F.dt
    work.fill(0.0)
    for a in range(layout.until[0]):  # each term is a row of one axis alone
        at, v, axis = terms[a, PLACE], own.of_rate[a], terms[a, AXIS]
        if 0 <= at < n:
            for k in range(m):
                work[axis, k] += v * X[at, k]
    for k in range(m):
        x = work[0, k] + X[3, k] + w[1] * X[9, k] - w[2] * X[12, k]
        y = work[1, k] + X[4, k] + w[2] * X[10, k] - w[0] * X[13, k]
        z = work[2, k] + X[5, k] + w[0] * X[11, k] - w[1] * X[14, k]
        for i in range(3):
            top[i, k] = (
                F.back[0][i] * X[0, k] + F.back[1][i] * X[1, k] + F.back[2][i] * X[2, k]
                + (F.gain[0][i] * x + F.gain[1][i] * y + F.gain[2][i] * z)
            )  # fmt: skip
    for j in range(3 if layout.based else 0):
        at = layout.place[BETA + j]
        for i in range(3 if 0 <= at < n else 0):
            for k in range(m):
                top[i, k] -= dt * F.by_base[j][i] * X[at, k]


@merged
def add_unknown(F: Transition, n: int, layout: StateLayout, own: Room, top: Array) -> None:
    """Add to ``top`` (3, m), as of `times`, what errors outside the ``n`` of the error state, with the places behind
    them, do in a step."""
    terms = layout.terms
    for a in range(layout.until[0]):
        at, axis = terms[a, PLACE], F.gain[terms[a, AXIS]]
        for i in range(3 if at >= n else 0):
            top[i, at - n] += own.of_rate[a] * axis[i]
    for j in range(3 if layout.based else 0):
        at = layout.place[BETA + j]
        for i in range(3 if at >= n else 0):
            top[i, at - n] -= F.dt * F.by_base[j][i]


@merged
def propagate_covariance(
    P: Array, F: Transition, layout: StateLayout, own: Room, noise: float, top: Array, work: Array
) -> None:
    """Covariance ``P`` (n, n) of the error state after a step, in place; ``noise`` [rad^2] the variance of the attitude
    gained in it; quantities of the rate as `turning` left them in ``own``; ``top``, ``work`` (3, n) are used up."""
    n, terms, w, d = len(P), layout.terms, F.w, own.small[0]
    times(F, P, layout, own, top, work)
    for i in range(3):
        d[0] = top[i, 3] + w[1] * top[i, 9] - w[2] * top[i, 12]
        d[1] = top[i, 4] + w[2] * top[i, 10] - w[0] * top[i, 13]
        d[2] = top[i, 5] + w[0] * top[i, 11] - w[1] * top[i, 14]
        for a in range(layout.until[0]):
            if 0 <= terms[a, PLACE] < n:
                d[terms[a, AXIS]] += own.of_rate[a] * top[i, terms[a, PLACE]]
        for k in range(i + 1):
            value = noise if i == k else 0.0
            for j in range(3):
                value += F.back[j][k] * top[i, j] + F.gain[j][k] * d[j]
                if layout.based and 0 <= layout.place[BETA + j] < n:
                    value -= F.dt * F.by_base[j][k] * top[i, layout.place[BETA + j]]
            P[i, k], P[k, i] = value, value
    for m in range(3, n):
        for i in range(3):
            P[i, m], P[m, i] = top[i, m], top[i, m]


@kernel
def wander(P: Array, c: Array, place: Places, of_gyros: float, of_accelerometers: float, dt: float) -> None:
    """Biases that walk, and their covariance in ``P`` (3 + p, 3 + p), after ``dt`` [s], in place; they are
    exponentially correlated, of standard deviations ``of_gyros`` [rad/s] and ``of_accelerometers`` [m/s^2]."""
    keep = math.exp(-dt / WALK_TIME)
    for i in range(6):
        at, sigma = place[WALK + i], of_gyros if i < 3 else of_accelerometers
        if 0 <= at < len(P):
            c[WALK + i] *= keep
            for m in range(len(P)):
                P[at, m] *= keep
                P[m, at] *= keep
            P[at, at] += sigma * sigma * (1.0 - keep * keep)


@kernel
def encoder_row(i: int, columns: Places, axes: Array, row: SlopeRow) -> int:
    """Put the derivative of the attitude that encoders have about axis ``i`` of p, less that of the state, into a
    ``row``; returns the number of entries. ``columns`` (m,) are the places of the ``axes``."""
    row.places[0], row.values[0] = i, 1.0
    for a in range(len(columns)):
        row.places[1 + a], row.values[1 + a] = columns[a], -axes[a, i]
    return 1 + len(columns)


@kernel
def decorrelated_row(i: int, root: Vector, columns: Places, axes: Array, row: SlopeRow) -> int:
    """The same of the ``i``-th of their decorrelated scalars, of variance 1; ``root`` as of `encoder_roots`."""
    for j in range(i + 1):
        row.places[j], row.values[j] = j, root[j]
    for a in range(len(columns)):
        row.places[1 + i + a] = columns[a]
        row.values[1 + i + a] = -(root[0] * axes[a, 0] + root[1] * axes[a, 1] + root[2] * axes[a, 2])
    return 1 + i + len(columns)


@kernel
def encoder_roots(
    th: Vector | Array, axes: Axes, signs: Array, sigma: float, joints: Array, floor: float
) -> tuple[Vectors, Vector]:
    """Inverse Cholesky factor (lower, rows) of the covariance of an encoder attitude, and its variances (3,): of
    ``sigma^2 J D J^T + floor I`` [rad^2] about the axes of p at gimbal angles ``th`` (3,), D diagonal:
    ``joints`` (3,), the variance of each joint's angle over that of an encoder.
    """
    jx, jy, jz = joint_axes(th, axes, signs)
    s, dx, dy, dz = sigma * sigma, joints[0], joints[1], joints[2]
    r00 = s * (dx * jx[0] * jx[0] + dy * jy[0] * jy[0] + dz * jz[0] * jz[0]) + floor
    r11 = s * (dx * jx[1] * jx[1] + dy * jy[1] * jy[1] + dz * jz[1] * jz[1]) + floor
    r22 = s * (dx * jx[2] * jx[2] + dy * jy[2] * jy[2] + dz * jz[2] * jz[2]) + floor
    r10 = s * (dx * jx[1] * jx[0] + dy * jy[1] * jy[0] + dz * jz[1] * jz[0])
    r20 = s * (dx * jx[2] * jx[0] + dy * jy[2] * jy[0] + dz * jz[2] * jz[0])
    r21 = s * (dx * jx[2] * jx[1] + dy * jy[2] * jy[1] + dz * jz[2] * jz[1])
    l00 = math.sqrt(r00)
    l10, l20 = r10 / l00, r20 / l00
    l11 = math.sqrt(r11 - l10 * l10)
    l21 = (r21 - l20 * l10) / l11
    l22 = math.sqrt(r22 - l20 * l20 - l21 * l21)
    i10 = -l10 / (l00 * l11)
    i21 = -l21 / (l11 * l22)
    i20 = -(l20 / l00 + l21 * i10) / l22
    return ((1.0 / l00, 0.0, 0.0), (i10, 1.0 / l11, 0.0), (i20, i21, 1.0 / l22)), (r00, r11, r22)
