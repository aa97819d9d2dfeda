"""Compiled Jacobians of the platform, by small errors of attitude and coefficients.

The error state is dtheta (3) [rad], right-handed about the axes of p, then the coefficients (p,) in the linear form:
``q_true = q qexp(dtheta)``. Both the error-state filter and the bounds rest on these.

    dtheta+ = exp(-[w dt]x) dtheta + Jr(w dt) dt dw,   dw = dkg0 + dM w_c,   Jr the right Jacobian of rotations
    df = f x dtheta = [f]x dtheta

With the extended model earth rate and gravity turn with beta: d(R(beta) v) = -[R v]x Jr(-beta) dbeta. States of the
rig have a column each, an axis in p [per unit of the state]: of the rotation gained in a step (`dynamics_columns`), of
the attitude that encoders have (`encoder_columns`), and entries of an accelerometer's row (`accelerometer_row`).
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from inercal._jit import allocating, kernel
from inercal.arrays import Array
from inercal.estimate.kalman import Row
from inercal.geometry.kernels import Quaternion, Vector, exp, multiply, right_jacobian, rotate
from inercal.selfcal.limits import LIMITS
from inercal.selfcal.platform.kinematics import Axes, elementary, joint_axes, unit
from inercal.selfcal.platform.model import (
    Rates,
    Sensing,
    about_turning,
    centripetal,
    platform_rate,
    rate_at,
    squared,
)
from inercal.selfcal.platform.states import (
    ASYM,
    BY_FORCE,
    GAMMA,
    K2,
    LEVER,
    NONORTH,
    SAG,
    TAU,
    WALK,
    WARM,
    WAVE,
    ZERO_Y,
    Layout,
)

Vectors: TypeAlias = tuple[Vector, Vector, Vector]

FLOOR = LIMITS.encoder_floor
"""As kernels take it."""

STIFF = LIMITS.stiff_share
"""As kernels take it."""

AXES = LIMITS.axes_known
"""As kernels take it [rad]."""

WALK_TIME = LIMITS.walk_time
"""As kernels take it [s]."""

WIDEST = 40
"""Most entries of a row of the model, and most columns of states."""

Places: TypeAlias = NDArray[np.int64]
"""Place (K,) of each parameter of the full vector in the error state, -1 where it is no state."""


class Columns(NamedTuple):
    """Room for ``WIDEST`` columns: ``places`` in the error state, ``axes`` (WIDEST, 3) in p per unit of the state."""

    places: NDArray[np.int64]
    axes: Array


@allocating
def empty_columns() -> Columns:
    """Room for columns."""
    return Columns(np.empty(WIDEST, dtype=np.int64), np.empty((WIDEST, 3)))


@kernel
def put(columns: Columns, count: int, place: int, v: Vector, factor: float) -> int:
    """Put a column into its room where ``place`` is that of a state; returns the number of columns."""
    if place < 0:
        return count
    columns.places[count] = place
    for i in range(3):
        columns.axes[count, i] = factor * v[i]
    return count + 1


@kernel
def cross(a: Vector, b: Vector) -> Vector:
    """Cross product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def turned_by_beta(v: Vector, q: Quaternion, c: Array) -> Vectors:
    """Changes of a vector of the base, in p at attitude ``q``, per change of each component of beta; ``v`` (3,) is the
    vector in the frame of the encoders, turned by beta already."""
    j = right_jacobian((-c[21], -c[22], -c[23]))
    back = (q[0], -q[1], -q[2], -q[3])
    return (
        rotate(back, cross((j[0][0], j[1][0], j[2][0]), v)),
        rotate(back, cross((j[0][1], j[1][1], j[2][1]), v)),
        rotate(back, cross((j[0][2], j[1][2], j[2][2]), v)),
    )


class Step(NamedTuple):
    """A step of the platform: its ``commanded`` rate and its own ``rate`` (3,) [rad/s]; ``earth`` (3,) [rad/s] in the
    frame of the encoders; the ``attitude`` (4,) after it; ``dt`` [s]; specific ``force`` (3,) [m/s^2] in it, how
    ``warm`` [K] it is."""

    commanded: Vector
    rate: Vector
    earth: Vector
    attitude: Quaternion
    dt: float
    force: Vector
    warm: float


