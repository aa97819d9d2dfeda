"""Compiled model of the platform, once: its rate, the attitude of its encoders, the outputs of its accelerometers, each
with its columns by the states from the same numbers.

Parameters ``c`` are the full vector (K,) of `inercal.systems.selfcal.platform.states`, in the linear form; a
`StateLayout` says which of them are states. Attitudes are ``q_ep`` against the frame e of the encoders; earth rate and
gravity in b turn with beta. With coefficients c and quantities v of a linear port
(`inercal.systems.selfcal.platform.layout`), f the specific force in p, T how much warmer it is than the temperature of
the coefficients,

    rate     w' = w + M w + kg0 + sum c v(w, f, T)
    force    f' = f + sum c v(w'),   v the rows of [w']x [w']x           levers
    output   a  = ka0 + s + sum c v(s, T),   s the linear output at f'   K2 s^2 / (1 + ka1), by temperature, walks
    angle    th' = th - sum c v(th)                                      zero_y, harmonics
    chain    q_ep = R_i(th'_x) R_k(nonorth_xy) R_j(th'_y) R_i(nonorth_yz) R_k(th'_z) qexp(gamma) qexp(sag x f)

for joints about the axes i, j, k of p. The error state is dtheta (3) [rad], right-handed about the axes of p, then the
states: ``q_true = q qexp(dtheta)``; a column is an axis in p per unit of the state.

Biases are ``kg0`` and ``ka0`` in the mean, and walk about them. A sensor that is late by tau reads at t what was at
t - tau, in the clock of the rates: a delay that all share is only another time. Rates are held from row to row, and the
platform has turned since then at the rate before the row, or will turn until then at the one after it where tau is
negative.

Most kernels here are `merged`: a layout that is handed over from kernel to kernel costs as much as a step of 18 states.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inercal.foundation._jit import allocating, kernel, merged
from inercal.foundation.arrays import Array
from inercal.foundation.geometry.kernels import Quaternion, Vector, exp, multiply, right_jacobian, rotate
from inercal.systems.selfcal.platform.kinematics import Axes, elementary, joint_axes, unit
from inercal.systems.selfcal.platform.layout import StateLayout
from inercal.systems.selfcal.platform.rig import World
from inercal.systems.selfcal.platform.states import BETA, GAMMA, SAG, TAU

Vectors = tuple[Vector, Vector, Vector]

WIDEST = 80
"""Most entries of a row of the model, and most columns of states."""

SLOT, PLACE, AXIS, QUANTITY, ORDER, ENTRY = range(6)
"""Columns of `StateLayout.terms`."""

STILL = (0.0, 0.0, 0.0)
"""No vector, for kernels."""


class Room(NamedTuple):
    """Room for what a row makes: quantities ``of_rate`` (WIDEST,) of the terms of the rate; ``axes`` (WIDEST, 3) of the
    encoders' columns; ``entries`` (3, WIDEST) of the accelerometers' rows. ``quantities`` (WIDEST,) and ``small``
    (5, 3) sums, angles and joints are used up."""

    of_rate: Array
    axes: Array
    entries: Array
    quantities: Array
    small: Array


@allocating
def room() -> Room:
    """Room for a row."""
    return Room(
        np.zeros(WIDEST), np.zeros((WIDEST, 3)), np.zeros((3, WIDEST)), np.zeros(WIDEST), np.zeros((5, 3))
    )


class EncoderWorld(NamedTuple):
    """The world in the frame of the encoders: ``earth`` rate (3,) [rad/s], and the specific force at rest ``up`` (3,)
    [m/s^2]."""

    earth: Vector
    up: Vector


@kernel
def base_of(c: Array, based: bool, world: World) -> EncoderWorld:
    """The world, turned by beta where the base is."""
    earth, up = (world.earth[0], world.earth[1], world.earth[2]), (world.up[0], world.up[1], world.up[2])
    if not based:
        return EncoderWorld(earth, up)
    turn = exp((c[BETA], c[BETA + 1], c[BETA + 2]))
    return EncoderWorld(rotate(turn, earth), rotate(turn, up))


@kernel
def turned_by_beta(v: Vector, q: Quaternion, c: Array) -> Vectors:
    """Changes of a vector of the base, in p at attitude ``q``, per change of each component of beta; ``v`` (3,) is the
    vector in the frame of the encoders, turned by beta already: d(R(beta) v) = -[R v]x Jr(-beta) dbeta."""
    j = right_jacobian((-c[BETA], -c[BETA + 1], -c[BETA + 2]))
    back = (q[0], -q[1], -q[2], -q[3])
    return (
        rotate(back, cross((j[0][0], j[1][0], j[2][0]), v)),
        rotate(back, cross((j[0][1], j[1][1], j[2][1]), v)),
        rotate(back, cross((j[0][2], j[1][2], j[2][2]), v)),
    )


@kernel
def cross(a: Vector, b: Vector) -> Vector:
    """Cross product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def specific_force(q: Quaternion | Array, up: Vector) -> Vector:
    """Specific force (3,) [m/s^2] in p of a platform at rest, ``up`` that in the frame of the encoders."""
    return rotate((q[0], -q[1], -q[2], -q[3]), up)


