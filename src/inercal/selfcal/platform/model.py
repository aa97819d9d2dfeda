"""Compiled model of the platform: its rate, its attitude from step to step, its accelerometers and encoders.

Parameters ``c`` are the full vector of `inercal.selfcal.platform.states`, in the linear form: the paper's 18, the 24
of the extended model, or all (K,) with those of the rig. Attitudes are ``q_ep`` against the frame e of the encoders;
earth rate and gravity in b turn with beta. With the states of the rig

    q_ep = R_i(th_x) qexp(nonorth_xy e_k) R_j(th_y - zero_y) qexp(nonorth_yz e_i) R_k(th_z) qexp(gamma) qexp(sag x f)

for joints about the axes i, j, k of p, th the readings without their harmonics, f the specific force in p; each
accelerometer reads ``ka0 + s + K2 s^2 / (1 + ka1)``, s its output without them at the specific force
``f + w x (w x r)``, r its place and w the rate against inertial space. Gyros drift by ``G f``.

Biases are ``kg0`` and ``ka0`` in the mean, and walk about them. At another temperature than that of the coefficients
kg0, ka0 and ka1 change with it.

A sensor that is late by tau reads at t what was at t - tau, in the clock of the rates: a delay that all share is only
another time. Rates are held from row to row, and the platform has turned since then at the rate before the row, or
will turn until then at the one after it where tau is negative.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inercal._jit import kernel
from inercal.arrays import Array
from inercal.geometry.kernels import Quaternion, Vector, exp, multiply, normalize, rotate
from inercal.selfcal.platform.kinematics import Axes, attitude, elementary, joint_axes, nearest_turn
from inercal.selfcal.platform.rig import World
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


@kernel
def platform_rate(w: Vector | Array, c: Array) -> Vector:
    """Rate ``w_Ip^p`` (3,) [rad/s] of a platform that is commanded ``w`` (3,): ``w + M w + kg0``."""
    x = w[0] + c[0] + c[6] * w[1] - c[9] * w[2]
    y = w[1] + c[1] - c[10] * w[0] + c[7] * w[2]
    z = w[2] + c[2] + c[8] * w[0] - c[11] * w[1]
    if len(c) > 18:
        x, y, z = x + c[18] * w[0], y + c[19] * w[1], z + c[20] * w[2]
    if len(c) > 24:
        x += 0.5 * c[ASYM] * abs(w[0]) + c[WALK]
        y += 0.5 * c[ASYM + 1] * abs(w[1]) + c[WALK + 1]
        z += 0.5 * c[ASYM + 2] * abs(w[2]) + c[WALK + 2]
    return x, y, z


@kernel
def force_within(q: Quaternion | Array, w: Vector, by: float, up: Vector) -> Vector:
    """Specific force (3,) [m/s^2] in p at rest, ``by`` [s] after attitude ``q`` at a rate ``w`` (3,) [rad/s]."""
    return specific_force(multiply((q[0], q[1], q[2], q[3]), exp((by * w[0], by * w[1], by * w[2]))), up)


@kernel
def drifting(rate: Vector, f: Vector, warm: float, c: Array) -> Vector:
    """A ``rate`` (3,) [rad/s] of the platform with what gyros drift by specific force ``f`` (3,) [m/s^2] and ``warm``
    [K] above the temperature of the coefficients."""
    x, y, z = BY_FORCE, BY_FORCE + 3, BY_FORCE + 6
    return (
        rate[0] + c[x] * f[0] + c[x + 1] * f[1] + c[x + 2] * f[2] + c[WARM] * warm,
        rate[1] + c[y] * f[0] + c[y + 1] * f[1] + c[y + 2] * f[2] + c[WARM + 1] * warm,
        rate[2] + c[z] * f[0] + c[z + 1] * f[1] + c[z + 2] * f[2] + c[WARM + 2] * warm,
    )


@kernel
def on_the_base(v_b: Vector | Array, c: Array) -> Vector:
    """A vector stated in the base, in the frame of the encoders: turned by beta."""
    if len(c) > 18:
        return rotate(exp((c[21], c[22], c[23])), v_b)
    return v_b[0], v_b[1], v_b[2]


@kernel
def propagate(q: Quaternion | Array, rate: Vector, earth: Vector, dt: float) -> Quaternion:
    """Attitude after ``dt`` [s] at a constant rate against inertial space [rad/s, in p], exact; not normalised.

    ``qexp(-earth dt) q qexp(rate dt)`` with the earth rate [rad/s] in the frame of the encoders.
    """
    with_earth = multiply(exp((-earth[0] * dt, -earth[1] * dt, -earth[2] * dt)), q)
    return multiply(with_earth, exp((rate[0] * dt, rate[1] * dt, rate[2] * dt)))


class Rates(NamedTuple):
    """Rates (3,) [rad/s] as read ``before`` and ``after`` a row."""

    before: Vector
    after: Vector


@kernel
def rate_at(read: Rates, late: float) -> Vector:
    """Rate (3,) [rad/s] as read by when a sensor that is ``late`` [s] was read."""
    return read.before if late >= 0.0 else read.after


@kernel
def specific_force(q: Quaternion | Array, up: Vector) -> Vector:
    """Specific force (3,) [m/s^2] in p of a platform at rest, ``up`` that in the frame of the encoders."""
    return rotate((q[0], -q[1], -q[2], -q[3]), up)


@kernel
def accelerometers(f: Vector, c: Array) -> Vector:
    """Outputs (3,) [m/s^2] at specific force ``f`` (3,), linear form, without K2 and levers."""
    return (
        c[12] + (1.0 + c[15]) * f[0],
        c[13] + (1.0 + c[16]) * f[1] - c[4] * f[0],
        c[14] + (1.0 + c[17]) * f[2] + c[3] * f[0] - c[5] * f[1],
    )


@kernel
def centripetal(i: int, w: Vector) -> Vector:
    """Acceleration (3,) [1/s^2] of accelerometer ``i`` along its axis, per place along x, y, z: row i of [w]x [w]x."""
    square = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    return (
        w[i] * w[0] - (square if i == 0 else 0.0),
        w[i] * w[1] - (square if i == 1 else 0.0),
        w[i] * w[2] - (square if i == 2 else 0.0),
    )


@kernel
def squared(signal: float, i: int, c: Array) -> float:
    """Output [m/s^2] of accelerometer ``i`` per K2, at its ``signal`` [m/s^2] without bias."""
    return float(signal * signal / (1.0 + c[15 + i]))


@kernel
def rig_accelerometers(f: Vector, w: Vector, warm: float, c: Array) -> Vector:
    """Outputs (3,) [m/s^2] at specific force ``f`` (3,) at the centre of the gimbals and rate ``w`` (3,) [rad/s]
    against inertial space, ``warm`` [K] above the temperature of the coefficients, with K2 and levers."""
    by_x, by_y, by_z = centripetal(0, w), centripetal(1, w), centripetal(2, w)
    there = (
        f[0] + by_x[0] * c[LEVER] + by_x[1] * c[LEVER + 1] + by_x[2] * c[LEVER + 2],
        f[1] + by_y[0] * c[LEVER + 3] + by_y[1] * c[LEVER + 4] + by_y[2] * c[LEVER + 5],
        f[2] + by_z[0] * c[LEVER + 6] + by_z[1] * c[LEVER + 7] + by_z[2] * c[LEVER + 8],
    )
    x, y, z = accelerometers(there, c)
    return (
        x + _beside(x - c[12], 0, warm, c),
        y + _beside(y - c[13], 1, warm, c),
        z + _beside(z - c[14], 2, warm, c),
    )


@kernel
def _beside(signal: float, i: int, warm: float, c: Array) -> float:
    """Output [m/s^2] of accelerometer ``i`` beside the linear one, at its ``signal`` [m/s^2] without bias."""
    by_temperature = c[WARM + 3 + i] + c[WARM + 6 + i] * signal / (1.0 + c[15 + i])
    return float(c[K2 + i] * squared(signal, i, c) + c[WALK + 3 + i] + warm * by_temperature)


class Sensing(NamedTuple):
    """The platform as its accelerometers sense it at a row: specific ``force`` (3,) [m/s^2] at the centre of the
    gimbals, in p of the ``attitude`` (4,) then; its ``rate`` (3,) [rad/s] against inertial space and the one
    ``over_base``; how ``warm`` [K] it is, above the temperature of the coefficients."""

    force: Vector
    attitude: Quaternion
    rate: Vector
    over_base: Vector
    warm: float


@kernel
def sensing(q: Quaternion, read: Rates, earth: Vector, up: Vector, warm: float, c: Array) -> Sensing:
    """The platform as accelerometers late by tau_a sense it at a row of attitude ``q``."""
    if len(c) > 24:
        return sensing_late(q, read, earth, up, warm, c)
    return Sensing(specific_force(q, up), q, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0)


@kernel
def sensing_late(q: Quaternion, read: Rates, earth: Vector, up: Vector, warm: float, c: Array) -> Sensing:
    """`sensing` with a delay."""
    rate = platform_rate(rate_at(read, c[TAU + 1]), c)
    then = propagate(q, rate, earth, -c[TAU + 1])
    v = specific_force(then, earth)
    over_base = (rate[0] - v[0], rate[1] - v[1], rate[2] - v[2])
    return Sensing(specific_force(then, up), then, rate, over_base, warm)


@kernel
def outputs(sensed: Sensing, c: Array) -> Vector:
    """Outputs (3,) [m/s^2] of the accelerometers."""
    if len(c) <= 24:
        return accelerometers(sensed.force, c)
    return rig_accelerometers(sensed.force, sensed.rate, sensed.warm, c)


@kernel
def joints_attitude(th: Vector | Array, c: Array, axes: Axes, signs: Array) -> Quaternion:
    """Attitude of p as the encoders read it (3,) [rad], at once, with gamma, non-orthogonality and zero_y."""
    outer = multiply(elementary(axes[0], signs[0] * th[0]), elementary(axes[2], c[NONORTH]))
    inner = multiply(elementary(axes[1], signs[1] * (th[1] - c[ZERO_Y])), elementary(axes[0], c[NONORTH + 1]))
    last = multiply(elementary(axes[2], signs[2] * th[2]), exp((c[GAMMA], c[GAMMA + 1], c[GAMMA + 2])))
    return multiply(multiply(outer, inner), last)


@kernel
def sagging(q: Quaternion, up: Vector, c: Array) -> Vector:
    """Turn (3,) [rad] of the sensors on a platform of attitude ``q``, which gravity bends: sag x f."""
    f = specific_force(q, up)
    x, y, z = c[SAG], c[SAG + 1], c[SAG + 2]
    return y * f[2] - z * f[1], z * f[0] - x * f[2], x * f[1] - y * f[0]


@kernel
def without_harmonics(th: Vector | Array, c: Array, waves: NDArray[np.int64]) -> Vector:
    """Angles (3,) [rad] without the harmonics of encoders that read ``th`` (3,) [rad]; ``waves`` as of a layout."""
    x, y, z = th[0], th[1], th[2]
    for k in range(len(waves)):
        joint, at = waves[k, 0], waves[k, 1] * th[waves[k, 0]]
        error = c[WAVE + 2 * k] * math.sin(at) + c[WAVE + 2 * k + 1] * math.cos(at)
        if joint == 0:
            x -= error
        elif joint == 1:
            y -= error
        else:
            z -= error
    return x, y, z


@kernel
def encoders_attitude(
    th: Vector | Array,
    read: Rates,
    earth: Vector,
    up: Vector,
    c: Array,
    layout: Layout,
    axes: Axes,
    signs: Array,
) -> Quaternion:
    """Attitude of p at a row as the encoders have it, which read ``th`` (3,) [rad] late by tau_enc."""
    if len(c) > 24:
        q = joints_attitude(without_harmonics(th, c, layout.waves), c, axes, signs)
        q = multiply(q, exp(sagging(q, up, c)))
        rate, tau = platform_rate(rate_at(read, c[TAU]), c), c[TAU]
        if layout.turning.all():
            return propagate(q, rate, earth, tau)
        v = specific_force(q, earth)
        by = about_turning((rate[0] - v[0], rate[1] - v[1], rate[2] - v[2]), th, layout.turning, axes, signs)
        return multiply(q, exp((tau * by[0], tau * by[1], tau * by[2])))
    return attitude(th, axes, signs)


@kernel
def about_turning(
    rate: Vector, th: Vector | Array, turning: NDArray[np.bool_], axes: Axes, signs: Array
) -> Vector:
    """The part of a ``rate`` (3,) [rad/s] over the base, in p, that joints which are ``turning`` (3,) can have; what is
    left is noise of the gyros."""
    x, y, z = joint_axes(th, axes, signs)
    if turning[0] and turning[1] and turning[2]:
        return rate
    first, second = (x if turning[0] else y if turning[1] else z), (z if turning[2] else y)
    across = (
        first[1] * second[2] - first[2] * second[1],
        first[2] * second[0] - first[0] * second[2],
        first[0] * second[1] - first[1] * second[0],
    )
    size = across[0] * across[0] + across[1] * across[1] + across[2] * across[2]
    one = turning[0] + turning[1] + turning[2] == 1
    if one or size < 1e-6:  # one axis, or two that coincide
        of = x if turning[0] else y if turning[1] else z
        along = rate[0] * of[0] + rate[1] * of[1] + rate[2] * of[2]
        return along * of[0], along * of[1], along * of[2]
    beside = (rate[0] * across[0] + rate[1] * across[1] + rate[2] * across[2]) / size
    return rate[0] - beside * across[0], rate[1] - beside * across[1], rate[2] - beside * across[2]


@kernel
def encoders_read(q: Quaternion, near: Vector, c: Array, world: World) -> Vector:
    """Readings (3,) [rad] of encoders at once at attitude ``q``, by Newton's method from ``near`` (3,)."""
    th = near
    for _ in range(6):
        miss = boxminus_of(joints_attitude(th, c, world.axes, world.signs), q)
        th = _moved(th, miss, world)
    return th


