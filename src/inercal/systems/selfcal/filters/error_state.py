"""The product's default: an error-state filter with analytic Jacobians.

The attitude is a quaternion, its error a rotation vector in p (`inercal.systems.selfcal.platform.linearised`); each
step is exact for a rate held over it. The encoders come first, three decorrelated scalars, their residual linear in any
error of the prediction. The accelerometers follow, linearised at what the encoders made of it: a wrong start does no
harm.
"""

from __future__ import annotations

import math

import numpy as np

from inercal.foundation._jit import allocating, kernel
from inercal.foundation.arrays import Array
from inercal.foundation.geometry.kernels import Quaternion, Vector, exp, log, multiply, normalize
from inercal.foundation.inference.kalman import SlopeRow, empty_row, innovation_variance, scalar_update
from inercal.systems.selfcal.filters.filter_result import (
    Estimates,
    FilterState,
    Trace,
    empty_estimates,
    remember,
)
from inercal.systems.selfcal.filters.problem import (
    AttitudeStart,
    FilterModel,
    FilterProblem,
    admitted,
    apart,
    encoders_at,
    updating,
    watch,
)
from inercal.systems.selfcal.platform.kinematics import nearest_turn
from inercal.systems.selfcal.platform.linearised import (
    Places,
    decorrelated_row,
    encoder_roots,
    encoder_row,
    propagate_covariance,
    transition,
    wander,
)
from inercal.systems.selfcal.platform.model import (
    WIDEST,
    Rates,
    Vectors,
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
from inercal.systems.selfcal.platform.states import LEVER, TAU


def initial(
    problem: FilterProblem, th: Array, start: AttitudeStart | None = None, rate: Array | None = None
) -> FilterState:
    """The state before the first step: the states at their mean with the prior, the attitude that of encoders which
    read ``th`` (3,) or ``start``; ``rate`` (3,) [rad/s] is the first one read."""
    p = len(problem.prior)
    q = None if start is None else start.attitude.copy()
    sigma = problem.noise.encoder if start is None else start.sigma
    covariance = np.zeros((3 + p, 3 + p))
    covariance[3:, 3:] = np.diag(problem.prior**2)
    begun = FilterState(
        np.empty(4), problem.mean.copy(), covariance, np.zeros(3, dtype=np.int64), np.array(th, dtype=float)
    )
    return with_attitude(begun, problem, q, sigma, np.zeros(3) if rate is None else rate)


def with_attitude(
    state: FilterState, problem: FilterProblem, q: Array | None, sigma: float, rate: Array
) -> FilterState:
    """The state with an attitude ``q`` (4,) known to ``sigma`` [rad], or else that of the encoders, whose errors are
    those of the states; coefficients and their covariance stay. Encoders that are late are taken to be so by less than
    the platform turns at ``rate`` (3,) [rad/s] in the prior of the delay."""
    P = state.covariance.copy()
    P[:3], P[:, :3] = 0.0, 0.0
    P[np.diag_indices(3)] = sigma**2
    if q is None:
        q, slope = encoders_at(problem, state.th, state.coefficients, rate)
        at_rest = problem.states.layout.place[TAU] - 3
        if at_rest >= 0:  # the platform may have begun to turn at this row
            late, variance = state.coefficients[at_rest], P[3 + at_rest, 3 + at_rest]
            if not (late < 0.0 and late**2 > 9.0 * variance):
                c = np.where(np.arange(len(slope.T)) == at_rest, 0.0, state.coefficients)
                q, slope = encoders_at(problem, state.th, c, rate)
                P[:3, :3] += np.outer(slope[:, at_rest], slope[:, at_rest]) * (variance + late**2)
                slope[:, at_rest] = 0.0
        if slope.any():
            P[:3, 3:] = slope @ P[3:, 3:]
            P[:3, :3] += P[:3, 3:] @ slope.T
            P[3:, :3] = P[:3, 3:].T
    return state._replace(attitude=np.array(q), covariance=P)


def advance(
    state: FilterState, problem: FilterProblem, steps: Steps, history: bool = True
) -> tuple[FilterState, Trace]:
    """Take the filter through m steps; the arrays of ``state`` become those of the new one. Without ``history`` the
    trace holds no more than the normalised innovations squared."""
    out = empty_estimates(len(steps.dt), len(problem.prior), history)
    return state, Trace(out, gimbal_cosine=_advance(state, problem.model, steps, out))


@kernel
def _corrected(q: Quaternion, c: Array, index: Places, x: Array) -> Quaternion:
    """The attitude with the error state ``x`` put in, and the states of the full vector ``c`` too, at their places
    ``index`` (p,); x is then 0."""
    for j in range(len(index)):
        c[index[j]] += x[3 + j]
    turned = normalize(multiply(q, exp((x[0], x[1], x[2]))))
    x.fill(0.0)
    return turned


@kernel
def _undecided(P: Array, c: Array, place: Places, sensor: int, read: Rates, unknown: bool) -> float:
    """Variance [rad^2] of the angle turned while it is not known on which side of a row a sensor, 0 encoders or 1
    accelerometers, was read where the rate changes: its delay may be of either sign. Where the rate behind the row is
    ``unknown``, that of the whole delay, which turns as before or not."""
    at, lag = place[TAU + sensor], c[TAU + sensor]
    variance, w = P[at, at] if at >= 0 else 0.0, read.before
    if unknown:
        if lag > 0.0 and lag * lag > 9.0 * variance:
            return 0.0
        return float((lag * lag + variance) * (w[0] * w[0] + w[1] * w[1] + w[2] * w[2]))
    if at < 0 or lag * lag > 9.0 * variance:
        return 0.0
    x, y, z = (
        read.after[0] - read.before[0],
        read.after[1] - read.before[1],
        read.after[2] - read.before[2],
    )
    return float(variance * (x * x + y * y + z * z))


@kernel
def _shaken(P: Array, c: Array, place: Places, read: Rates, dt: float, unknown: bool) -> float:
    """Variance [m^2/s^4] of accelerometers away from the centre at a row where the rate changes, within the step of
    ``dt`` [s] before or after: as large as the angular acceleration makes it at the places that they have. Where the
    rate behind the row is ``unknown``, the platform may stop there."""
    square = 0.0
    for k in range(LEVER, LEVER + 9):
        if place[k] >= 0:
            square += c[k] * c[k] + P[place[k], place[k]]
    x, y, z = (
        read.after[0] - read.before[0],
        read.after[1] - read.before[1],
        read.after[2] - read.before[2],
    )
    if unknown:
        x, y, z = read.before
    x, y, z = x / dt, y / dt, z / dt
    return square * (x * x + y * y + z * z)


@kernel
def _encoder_update(
    q: Quaternion,
    of_encoders: Quaternion,
    roots: Vectors,
    variances: Vector,
    P: Array,
    x: Array,
    columns: Places,
    axes: Array,
    row: SlopeRow,
    work: Array,
    innovations: Array,
) -> float:
    """Put encoders into covariance ``P`` and error state ``x``; returns the sum of squares.

    ``of_encoders`` (4,) is the attitude that they have, with ``axes`` of states at the places ``columns`` (m,);
    ``roots`` and ``variances`` as of `encoder_roots`; ``innovations`` (3,) are written, or (0,).
    """
    miss = log(multiply((q[0], -q[1], -q[2], -q[3]), of_encoders))
    if len(innovations) > 0:
        for i in range(3):
            size = encoder_row(i, columns, axes, row)
            innovations[i] = miss[i] / math.sqrt(innovation_variance(P, row, size, variances[i]))
    total = 0.0
    for i in range(3):
        root = roots[i]
        size = decorrelated_row(i, root, columns, axes, row)
        z = root[0] * miss[0] + root[1] * miss[1] + root[2] * miss[2]
        total += scalar_update(P, x, row, size, z, 1.0, work)
    return total


@allocating
def _advance(state: FilterState, model: FilterModel, steps: Steps, out: Estimates) -> float:
    """The loop; returns the least |cos thy|."""
    estimated, P, near, angles = state.coefficients, state.covariance, state.near, state.th
    world, noise, gate, layout = model
    intervals, rates, acc, th, later, warm = steps
    index, place = layout.chosen, layout.place
    c = layout.stated.copy()
    for j in range(len(index)):
        c[index[j]] = estimated[j]
    n = len(P)
    top, spare, x, work = np.empty((3, n)), np.empty((3, n)), np.zeros(n), np.empty(n)
    row, own = empty_row(WIDEST), room()
    variance = noise.accelerometer * noise.accelerometer
    history = len(out.u) > 0
    late = place[TAU] >= 0 or place[TAU + 1] >= 0 or c[TAU] != 0.0 or c[TAU + 1] != 0.0
    levers, unwanted = place[LEVER] >= 0, np.empty(0)
    cosine, sigma, of_acc = 1.0, noise.encoder, variance
    q = (state.attitude[0], state.attitude[1], state.attitude[2], state.attitude[3])
    base = base_of(c, layout.based, world)
    for k in range(len(intervals)):
        dt, w = intervals[k], (rates[k, 0], rates[k, 1], rates[k, 2])
        unknown, after = math.isnan(later[k, 0]), (later[k, 0], later[k, 1], later[k, 2])
        read = Rates(w, w if unknown else after)
        f = force_within(q, w, 0.5 * dt, base.up, layout.by_force)
        rate = turning(w, f, warm[k], c, layout, own)
        q = normalize(propagate(q, rate, base.earth, dt))
        walk = noise.angle_random_walk * noise.angle_random_walk * dt
        F = transition(w, rate, dt, q, base.earth, c, layout.based)
        propagate_covariance(P, F, layout, own, walk, top, spare)
        if layout.walking:
            wander(P, c, place, noise.gyro_walk, noise.accelerometer_walk, dt)
        total, count = 0.0, 0
        seen = not (math.isnan(th[k, 0]) or math.isnan(th[k, 1]) or math.isnan(th[k, 2]))
        if seen:
            for i in range(3):
                angles[i] = nearest_turn(th[k, i], angles[i])
            cosine = min(cosine, abs(math.cos(angles[1])))
            of_encoders = encoders(angles, read, base, c, layout, world, own)
            watch(specific_force(of_encoders, base.up), gate, near)
        take = updating(gate, near)
        if history:
            for i in range(6):
                out.innovations[k, i] = math.nan
        if take and seen:
            if late:
                sigma = math.sqrt(noise.encoder * noise.encoder + _undecided(P, c, place, 0, read, unknown))
            shown = out.innovations[k, 3:] if history else unwanted
            floor = apart(noise, dt, sigma)
            roots, variances = encoder_roots(angles, world.axes, world.signs, sigma, noise.joints, floor)
            total += _encoder_update(
                q, of_encoders, roots, variances, P, x, layout.columns, own.axes, row, work, shown
            )
            count += 3
            q = _corrected(q, c, index, x)
            base = base_of(c, layout.based, world)
        if take:
            expected, a = accelerometers(q, read, warm[k], base, c, layout, own)
            if late:
                of_acc = variance + _undecided(P, c, place, 1, read, unknown) * (
                    a[0] * a[0] + a[1] * a[1] + a[2] * a[2]
                )
            if levers:
                of_acc = (of_acc if late else variance) + _shaken(P, c, place, read, dt, unknown)
            for i in range(3):
                if history and not math.isnan(acc[k, i]) and admitted(i, gate, near):
                    of_row = SlopeRow(layout.rows[i], own.entries[i])
                    spread = innovation_variance(P, of_row, layout.sizes[i], of_acc)
                    out.innovations[k, i] = (acc[k, i] - expected[i]) / math.sqrt(spread)
            for i in range(3):
                if not math.isnan(acc[k, i]) and admitted(i, gate, near):
                    of_row = SlopeRow(layout.rows[i], own.entries[i])
                    z = acc[k, i] - expected[i]
                    total += scalar_update(P, x, of_row, layout.sizes[i], z, of_acc, work)
                    count += 1
            q = _corrected(q, c, index, x)
            base = base_of(c, layout.based, world)
        out.nis[k] = total if count > 0 else math.nan
        out.dims[k] = count
        if history:
            remember(out, k, q, c, index, P)
    for i in range(4):
        state.attitude[i] = q[i]
    for j in range(len(index)):
        estimated[j] = c[index[j]]
    return cosine
