"""Estimator 4, the product's default: an error-state filter with analytic Jacobians.

The attitude is a quaternion, its error a rotation vector in p (`inercal.selfcal.platform.linearised`); each step is
exact for a rate held over it. The encoders come first, three decorrelated scalars: whatever the error of the
prediction, their residual is linear in it. The accelerometers follow, linearised at what the encoders made of it, so
that a prediction that is far off, as after a wrong start, does no harm. Innovations of accelerometers are those that
are left once the encoders of the row are known.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from inercal._jit import kernel
from inercal.estimate.kalman import innovation_variance, scalar_update
from inercal.geometry.kernels import Quaternion, exp, log, multiply, normalize
from inercal.selfcal.filters.filter_result import Problem, Start, State, Trace, empty_trace
from inercal.selfcal.filters.gating import admitted, gate_of, updating, watch
from inercal.selfcal.platform.kinematics import Axes, attitude, nearest_turn
from inercal.selfcal.platform.linearised import accelerometer_row, encoder_roots, propagate_covariance
from inercal.selfcal.platform.model import (
    accelerometers,
    on_the_base,
    platform_rate,
    propagate,
    specific_force,
)

Array: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.int64]


def initial(problem: Problem, th: Array, start: Start | None = None) -> State:
    """The state before the first step: coefficients 0 with the prior, the attitude that of ``th`` (3,) or ``start``."""
    world, p = problem.world, len(problem.prior)
    covariance = np.zeros((3 + p, 3 + p))
    sigma = problem.noise.encoder if start is None else start.sigma
    covariance[np.diag_indices(3)] = sigma**2
    covariance[3:, 3:] = np.diag(problem.prior**2)
    q = np.array(attitude(th, world.axes, world.signs)) if start is None else start.attitude.copy()
    return State(q, np.zeros(p), covariance, np.zeros(3, dtype=np.int64), np.array(th, dtype=float))


def advance(
    state: State, problem: Problem, dt: Array, rate: Array, acc: Array, th: Array, history: bool = True
) -> tuple[State, Trace]:
    """Take the filter through m steps.

    Parameters
    ----------
    state : State
        Its arrays become those of the new one.
    problem : Problem
    dt : (m,) s
    rate : (m, 3) rad/s, held over each step
    acc, th : (m, 3) m/s^2, rad
        Measured at the end of each step; NaN where not.
    history : bool
        Whether the trace holds more than the normalised innovations squared.
    """
    world, trace = problem.world, empty_trace(len(dt), len(problem.prior), history)
    cosine = _advance(
        state.attitude, state.coefficients, state.covariance, state.near, state.th, dt, rate, acc, th,
        world.earth, world.up, world.axes, world.signs, problem.noise.levels, gate_of(problem.filter.gating),
        trace.attitude, trace.attitude_u, trace.coefficients, trace.u, trace.innovations, trace.nis, trace.dims,
    )  # fmt: skip
    return state, trace._replace(gimbal_cosine=cosine)


@kernel
def _corrected(q: Quaternion, c: Array, x: Array) -> Quaternion:
    """The attitude with the error state ``x`` put in, and the coefficients ``c`` too, in place; x is then 0."""
    for j in range(len(c)):
        c[j] += x[3 + j]
    turned = normalize(multiply(q, exp((x[0], x[1], x[2]))))
    x[:] = 0.0
    return turned


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
    out_attitude: Array,
    out_attitude_u: Array,
    out_coefficients: Array,
    out_u: Array,
    out_innovations: Array,
    nis: Array,
    dims: Indices,
) -> float:
    """The loop; returns the least |cos thy|."""
    n, p = len(P), len(c)
    top, x, work = np.empty((6, n)), np.empty(n), np.empty(n)
    places, row = np.empty(10, dtype=np.int64), np.empty(10)
    variance = levels[1] * levels[1]
    history = len(out_u) > 0
    cosine = 1.0
    q = (attitude_[0], attitude_[1], attitude_[2], attitude_[3])
    for k in range(len(dt)):
        w = (rates[k, 0], rates[k, 1], rates[k, 2])
        rate, earth_e, up_e = platform_rate(w, c), on_the_base(earth, c), on_the_base(up, c)
        q = normalize(propagate(q, rate, earth_e, dt[k]))
        propagate_covariance(P, c, w, rate, earth_e, q, dt[k], levels[0] * levels[0] * dt[k], top)
        x[:] = 0.0
        total, count = 0.0, 0
        seen = not (math.isnan(th[k, 0]) or math.isnan(th[k, 1]) or math.isnan(th[k, 2]))
        if seen:
            for i in range(3):
                angles[i] = nearest_turn(th[k, i], angles[i])
            cosine = min(cosine, abs(math.cos(angles[1])))
            of_encoders = attitude(angles, axes, signs)
            watch(specific_force(of_encoders, up_e), gate, near)
        take = updating(gate, near)
        if history:
            for i in range(6):
                out_innovations[k, i] = math.nan
        if take and seen:
            roots, variances = encoder_roots(angles, axes, signs, levels[2])
            miss = log(multiply((q[0], -q[1], -q[2], -q[3]), of_encoders))
            for i in range(3):
                if history:
                    out_innovations[k, 3 + i] = miss[i] / math.sqrt(P[i, i] + variances[i])
            for i in range(3):
                root = roots[i]
                for j in range(i + 1):
                    places[j], row[j] = j, root[j]
                z = root[0] * miss[0] + root[1] * miss[1] + root[2] * miss[2]
                total += scalar_update(P, x, places, row, i + 1, z, 1.0, work)
                count += 1
            q = _corrected(q, c, x)
        if take:
            up_e = on_the_base(up, c)
            f = specific_force(q, up_e)
            read = accelerometers(f, c)
            for i in range(3):
                if not math.isnan(acc[k, i]) and admitted(i, gate, near):
                    of_row = accelerometer_row(i, f, c, up_e, q, places, row)
                    if history:
                        own = innovation_variance(P, places, row, of_row, variance)
                        out_innovations[k, i] = (acc[k, i] - read[i]) / math.sqrt(own)
            for i in range(3):
                if not math.isnan(acc[k, i]) and admitted(i, gate, near):
                    of_row = accelerometer_row(i, f, c, up_e, q, places, row)
                    total += scalar_update(P, x, places, row, of_row, acc[k, i] - read[i], variance, work)
                    count += 1
            q = _corrected(q, c, x)
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
    return cosine
