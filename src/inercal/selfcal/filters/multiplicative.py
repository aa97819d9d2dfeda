"""Estimator 3: a multiplicative unscented filter, sigma points of the error state on the manifold of attitudes.

A point is ``q qexp(dtheta)`` with coefficients; the attitude itself stays a unit quaternion and its covariance has no
more than three dimensions (Crassidis and Markley 2003, with a rotation vector in p). Each step:

1. Points around the state go through the exact step of the platform; their deviations from the centre's attitude make
   mean and covariance, to which the walk of the gyros is added.
2. Encoders are put in. About the prediction their residual is linear in dtheta, so no points are needed, and an
   error of attitude of any size is gone before anything nonlinear is asked of it.
3. Points are drawn again for the accelerometers.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from inercal._jit import kernel
from inercal.estimate.factor import FACTORS
from inercal.estimate.kalman import scalar_update
from inercal.estimate.sigma_point import draw, moments, update, weights
from inercal.geometry.kernels import Quaternion, Vector, exp, log, multiply, normalize, rotate
from inercal.selfcal.filters.error_state import initial as initial
from inercal.selfcal.filters.filter_result import Problem, State, Trace, empty_trace
from inercal.selfcal.filters.gating import admitted, gate_of, updating, watch
from inercal.selfcal.platform.kinematics import Axes, attitude, nearest_turn
from inercal.selfcal.platform.linearised import encoder_roots
from inercal.selfcal.platform.model import (
    accelerometers,
    on_the_base,
    platform_rate,
    propagate,
    specific_force,
)
from inercal.selfcal.settings import FACTOR_OF

Array: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.int64]

WIDE = 3.0
"""Length [rad] beyond which a deviation may be more than half a turn, where a logarithm is not what it came from."""


def advance(
    state: State, problem: Problem, dt: Array, rate: Array, acc: Array, th: Array, history: bool = True
) -> tuple[State, Trace]:
    """Take the filter through m steps; arguments as of `inercal.selfcal.filters.error_state.advance`.

    Innovations of the accelerometers are those that are left once the encoders are known.
    """
    world, trace = problem.world, empty_trace(len(dt), len(problem.prior), history)
    lowest, fallbacks, cosine = _advance(
        state.attitude, state.coefficients, state.covariance, state.near, state.th, dt, rate, acc, th,
        world.earth, world.up, world.axes, world.signs, problem.noise.levels, gate_of(problem.filter.gating),
        FACTORS[problem.filter.factor or FACTOR_OF["mukf"]],
        trace.attitude, trace.attitude_u, trace.coefficients, trace.u, trace.innovations, trace.nis, trace.dims,
    )  # fmt: skip
    return state, trace._replace(lowest_eigenvalue=lowest, fallbacks=fallbacks, gimbal_cosine=cosine)


@kernel
def _deviation(q: Quaternion, before: Vector, turn: Vector) -> Vector:
    """Rotation vector of ``q``, a deviation that was ``before`` and turned with the platform by ``turn`` [rad].

    A deviation of many standard deviations may be more than half a turn; it must not come back by the short way.
    """
    if before[0] * before[0] + before[1] * before[1] + before[2] * before[2] < WIDE * WIDE:
        return log(q)
    u = rotate(exp((-turn[0], -turn[1], -turn[2])), before)
    rest = log(multiply(exp((-u[0], -u[1], -u[2])), q))
    return u[0] + rest[0], u[1] + rest[1], u[2] + rest[2]


@kernel
def _predict(
    q: Quaternion, c: Array, w: Vector, dt: float, earth: Array, columns: Array, at: Array, z: Array
) -> Quaternion:
    """Attitude after a step of ``dt`` [s], from which ``z`` (2 n + 1, 3) receives the deviations of all points.

    ``columns`` (n, n) of the points before the step; ``at`` (p,) used up.
    """
    n = len(columns)
    rate = platform_rate(w, c)
    turn = (rate[0] * dt, rate[1] * dt, rate[2] * dt)
    centre = normalize(propagate(q, rate, on_the_base(earth, c), dt))
    back = (centre[0], -centre[1], -centre[2], -centre[3])
    held = multiply(back, multiply(_by_earth(earth, c, dt), q))
    for k in range(2 * n):
        column, sign = (columns[k], 1.0) if k < n else (columns[k - n], -1.0)
        d = (sign * column[0], sign * column[1], sign * column[2])
        for j in range(len(c)):
            at[j] = c[j] + sign * column[3 + j]
        rate = platform_rate(w, at)
        if len(c) > 18:
            held = multiply(back, multiply(_by_earth(earth, at, dt), q))
        after = multiply(multiply(held, exp(d)), exp((rate[0] * dt, rate[1] * dt, rate[2] * dt)))
        z[1 + k, 0], z[1 + k, 1], z[1 + k, 2] = _deviation(after, d, turn)
    return centre


@kernel
def _by_earth(earth: Array, c: Array, dt: float) -> Quaternion:
    """Turn of the base against inertial space in ``dt`` [s], back."""
    e = on_the_base(earth, c)
    return exp((-e[0] * dt, -e[1] * dt, -e[2] * dt))


@kernel
def _read(q: Quaternion, c: Array, up: Array, columns: Array, at: Array, z: Array) -> None:
    """Put into ``z`` (2 n + 1, 3) [m/s^2] what the accelerometers read at all points; arguments as of `_predict`."""
    n = len(columns)
    for k in range(2 * n):
        column, sign = (columns[k], 1.0) if k < n else (columns[k - n], -1.0)
        for j in range(len(c)):
            at[j] = c[j] + sign * column[3 + j]
        turned = multiply(q, exp((sign * column[0], sign * column[1], sign * column[2])))
        z[1 + k, 0], z[1 + k, 1], z[1 + k, 2] = accelerometers(
            specific_force(turned, on_the_base(up, at)), at
        )


@kernel
def _correct(q: Quaternion, c: Array, x: Array) -> Quaternion:
    """Put a correction (n,) into attitude, which is returned, and coefficients."""
    for j in range(len(c)):
        c[j] += x[3 + j]
    return normalize(multiply(q, exp((x[0], x[1], x[2]))))


@kernel
def _advance(
    attitude_: Array,
    c: Array,
    P: Array,
    near: Indices,
    angles: Array,
    dt: Array,
    rates: Array,
    acc: Array,
    th: Array,
    earth: Array,
    up: Array,
    axes: Axes,
    signs: Array,
    levels: Array,
    gate: Array,
    kind: int,
    out_attitude: Array,
    out_attitude_u: Array,
    out_coefficients: Array,
    out_u: Array,
    out_innovations: Array,
    nis: Array,
    dims: Indices,
) -> tuple[float, int, float]:
    """The loop; returns the lowest eigenvalue, the number of fallbacks, the least |cos thy|."""
    n, p = len(P), len(c)
    _, _, other, spread = weights(n, 1.0, 0.0, 0.0)  # those of the centre are zero
    A, work, columns, at = np.empty((n, n)), np.empty((n, n)), np.empty((n, n)), np.empty(p)
    z, odd, middle, r = np.zeros((2 * n + 1, 3)), np.empty((n, 3)), np.empty(3), np.empty(3)
    Pxz, Pzz, L, x, spare = np.empty((n, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty(n), np.empty(n)
    places, row = np.arange(3), np.empty(3)
    history = len(out_u) > 0
    told, cosine = np.array([math.nan, 0.0]), 1.0
    q = (attitude_[0], attitude_[1], attitude_[2], attitude_[3])
    for k in range(len(dt)):
        draw(P, kind, spread, A, work, columns, told)
        q = _predict(q, c, (rates[k, 0], rates[k, 1], rates[k, 2]), dt[k], earth, columns, at, z)
        moments(z, columns, other, middle, odd, Pzz, Pxz)
        q = normalize(multiply(q, exp((middle[0], middle[1], middle[2]))))
        for i in range(3):
            for j in range(3):
                P[i, j] = Pzz[i, j]
            P[i, i] += levels[0] * levels[0] * dt[k]
            for j in range(3, n):
                P[i, j], P[j, i] = Pxz[j, i], Pxz[j, i]
        seen = not (math.isnan(th[k, 0]) or math.isnan(th[k, 1]) or math.isnan(th[k, 2]))
        if seen:
            for i in range(3):
                angles[i] = nearest_turn(th[k, i], angles[i])
            cosine = min(cosine, abs(math.cos(angles[1])))
            of_encoders = attitude(angles, axes, signs)
            watch(specific_force(of_encoders, on_the_base(up, c)), gate, near)
        take = updating(gate, near)
        total, count = 0.0, 0
        if history:
            for i in range(6):
                out_innovations[k, i] = math.nan
        if take and seen:
            roots, variances = encoder_roots(angles, axes, signs, levels[2])
            miss = log(multiply((q[0], -q[1], -q[2], -q[3]), of_encoders))
            x[:] = 0.0
            for i in range(3):
                if history:
                    out_innovations[k, 3 + i] = miss[i] / math.sqrt(P[i, i] + variances[i])
            for i in range(3):
                row[0], row[1], row[2] = roots[i]
                along = row[0] * miss[0] + row[1] * miss[1] + row[2] * miss[2]
                total += scalar_update(P, x, places, row, 3, along, 1.0, spare)
                count += 1
            # The covariance is not turned with the corrected attitude. Small corrections turn it by nothing; after a
            # large one it is that of the encoders, which is stated about the measured attitude as it is.
            q = _correct(q, c, x)
        for i in range(3):
            r[i] = acc[k, i] if take and admitted(i, gate, near) else math.nan
        if not (math.isnan(r[0]) and math.isnan(r[1]) and math.isnan(r[2])):
            draw(P, kind, spread, A, work, columns, told)
            _read(q, c, up, columns, at, z)
            moments(z, columns, other, middle, odd, Pzz, Pxz)
            for i in range(3):
                r[i] -= middle[i]
                Pzz[i, i] += levels[1] * levels[1]
                if history:
                    out_innovations[k, i] = r[i] / math.sqrt(Pzz[i, i])
            of_acc, used = update(r, Pxz, Pzz, L, P, x)
            total, count = total + of_acc, count + used
            q = _correct(q, c, x)
        nis[k] = total if count > 0 else math.nan
        dims[k] = count
        if history:
            for i in range(4):
                out_attitude[k, i] = q[i]
            for i in range(3):
                out_attitude_u[k, i] = math.sqrt(P[i, i])
            for j in range(p):
                out_coefficients[k, j] = c[j]
                out_u[k, j] = math.sqrt(P[3 + j, 3 + j])
    for i in range(4):
        attitude_[i] = q[i]
    return told[0], int(told[1]), cosine
