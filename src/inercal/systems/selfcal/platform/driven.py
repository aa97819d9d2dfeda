"""A platform whose joints are driven by motors and whose gyros measure, as on a rig of one or two axes: compiled."""

from __future__ import annotations

from typing import NamedTuple

from inercal.foundation._jit import allocating, kernel
from inercal.foundation.arrays import Array
from inercal.foundation.geometry.kernels import Quaternion, Vector, exp, log, multiply
from inercal.systems.selfcal.platform.layout import StateLayout
from inercal.systems.selfcal.platform.model import (
    base_of,
    bending,
    chain,
    force_within,
    joint_angles,
    propagate,
    room,
    sensed,
    specific_force,
    turning,
)
from inercal.systems.selfcal.platform.rig import World
from inercal.systems.selfcal.platform.states import TAU


class Driven(NamedTuple):
    """Rows (n) of a motion, without noise of accelerometers and encoders: attitudes ``q`` (n, 4) against the base at
    rest, ``rate`` (n - 1, 3) [rad/s] as gyros read it, ``acc`` (n, 3) [m/s^2], ``th`` (n, 3) [rad] as encoders do."""

    q: Array
    rate: Array
    acc: Array
    th: Array


@allocating
def drive(
    angles: Array,
    sway: Array,
    dt: float,
    noise: Array,
    warm: Array,
    c: Array,
    layout: StateLayout,
    world: World,
    out: Driven,
) -> None:
    """Turn the joints through ``angles`` (n, 3) [rad] that their encoders would read at once, rows every ``dt`` [s].

    ``sway`` (n, 3) [rad] of the base; ``noise`` (n - 1, 3) [rad/s] of the gyros; ``warm`` (n,) [K] above the
    temperature of the coefficients; ``c`` (K,) full vector, linear form, what of it is not 0 in the ``layout``.
    """
    q, rate, acc, th = out
    n, own, base = len(q), room(), base_of(c, layout.based, world)
    for k in range(n):
        joint_angles(angles[k], c, layout, own)
        back = chain(c, layout, world, own)
        at = multiply(exp((sway[k, 0], sway[k, 1], sway[k, 2])), (back[0], -back[1], -back[2], -back[3]))
        at = multiply(at, bending(specific_force(at, base.up), c))
        for i in range(4):
            q[k, i] = at[i]
    for k in range(n - 1):
        here = (q[k, 0], q[k, 1], q[k, 2], q[k, 3])
        true = _gained(here, (q[k + 1, 0], q[k + 1, 1], q[k + 1, 2], q[k + 1, 3]), base.earth, dt)
        f = force_within(here, true, 0.5 * dt, base.up, layout.by_force)
        read = true
        for _ in range(8):  # each round is nearer by a misalignment
            made = turning(read, f, warm[k], c, layout, own)
            read = (
                read[0] + true[0] - made[0] - noise[k, 0],
                read[1] + true[1] - made[1] - noise[k, 1],
                read[2] + true[2] - made[2] - noise[k, 2],
            )
        for i in range(3):
            rate[k, i] = read[i]
    for k in range(n):
        j, i = max(k - 1, 0), min(k, n - 2)
        here = (q[k, 0], q[k, 1], q[k, 2], q[k, 3])
        j = j if c[TAU + 1] >= 0.0 else i
        w = _gained(
            (q[j, 0], q[j, 1], q[j, 2], q[j, 3]),
            (q[j + 1, 0], q[j + 1, 1], q[j + 1, 2], q[j + 1, 3]),
            base.earth,
            dt,
        )
        then = propagate(here, w, base.earth, -c[TAU + 1])
        outputs, _ = sensed(then, w, w, warm[k], base, c, layout, own)
        j = max(k - 1, 0) if c[TAU] >= 0.0 else min(k, n - 2)
        for i in range(3):
            acc[k, i] = outputs[i]
            th[k, i] = angles[k, i] - c[TAU] * (angles[j + 1, i] - angles[j, i]) / dt


@kernel
def _gained(begin: Quaternion, end: Quaternion, earth: Vector, dt: float) -> Vector:
    """Constant rate (3,) [rad/s] against inertial space, in p, from an attitude to another within ``dt`` [s]."""
    spun = multiply(exp((earth[0] * dt, earth[1] * dt, earth[2] * dt)), end)
    turn = log(multiply((begin[0], -begin[1], -begin[2], -begin[3]), spun))
    return turn[0] / dt, turn[1] / dt, turn[2] / dt
