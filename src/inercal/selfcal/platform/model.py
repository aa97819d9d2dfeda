"""Compiled model of the platform: its rate, its attitude from step to step, its accelerometers.

Coefficients ``c`` (p,), p 18 or 24, are in the linear form, in the order of `inercal.selfcal.platform.coefficients`.
Attitudes are ``q_bp`` against the frame b of the encoders; earth rate and gravity in b turn with beta.
"""

from __future__ import annotations

from typing import NamedTuple

from inercal._jit import kernel
from inercal.arrays import Array
from inercal.geometry.kernels import Quaternion, Vector, exp, multiply, normalize, rotate
from inercal.selfcal.platform.rig import World


@kernel
def platform_rate(w: Vector | Array, c: Array) -> Vector:
    """Rate ``w_Ip^p`` (3,) [rad/s] of a platform that is commanded ``w`` (3,): ``w + M w + kg0``."""
    x = w[0] + c[0] + c[6] * w[1] - c[9] * w[2]
    y = w[1] + c[1] - c[10] * w[0] + c[7] * w[2]
    z = w[2] + c[2] + c[8] * w[0] - c[11] * w[1]
    if len(c) > 18:
        x, y, z = x + c[18] * w[0], y + c[19] * w[1], z + c[20] * w[2]
    return x, y, z


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


@kernel
def specific_force(q: Quaternion | Array, up: Vector) -> Vector:
    """Specific force (3,) [m/s^2] in p of a platform at rest, ``up`` that in the frame of the encoders."""
    return rotate((q[0], -q[1], -q[2], -q[3]), up)


@kernel
def accelerometers(f: Vector, c: Array) -> Vector:
    """Outputs (3,) [m/s^2] at specific force ``f`` (3,), linear form."""
    return (
        c[12] + (1.0 + c[15]) * f[0],
        c[13] + (1.0 + c[16]) * f[1] - c[4] * f[0],
        c[14] + (1.0 + c[17]) * f[2] + c[3] * f[0] - c[5] * f[1],
    )


class Truth(NamedTuple):
    """A true motion of n rows: attitudes ``q`` (n, 4), and outputs ``acc`` (n, 3) [m/s^2] of accelerometers without
    noise."""

    q: Array
    acc: Array


@kernel
def simulate_truth(q0: Array, w: Array, dt: float, noise: Array, c: Array, world: World, out: Truth) -> None:
    """True attitudes and accelerometer outputs, integrated at finer steps of ``dt`` [s], m between rows.

    ``q0`` (4,) attitude at the first row; ``w`` (n - 1, m, 3) [rad/s] as commanded and ``noise`` (n - 1, m, 3) [rad/s]
    of the gyros in each finer step; ``c`` (p,) coefficients, linear form.
    """
    q, acc = out
    at = (q0[0], q0[1], q0[2], q0[3])
    earth_e, up_e = on_the_base(world.earth, c), on_the_base(world.up, c)
    for k in range(len(q)):
        if k > 0:
            for j in range(w.shape[1]):
                rate = platform_rate((w[k - 1, j, 0], w[k - 1, j, 1], w[k - 1, j, 2]), c)
                noisy = (
                    rate[0] + noise[k - 1, j, 0],
                    rate[1] + noise[k - 1, j, 1],
                    rate[2] + noise[k - 1, j, 2],
                )
                at = normalize(propagate(at, noisy, earth_e, dt))
        read = accelerometers(specific_force(at, up_e), c)
        for i in range(4):
            q[k, i] = at[i]
        for i in range(3):
            acc[k, i] = read[i]
