"""The model of a wind-tunnel model that pitches: what its sensors read, and how its state goes on; compiled.

Body axes x forward, y left, z up; theta nose-up pitch, w its rate, al its acceleration, j its jerk. A point (r, 0, z)
of the body feels, at a fixed roll phi about x and pitching about a horizontal axis (c = cos phi),

    f_x = g sin theta - r w^2 - c z al + s_x'
    f_z = c (g cos theta + r al) - c^2 z w^2 + s_z'

with s_x', s_z' the flexure of the sting, outputs of two band-pass resonators s'' + 2 zeta w0 s' + w0^2 s = u. With
gyros for roll and yaw (rates p about x, y about z, both right-handed) w is the body rate and the roll phi a state:

    f_x = g sin theta - r (w^2 + y^2) - z (al - p y) + s_x'
    f_z = g cos theta cos phi + r (al + p y) - z (w^2 + p^2) + s_z'
    theta' = w cos phi + y sin phi
    phi'   = p + (w sin phi - y cos phi) tan theta

An accelerometer at angle lambda, counted from +x towards -z, reads f_x cos lambda - f_z sin lambda + b; the gyro, which
lags by tau, (1 + k) (w - tau al + tau^2 j / 2) + b_g, times c at a fixed roll. Source: Tan et al. 2021, with the
lever-arm terms of three axes written out.

The state is, where each part is estimated (`places`): theta, w, al, j | b_g | b_1.. | dr_1.. | s_z, s_z', s_x, s_x' |
zo_1.., k_g | tau | phi, b_roll, b_yaw; b_.. are biases, dr_.., zo_.. errors of the positions r, z.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from inercal._jit import kernel

Array: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.int64]

#: what `places` holds: number of accelerometers, of states, of those that move, d; where a part of the state begins, -1
#: where it is not estimated; and from `ROWS` on the places (d,) of the states that move, in their order
COUNT, STATES, MOVING, LEVERS, RESONATORS, HEIGHTS, SCALE, DELAY, ROLL, ROWS = range(10)

#: what `constants` (16,) holds
(
    GRAVITY, SNAP, NOISE, GYRO_NOISE, TURN_NOISE, GYRO_DELAY, COMMON_DELAY, COMMON_DELAY_U, ROLL_COSINE, GATE,
    Z_RATE, Z_DAMPING, Z_LEVEL, X_RATE, X_DAMPING, X_LEVEL,
) = range(16)  # fmt: skip

GYRO_BIAS = 4
BIASES = 5

WIDEST = 11
"""Most entries that a row of the model has."""

_USUAL = 1e-3
"""Interval [s] for which a snap is stated."""

_FACTORIAL = (1.0, 1.0, 2.0, 6.0)

_NEAR_VERTICAL = 1e-4
"""What is added to cos^2 theta, so that roll stays finite where it is not defined."""


@kernel
def accelerometer(
    x: Array,
    s: float,
    c: float,
    i: int,
    geometry: Array,
    places: Indices,
    constants: Array,
    p: float,
    y: float,
    at: Indices,
    row: Array,
) -> tuple[float, int, float]:
    """What accelerometer ``i`` reads [m/s^2]: its value, the number of entries of its ``row``, and its variance.

    ``s``, ``c`` are sine and cosine of theta, which all of them share. ``geometry`` (N, 4): cos lambda, sin lambda,
    r, z [m]. ``p``, ``y`` [rad/s] the indications of the roll and yaw gyros, not used without a state of roll; their
    noise adds to the variance. ``at`` and ``row`` receive the places and values of the derivatives.
    """
    g, w, al = constants[GRAVITY], x[1], x[2]
    ca, sa, r, z = geometry[i, 0], geometry[i, 1], geometry[i, 2], geometry[i, 3]
    levers, res, heights, roll = places[LEVERS], places[RESONATORS], places[HEIGHTS], places[ROLL]
    if levers >= 0:
        r += x[levers + i]
    if heights >= 0:
        z += x[heights + i]
    noise = constants[NOISE]
    at[0], at[1], at[2], at[3] = 0, 1, 2, BIASES + i
    row[3] = 1.0
    count = 4
    if roll >= 0:
        phi, p, y = x[roll], p - x[roll + 1], y - x[roll + 2]
        sp, cp = math.sin(phi), math.cos(phi)
        by_rx, by_zx = -(w * w + y * y), -(al - p * y)
        by_rz, by_zz = al + p * y, -(w * w + p * p)
        fx = g * s + r * by_rx + z * by_zx
        fz = g * c * cp + r * by_rz + z * by_zz
        row[0] = ca * g * c + sa * g * s * cp
        row[1] = -2.0 * w * (ca * r - sa * z)
        row[2] = -ca * z - sa * r
        at[4], row[4] = roll, sa * g * c * sp
        by_p = ca * z * y - sa * (r * y - 2.0 * z * p)
        by_y = ca * (z * p - 2.0 * r * y) - sa * r * p
        at[5], row[5] = roll + 1, -by_p
        at[6], row[6] = roll + 2, -by_y
        noise += (by_p * by_p + by_y * by_y) * constants[TURN_NOISE]
        count = 7
    else:
        cp = constants[ROLL_COSINE]
        by_rx, by_zx = -w * w, -cp * al
        by_rz, by_zz = cp * al, -cp * cp * w * w
        fx = g * s + r * by_rx + z * by_zx
        fz = cp * g * c + r * by_rz + z * by_zz
        row[0] = ca * g * c + sa * cp * g * s
        row[1] = -2.0 * w * (ca * r - sa * cp * cp * z)
        row[2] = -cp * (ca * z + sa * r)
    if res >= 0:
        fz += x[res + 1]
        fx += x[res + 3]
        at[count], row[count] = res + 1, -sa
        at[count + 1], row[count + 1] = res + 3, ca
        count += 2
    if levers >= 0:
        at[count], row[count] = levers + i, ca * by_rx - sa * by_rz
        count += 1
    if heights >= 0:
        at[count], row[count] = heights + i, ca * by_zx - sa * by_zz
        count += 1
    return ca * fx - sa * fz + x[BIASES + i], count, noise


@kernel
def gyro(x: Array, places: Indices, constants: Array, at: Indices, row: Array) -> tuple[float, int, float]:
    """What the gyro reads [rad/s], as `accelerometer` gives it."""
    scale, delay = places[SCALE], places[DELAY]
    tau = x[delay] if delay >= 0 else constants[GYRO_DELAY]
    c = 1.0 if places[ROLL] >= 0 else constants[ROLL_COSINE]
    k = c * (1.0 + (x[scale] if scale >= 0 else 0.0))
    then = x[1] - tau * x[2] + 0.5 * tau * tau * x[3]
    at[0], at[1], at[2], at[3] = 1, 2, 3, GYRO_BIAS
    row[0], row[1], row[2], row[3] = k, -k * tau, 0.5 * k * tau * tau, 1.0
    count = 4
    if scale >= 0:
        at[count], row[count] = scale, c * then
        count += 1
    if delay >= 0:
        at[count], row[count] = delay, k * (tau * x[3] - x[2])
        count += 1
    return k * then + x[GYRO_BIAS], count, constants[GYRO_NOISE]


@kernel
def transition(dt: float, places: Indices, constants: Array, F: Array, Q: Array) -> None:
    """How the states that move go on in ``dt`` [s]: theta to jerk under white snap, resonators under white noise.

    ``F`` (d, d) receives their transition, ``Q`` (d, d) its noise. Exact (Van Loan's integrals in closed form). Those
    of a state of roll depend on the motion: `turning`. Above 1 kHz the snap grows with the square of the rate: each row
    is linearised anew, and the more rows there are the more certain linearisation alone would make the filter.
    """
    d = places[MOVING]
    for i in range(d):
        for j in range(d):
            F[i, j], Q[i, j] = 0.0, 0.0
        F[i, i] = 1.0
    lively = max(1.0, _USUAL / dt) if dt > 0.0 else 1.0
    noise = constants[SNAP] * lively * lively * dt
    for i in range(4):
        power = noise
        for j in range(4):
            Q[3 - i, 3 - j] = power / ((i + j + 1) * _FACTORIAL[i] * _FACTORIAL[j])
            power *= dt
        noise *= dt
        power = 1.0
        for j in range(i, 4):
            F[i, j] = power / _FACTORIAL[j - i]
            power *= dt
    if places[RESONATORS] >= 0:
        for b in range(2):
            w0, zeta, level = (
                constants[Z_RATE + 3 * b],
                constants[Z_DAMPING + 3 * b],
                constants[Z_LEVEL + 3 * b],
            )
            i, k = 4 + 2 * b, 5 + 2 * b
            wd = w0 * math.sqrt(1.0 - zeta * zeta)
            e, s, c = math.exp(-zeta * w0 * dt), math.sin(wd * dt), math.cos(wd * dt)
            F[i, i], F[i, k] = e * (c + zeta * w0 / wd * s), e * s / wd
            F[k, i], F[k, k] = -e * w0 * w0 / wd * s, e * (c - zeta * w0 / wd * s)
            # stationary: the variances s: level^2 / w0^2, s': level^2 stay as they are
            vi, vk = level * level / (w0 * w0), level * level
            Q[i, i] = vi - F[i, i] * F[i, i] * vi - F[i, k] * F[i, k] * vk
            Q[k, k] = vk - F[k, i] * F[k, i] * vi - F[k, k] * F[k, k] * vk
            Q[i, k] = -F[i, i] * F[k, i] * vi - F[i, k] * F[k, k] * vk
            Q[k, i] = Q[i, k]


@kernel
def turning(
    x: Array,
    dt: float,
    p: float,
    y: float,
    places: Indices,
    constants: Array,
    F: Array,
    Q: Array,
    base: float,
) -> tuple[float, float]:
    """Put the rows of theta and roll into ``F`` and ``Q``; theta and roll [rad] after ``dt``.

    ``p``, ``y`` [rad/s] what the roll and yaw gyros say of the step; ``base`` is the noise of theta from snap alone.
    """
    a, roll = places[MOVING] - 3, places[ROLL]
    p, y = p - x[roll + 1], y - x[roll + 2]
    s, c = math.sin(x[roll]), math.cos(x[roll])
    st, ct = math.sin(x[0]), math.cos(x[0])
    steep = ct * ct + _NEAR_VERTICAL
    tangent = st * ct / steep
    turned = x[1] * dt + 0.5 * x[2] * dt * dt + x[3] * dt * dt * dt / 6.0
    across = x[1] * s - y * c
    F[0, 1], F[0, 2], F[0, 3] = c * dt, 0.5 * c * dt * dt, c * dt * dt * dt / 6.0
    F[0, a], F[0, a + 2] = -s * turned + c * y * dt, -s * dt
    F[a, 0], F[a, 1] = across * dt / steep, s * tangent * dt
    F[a, a] = 1.0 + (x[1] * c + y * s) * tangent * dt
    F[a, a + 1], F[a, a + 2] = -dt, c * tangent * dt
    noise = constants[TURN_NOISE] * dt * dt
    Q[0, 0] = base + s * s * noise
    Q[a, a] = (1.0 + c * c * tangent * tangent) * noise
    Q[0, a] = -s * c * tangent * noise
    Q[a, 0] = Q[0, a]
    return x[0] + c * turned + s * y * dt, x[roll] + dt * (p + across * tangent)