@kernel
def dynamics_columns(c: Array, place: Places, step: Step, columns: Columns) -> int:
    """Columns of the rotation gained in a step, but those of the paper's states; returns their number."""
    count, dt, w = 0, step.dt, step.commanded
    j = right_jacobian((step.rate[0] * dt, step.rate[1] * dt, step.rate[2] * dt))
    for i in range(3):
        axis = (j[0][i], j[1][i], j[2][i])
        count = put(columns, count, place[18 + i], axis, dt * w[i])
        count = put(columns, count, place[ASYM + i], axis, 0.5 * dt * abs(w[i]))
        count = put(columns, count, place[WALK + i], axis, dt)
        for k in range(3):
            count = put(columns, count, place[BY_FORCE + 3 * i + k], axis, dt * step.force[k])
        count = put(columns, count, place[WARM + i], axis, dt * step.warm)
    by_beta = turned_by_beta(step.earth, step.attitude, c)
    for i in range(3):
        count = put(columns, count, place[21 + i], by_beta[i], -dt)
    return count


@kernel
def add_columns(P: Array, columns: Columns, count: int, top: Array) -> None:
    """Add to ``top`` (3, n) the rows of ``P`` (n, n) that states have with their columns."""
    for a in range(count):
        of_state = columns.places[a]
        for i in range(3):
            axis = columns.axes[a, i]
            for m in range(len(P)):
                top[i, m] += axis * P[of_state, m]


@kernel
def along_columns(columns: Columns, count: int, k: int, top: Array, i: int) -> float:
    """Sum of component ``k`` of the columns, each times the entry of ``top`` of row ``i`` at the place of its state."""
    total = 0.0
    for a in range(count):
        total += columns.axes[a, k] * top[i, columns.places[a]]
    return total


@kernel
def propagate_covariance(
    P: Array, c: Array, place: Places, step: Step, noise: float, top: Array, columns: Columns
) -> None:
    """Covariance ``P`` (3 + p, 3 + p) of the error state after a step, in place; ``c`` the full vector, ``noise``
    [rad^2] the variance of the attitude gained in the step; ``top`` (3, 3 + p) and ``columns`` are used up."""
    n, w, rate, dt = len(P), step.commanded, step.rate, step.dt
    j = right_jacobian((rate[0] * dt, rate[1] * dt, rate[2] * dt))
    back = exp((-rate[0] * dt, -rate[1] * dt, -rate[2] * dt))
    a0, a1, a2 = rotate(back, (1.0, 0.0, 0.0)), rotate(back, (0.0, 1.0, 0.0)), rotate(back, (0.0, 0.0, 1.0))
    count = dynamics_columns(c, place, step, columns) if len(c) > 18 else 0
    for m in range(n):
        # change of the platform's rate, about each axis
        x = P[3, m] + w[1] * P[9, m] - w[2] * P[12, m]
        y = P[4, m] + w[2] * P[10, m] - w[0] * P[13, m]
        z = P[5, m] + w[0] * P[11, m] - w[1] * P[14, m]
        for i in range(3):
            top[i, m] = (
                a0[i] * P[0, m]
                + a1[i] * P[1, m]
                + a2[i] * P[2, m]
                + dt * (j[i][0] * x + j[i][1] * y + j[i][2] * z)
            )
    if count > 0:
        add_columns(P, columns, count, top)
    for i in range(3):
        x = top[i, 3] + w[1] * top[i, 9] - w[2] * top[i, 12]
        y = top[i, 4] + w[2] * top[i, 10] - w[0] * top[i, 13]
        z = top[i, 5] + w[0] * top[i, 11] - w[1] * top[i, 14]
        for k in range(i + 1):
            value = (
                a0[k] * top[i, 0] + a1[k] * top[i, 1] + a2[k] * top[i, 2]
                + dt * (j[k][0] * x + j[k][1] * y + j[k][2] * z)
            )  # fmt: skip
            if count > 0:
                value += along_columns(columns, count, k, top, i)
            P[i, k] = value
            P[k, i] = value
        P[i, i] += noise
    for m in range(3, n):
        for i in range(3):
            P[i, m] = top[i, m]
            P[m, i] = top[i, m]


