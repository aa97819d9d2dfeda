"""Estimator 4, the product's default: an error-state filter with analytic Jacobians.

The attitude is a quaternion, its error a rotation vector in p (`inercal.selfcal.platform.linearised`); each step is
exact for a rate held over it. The encoders come first, three decorrelated scalars, their residual linear in any error
of the prediction. The accelerometers follow, linearised at what the encoders made of it: a wrong start does no harm.
"""

from __future__ import annotations

import math

import numpy as np

from inercal._jit import kernel
from inercal.arrays import Array
from inercal.estimate.kalman import empty_row, innovation_variance, scalar_update
from inercal.geometry.kernels import Quaternion, exp, log, multiply, normalize
from inercal.selfcal.filters.filter_result import Estimates, State, Trace, empty_estimates, remember
from inercal.selfcal.filters.problem import FilterModel, FilterProblem, Start, admitted, updating, watch
from inercal.selfcal.platform.kinematics import attitude, nearest_turn
from inercal.selfcal.platform.linearised import (
    WIDEST,
    Step,
    accelerometer_row,
    encoder_roots,
    propagate_covariance,
)
from inercal.selfcal.platform.model import (
    accelerometers,
    on_the_base,
    platform_rate,
    propagate,
    specific_force,
)
from inercal.selfcal.platform.recording import Steps


def initial(problem: FilterProblem, th: Array, start: Start | None = None) -> State:
    """The state before the first step: coefficients 0 with the prior, the attitude that of ``th`` (3,) or ``start``."""
    world, p = problem.world, len(problem.prior)
    covariance = np.zeros((3 + p, 3 + p))
    sigma = problem.noise.encoder if start is None else start.sigma
    covariance[np.diag_indices(3)] = sigma**2
    covariance[3:, 3:] = np.diag(problem.prior**2)
    q = np.array(attitude(th, world.axes, world.signs)) if start is None else start.attitude.copy()
    return State(q, np.zeros(p), covariance, np.zeros(3, dtype=np.int64), np.array(th, dtype=float))


def advance(state: State, problem: FilterProblem, steps: Steps, history: bool = True) -> tuple[State, Trace]:
    """Take the filter through m steps; the arrays of ``state`` become those of the new one. Without ``history`` the
    trace holds no more than the normalised innovations squared."""
    out = empty_estimates(len(steps.dt), len(problem.prior), history)
    return state, Trace(out, gimbal_cosine=_advance(state, problem.model, steps, out))


@kernel
def corrected(q: Quaternion, c: Array, x: Array) -> Quaternion:
    """The attitude with the error state ``x`` put in, and the coefficients ``c`` too, in place; x is then 0."""
    for j in range(len(c)):
        c[j] += x[3 + j]
    turned = normalize(multiply(q, exp((x[0], x[1], x[2]))))
    x[:] = 0.0
    return turned


@kernel
def _advance(state: State, model: FilterModel, steps: Steps, out: Estimates) -> float:
    """The loop; returns the least |cos thy|."""
    c, P, near, angles = state.coefficients, state.covariance, state.near, state.th
    world, noise, gate = model
    intervals, rates, acc, th = steps
    n = len(P)
    top, x, work = np.empty((6, n)), np.empty(n), np.empty(n)
    row = empty_row(WIDEST)
    variance = noise.accelerometer * noise.accelerometer
    history = len(out.u) > 0
    cosine = 1.0
    q = (state.attitude[0], state.attitude[1], state.attitude[2], state.attitude[3])
    for k in range(len(intervals)):
        dt, w = intervals[k], (rates[k, 0], rates[k, 1], rates[k, 2])
        rate, earth_e, up_e = platform_rate(w, c), on_the_base(world.earth, c), on_the_base(world.up, c)
        q = normalize(propagate(q, rate, earth_e, dt))
        walk = noise.angle_random_walk * noise.angle_random_walk * dt
        propagate_covariance(P, c, Step(w, rate, earth_e, q, dt), walk, top)
        x[:] = 0.0
        total, count = 0.0, 0
        seen = not (math.isnan(th[k, 0]) or math.isnan(th[k, 1]) or math.isnan(th[k, 2]))
        if seen:
            for i in range(3):
                angles[i] = nearest_turn(th[k, i], angles[i])
            cosine = min(cosine, abs(math.cos(angles[1])))
            of_encoders = attitude(angles, world.axes, world.signs)
            watch(specific_force(of_encoders, up_e), gate, near)
        take = updating(gate, near)
        if history:
            for i in range(6):
                out.innovations[k, i] = math.nan
        if take and seen:
            roots, variances = encoder_roots(angles, world.axes, world.signs, noise.encoder)
            miss = log(multiply((q[0], -q[1], -q[2], -q[3]), of_encoders))
            for i in range(3):
                if history:
                    out.innovations[k, 3 + i] = miss[i] / math.sqrt(P[i, i] + variances[i])
            for i in range(3):
                root = roots[i]
                for j in range(i + 1):
                    row.places[j], row.values[j] = j, root[j]
                z = root[0] * miss[0] + root[1] * miss[1] + root[2] * miss[2]
                total += scalar_update(P, x, row, i + 1, z, 1.0, work)
                count += 1
            q = corrected(q, c, x)
        if take:
            up_e = on_the_base(world.up, c)
            f = specific_force(q, up_e)
            read = accelerometers(f, c)
            for i in range(3):
                if not math.isnan(acc[k, i]) and admitted(i, gate, near):
                    size = accelerometer_row(i, f, c, up_e, q, row)
                    if history:
                        own = innovation_variance(P, row, size, variance)
                        out.innovations[k, i] = (acc[k, i] - read[i]) / math.sqrt(own)
            for i in range(3):
                if not math.isnan(acc[k, i]) and admitted(i, gate, near):
                    size = accelerometer_row(i, f, c, up_e, q, row)
                    total += scalar_update(P, x, row, size, acc[k, i] - read[i], variance, work)
                    count += 1
            q = corrected(q, c, x)
        out.nis[k] = total if count > 0 else math.nan
        out.dims[k] = count
        if history:
            remember(out, k, q, c, P)
    for i in range(4):
        state.attitude[i] = q[i]
    return cosine