@kernel
def boxminus_of(q: Quaternion, there: Quaternion) -> Vector:
    """Small rotation (3,) [rad] from attitude ``q`` to another, about the axes of p."""
    d = multiply((q[0], -q[1], -q[2], -q[3]), there)
    s = 2.0 if d[0] >= 0.0 else -2.0
    return s * d[1], s * d[2], s * d[3]


@kernel
def _moved(th: Vector, miss: Vector, world: World) -> Vector:
    """Angles (3,) [rad] that turn the platform further by ``miss`` (3,) [rad], to first order."""
    x, y, z = joint_axes(th, world.axes, world.signs)
    across = (y[1] * z[2] - y[2] * z[1], y[2] * z[0] - y[0] * z[2], y[0] * z[1] - y[1] * z[0])
    volume = x[0] * across[0] + x[1] * across[1] + x[2] * across[2]
    by_y = (z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0])
    by_z = (x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0])
    return (
        th[0] + (across[0] * miss[0] + across[1] * miss[1] + across[2] * miss[2]) / volume,
        th[1] + (by_y[0] * miss[0] + by_y[1] * miss[1] + by_y[2] * miss[2]) / volume,
        th[2] + (by_z[0] * miss[0] + by_z[1] * miss[1] + by_z[2] * miss[2]) / volume,
    )


