"""Compiled truth of a simulated platform: its attitudes and what its sensors read without noise."""

from __future__ import annotations

from typing import NamedTuple

from inercal.foundation._jit import allocating, kernel, merged
from inercal.foundation.arrays import Array
from inercal.foundation.geometry.kernels import Quaternion, Vector, multiply, normalize
from inercal.systems.selfcal.platform.kinematics import joint_axes, nearest_turn
from inercal.systems.selfcal.platform.layout import StateLayout
from inercal.systems.selfcal.platform.model import (
    EncoderWorld,
    Rates,
    Room,
    accelerometers,
    base_of,
    encoders,
    force_within,
    propagate,
    room,
    turning,
)
from inercal.systems.selfcal.platform.rig import World


class PlatformTruth(NamedTuple):
    """A true motion of n rows: attitudes ``q`` (n, 4), outputs ``acc`` (n, 3) [m/s^2] of accelerometers and readings
    ``th`` (n, 3) [rad] of encoders without noise."""

    q: Array
    acc: Array
    th: Array


@allocating
def simulate_truth(
    q0: Array,
    w: Array,
    dt: float,
    noise: Array,
    warm: Array,
    c: Array,
    layout: StateLayout,
    world: World,
    out: PlatformTruth,
) -> None:
    """True attitudes and readings, integrated at finer steps of ``dt`` [s], m between rows.

    ``q0`` (4,) attitude at the first row; ``w`` (n - 1, m, 3) [rad/s] at which the platform is commanded to turn and
    ``noise`` (n - 1, m, 3) [rad/s] of the gyros in each finer step; ``warm`` (n,) [K] above the temperature of the
    coefficients; ``c`` full vector, linear form. Readings ``th`` are made where the layout has encoders that read other
    angles than those of the joints, from nominal angles that stand there; else they stay as they are.
    """
    q, acc, th = out
    at, own, m = (q0[0], q0[1], q0[2], q0[3]), room(), w.shape[1]
    base = base_of(c, layout.based, world)
    for k in range(len(q)):
        for j in range(m if k > 0 else 0):
            commanded = (w[k - 1, j, 0], w[k - 1, j, 1], w[k - 1, j, 2])
            f = force_within(at, commanded, 0.5 * dt, base.up, layout.by_force)
            rate = turning(commanded, f, warm[k - 1], c, layout, own)
            noisy = (
                rate[0] + noise[k - 1, j, 0],
                rate[1] + noise[k - 1, j, 1],
                rate[2] + noise[k - 1, j, 2],
            )
            at = normalize(propagate(at, noisy, base.earth, dt))
        last, first = max(k - 1, 0), min(k, len(w) - 1)
        read = Rates(
            (w[last, m - 1, 0], w[last, m - 1, 1], w[last, m - 1, 2]),
            (w[first, 0, 0], w[first, 0, 1], w[first, 0, 2]),
        )
        outputs, _ = accelerometers(at, read, warm[k], base, c, layout, own)
        if layout.read_off:
            near = (th[k, 0], th[k, 1], th[k, 2])
            angles = _angles_read(at, near, read, base, c, layout, world, own)
            for i in range(3):
                th[k, i] = nearest_turn(angles[i], near[i])
        for i in range(4):
            q[k, i] = at[i]
        for i in range(3):
            acc[k, i] = outputs[i]


@merged
def _angles_read(
    q: Quaternion,
    near: Vector,
    read: Rates,
    base: EncoderWorld,
    c: Array,
    layout: StateLayout,
    world: World,
    own: Room,
) -> Vector:
    """Angles (3,) [rad] that encoders read at attitude ``q``, by Newton's method from ``near`` (3,)."""
    th = near
    for _ in range(8):
        th = _moved(th, boxminus_of(encoders(th, read, base, c, layout, world, own), q), world)
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
