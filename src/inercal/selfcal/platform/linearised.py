"""Compiled Jacobians of the platform, by small errors of attitude and coefficients.

The error state is dtheta (3) [rad], right-handed about the axes of p, then the coefficients (p,) in the linear form:
``q_true = q qexp(dtheta)``. Both the error-state filter and the bounds rest on these.

    dtheta+ = exp(-[w dt]x) dtheta + Jr(w dt) dt dw,   dw = dkg0 + dM w_c,   Jr the right Jacobian of rotations
    df = f x dtheta = [f]x dtheta

With the extended model earth rate and gravity turn with beta: d(R(beta) v) = -[R v]x Jr(-beta) dbeta.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

from inercal._jit import kernel
from inercal.arrays import Array
from inercal.estimate.kalman import Row
from inercal.geometry.kernels import Quaternion, Vector, exp, right_jacobian, rotate
from inercal.selfcal.limits import LIMITS
from inercal.selfcal.platform.kinematics import Axes, joint_axes

Vectors: TypeAlias = tuple[Vector, Vector, Vector]

FLOOR = LIMITS.encoder_floor
"""As kernels take it."""

WIDEST = 10
"""Most entries of a row of the model."""


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
    frame of the encoders; the ``attitude`` (4,) after it; ``dt`` [s]."""

    commanded: Vector
    rate: Vector
    earth: Vector
    attitude: Quaternion
    dt: float


@kernel
def propagate_covariance(P: Array, c: Array, step: Step, noise: float, top: Array) -> None:
    """Covariance ``P`` (3 + p, 3 + p) of the error state after a step, in place; ``c`` (p,) coefficients, ``noise``
    [rad^2] the variance of the attitude gained in the step; ``top`` (6, 3 + p) is used up."""
    n, w, rate, dt = len(P), step.commanded, step.rate, step.dt
    j = right_jacobian((rate[0] * dt, rate[1] * dt, rate[2] * dt))
    back = exp((-rate[0] * dt, -rate[1] * dt, -rate[2] * dt))
    a0, a1, a2 = rotate(back, (1.0, 0.0, 0.0)), rotate(back, (0.0, 1.0, 0.0)), rotate(back, (0.0, 0.0, 1.0))
    extended = n > 21
    b0 = b1 = b2 = (0.0, 0.0, 0.0)
    if extended:
        b0, b1, b2 = turned_by_beta(step.earth, step.attitude, c)
    for m in range(n):
        # change of the platform's rate, about each axis
        x = P[3, m] + w[1] * P[9, m] - w[2] * P[12, m]
        y = P[4, m] + w[2] * P[10, m] - w[0] * P[13, m]
        z = P[5, m] + w[0] * P[11, m] - w[1] * P[14, m]
        if extended:
            x, y, z = x + w[0] * P[21, m], y + w[1] * P[22, m], z + w[2] * P[23, m]
        for i in range(3):
            top[i, m] = (
                a0[i] * P[0, m]
                + a1[i] * P[1, m]
                + a2[i] * P[2, m]
                + dt * (j[i][0] * x + j[i][1] * y + j[i][2] * z)
            )
            if extended:
                top[i, m] -= dt * (b0[i] * P[24, m] + b1[i] * P[25, m] + b2[i] * P[26, m])
    for i in range(3):
        x = top[i, 3] + w[1] * top[i, 9] - w[2] * top[i, 12]
        y = top[i, 4] + w[2] * top[i, 10] - w[0] * top[i, 13]
        z = top[i, 5] + w[0] * top[i, 11] - w[1] * top[i, 14]
        if extended:
            x, y, z = x + w[0] * top[i, 21], y + w[1] * top[i, 22], z + w[2] * top[i, 23]
        for k in range(i + 1):
            value = (
                a0[k] * top[i, 0] + a1[k] * top[i, 1] + a2[k] * top[i, 2]
                + dt * (j[k][0] * x + j[k][1] * y + j[k][2] * z)
            )  # fmt: skip
            if extended:
                value -= dt * (b0[k] * top[i, 24] + b1[k] * top[i, 25] + b2[k] * top[i, 26])
            P[i, k] = value
            P[k, i] = value
        P[i, i] += noise
    for m in range(3, n):
        for i in range(3):
            P[i, m] = top[i, m]
            P[m, i] = top[i, m]


@kernel
def accelerometer_row(i: int, f: Vector, c: Array, up: Vector, q: Quaternion, row: Row) -> int:
    """Put the derivative of accelerometer ``i`` by the error state into a ``row`` with room for `WIDEST` entries.

    ``f`` (3,) [m/s^2] in p, ``up`` (3,) [m/s^2] in the frame of the encoders. Returns the number of entries.
    """
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
        by_beta = turned_by_beta(up, q, c)
        for k in range(3):
            places[count] = 24 + k
            values[count] = gx * by_beta[k][0] + gy * by_beta[k][1] + gz * by_beta[k][2]
            count += 1
    return count


@kernel
def encoder_roots(th: Vector | Array, axes: Axes, signs: Array, sigma: float) -> tuple[Vectors, Vector]:
    """Inverse Cholesky factor (lower, rows) of the covariance of an encoder attitude, and its variances (3,).

    The covariance is ``sigma^2 (J J^T + 0.05^2 I)`` [rad^2] about the axes of p, at gimbal angles ``th`` (3,).
    """
    jx, jy, jz = joint_axes(th, axes, signs)
    s = sigma * sigma
    r00 = s * (jx[0] * jx[0] + jy[0] * jy[0] + jz[0] * jz[0] + FLOOR * FLOOR)
    r11 = s * (jx[1] * jx[1] + jy[1] * jy[1] + jz[1] * jz[1] + FLOOR * FLOOR)
    r22 = s * (jx[2] * jx[2] + jy[2] * jy[2] + jz[2] * jz[2] + FLOOR * FLOOR)
    r10 = s * (jx[1] * jx[0] + jy[1] * jy[0] + jz[1] * jz[0])
    r20 = s * (jx[2] * jx[0] + jy[2] * jy[0] + jz[2] * jz[0])
    r21 = s * (jx[2] * jx[1] + jy[2] * jy[1] + jz[2] * jz[1])
    l00 = math.sqrt(r00)
    l10, l20 = r10 / l00, r20 / l00
    l11 = math.sqrt(r11 - l10 * l10)
    l21 = (r21 - l20 * l10) / l11
    l22 = math.sqrt(r22 - l20 * l20 - l21 * l21)
    i10 = -l10 / (l00 * l11)
    i21 = -l21 / (l11 * l22)
    i20 = -(l20 / l00 + l21 * i10) / l22
    return ((1.0 / l00, 0.0, 0.0), (i10, 1.0 / l11, 0.0), (i20, i21, 1.0 / l22)), (r00, r11, r22)