class Truth(NamedTuple):
    """A true motion of n rows: attitudes ``q`` (n, 4), outputs ``acc`` (n, 3) [m/s^2] of accelerometers and readings
    ``th`` (n, 3) [rad] of encoders without noise."""

    q: Array
    acc: Array
    th: Array


@kernel
def simulate_truth(
    q0: Array, w: Array, dt: float, noise: Array, warm: Array, c: Array, world: World, out: Truth
) -> None:
    """True attitudes and readings, integrated at finer steps of ``dt`` [s], m between rows.

    ``q0`` (4,) attitude at the first row; ``w`` (n - 1, m, 3) [rad/s] at which the platform is commanded to turn and
    ``noise`` (n - 1, m, 3) [rad/s] of the gyros in each finer step; ``warm`` (n,) [K] above the temperature of the
    coefficients; ``c`` full vector, linear form. Readings ``th`` are made of the states of the rig alone, from nominal
    angles that stand there; else they stay as they are.
    """
    q, acc, th = out
    at = (q0[0], q0[1], q0[2], q0[3])
    earth_e, up_e = on_the_base(world.earth, c), on_the_base(world.up, c)
    m = w.shape[1]
    for k in range(len(q)):
        if k > 0:
            for j in range(m):
                commanded = (w[k - 1, j, 0], w[k - 1, j, 1], w[k - 1, j, 2])
                rate = platform_rate(commanded, c)
                if len(c) > 24:
                    rate = drifting(rate, force_within(at, commanded, 0.5 * dt, up_e), warm[k - 1], c)
                noisy = (
                    rate[0] + noise[k - 1, j, 0],
                    rate[1] + noise[k - 1, j, 1],
                    rate[2] + noise[k - 1, j, 2],
                )
                at = normalize(propagate(at, noisy, earth_e, dt))
        if len(c) <= 24:
            read = accelerometers(specific_force(at, up_e), c)
        else:
            last, first = max(k - 1, 0), min(k, len(w) - 1)
            before = platform_rate((w[last, m - 1, 0], w[last, m - 1, 1], w[last, m - 1, 2]), c)
            after = platform_rate((w[first, 0, 0], w[first, 0, 1], w[first, 0, 2]), c)
            of_acc, of_enc = before if c[TAU + 1] >= 0.0 else after, before if c[TAU] >= 0.0 else after
            then = propagate(at, of_acc, earth_e, -c[TAU + 1])
            read = rig_accelerometers(specific_force(then, up_e), of_acc, warm[k], c)
            near = (th[k, 0], th[k, 1], th[k, 2])
            seen = propagate(at, of_enc, earth_e, -c[TAU])
            bent = sagging(seen, up_e, c)
            angles = encoders_read(multiply(seen, exp((-bent[0], -bent[1], -bent[2]))), near, c, world)
            for i in range(3):
                th[k, i] = nearest_turn(angles[i], near[i])
        for i in range(4):
            q[k, i] = at[i]
        for i in range(3):
            acc[k, i] = read[i]
