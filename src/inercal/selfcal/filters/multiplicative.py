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

import numpy as np

from inercal._jit import kernel
from inercal.arrays import Array
from inercal.estimate.factor import FACTORS
from inercal.estimate.kalman import Row, scalar_update
from inercal.estimate.sigma_point import draw, empty_moments, empty_points, moments, update, weights
from inercal.geometry.kernels import Quaternion, Vector, exp, log, multiply, normalize, rotate
from inercal.selfcal.estimators import FACTOR_OF
from inercal.selfcal.filters.error_state import corrected
from inercal.selfcal.filters.error_state import initial as initial
from inercal.selfcal.filters.filter_result import Estimates, State, Trace, empty_estimates, remember
from inercal.selfcal.filters.problem import FilterModel, FilterProblem, admitted, updating, watch
from inercal.selfcal.platform.kinematics import attitude, nearest_turn
from inercal.selfcal.platform.linearised import encoder_roots
from inercal.selfcal.platform.model import (
    accelerometers,
    on_the_base,
    platform_rate,
    propagate,
    specific_force,
)
from inercal.selfcal.platform.recording import Steps
from inercal.selfcal.platform.rig import World

WIDE = 3.0
"""Length [rad] beyond which a deviation may be more than half a turn, where a logarithm is not what it came from."""


def advance(state: State, problem: FilterProblem, steps: Steps, history: bool = True) -> tuple[State, Trace]:
    """Take the filter through m steps, as `inercal.selfcal.filters.error_state.advance` does."""
    out = empty_estimates(len(steps.dt), len(problem.prior), history)
    factor = FACTORS[problem.filter.factor or FACTOR_OF["mukf"]]
    health = _advance(state, problem.model, factor, steps, out)
    return state, Trace(out, *health)


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
    q: Quaternion, c: Array, w: Vector, dt: float, world: World, columns: Array, shifted: Array, z: Array
) -> Quaternion:
    """Attitude after a step of ``dt`` [s], from which ``z`` (2 n + 1, 3) receives the deviations of all points;
    ``columns`` (n, n) are those of the points before, ``shifted`` (p,) is used up."""
    n = len(columns)
    rate = platform_rate(w, c)
    turn = (rate[0] * dt, rate[1] * dt, rate[2] * dt)
    centre = normalize(propagate(q, rate, on_the_base(world.earth, c), dt))
    back = (centre[0], -centre[1], -centre[2], -centre[3])
    held = multiply(back, multiply(_by_earth(world.earth, c, dt), q))
    for k in range(2 * n):
        column, sign = (columns[k], 1.0) if k < n else (columns[k - n], -1.0)
        d = (sign * column[0], sign * column[1], sign * column[2])
        for j in range(len(c)):
            shifted[j] = c[j] + sign * column[3 + j]
        rate = platform_rate(w, shifted)
        if len(c) > 18:
            held = multiply(back, multiply(_by_earth(world.earth, shifted, dt), q))
        after = multiply(multiply(held, exp(d)), exp((rate[0] * dt, rate[1] * dt, rate[2] * dt)))
        z[1 + k, 0], z[1 + k, 1], z[1 + k, 2] = _deviation(after, d, turn)
    return centre


@kernel
def _by_earth(earth: Array, c: Array, dt: float) -> Quaternion:
    """Turn of the base against inertial space in ``dt`` [s], back."""
    e = on_the_base(earth, c)
    return exp((-e[0] * dt, -e[1] * dt, -e[2] * dt))


@kernel
def _read(q: Quaternion, c: Array, up: Array, columns: Array, shifted: Array, z: Array) -> None:
    """Put into ``z`` (2 n + 1, 3) [m/s^2] the accelerometers' readings at all points; arguments as of `_predict`."""
    n = len(columns)
    for k in range(2 * n):
        column, sign = (columns[k], 1.0) if k < n else (columns[k - n], -1.0)
        for j in range(len(c)):
            shifted[j] = c[j] + sign * column[3 + j]
        turned = multiply(q, exp((sign * column[0], sign * column[1], sign * column[2])))
        z[1 + k, 0], z[1 + k, 1], z[1 + k, 2] = accelerometers(
            specific_force(turned, on_the_base(up, shifted)), shifted
        )


