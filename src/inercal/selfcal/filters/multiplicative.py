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

from inercal._jit import allocating, kernel
from inercal.arrays import Array
from inercal.estimate.factor import FACTORS
from inercal.estimate.kalman import empty_row
from inercal.estimate.sigma_point import draw, empty_moments, empty_points, moments, update, weights
from inercal.geometry.kernels import Quaternion, Vector, exp, log, multiply, normalize, rotate
from inercal.selfcal.estimators import FACTOR_OF
from inercal.selfcal.filters.error_state import corrected, encoder_update, shaken, undecided
from inercal.selfcal.filters.error_state import initial as initial
from inercal.selfcal.filters.filter_result import Estimates, State, Trace, empty_estimates, remember
from inercal.selfcal.filters.problem import FilterModel, FilterProblem, admitted, apart, updating, watch
from inercal.selfcal.platform.kinematics import nearest_turn
from inercal.selfcal.platform.linearised import WIDEST, Places, empty_columns, encoder_columns, wander
from inercal.selfcal.platform.model import (
    Rates,
    drifting,
    encoders_attitude,
    force_within,
    on_the_base,
    outputs,
    platform_rate,
    propagate,
    sensing,
    specific_force,
)
from inercal.selfcal.platform.recording import Steps
from inercal.selfcal.platform.rig import World
from inercal.selfcal.platform.states import LEVER, TAU

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
def _moved(c: Array, index: Places, column: Array, sign: float, shifted: Array) -> None:
    """Put the states at a point, of which ``column`` is the deviation, into ``shifted``, else the full vector ``c``."""
    for j in range(len(index)):
        at = index[j]
        shifted[at] = c[at] + sign * column[3 + j]


@kernel
def _predict(
    q: Quaternion,
    c: Array,
    index: Places,
    w: Vector,
    warm: float,
    dt: float,
    world: World,
    columns: Array,
    shifted: Array,
    z: Array,
) -> Quaternion:
    """Attitude after a step of ``dt`` [s], from which ``z`` (2 n + 1, 3) receives the deviations of all points;
    ``columns`` (n, n) are those of the points before, ``index`` (p,) the places of states in ``c``; ``shifted``, as
    long, has what is no state."""
    n = len(columns)
    rate, f = platform_rate(w, c), (0.0, 0.0, 0.0)
    if len(c) > 24:
        f = force_within(q, w, 0.5 * dt, on_the_base(world.up, c))
        rate = drifting(rate, f, warm, c)
    turn = (rate[0] * dt, rate[1] * dt, rate[2] * dt)
    centre = normalize(propagate(q, rate, on_the_base(world.earth, c), dt))
    back = (centre[0], -centre[1], -centre[2], -centre[3])
    held = multiply(back, multiply(_by_earth(world.earth, c, dt), q))
    for k in range(2 * n):
        column, sign = (columns[k], 1.0) if k < n else (columns[k - n], -1.0)
        d = (sign * column[0], sign * column[1], sign * column[2])
        _moved(c, index, column, sign, shifted)
        rate = platform_rate(w, shifted)
        if len(c) > 24:
            rate = drifting(rate, f, warm, shifted)
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
def _read(
    q: Quaternion,
    c: Array,
    index: Places,
    read: Rates,
    warm: float,
    world: World,
    columns: Array,
    shifted: Array,
    z: Array,
) -> None:
    """Put into ``z`` (2 n + 1, 3) [m/s^2] the accelerometers' readings at all points; ``read`` are the rates about the
    row, other arguments as of `_predict`."""
    n = len(columns)
    for k in range(2 * n):
        column, sign = (columns[k], 1.0) if k < n else (columns[k - n], -1.0)
        _moved(c, index, column, sign, shifted)
        turned = multiply(q, exp((sign * column[0], sign * column[1], sign * column[2])))
        earth, up = on_the_base(world.earth, shifted), on_the_base(world.up, shifted)
        z[1 + k, 0], z[1 + k, 1], z[1 + k, 2] = outputs(
            sensing(turned, read, earth, up, warm, shifted), shifted
        )


