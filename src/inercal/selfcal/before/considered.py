"""Considered states: errors of the rig that are in the recording, but not among the states of an estimator.

The estimator does not know an error b of such a state; its own errors x, attitude and states, go on as

    x+ = F x + G b,   z = H x + D b + v,   x <- x - K z,   K the gain of the estimator,

so that the sensitivity S = dx/db goes on as ``S+ = F S + G``, ``S <- S - K (H S + D)`` (S. F. Schmidt, Application of
state-space methods to navigation problems, Advances in Control Systems 3 (1966) 293; A. H. Jazwinski, Stochastic
Processes and Filtering Theory, 1970, section 8.4). G and D are the columns that the state would have.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from inercal._jit import allocating, kernel
from inercal.arrays import Array
from inercal.estimate.kalman import Row, empty_row
from inercal.geometry.kernels import exp, right_jacobian, rotate
from inercal.selfcal.before.bounds import Path, arrived
from inercal.selfcal.filters.gaps import anew
from inercal.selfcal.filters.problem import (
    FilterModel,
    FilterProblem,
    admitted,
    apart,
    encoders_at,
    updating,
    watch,
)
from inercal.selfcal.platform.kinematics import attitude
from inercal.selfcal.platform.linearised import (
    WALK_TIME,
    WIDEST,
    Columns,
    Places,
    Step,
    accelerometer_row,
    decorrelated_row,
    dynamics_columns,
    empty_columns,
    encoder_columns,
    encoder_roots,
    encoder_row,
    propagate_covariance,
    wander,
)
from inercal.selfcal.platform.model import (
    on_the_base,
    sensing,
    specific_force,
)
from inercal.selfcal.platform.recording import Recording
from inercal.selfcal.platform.states import ALL, WALK


def sensitivities(
    recording: Recording,
    problem: FilterProblem,
    attitudes: Array,
    coefficients: Array,
    names: Sequence[str],
    restarts: Sequence[int] = (),
) -> Array:
    """Changes (p, m) of the estimates of a problem's states, linear form, per error of each of ``names`` (m,), SI.

    ``attitudes`` (n, 4), ``coefficients`` and ``restarts`` as of `inercal.selfcal.before.bounds.recorded_bounds`.
    """
    return -_carried(
        recording, problem, attitudes, coefficients, names, restarts, np.empty((0, 6, len(names)))
    )[3:]


def load_kernels(problem: FilterProblem) -> None:
    """Load, or compile, the kernels of `sensitivities`."""
    still = np.zeros((2, 3))
    recording = Recording(np.array([0.0, 1.0]), still[1:], still, np.full((2, 3), np.nan))
    sensitivities(recording, problem, np.eye(4)[[0, 0]], np.zeros(len(problem.prior)), ())


def innovation_slopes(
    recording: Recording,
    problem: FilterProblem,
    attitudes: Array,
    coefficients: Array,
    names: Sequence[str],
    restarts: Sequence[int],
) -> Array:
    """Changes (n - 1, 6, m) of the normalised innovations per error of each of ``names`` (m,), SI, as `sensitivities`
    has those of the estimates; 0 where nothing was measured."""
    return both(recording, problem, attitudes, coefficients, names, restarts)[0]


def both(
    recording: Recording,
    problem: FilterProblem,
    attitudes: Array,
    coefficients: Array,
    names: Sequence[str],
    restarts: Sequence[int],
) -> tuple[Array, Array]:
    """`innovation_slopes` (n - 1, 6, m) and `sensitivities` (p, m), in one run."""
    slopes = np.zeros((len(recording.t), 6, len(names)))
    S = _carried(recording, problem, attitudes, coefficients, names, restarts, slopes)
    return slopes[1:], -S[3:]


def _carried(
    recording: Recording,
    problem: FilterProblem,
    attitudes: Array,
    coefficients: Array,
    names: Sequence[str],
    restarts: Sequence[int],
    slopes: Array,
) -> Array:
    """Sensitivities (3 + p, m) of the errors of attitude and states at the end; ``slopes`` (n or 0, 6, m), zeros, as of
    `carry`."""
    p, m = len(coefficients), len(names)
    states = problem.states
    place = np.full(len(ALL), -1, dtype=np.int64)
    place[states.index] = 3 + np.arange(p)
    place[[ALL.index(name) for name in names]] = 3 + p + np.arange(m)
    full = states.stated.copy()
    full[states.index] = coefficients
    whole = replace(states, names=(*states.names, *names))
    wide = FilterProblem(problem.world, problem.noise, np.ones(p + m), problem.filter, whole)
    P, S = np.diag(np.append(np.full(3, problem.noise.encoder**2), problem.prior**2)), np.zeros((3 + p, m))
    seen = np.column_stack([np.isfinite(recording.acc), np.all(np.isfinite(recording.th), axis=1)])
    q, th, dt, rate = attitudes, recording.th, recording.dt, recording.rate
    warm = np.zeros(len(q)) if recording.warm is None else recording.warm
    first = 0
    model = problem.model._replace(
        layout=whole.layout._replace(chosen=states.index, place=place, stated=full)
    )
    for last in (*restarts, len(q)):
        _on_encoders(P, S, wide, th[first], full[wide.states.index], rate[min(first, len(rate) - 1)])
        rows, steps = slice(first, last), slice(first, max(last - 1, 0))
        path = Path(q[rows], th[rows], dt[steps], rate[steps], seen[rows], warm[rows])
        carry(P, S, path, full, model, slopes[rows])
        if last < len(q):
            P[:3], P[:, :3], S[:3] = 0.0, 0.0, 0.0
            P[np.diag_indices(3)] = anew(problem, th[last]).sigma ** 2
        first = last
    return S


def _on_encoders(P: Array, S: Array, wide: FilterProblem, th: Array, c: Array, rate: Array) -> None:
    """Put into covariance (3 + p, 3 + p) and sensitivities (3 + p, m) that the attitude is that of the encoders.

    ``wide`` has all states, estimated ones first; ``c`` are their values. A delay may be that of a platform at rest.
    """
    p = len(P) - 3
    _, slope = encoders_at(wide, th, c, 0.0 * rate)
    own = slope[:, :p]
    whole = np.eye(3 + p)
    whole[:3, 3:] = own
    P[:] = whole @ P @ whole.T
    S[:3] = own @ S[3:] + slope[:, p:]


@allocating
def carry(P: Array, S: Array, path: Path, c: Array, model: FilterModel, slopes: Array) -> None:
    """Covariance ``P`` (n, n) of the error state and sensitivities ``S`` (n, m) along a path, in place; ``c`` is the
    whole full vector, linear form; in the layout considered states have the places behind the n. ``slopes`` (rows, 6,
    m), or none, receive those of the normalised innovations."""
    q, th, measured, warm = path.q, path.th, path.measured, path.warm
    world, noise, gate, layout = model
    n, place = len(P), layout.place
    own = place.copy()
    for i in range(len(own)):
        if own[i] >= n:
            own[i] = -1
    top, gain, row, columns = np.empty((3, n)), np.empty(n), empty_row(WIDEST), empty_columns()
    shift, near = np.empty((3, S.shape[1])), np.zeros(3, dtype=np.int64)
    earth_e, up_e, mean = on_the_base(world.earth, c), on_the_base(world.up, c), c.copy()
    variance = noise.accelerometer * noise.accelerometer
    for k in range(1, len(q)):
        step, read = arrived(path, k, c, earth_e, up_e)
        at = step.attitude
        _carry_step(S, n, c, place, step, shift, columns)
        walk = noise.angle_random_walk * noise.angle_random_walk * step.dt
        propagate_covariance(P, c, own, step, walk, top, columns)
        wander(P, mean, own, noise.gyro_walk, noise.accelerometer_walk, step.dt)
        _forget(S, own, step.dt)
        if measured[k, 3]:
            watch(specific_force(attitude(th[k], world.axes, world.signs), up_e), gate, near)
        if updating(gate, near):
            if measured[k, 3]:
                roots, variances = encoder_roots(
                    th[k],
                    world.axes,
                    world.signs,
                    noise.encoder,
                    noise.joints,
                    apart(noise, step.dt, noise.encoder),
                )
                wide = encoder_columns(
                    th[k], at, read, earth_e, up_e, c, layout, world.axes, world.signs, columns
                )
                for i in range(3 if len(slopes) > 0 else 0):
                    size = encoder_row(i, columns, wide, row)
                    _shown(P, S, row, size, variances[i], slopes[k, 3 + i])
                for i in range(3):
                    size = decorrelated_row(i, roots[i], columns, wide, row)
                    _update(P, S, row, size, 1.0, gain, shift[0])
            sensed = sensing(at, read, earth_e, up_e, warm[k], c)
            for i in range(3 if len(slopes) > 0 else 0):
                if measured[k, i] and admitted(i, gate, near):
                    size = accelerometer_row(i, sensed, c, place, up_e, row)
                    _shown(P, S, row, size, variance, slopes[k, i])
            for i in range(3):
                if measured[k, i] and admitted(i, gate, near):
                    size = accelerometer_row(i, sensed, c, place, up_e, row)
                    _update(P, S, row, size, variance, gain, shift[0])


@kernel
def _forget(S: Array, place: Places, dt: float) -> None:
    """Let what errors of walking biases depend on fade within ``dt`` [s], as these do, in sensitivities ``S``."""
    keep = math.exp(-dt / WALK_TIME)
    for i in range(WALK, WALK + 6):
        if place[i] >= 0:
            for k in range(S.shape[1]):
                S[place[i], k] *= keep


@kernel
def _carry_step(
    S: Array, n: int, c: Array, place: Places, step: Step, shift: Array, columns: Columns
) -> None:
    """Sensitivities after a step; ``shift`` (3, m) and ``columns`` are used up."""
    w, rate, dt, m = step.commanded, step.rate, step.dt, S.shape[1]
    j = right_jacobian((rate[0] * dt, rate[1] * dt, rate[2] * dt))
    back = exp((-rate[0] * dt, -rate[1] * dt, -rate[2] * dt))
    count = dynamics_columns(c, place, step, columns)
    for k in range(m):
        v = rotate(back, (S[0, k], S[1, k], S[2, k]))
        x = S[3, k] + w[1] * S[9, k] - w[2] * S[12, k]
        y = S[4, k] + w[2] * S[10, k] - w[0] * S[13, k]
        z = S[5, k] + w[0] * S[11, k] - w[1] * S[14, k]
        for i in range(3):
            shift[i, k] = v[i] + dt * (j[i][0] * x + j[i][1] * y + j[i][2] * z)
    for a in range(count):
        at = columns.places[a]
        for i in range(3):
            if at >= n:
                shift[i, at - n] += columns.axes[a, i]
            else:
                for k in range(m):
                    shift[i, k] += columns.axes[a, i] * S[at, k]
    for i in range(3):
        for k in range(m):
            S[i, k] = shift[i, k]


@kernel
def _shown(P: Array, S: Array, row: Row, size: int, r: float, slope: Array) -> None:
    """Slopes (m,) of a normalised innovation of variance ``r`` beside that of the error state."""
    places, values, n, total = row.places, row.values, len(P), r
    for a in range(size):
        for b in range(size):
            if places[a] < n and places[b] < n:
                total += values[a] * values[b] * P[places[a], places[b]]
    _seen(S, row, size, n, slope)
    root = math.sqrt(total) if total > 0.0 else math.nan
    for k in range(len(slope)):
        slope[k] /= root


@kernel
def _seen(S: Array, row: Row, size: int, n: int, out: Array) -> None:
    """Put into ``out`` (m,) what a ``row`` sees of each error: ``S`` (n, m) of the error state, and of itself."""
    out[:] = 0.0
    for a in range(size):
        at, value = row.places[a], row.values[a]
        if at < n:
            for k in range(len(out)):
                out[k] += value * S[at, k]
        else:
            out[at - n] += value


@kernel
def _update(P: Array, S: Array, row: Row, size: int, r: float, gain: Array, shift: Array) -> None:
    """Covariance and sensitivities after a scalar measurement of variance ``r``; ``gain`` (n,) and ``shift`` (m,) are
    used up."""
    places, values = row.places, row.values
    n, m = S.shape
    variance = r
    gain[:] = 0.0
    for a in range(size):
        if places[a] < n:
            line, value = P[places[a]], values[a]  # rows are columns, and near each other
            for i in range(n):
                gain[i] += line[i] * value
    for a in range(size):
        if places[a] < n:
            variance += values[a] * gain[places[a]]
    _seen(S, row, size, n, shift)
    for i in range(n):
        of_row = gain[i] / variance
        for k in range(m):
            S[i, k] -= of_row * shift[k]
        for j in range(n):
            P[i, j] -= of_row * gain[j]
