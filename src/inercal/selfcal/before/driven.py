"""A platform whose joints are driven by motors and whose gyros measure, as on a rig of one or two axes: compiled."""

from __future__ import annotations

from typing import NamedTuple

from inercal._jit import kernel
from inercal.arrays import Array
from inercal.geometry.kernels import Quaternion, Vector, exp, log, multiply
from inercal.selfcal.platform.model import (
    drifting,
    force_within,
    joints_attitude,
    on_the_base,
    platform_rate,
    propagate,
    rig_accelerometers,
    sagging,
    specific_force,
)
from inercal.selfcal.platform.rig import World
from inercal.selfcal.platform.states import TAU


class Driven(NamedTuple):
    """Rows (n) of a motion, without noise of accelerometers and encoders: attitudes ``q`` (n, 4) against the base at
    rest, ``rate`` (n - 1, 3) [rad/s] as gyros read it, ``acc`` (n, 3) [m/s^2], ``th`` (n, 3) [rad] as encoders do."""

    q: Array
    rate: Array
    acc: Array
    th: Array


@kernel
def drive(
    angles: Array, sway: Array, dt: float, noise: Array, warm: Array, c: Array, world: World, out: Driven
) -> None:
    """Turn the joints through ``angles`` (n, 3) [rad] that their encoders would read at once, rows every ``dt`` [s].

    ``sway`` (n, 3) [rad] of the base; ``noise`` (n - 1, 3) [rad/s] of the gyros; ``warm`` (n,) [K] above the
    temperature of the coefficients; ``c`` (K,) full vector, linear form.
    """
    q, rate, acc, th = out
    earth_e, up_e = on_the_base(world.earth, c), on_the_base(world.up, c)
    n = len(q)
    for k in range(n):
        at = joints_attitude((angles[k, 0], angles[k, 1], angles[k, 2]), c, world.axes, world.signs)
        at = multiply(exp((sway[k, 0], sway[k, 1], sway[k, 2])), at)
        bent = sagging(at, up_e, c)
        at = multiply(at, exp(bent))
        for i in range(4):
            q[k, i] = at[i]
    for k in range(n - 1):
        here = (q[k, 0], q[k, 1], q[k, 2], q[k, 3])
        true = _gained(here, (q[k + 1, 0], q[k + 1, 1], q[k + 1, 2], q[k + 1, 3]), earth_e, dt)
        f = force_within(here, true, 0.5 * dt, up_e)
        read = true
        for _ in range(8):  # each round is nearer by a misalignment
            back = drifting(platform_rate(read, c), f, warm[k], c)
            read = (
                read[0] + true[0] - back[0] - noise[k, 0],
                read[1] + true[1] - back[1] - noise[k, 1],
                read[2] + true[2] - back[2] - noise[k, 2],
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
            earth_e,
            dt,
        )
        then = propagate(here, w, earth_e, -c[TAU + 1])
        read = rig_accelerometers(specific_force(then, up_e), w, warm[k], c)
        j = max(k - 1, 0) if c[TAU] >= 0.0 else min(k, n - 2)
        for i in range(3):
            acc[k, i] = read[i]
            th[k, i] = angles[k, i] - c[TAU] * (angles[j + 1, i] - angles[j, i]) / dt


@kernel
def _gained(begin: Quaternion, end: Quaternion, earth: Vector, dt: float) -> Vector:
    """Constant rate (3,) [rad/s] against inertial space, in p, from an attitude to another within ``dt`` [s]."""
    spun = multiply(exp((earth[0] * dt, earth[1] * dt, earth[2] * dt)), end)
    turn = log(multiply((begin[0], -begin[1], -begin[2], -begin[3]), spun))
    return turn[0] / dt, turn[1] / dt, turn[2] / dt