@merged
def force_within(q: Quaternion, w: Vector, by: float, up: Vector, wanted: bool) -> Vector:
    """Specific force (3,) [m/s^2] in p, ``by`` [s] after attitude ``q`` at a rate ``w`` (3,) [rad/s]; 0 where no state
    asks for it."""
    return specific_force(multiply(q, exp((by * w[0], by * w[1], by * w[2]))), up) if wanted else STILL


@kernel
def rate_quantities(w: Vector, f: Vector, warm: float) -> tuple[float, ...]:
    """Quantities of the rate, in the order of `QUANTITIES`; as plain Python it also takes arrays."""
    asymmetry = (0.5 * abs(w[0]), 0.5 * abs(w[1]), 0.5 * abs(w[2]))
    return (*w, *asymmetry, *f, warm, 1.0)


@merged
def turning(w: Vector, f: Vector, warm: float, c: Array, layout: StateLayout, own: Room) -> Vector:
    """Rate ``w_Ip^p`` (3,) [rad/s] of a platform that is commanded ``w`` (3,), at specific force ``f`` (3,) [m/s^2] and
    ``warm`` [K] above the temperature of the coefficients; quantities of its terms in ``own.of_rate``."""
    x = w[0] + c[0] + c[6] * w[1] - c[9] * w[2]
    y = w[1] + c[1] - c[10] * w[0] + c[7] * w[2]
    z = w[2] + c[2] + c[8] * w[0] - c[11] * w[1]
    if layout.until[0] == 0:
        return x, y, z
    quantities, total, terms = own.quantities, own.small[0], layout.terms
    total[0], total[1], total[2] = x, y, z
    v = rate_quantities((w[0], w[1], w[2]), f, warm)
    for i in range(len(v)):
        quantities[i] = v[i]
    for a in range(layout.until[0]):
        own.of_rate[a] = quantities[terms[a, QUANTITY]]
        total[terms[a, AXIS]] += c[terms[a, SLOT]] * own.of_rate[a]
    return total[0], total[1], total[2]


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


@merged
def joint_angles(th: Vector | Array, c: Array, layout: StateLayout, own: Room) -> None:
    """Put the angles of the joints whose encoders read ``th`` (3,) [rad] into ``own.small[1]``, and the quantities of
    their terms into ``own.quantities``."""
    angles, terms, first = own.small[1], layout.terms, layout.until[2]
    angles[0], angles[1], angles[2] = th[0], th[1], th[2]
    for a in range(first, layout.until[3]):
        j, kind, order = terms[a, AXIS], terms[a, QUANTITY], terms[a, ORDER]
        v = 1.0 if kind == 0 else math.sin(order * th[j]) if kind == 1 else math.cos(order * th[j])
        angles[j] -= c[terms[a, SLOT]] * v
        own.quantities[a - first] = v


