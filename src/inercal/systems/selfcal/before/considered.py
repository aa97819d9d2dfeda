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

from inercal.foundation._jit import allocating, kernel
from inercal.foundation.arrays import Array
from inercal.foundation.inference.kalman import SlopeRow, empty_row
from inercal.systems.selfcal.before.bounds import Path, arrived
from inercal.systems.selfcal.filters.gaps import anew
from inercal.systems.selfcal.filters.problem import (
    FilterModel,
    FilterProblem,
    admitted,
    apart,
    encoders_at,
    updating,
    watch,
)
from inercal.systems.selfcal.platform.kinematics import attitude
from inercal.systems.selfcal.platform.linearised import (
    WALK_TIME,
    Places,
    add_unknown,
    decorrelated_row,
    encoder_roots,
    encoder_row,
    propagate_covariance,
    times,
    wander,
)
from inercal.systems.selfcal.platform.model import (
    WIDEST,
    accelerometers,
    base_of,
    encoders,
    room,
    specific_force,
)
from inercal.systems.selfcal.platform.recording import Recording
from inercal.systems.selfcal.platform.states import WALK


def sensitivities(
    recording: Recording,
    problem: FilterProblem,
    attitudes: Array,
    coefficients: Array,
    names: Sequence[str],
    restarts: Sequence[int] = (),
) -> Array:
    """Changes (p, m) of the estimates of a problem's states, linear form, per error of each of ``names`` (m,), SI.

    ``attitudes`` (n, 4), ``coefficients`` and ``restarts`` as of
    `inercal.systems.selfcal.before.bounds.recorded_bounds`.
    """
    return -_carried(
        recording, problem, attitudes, coefficients, names, restarts, np.empty((0, 6, len(names)))
    )[3:]


def load_kernels(problem: FilterProblem) -> None:
    """Load, or compile, the kernels of `sensitivities`."""
    still = np.zeros((2, 3))
    recording = Recording(np.array([0.0, 1.0]), still[1:], still, np.full((2, 3), np.nan))
    sensitivities(recording, problem, np.eye(4)[[0, 0]], np.zeros(len(problem.prior)), ())


def both(
    recording: Recording,
    problem: FilterProblem,
    attitudes: Array,
    coefficients: Array,
    names: Sequence[str],
    restarts: Sequence[int],
) -> tuple[Array, Array]:
    """Changes (n - 1, 6, m) of the normalised innovations per error of each of ``names`` (m,), SI, 0 where nothing was
    measured, and `sensitivities` (p, m), in one run."""
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
    full = states.stated.copy()
    full[states.index] = coefficients
    whole = replace(states, names=(*states.names, *names))
    wide = FilterProblem(problem.world, problem.noise, np.ones(p + m), problem.filter, whole)
    P, S = np.diag(np.append(np.full(3, problem.noise.encoder**2), problem.prior**2)), np.zeros((3 + p, m))
    seen = np.column_stack([np.isfinite(recording.acc), np.all(np.isfinite(recording.th), axis=1)])
    q, th, dt, rate = attitudes, recording.th, recording.dt, recording.rate
    warm = np.zeros(len(q)) if recording.warm is None else recording.warm
    first = 0
    model = problem.model._replace(layout=whole.layout)
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
    n, m, place = len(P), S.shape[1], layout.place
    top, spare, gain, row, own = np.empty((3, n)), np.empty((3, n)), np.empty(n), empty_row(WIDEST), room()
    shift, used, near = np.empty((3, m)), np.empty((3, m)), np.zeros(3, dtype=np.int64)
    base, mean = base_of(c, layout.based, world), c.copy()
    variance = noise.accelerometer * noise.accelerometer
    for k in range(1, len(q)):
        F, read = arrived(path, k, c, base, layout, own)
        at = (q[k, 0], q[k, 1], q[k, 2], q[k, 3])
        times(F, S, layout, own, shift, used)
        add_unknown(F, n, layout, own, shift)
        for i in range(3):
            for j in range(m):
                S[i, j] = shift[i, j]
        walk = noise.angle_random_walk * noise.angle_random_walk * F.dt
        propagate_covariance(P, F, layout, own, walk, top, spare)
        if layout.walking:
            wander(P, mean, place, noise.gyro_walk, noise.accelerometer_walk, F.dt)
            _forget(S, place, F.dt)
        if measured[k, 3]:
            watch(specific_force(attitude(th[k], world.axes, world.signs), base.up), gate, near)
        if updating(gate, near):
            if measured[k, 3]:
                sigma = noise.encoder
                floor = apart(noise, F.dt, sigma)
                roots, variances = encoder_roots(th[k], world.axes, world.signs, sigma, noise.joints, floor)
                if len(layout.columns) > 0:
                    encoders(th[k], read, base, c, layout, world, own)
                for i in range(3 if len(slopes) > 0 else 0):
                    size = encoder_row(i, layout.columns, own.axes, row)
                    _shown(P, S, row, size, variances[i], slopes[k, 3 + i])
                for i in range(3):
                    size = decorrelated_row(i, roots[i], layout.columns, own.axes, row)
                    _update(P, S, row, size, 1.0, gain, shift[0])
            accelerometers(at, read, warm[k], base, c, layout, own)
            for i in range(3 if len(slopes) > 0 else 0):
                if measured[k, i] and admitted(i, gate, near):
                    of_row = SlopeRow(layout.rows[i], own.entries[i])
                    _shown(P, S, of_row, layout.sizes[i], variance, slopes[k, i])
            for i in range(3):
                if measured[k, i] and admitted(i, gate, near):
                    of_row = SlopeRow(layout.rows[i], own.entries[i])
                    _update(P, S, of_row, layout.sizes[i], variance, gain, shift[0])


@kernel
def _forget(S: Array, place: Places, dt: float) -> None:
    """Let what errors of walking biases depend on fade within ``dt`` [s], as these do, in sensitivities ``S``."""
    keep = math.exp(-dt / WALK_TIME)
    for i in range(WALK, WALK + 6):
        if 0 <= place[i] < len(S):
            for k in range(S.shape[1]):
                S[place[i], k] *= keep


@kernel
def _shown(P: Array, S: Array, row: SlopeRow, size: int, r: float, slope: Array) -> None:
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
def _seen(S: Array, row: SlopeRow, size: int, n: int, out: Array) -> None:
    """Put into ``out`` (m,) what a ``row`` sees of each error: ``S`` (n, m) of the error state, and of itself."""
    out.fill(0.0)
    for a in range(size):
        at, value = row.places[a], row.values[a]
        if at < n:
            for k in range(len(out)):
                out[k] += value * S[at, k]
        else:
            out[at - n] += value


@kernel
def _update(P: Array, S: Array, row: SlopeRow, size: int, r: float, gain: Array, shift: Array) -> None:
    """Covariance and sensitivities after a scalar measurement of variance ``r``; ``gain`` (n,) and ``shift`` (m,) are
    used up."""
    places, values = row.places, row.values
    n, m = S.shape
    variance = r
    gain.fill(0.0)
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