@kernel
def wander(P: Array, c: Array, place: Places, of_gyros: float, of_accelerometers: float, dt: float) -> None:
    """Biases that walk, and their covariance in ``P`` (3 + p, 3 + p), after ``dt`` [s], in place; they are
    exponentially correlated, of standard deviations ``of_gyros`` [rad/s] and ``of_accelerometers`` [m/s^2]."""
    keep = math.exp(-dt / WALK_TIME)
    for i in range(6):
        at, sigma = place[WALK + i], of_gyros if i < 3 else of_accelerometers
        if at >= 0:
            c[WALK + i] *= keep
            for m in range(len(P)):
                P[at, m] *= keep
                P[m, at] *= keep
            P[at, at] += sigma * sigma * (1.0 - keep * keep)


@kernel
def encoder_columns(
    th: Vector | Array,
    q: Quaternion,
    read: Rates,
    earth: Vector,
    up: Vector,
    c: Array,
    layout: Layout,
    axes: Axes,
    signs: Array,
    columns: Columns,
) -> int:
    """Columns of the attitude ``q`` (4,) that encoders have which read ``th`` (3,) [rad]; returns their number.

    Turns of p within a delay, of some 1e-4, and by sag are left out of the axes.
    """
    if len(c) <= 24:
        return 0
    place, waves, gamma = layout.place, layout.waves, (c[GAMMA], c[GAMMA + 1], c[GAMMA + 2])
    j, count = right_jacobian(gamma), 0
    for i in range(3):
        count = put(columns, count, place[GAMMA + i], (j[0][i], j[1][i], j[2][i]), 1.0)
    back = exp((-gamma[0], -gamma[1], -gamma[2]))
    about_z = rotate(back, unit(axes[2], signs[2]))
    back = multiply(back, elementary(axes[2], -signs[2] * th[2]))
    count = put(columns, count, place[NONORTH + 1], rotate(back, unit(axes[0], 1.0)), 1.0)
    back = multiply(back, elementary(axes[0], -c[NONORTH + 1]))
    about_y = rotate(back, unit(axes[1], signs[1]))
    count = put(columns, count, place[ZERO_Y], about_y, -1.0)
    back = multiply(back, elementary(axes[1], -signs[1] * (th[1] - c[ZERO_Y])))
    count = put(columns, count, place[NONORTH], rotate(back, unit(axes[2], 1.0)), 1.0)
    if len(waves) > 0:
        about_x = rotate(multiply(back, elementary(axes[2], -c[NONORTH])), unit(axes[0], signs[0]))
        for k in range(len(waves)):
            joint, at = waves[k, 0], waves[k, 1] * th[waves[k, 0]]
            axis = about_x if joint == 0 else about_y if joint == 1 else about_z
            count = put(columns, count, place[WAVE + 2 * k], axis, -math.sin(at))
            count = put(columns, count, place[WAVE + 2 * k + 1], axis, -math.cos(at))
    to_p = (q[0], -q[1], -q[2], -q[3])
    f = rotate(to_p, up)
    for i in range(3):
        count = put(columns, count, place[SAG + i], cross(unit(i, 1.0), f), 1.0)
    w, v = platform_rate(rate_at(read, c[TAU]), c), rotate(to_p, earth)
    late = about_turning((w[0] - v[0], w[1] - v[1], w[2] - v[2]), th, layout.turning, axes, signs)
    return put(columns, count, place[TAU], late, 1.0)


@kernel
def encoder_row(i: int, columns: Columns, count: int, row: Row) -> int:
    """Put the derivative of the attitude that encoders have about axis ``i`` of p, less that of the state, into a
    ``row``; returns the number of entries. ``count`` columns as of `encoder_columns`."""
    row.places[0], row.values[0] = i, 1.0
    for a in range(count):
        row.places[1 + a], row.values[1 + a] = columns.places[a], -columns.axes[a, i]
    return 1 + count