@merged
def chain(c: Array, layout: StateLayout, world: World, own: Room) -> Quaternion:
    """Inverse (4,) of the attitude of p in the chain of joints at angles ``own.small[1]``; columns of mount and links
    in ``own.axes``, axes of the joints in p in ``own.small[2:]``.

    The chain is gone through from the platform outwards: the inverse that grows gives the axis of each turn in p.
    """
    angles, joints, axes = own.small[1], own.small[2:], own.axes
    back = (1.0, 0.0, 0.0, 0.0)
    if layout.mounted:
        mount = (c[GAMMA], c[GAMMA + 1], c[GAMMA + 2])
        back, j = exp((-mount[0], -mount[1], -mount[2])), right_jacobian(mount)
        for i in range(3):
            at = layout.mount[i]
            if at >= 0:
                axes[at, 0], axes[at, 1], axes[at, 2] = j[0][i], j[1][i], j[2][i]
    for link in range(len(layout.links) - 1, -1, -1):
        axis, joint = world.axes[layout.links[link, 0]], layout.links[link, 1]
        slot, at = layout.links[link, 2], layout.links[link, 3]
        if joint >= 0:
            about = rotate(back, unit(axis, world.signs[joint]))
            joints[joint, 0], joints[joint, 1], joints[joint, 2] = about
            back = multiply(back, elementary(axis, -world.signs[joint] * angles[joint]))
        else:
            about = rotate(back, unit(axis, 1.0))
            if at >= 0:
                axes[at, 0], axes[at, 1], axes[at, 2] = about
            back = multiply(back, elementary(axis, -c[slot]))
    return back


@merged
def bending(f: Vector, c: Array) -> Quaternion:
    """Turn (4,) of the sensors on a platform that specific force ``f`` (3,) in p bends: qexp(sag x f)."""
    return exp(cross((c[SAG], c[SAG + 1], c[SAG + 2]), f))


@merged
def encoders(
    th: Vector | Array,
    read: Rates,
    base: EncoderWorld,
    c: Array,
    layout: StateLayout,
    world: World,
    own: Room,
) -> Quaternion:
    """Attitude (4,) of p at a row as the encoders have it, which read ``th`` (3,) [rad] late by tau_enc; its columns,
    of the places ``layout.columns``, in ``own.axes``.

    Turns of p by sag, of some 1e-5, are left out of the axes of what is before it; what rates change within a delay is
    left out, too.
    """
    joints, axes, terms, first = own.small[2:], own.axes, layout.terms, layout.until[2]
    joint_angles(th, c, layout, own)
    q = chain(c, layout, world, own)
    for a in range(first, layout.until[3]):
        at = terms[a, ENTRY]
        for i in range(3 if at >= 0 else 0):
            axes[at, i] = -own.quantities[a - first] * joints[terms[a, AXIS], i]
    q = (q[0], -q[1], -q[2], -q[3])
    if layout.bent:
        f = specific_force(q, base.up)
        for i in range(3):
            at = layout.bend[i]
            if at >= 0:
                axes[at, 0], axes[at, 1], axes[at, 2] = cross(unit(i, 1.0), f)
        q = multiply(q, bending(f, c))
    if layout.late_encoders:
        rate, tau = turning(rate_at(read, c[TAU]), STILL, 0.0, c, layout, own), c[TAU]
        of_earth = specific_force(q, base.earth)
        over = (rate[0] - of_earth[0], rate[1] - of_earth[1], rate[2] - of_earth[2])
        by = about_turning(over, th, layout.turning, world.axes, world.signs)
        within = rate if layout.turning.all() else by
        back = exp((-tau * within[0], -tau * within[1], -tau * within[2]))
        for a in range(len(layout.columns)):
            at_row = rotate(back, (axes[a, 0], axes[a, 1], axes[a, 2]))
            axes[a, 0], axes[a, 1], axes[a, 2] = at_row
        if layout.late[0] >= 0:
            axes[layout.late[0], 0], axes[layout.late[0], 1], axes[layout.late[0], 2] = by
        if layout.turning.all():
            return propagate(q, rate, base.earth, tau)
        q = multiply(q, (back[0], -back[1], -back[2], -back[3]))
    return q


