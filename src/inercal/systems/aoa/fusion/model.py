"""The model of a wind-tunnel model that pitches: what its sensors read, and how its state goes on; compiled.

Body axes x forward, y left, z up; theta nose-up pitch, w its rate, al its acceleration, j its jerk. A point (r, 0, z)
of the body feels, at a fixed roll phi about x and pitching about a horizontal axis (c = cos phi),

    f_x = g sin theta - r w^2 - c z al + s_x'
    f_z = c (g cos theta + r al) - c^2 z w^2 + s_z'

with s_x', s_z' the flexure of the sting, outputs of two band-pass resonators s'' + 2 zeta w0 s' + w0^2 s = u; where
the support plunges the latter is along the vertical, g + s_z' in the place of g and none in f_z. With
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
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from inercal.foundation._jit import kernel
from inercal.foundation.inference.kalman import SlopeRow

Array: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.int64]

GYRO_BIAS = 4
BIASES = 5

WIDEST = 11
"""Most entries of a row of the model."""


class Places(NamedTuple):
    """Places in the state.

    Numbers of ``accelerometers`` and of ``states``; where each part of the state begins, -1 where it is not estimated;
    and the places of the states that move, ``moving`` (d,), in their order.
    """

    accelerometers: int
    states: int
    levers: int
    resonators: int
    heights: int
    scale: int
    delay: int
    roll: int
    moving: Indices


class Constants(NamedTuple):
    """Constants of the model, in SI.

    ``snap`` is a spectral density; ``accelerometer_noise``, ``gyro_noise`` and ``turn_noise`` (of the gyros for roll
    and yaw) are variances; ``accelerometer_walk`` and ``gyro_walk`` what those of the biases gain in a second; ``gate``
    is the largest square of an innovation over its variance. The resonators of the sting, for heave and axial motion,
    have an angular frequency, a damping, and a level of the output; ``plunge`` is 1 where the first one is along the
    vertical, else 0.
    """

    gravity: float
    snap: float
    accelerometer_noise: float
    gyro_noise: float
    turn_noise: float
    accelerometer_walk: float
    gyro_walk: float
    gyro_delay: float
    common_delay: float
    common_delay_u: float
    roll_cosine: float
    gate: float
    heave_frequency: float
    heave_damping: float
    heave_level: float
    axial_frequency: float
    axial_damping: float
    axial_level: float
    plunge: float


class Model(NamedTuple):
    """The model as kernels take it: ``geometry`` (N, 4) of the accelerometers, cos lambda, sin lambda, r, z [m]; places
    and constants."""

    geometry: Array
    places: Places
    constants: Constants


class Prediction(NamedTuple):
    """A state ``x`` (n,), sine and cosine of its theta, the indications ``p``, ``y`` [rad/s] of the roll and yaw gyros,
    which are not used without a state of roll.

    ``rate`` [rad/s], ``acceleration`` [rad/s^2] and ``jerk`` [rad/s^3] are the motion in the derivatives by positions
    and by the gyro's scale and delay: that after the row before, which all sensors have corrected, the jerk as far as
    it is above noise. The noise of a prediction would teach these errors, and always in the same sense.
    """

    x: Array
    sine: float
    cosine: float
    p: float
    y: float
    rate: float
    acceleration: float
    jerk: float


class FusionStep(NamedTuple):
    """A step: ``dt`` [s], mean indications ``p``, ``y`` [rad/s] of the roll and yaw gyros, and ``snap`` [rad^2], the
    variance that theta gains from snap alone."""

    dt: float
    p: float
    y: float
    snap: float


class Resonator(NamedTuple):
    """Angular ``frequency`` [rad/s], ``damping`` and ``level`` [m/s^2] of one direction of the sting."""

    frequency: float
    damping: float
    level: float


_USUAL = 1e-3
"""Interval [s] for which a snap is stated."""

_FACTORIAL = (1.0, 1.0, 2.0, 6.0)

_NEAR_VERTICAL = 1e-4
"""Addition to cos^2 theta, so that roll stays finite where it is not defined."""


@kernel
def accelerometer(i: int, at: Prediction, model: Model, out: SlopeRow) -> tuple[float, float, int]:
    """Reading of accelerometer ``i`` [m/s^2], its variance, and how many entries of ``out`` are its derivative.

    The noise of the roll and yaw gyros adds to its variance.
    """
    geometry, of, constants = model
    places, row, x, s, c, p, y = out.places, out.values, at.x, at.sine, at.cosine, at.p, at.y
    g, w, al = constants.gravity, x[1], x[2]
    ca, sa, r, z = geometry[i, 0], geometry[i, 1], geometry[i, 2], geometry[i, 3]
    levers, res, heights, roll = of.levers, of.resonators, of.heights, of.roll
    plunge = constants.plunge if res >= 0 else 0.0
    if plunge > 0.0:
        g += x[res + 1]
    if levers >= 0:
        r += x[levers + i]
    if heights >= 0:
        z += x[heights + i]
    noise = constants.accelerometer_noise
    places[0], places[1], places[2], places[3] = 0, 1, 2, BIASES + i
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
        places[4], row[4] = roll, sa * g * c * sp
        by_p = ca * z * y - sa * (r * y - 2.0 * z * p)
        by_y = ca * (z * p - 2.0 * r * y) - sa * r * p
        places[5], row[5] = roll + 1, -by_p
        places[6], row[6] = roll + 2, -by_y
        noise += (by_p * by_p + by_y * by_y) * constants.turn_noise
        count = 7
    else:
        cp = constants.roll_cosine
        by_rx, by_zx = -w * w, -cp * al
        by_rz, by_zz = cp * al, -cp * cp * w * w
        fx = g * s + r * by_rx + z * by_zx
        fz = cp * g * c + r * by_rz + z * by_zz
        row[0] = ca * g * c + sa * cp * g * s
        row[1] = -2.0 * w * (ca * r - sa * cp * cp * z)
        row[2] = -cp * (ca * z + sa * r)
    if res >= 0:
        fz += (1.0 - plunge) * x[res + 1]
        fx += x[res + 3]
        level = math.cos(x[roll]) if roll >= 0 else cp
        places[count], row[count] = res + 1, plunge * (ca * s - sa * c * level) - (1.0 - plunge) * sa
        places[count + 1], row[count + 1] = res + 3, ca
        count += 2
    w, al = at.rate, at.acceleration
    if roll >= 0:
        by_rx, by_zx = -(w * w + y * y), -(al - p * y)
        by_rz, by_zz = al + p * y, -(w * w + p * p)
    else:
        by_rx, by_zx = -w * w, -cp * al
        by_rz, by_zz = cp * al, -cp * cp * w * w
    if levers >= 0:
        places[count], row[count] = levers + i, ca * by_rx - sa * by_rz
        count += 1
    if heights >= 0:
        places[count], row[count] = heights + i, ca * by_zx - sa * by_zz
        count += 1
    return ca * fx - sa * fz + x[BIASES + i], noise, count


@kernel
def gyro(at: Prediction, model: Model, out: SlopeRow) -> tuple[float, float, int]:
    """Reading of the gyro [rad/s] at a state, as of `accelerometer`."""
    _, of, constants = model
    places, row, x = out.places, out.values, at.x
    scale, delay = of.scale, of.delay
    tau = x[delay] if delay >= 0 else constants.gyro_delay
    c = 1.0 if of.roll >= 0 else constants.roll_cosine
    k = c * (1.0 + (x[scale] if scale >= 0 else 0.0))
    then = x[1] - tau * x[2] + 0.5 * tau * tau * x[3]
    places[0], places[1], places[2], places[3] = 1, 2, 3, GYRO_BIAS
    row[0], row[1], row[2], row[3] = k, -k * tau, 0.5 * k * tau * tau, 1.0
    count = 4
    if scale >= 0:
        places[count], row[count] = scale, c * (at.rate - tau * at.acceleration + 0.5 * tau * tau * at.jerk)
        count += 1
    if delay >= 0:
        places[count], row[count] = delay, k * (tau * at.jerk - at.acceleration)
        count += 1
    return k * then + x[GYRO_BIAS], constants.gyro_noise, count


@kernel
def transition(dt: float, model: Model, F: Array, Q: Array) -> None:
    """Transition of the states that move in ``dt`` [s]: theta to jerk under white snap, resonators under white noise.

    ``F`` (d, d) receives it, ``Q`` (d, d) its noise. Exact (Van Loan's integrals in closed form). Those of a state of
    roll depend on the motion: `turning`. Above 1 kHz the snap grows with the square of the rate: each row
    is linearised anew, and the more rows there are the more certain linearisation alone would make the filter.
    """
    places, constants = model.places, model.constants
    d = len(places.moving)
    for i in range(d):
        for j in range(d):
            F[i, j], Q[i, j] = 0.0, 0.0
        F[i, i] = 1.0
    lively = max(1.0, _USUAL / dt) if dt > 0.0 else 1.0
    noise = constants.snap * lively * lively * dt
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
    if places.resonators >= 0:
        heave = Resonator(constants.heave_frequency, constants.heave_damping, constants.heave_level)
        axial = Resonator(constants.axial_frequency, constants.axial_damping, constants.axial_level)
        _resonate(dt, heave, 4, F, Q)
        _resonate(dt, axial, 6, F, Q)


@kernel
def wander(P: Array, dt: float, model: Model) -> None:
    """Add to P (n, n) what the biases of the gyro and the accelerometers wander in ``dt`` [s]; of other gyros,
    `turning`."""
    constants = model.constants
    P[GYRO_BIAS, GYRO_BIAS] += constants.gyro_walk * dt
    for i in range(BIASES, BIASES + model.places.accelerometers):
        P[i, i] += constants.accelerometer_walk * dt


@kernel
def _resonate(dt: float, of: Resonator, i: int, F: Array, Q: Array) -> None:
    """Put transition and noise of a resonator into the rows ``i`` and ``i + 1`` of ``F`` and ``Q``."""
    w0, zeta, level = of
    k = i + 1
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
def turning(x: Array, step: FusionStep, model: Model, F: Array, Q: Array) -> tuple[float, float]:
    """Put the rows of theta and roll into ``F`` and ``Q``; theta and roll [rad] after the step."""
    dt = step.dt
    a, roll = len(model.places.moving) - 3, model.places.roll
    p, y = step.p - x[roll + 1], step.y - x[roll + 2]
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
    noise = model.constants.turn_noise * dt * dt
    Q[0, 0] = step.snap + s * s * noise
    Q[a, a] = (1.0 + c * c * tangent * tangent) * noise
    Q[0, a] = -s * c * tangent * noise
    Q[a, 0] = Q[0, a]
    Q[a + 1, a + 1] = Q[a + 2, a + 2] = model.constants.gyro_walk * dt
    return x[0] + c * turned + s * y * dt, x[roll] + dt * (p + across * tangent)
