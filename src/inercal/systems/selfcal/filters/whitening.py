"""Compiled filter of what moves at fixed constants, with the sensitivities of its errors by constants and errors of the
model, for `inercal.systems.selfcal.filters.whitened`.

With S (n, m) the sensitivities of the error of what moves, G and d what a column does in a step and to a reading,

    S+ = F S + G,   s = h S + d,   S <- S - K s,   K the gain of the filter.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inercal.foundation._jit import allocating, kernel
from inercal.foundation.arrays import Array
from inercal.foundation.geometry.kernels import Quaternion, Vector, exp, log, multiply, normalize, rotate
from inercal.systems.selfcal.filters.problem import FilterModel, admitted, apart, updating, watch
from inercal.systems.selfcal.platform.kinematics import joint_axes, unit
from inercal.systems.selfcal.platform.layout import StateLayout
from inercal.systems.selfcal.platform.linearised import WALK_TIME, Transition, encoder_roots, transition
from inercal.systems.selfcal.platform.model import (
    AXIS,
    PLACE,
    Rates,
    Room,
    accelerometers,
    base_of,
    encoders,
    force_within,
    propagate,
    room,
    specific_force,
    turning,
)
from inercal.systems.selfcal.platform.recording import Steps
from inercal.systems.selfcal.platform.states import BETA, WALK


class PassRows(NamedTuple):
    """Some rows: their ``steps``; variances of the attitude [rad^2] that the gyros gain in each step, ``gained`` (m,);
    of the readings, ``sigma`` (m,) [rad] of encoders and ``variance`` (m,) [m^2/s^4] of accelerometers; ``courses``
    (m, k); and the ``group`` (m,) whose sums they belong to, from 0."""

    steps: Steps
    gained: Array
    sigma: Array
    variance: Array
    courses: Array
    group: NDArray[np.int64]


class PassSlots(NamedTuple):
    """Places of the error state: ``into`` (3 + K,) the row of what moves, or, beyond their number, a column;
    ``low`` (10,) first column of the courses of each channel; ``world`` its first column, or -1."""

    into: NDArray[np.int64]
    low: NDArray[np.int64]
    world: int


@kernel
def _taken(
    P: Array, S: Array, h: Array, s: Array, nu: float, r: float, K: Array, x: Array, out: Array
) -> float:
    """Put a scalar of innovation ``nu`` and variance ``r`` into covariance ``P`` (n, n), sensitivities ``S`` (n, m) and
    the error ``x`` (n,), and add what it shows of each column to ``out`` (m,); returns the whitened innovation."""
    n, variance = len(x), r
    for i in range(n):
        K[i] = 0.0
        for j in range(n):
            K[i] += P[i, j] * h[j]
    for i in range(n):
        variance += h[i] * K[i]
        nu -= h[i] * x[i]
    root = math.sqrt(variance)
    for i in range(n):
        for j in range(i + 1):
            P[i, j] -= K[i] * K[j] / variance
            P[j, i] = P[i, j]
    for i in range(n):
        x[i] += K[i] / variance * nu
        by = K[i] / variance
        for m in range(len(s)):
            S[i, m] -= by * s[m]
    for m in range(len(s)):
        out[m] += s[m] / root
    return nu / root


@kernel
def _in_p(q: Quaternion, c: Array, based: bool, axis: int) -> Vector:
    """Axis 0, 1, 2 of b in p at attitude ``q``."""
    v = unit(axis, 1.0)
    if based:
        v = rotate(exp((c[BETA], c[BETA + 1], c[BETA + 2])), v)
    return rotate((q[0], -q[1], -q[2], -q[3]), v)


@kernel
def _turned(
    F: Transition,
    S: Array,
    P: Array,
    k: int,
    rows: PassRows,
    slots: PassSlots,
    layout: StateLayout,
    own: Room,
    noise: tuple[float, float],
    top: Array,
    B: Array,
    work: Array,
) -> None:
    """Sensitivities ``S`` (n, m) and covariance ``P`` (n, n) after a step; ``noise`` [rad/s], [m/s^2] of biases that
    walk; ``top`` (3, m), ``B`` and ``work`` (n, n) are used up."""
    n, m, into, low, w, terms = len(P), S.shape[1], slots.into, slots.low, F.w, layout.terms
    for i in range(3):
        for a in range(m):
            top[i, a] = F.back[0][i] * S[0, a] + F.back[1][i] * S[1, a] + F.back[2][i] * S[2, a]
    B.fill(0.0)
    for i in range(3):
        for j in range(3):
            B[i, j] = F.back[j][i]
    for e in range(3):
        gain = F.gain[e]
        for i in range(3):
            top[i, into[3 + e] - n] += gain[i]  # kg0, ds, do
            top[i, into[9 + e] - n] += gain[i] * w[(e + 1) % 3]
            top[i, into[12 + e] - n] -= gain[i] * w[(e + 2) % 3]
        for a in range(low[e], low[e + 1]):
            by = rows.courses[k, a - low[0]]
            for i in range(3):
                top[i, a] += by * gain[i]
    for a in range(layout.until[0]):
        if terms[a, PLACE] < 0:
            continue
        slot, gain, v = into[terms[a, PLACE]], F.gain[terms[a, AXIS]], own.of_rate[a]
        for i in range(3):
            if slot >= n:
                top[i, slot - n] += v * gain[i]
            else:
                B[i, slot] = v * gain[i]
                for b in range(m):
                    top[i, b] += v * gain[i] * S[slot, b]
    for j in range(3 if layout.based else 0):
        at = layout.place[BETA + j]
        for i in range(3 if at >= 0 else 0):
            top[i, into[at] - n] -= F.dt * F.by_base[j][i]
    keep = math.exp(-F.dt / WALK_TIME)
    for i in range(3, n):
        B[i, i] = keep
        for a in range(m):
            S[i, a] *= keep
    for i in range(3):
        for a in range(m):
            S[i, a] = top[i, a]
    for i in range(n):
        for j in range(n):
            work[i, j] = 0.0
            for a in range(n):
                work[i, j] += B[i, a] * P[a, j]
    for i in range(n):
        for j in range(i + 1):
            value = 0.0
            for a in range(n):
                value += work[i, a] * B[j, a]
            P[i, j], P[j, i] = value, value
    for i in range(3):
        P[i, i] += rows.gained[k]
    for j in range(6):
        at = layout.place[WALK + j]
        if at >= 0:
            sigma = noise[0] if j < 3 else noise[1]
            P[into[at], into[at]] += sigma * sigma * (1.0 - keep * keep)


@kernel
def _put_in(q: Quaternion, c: Array, layout: StateLayout, into: NDArray[np.int64], x: Array) -> Quaternion:
    """The attitude with the error ``x`` (n,) put in, and biases that walk in ``c``; x is then 0."""
    for j in range(6):
        at = layout.place[WALK + j]
        if at >= 0:
            c[WALK + j] += x[into[at]]
    turned = normalize(multiply(q, exp((x[0], x[1], x[2]))))
    x.fill(0.0)
    return turned


@allocating
def whiten(
    q: Array,
    P: Array,
    S: Array,
    near: NDArray[np.int64],
    rows: PassRows,
    slots: PassSlots,
    c: Array,
    model: FilterModel,
    z: Array,
    J: Array,
) -> None:
    """Take the filter of attitude ``q`` (4,), covariance ``P`` (n, n) and sensitivities ``S`` (n, m), all in place,
    through rows: whitened innovations ``z`` (rows, 6), NaN where nothing is read, and what one unit of each column
    does to them, added to ``J`` (groups, 6, m). ``c`` is the full vector, linear form, its walks in place; ``near``
    (3,) as of `inercal.systems.selfcal.filters.problem.watch`."""
    steps, n, m = rows.steps, len(P), S.shape[1]
    world, noise, gate, layout = model
    into, low, signs = slots.into, slots.low, world.signs
    own, base = room(), base_of(c, layout.based, world)
    top, s, B, work = np.empty((3, m)), np.empty(m), np.empty((n, n)), np.empty((n, n))
    h, K, x = np.zeros(n), np.empty(n), np.zeros(n)
    at = (q[0], q[1], q[2], q[3])
    walks = (noise.gyro_walk, noise.accelerometer_walk)
    for k in range(len(steps.dt)):
        out, dt, w = J[rows.group[k]], steps.dt[k], (steps.rate[k, 0], steps.rate[k, 1], steps.rate[k, 2])
        after = (steps.later[k, 0], steps.later[k, 1], steps.later[k, 2])
        read = Rates(w, w if math.isnan(after[0]) else after)
        f = force_within(at, w, 0.5 * dt, base.up, layout.by_force)
        rate = turning(w, f, steps.warm[k], c, layout, own)
        at = normalize(propagate(at, rate, base.earth, dt))
        F = transition(w, rate, dt, at, base.earth, c, layout.based)
        _turned(F, S, P, k, rows, slots, layout, own, walks, top, B, work)
        if n > 3:
            for j in range(6):
                c[WALK + j] *= math.exp(-dt / WALK_TIME)
        if slots.world >= 0:
            for e in range(3):
                axis = _in_p(at, c, layout.based, e)
                for i in range(3):
                    S[i, slots.world + e] -= dt * axis[i]
        for i in range(6):
            z[k, i] = math.nan
        angles = (steps.th[k, 0], steps.th[k, 1], steps.th[k, 2])
        seen = not math.isnan(angles[0] + angles[1] + angles[2])
        of_encoders = at
        if seen:
            of_encoders = encoders(angles, read, base, c, layout, world, own)
            watch(specific_force(of_encoders, base.up), gate, near)
        take = updating(gate, near)
        if seen and take:
            sigma = rows.sigma[k]
            roots, _ = encoder_roots(angles, world.axes, signs, sigma, noise.joints, apart(noise, dt, sigma))
            miss = log(multiply((at[0], -at[1], -at[2], -at[3]), of_encoders))
            about = joint_axes(angles, world.axes, signs)
            for i in range(3):
                r = roots[i]
                for a in range(m):
                    s[a] = r[0] * S[0, a] + r[1] * S[1, a] + r[2] * S[2, a]
                for a in range(len(layout.columns)):
                    s[into[layout.columns[a]] - n] -= (
                        r[0] * own.axes[a, 0] + r[1] * own.axes[a, 1] + r[2] * own.axes[a, 2]
                    )
                for e in range(3):
                    by = r[0] * about[e][0] + r[1] * about[e][1] + r[2] * about[e][2]
                    for a in range(low[6 + e], low[7 + e]):
                        s[a] += by * rows.courses[k, a - low[0]]
                h.fill(0.0)
                h[0], h[1], h[2] = r[0], r[1], r[2]
                nu = r[0] * miss[0] + r[1] * miss[1] + r[2] * miss[2]
                z[k, 3 + i] = _taken(P, S, h, s, nu, 1.0, K, x, out[3 + i])
            at = _put_in(at, c, layout, into, x)
        if not take:
            continue
        expected, _ = accelerometers(at, read, steps.warm[k], base, c, layout, own)
        gains = ((1.0 + c[15], 0.0, 0.0), (-c[4], 1.0 + c[16], 0.0), (c[3], -c[5], 1.0 + c[17]))
        for i in range(3):
            if math.isnan(steps.acc[k, i]) or not admitted(i, gate, near):
                continue
            h.fill(0.0)
            for a in range(layout.sizes[i]):
                slot = a if a < 3 else into[layout.rows[i, a]]
                if slot < n:
                    h[slot] += own.entries[i, a]
            for a in range(m):
                s[a] = h[0] * S[0, a] + h[1] * S[1, a] + h[2] * S[2, a]
            for j in range(3, n):
                if h[j] != 0.0:
                    for a in range(m):
                        s[a] += h[j] * S[j, a]
            for a in range(3, layout.sizes[i]):
                slot = into[layout.rows[i, a]]
                if slot >= n:
                    s[slot - n] += own.entries[i, a]
            if slots.world >= 0:
                g = gains[i]
                for e in range(3):
                    axis = _in_p(at, c, layout.based, e)
                    s[slots.world + 3 + e] += g[0] * axis[0] + g[1] * axis[1] + g[2] * axis[2]
            for a in range(low[3 + i], low[4 + i]):
                s[a] += rows.courses[k, a - low[0]]
            nu = steps.acc[k, i] - expected[i]
            z[k, i] = _taken(P, S, h, s, nu, rows.variance[k], K, x, out[i])
        at = _put_in(at, c, layout, into, x)
    q[0], q[1], q[2], q[3] = at