@merged
def accelerometers(
    q: Quaternion, read: Rates, warm: float, base: EncoderWorld, c: Array, layout: StateLayout, own: Room
) -> tuple[Vector, Vector]:
    """Outputs (3,) [m/s^2] at a row of attitude ``q`` of accelerometers late by tau_a, and the specific force (3,)
    [m/s^2] in p that they sense; their rows, of the places ``layout.rows``, in ``own.entries``."""
    rate, over = STILL, STILL
    if layout.moving:
        late = c[TAU + 1]
        rate = turning(rate_at(read, late), STILL, 0.0, c, layout, own)
        q = propagate(q, rate, base.earth, -late)
        v = specific_force(q, base.earth)
        over = (rate[0] - v[0], rate[1] - v[1], rate[2] - v[2])
    return sensed(q, rate, over, warm, base, c, layout, own)


@kernel
def output_quantities(s: Vector, by: Vector, warm: float) -> tuple[float, ...]:
    """Quantities of the outputs, in the order of `QUANTITIES`: ``s`` (3,) [m/s^2] are outputs without bias, ``by`` the
    same over their scales; as plain Python it also takes arrays."""
    return s[0] * by[0], s[1] * by[1], s[2] * by[2], warm, warm * by[0], warm * by[1], warm * by[2], 1.0


@merged
def sensed(
    q: Quaternion,
    rate: Vector,
    over: Vector,
    warm: float,
    base: EncoderWorld,
    c: Array,
    layout: StateLayout,
    own: Room,
) -> tuple[Vector, Vector]:
    """`accelerometers` of a platform that has attitude ``q`` when they read, and turns then at ``rate`` (3,) [rad/s]
    against inertial space, ``over`` (3,) [rad/s] the base.

    What of an output is not linear in the signal, K2 and by temperature, is left out of derivatives by others.
    """
    out, entries, terms, until = own.small[0], own.entries, layout.terms, layout.until
    f = specific_force(q, base.up)
    gx, gy, gz = 1.0 + c[15], 1.0 + c[16], 1.0 + c[17]
    gains = ((gx, 0.0, 0.0), (-c[4], gy, 0.0), (c[3], -c[5], gz))  # of the specific force, by accelerometer
    square = rate[0] * rate[0] + rate[1] * rate[1] + rate[2] * rate[2]
    out[0], out[1], out[2] = f
    for a in range(until[0], until[1]):
        i, k = terms[a, AXIS], terms[a, QUANTITY] % 3
        v = rate[i] * rate[k] - (square if i == k else 0.0)
        out[i] += c[terms[a, SLOT]] * v
        if terms[a, ENTRY] >= 0:
            entries[i, terms[a, ENTRY]] = v * gains[i][i]
    x, y, z = out[0], out[1], out[2]
    for i in range(3):
        entries[i, 3], entries[i, 4] = 1.0, out[i]
    entries[1, 5], entries[2, 5], entries[2, 6] = -x, x, -y
    sx, sy, sz = gx * x, gy * y - c[4] * x, gz * z + c[3] * x - c[5] * y
    out[0], out[1], out[2] = c[12] + sx, c[13] + sy, c[14] + sz
    if until[2] > until[1]:
        quantities, made = own.quantities, output_quantities((sx, sy, sz), (sx / gx, sy / gy, sz / gz), warm)
        for k in range(len(made)):
            quantities[k] = made[k]
        for a in range(until[1], until[2]):
            i, by = terms[a, AXIS], quantities[terms[a, QUANTITY]]
            out[i] += c[terms[a, SLOT]] * by
            if terms[a, ENTRY] >= 0:
                entries[i, terms[a, ENTRY]] = by
    turned = turned_by_beta(base.up, q, c) if layout.based else (STILL, STILL, STILL)
    for i in range(3):
        g, behind = gains[i], layout.begin[i]
        turn = cross(g, f)  # g . (f x dtheta) = (g x f) . dtheta
        entries[i, 0], entries[i, 1], entries[i, 2] = turn
        if layout.late[1] >= 0:
            entries[i, behind + layout.late[1]] = -(turn[0] * over[0] + turn[1] * over[1] + turn[2] * over[2])
        for j in range(3):
            if layout.base[j] >= 0:
                d = turned[j]
                entries[i, behind + layout.base[j]] = g[0] * d[0] + g[1] * d[1] + g[2] * d[2]
    return (out[0], out[1], out[2]), f