@allocating
def _advance(
    state: State, model: FilterModel, factor: int, steps: Steps, out: Estimates
) -> tuple[float, int, float]:
    """The loop; returns the lowest eigenvalue, the number of fallbacks, the least |cos thy|."""
    estimated, P, near, angles = state.coefficients, state.covariance, state.near, state.th
    world, noise, gate, layout = model
    intervals, rates, acc, th, later, warm = steps
    index, place, axes, signs = layout.chosen, layout.place, world.axes, world.signs
    c = layout.stated.copy()
    for j in range(len(index)):
        c[index[j]] = estimated[j]
    n = len(P)
    _, _, other, spread = weights(n, 1.0, 0.0, 0.0)  # those of the centre are zero
    points, shifted, of_points = empty_points(n), c.copy(), empty_moments(n, 3)
    z, r, L, x, spare = np.zeros((2 * n + 1, 3)), np.empty(3), np.empty((3, 3)), np.zeros(n), np.empty(n)
    row, of_states, unwanted = empty_row(WIDEST), empty_columns(), np.empty(0)
    history = len(out.u) > 0
    late = place[TAU] >= 0 or place[TAU + 1] >= 0
    levers = place[LEVER] >= 0
    variance = noise.accelerometer * noise.accelerometer
    cosine, sigma, of_acc = 1.0, noise.encoder, variance
    q = (state.attitude[0], state.attitude[1], state.attitude[2], state.attitude[3])
    for k in range(len(intervals)):
        dt, w = intervals[k], (rates[k, 0], rates[k, 1], rates[k, 2])
        read = Rates(w, (later[k, 0], later[k, 1], later[k, 2]))
        draw(P, factor, spread, points)
        q = _predict(q, c, index, w, warm[k], dt, world, points.columns, shifted, z)
        moments(z, points.columns, other, of_points)
        middle = of_points.mean
        q = normalize(multiply(q, exp((middle[0], middle[1], middle[2]))))
        for i in range(3):
            for j in range(3):
                P[i, j] = of_points.covariance[i, j]
            P[i, i] += noise.angle_random_walk * noise.angle_random_walk * dt
            for j in range(3, n):
                P[i, j], P[j, i] = of_points.cross[j, i], of_points.cross[j, i]
        if len(c) > 24:
            wander(P, c, place, noise.gyro_walk, noise.accelerometer_walk, dt)
        seen = not (math.isnan(th[k, 0]) or math.isnan(th[k, 1]) or math.isnan(th[k, 2]))
        if seen:
            for i in range(3):
                angles[i] = nearest_turn(th[k, i], angles[i])
            cosine = min(cosine, abs(math.cos(angles[1])))
            earth_e, up_e = on_the_base(world.earth, c), on_the_base(world.up, c)
            of_encoders = encoders_attitude(angles, read, earth_e, up_e, c, layout, axes, signs)
            watch(specific_force(of_encoders, up_e), gate, near)
        take = updating(gate, near)
        total, count = 0.0, 0
        if history:
            for i in range(6):
                out.innovations[k, i] = math.nan
        if take and seen:
            wide = encoder_columns(
                angles, of_encoders, read, earth_e, up_e, c, layout, axes, signs, of_states
            )
            if late:
                sigma = math.sqrt(noise.encoder * noise.encoder + undecided(P, c, place, 0, read))
            shown = out.innovations[k, 3:] if history else unwanted
            x[:] = 0.0
            total += encoder_update(
                q,
                of_encoders,
                angles,
                axes,
                signs,
                sigma,
                noise.joints,
                apart(noise, dt, sigma),
                P,
                x,
                of_states,
                wide,
                row,
                spare,
                shown,
            )
            count += 3
            # The covariance is not turned with the corrected attitude. Small corrections turn it by nothing; after a
            # large one it is that of the encoders, which is stated about the measured attitude as it is.
            q = corrected(q, c, index, x)
        for i in range(3):
            r[i] = acc[k, i] if take and admitted(i, gate, near) else math.nan
        if not (math.isnan(r[0]) and math.isnan(r[1]) and math.isnan(r[2])):
            draw(P, factor, spread, points)
            _read(q, c, index, read, warm[k], world, points.columns, shifted, z)
            moments(z, points.columns, other, of_points)
            if late:
                up_square = world.up[0] ** 2 + world.up[1] ** 2 + world.up[2] ** 2
                of_acc = variance + undecided(P, c, place, 1, read) * up_square
            if levers:
                of_acc = (of_acc if late else variance) + shaken(P, c, place, read, dt)
            for i in range(3):
                r[i] -= of_points.mean[i]
                of_points.covariance[i, i] += of_acc
                if history:
                    out.innovations[k, i] = r[i] / math.sqrt(of_points.covariance[i, i])
            own, used = update(r, of_points.cross, of_points.covariance, L, P, x)
            total, count = total + own, count + used
            q = corrected(q, c, index, x)
        out.nis[k] = total if count > 0 else math.nan
        out.dims[k] = count
        if history:
            remember(out, k, q, c, index, P)
    for i in range(4):
        state.attitude[i] = q[i]
    for j in range(len(index)):
        estimated[j] = c[index[j]]
    return points.health[0], int(points.health[1]), cosine