@kernel
def decorrelated_row(i: int, root: Vector, columns: Columns, count: int, row: Row) -> int:
    """The same of the ``i``-th of their decorrelated scalars, of variance 1; ``root`` as of `encoder_roots`."""
    for j in range(i + 1):
        row.places[j], row.values[j] = j, root[j]
    for a in range(count):
        x, y, z = columns.axes[a, 0], columns.axes[a, 1], columns.axes[a, 2]
        row.places[1 + i + a] = columns.places[a]
        row.values[1 + i + a] = -(root[0] * x + root[1] * y + root[2] * z)
    return 1 + i + count


@kernel
def accelerometer_row(i: int, sensed: Sensing, c: Array, place: Places, up: Vector, row: Row) -> int:
    """Put the derivative of accelerometer ``i`` by the error state into a ``row`` with room for `WIDEST` entries.

    ``up`` (3,) [m/s^2] is in the frame of the encoders. Returns the number of entries. The turn of p within a delay is
    left out of the derivative by the attitude.
    """
    f = sensed.force
    # weights of the specific force in this output
    gx = 1.0 + c[15] if i == 0 else -c[4] if i == 1 else c[3]
    gy = 0.0 if i == 0 else 1.0 + c[16] if i == 1 else -c[5]
    gz = 1.0 + c[17] if i == 2 else 0.0
    # g . (f x dtheta) = (g x f) . dtheta
    turn = cross((gx, gy, gz), f)
    places, values = row.places, row.values
    for k in range(3):
        places[k], values[k] = k, turn[k]
    places[3], values[3] = 15 + i, 1.0
    places[4], values[4] = 18 + i, f[i]
    count = 5
    if i == 1:
        places[5], values[5] = 7, -f[0]
        count = 6
    elif i == 2:
        places[5], values[5] = 6, f[0]
        places[6], values[6] = 8, -f[1]
        count = 7
    if len(c) > 18:
        by_beta = turned_by_beta(up, sensed.attitude, c)
        for k in range(3):
            if place[21 + k] >= 0:
                places[count] = place[21 + k]
                values[count] = gx * by_beta[k][0] + gy * by_beta[k][1] + gz * by_beta[k][2]
                count += 1
    if len(c) > 24:
        count = rig_entries(i, sensed, (gx, gy, gz), turn, c, place, row, count)
    return count


@kernel
def rig_entries(
    i: int, sensed: Sensing, g: Vector, turn: Vector, c: Array, place: Places, row: Row, count: int
) -> int:
    """Put delay, K2, lever, walk and warmth of accelerometer ``i`` into its row behind ``count`` entries; returns
    their number.

    ``g`` (3,) are the weights of the specific force, ``turn`` (3,) the derivative by the attitude.
    """
    places, values, f = row.places, row.values, sensed.force
    late = sensed.over_base
    if place[TAU + 1] >= 0:
        places[count] = place[TAU + 1]
        values[count] = -(turn[0] * late[0] + turn[1] * late[1] + turn[2] * late[2])
        count += 1
    signal = g[0] * f[0] + g[1] * f[1] + g[2] * f[2]
    if place[K2 + i] >= 0:
        places[count] = place[K2 + i]
        values[count] = squared(signal, i, c)
        count += 1
    along = centripetal(i, sensed.rate)
    for k in range(3):
        if place[LEVER + 3 * i + k] >= 0:
            places[count], values[count] = place[LEVER + 3 * i + k], (1.0 + c[15 + i]) * along[k]
            count += 1
    if place[WALK + 3 + i] >= 0:
        places[count], values[count] = place[WALK + 3 + i], 1.0
        count += 1
    if place[WARM + 3 + i] >= 0:
        places[count], values[count] = place[WARM + 3 + i], sensed.warm
        count += 1
    if place[WARM + 6 + i] >= 0:
        places[count], values[count] = place[WARM + 6 + i], sensed.warm * signal / (1.0 + c[15 + i])
        count += 1
    return count


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