@kernel
def _advance(
    state: State, model: FilterModel, factor: int, steps: Steps, out: Estimates
) -> tuple[float, int, float]:
    """The loop; returns the lowest eigenvalue, the number of fallbacks, the least |cos thy|."""
    c, P, near, angles = state.coefficients, state.covariance, state.near, state.th
    world, noise, gate = model
    intervals, rates, acc, th = steps
    n, p = len(P), len(c)
    _, _, other, spread = weights(n, 1.0, 0.0, 0.0)  # those of the centre are zero
    points, shifted, of_points = empty_points(n), np.empty(p), empty_moments(n, 3)
    z, r, L, x, spare = np.zeros((2 * n + 1, 3)), np.empty(3), np.empty((3, 3)), np.empty(n), np.empty(n)
    row = Row(np.arange(3), np.empty(3))
    history = len(out.u) > 0
    cosine = 1.0
    q = (state.attitude[0], state.attitude[1], state.attitude[2], state.attitude[3])
    for k in range(len(intervals)):
        dt, w = intervals[k], (rates[k, 0], rates[k, 1], rates[k, 2])
        draw(P, factor, spread, points)
        q = _predict(q, c, w, dt, world, points.columns, shifted, z)
        moments(z, points.columns, other, of_points)
        middle = of_points.mean
        q = normalize(multiply(q, exp((middle[0], middle[1], middle[2]))))
        for i in range(3):
            for j in range(3):
                P[i, j] = of_points.covariance[i, j]
            P[i, i] += noise.angle_random_walk * noise.angle_random_walk * dt
            for j in range(3, n):
                P[i, j], P[j, i] = of_points.cross[j, i], of_points.cross[j, i]
        seen = not (math.isnan(th[k, 0]) or math.isnan(th[k, 1]) or math.isnan(th[k, 2]))
        if seen:
            for i in range(3):
                angles[i] = nearest_turn(th[k, i], angles[i])
            cosine = min(cosine, abs(math.cos(angles[1])))
            of_encoders = attitude(angles, world.axes, world.signs)
            watch(specific_force(of_encoders, on_the_base(world.up, c)), gate, near)
        take = updating(gate, near)
        total, count = 0.0, 0
        if history:
            for i in range(6):
                out.innovations[k, i] = math.nan
        if take and seen:
            roots, variances = encoder_roots(angles, world.axes, world.signs, noise.encoder)
            miss = log(multiply((q[0], -q[1], -q[2], -q[3]), of_encoders))
            x[:] = 0.0
            for i in range(3):
                if history:
                    out.innovations[k, 3 + i] = miss[i] / math.sqrt(P[i, i] + variances[i])
            for i in range(3):
                root = roots[i]
                row.values[0], row.values[1], row.values[2] = root
                along = root[0] * miss[0] + root[1] * miss[1] + root[2] * miss[2]
                total += scalar_update(P, x, row, 3, along, 1.0, spare)
                count += 1
            # The covariance is not turned with the corrected attitude. Small corrections turn it by nothing; after a
            # large one it is that of the encoders, which is stated about the measured attitude as it is.
            q = corrected(q, c, x)
        for i in range(3):
            r[i] = acc[k, i] if take and admitted(i, gate, near) else math.nan
        if not (math.isnan(r[0]) and math.isnan(r[1]) and math.isnan(r[2])):
            draw(P, factor, spread, points)
            _read(q, c, world.up, points.columns, shifted, z)
            moments(z, points.columns, other, of_points)
            for i in range(3):
                r[i] -= of_points.mean[i]
                of_points.covariance[i, i] += noise.accelerometer * noise.accelerometer
                if history:
                    out.innovations[k, i] = r[i] / math.sqrt(of_points.covariance[i, i])
            of_acc, used = update(r, of_points.cross, of_points.covariance, L, P, x)
            total, count = total + of_acc, count + used
            q = corrected(q, c, x)
        out.nis[k] = total if count > 0 else math.nan
        out.dims[k] = count
        if history:
            remember(out, k, q, c, P)
    for i in range(4):
        state.attitude[i] = q[i]
    return points.health[0], int(points.health[1]), cosine
