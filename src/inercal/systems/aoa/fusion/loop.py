"""The loop of the causal filter, compiled and free of allocation.

A row is predicted, then updated by one scalar after the other: accelerometers in their order, the gyro, and a stated
angle, all linearised at the prediction. (A scalar that is linearised anew at the state after the scalars before it
multiplies their noise by its own, and the filter is too sure: with axes at odd angles by a factor of six.) An
innovation v larger than five standard deviations enlarges its own variance, S = v^2 / 25: the larger it is the less it
pulls, while a gate that shuts would lock the filter out for good once it is wrong. Where some of the sensors agree with
a wrong angle, as after a shock, this pull can still be too small. So where one sensor has surprised by twice as much in
each of a long series of rows, theta is found anew.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from inercal.foundation._jit import allocating, kernel
from inercal.foundation.inference.kalman import SlopeRow, empty_row
from inercal.systems.aoa.fusion.model import (
    WIDEST,
    Constants,
    FusionStep,
    Model,
    Places,
    Prediction,
    accelerometer,
    gyro,
    transition,
    turning,
    wander,
)
from inercal.systems.aoa.limits import LIMITS

Array: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.int64]

LOST, PATIENCE = LIMITS.lost_variance, LIMITS.contradicting_rows  # frozen into the kernels

_TURNS = 1e3
"""Angle [rad] that no model reaches."""

OUTPUTS = 5
"""Columns of a row of output before the innovations: theta, its u, rate, its u, acceleration."""

MOTION = 25
"""Columns of a motion that is carried on from a row (`inercal.systems.aoa.fusion.ahead`)."""

BESIDE = 5
"""Columns of a row of measurements after the accelerometers: gyro, a stated angle and its u, roll and yaw."""

_READING = 1e100
"""Size of a reading from which on it counts as missing, like NaN."""

_EVEN = 1e-9


class Belief(NamedTuple):
    """State of the filter between two rows, changed in place: ``x`` (n,) and its covariance ``P`` (n, n); ``turns``
    (N + 3,) the last indications of the roll and yaw gyros, and the successive rows in which each accelerometer and the
    gyro surprised."""

    x: Array
    P: Array
    turns: Array


class FusedRows(NamedTuple):
    """Rows of measurements: ``dt`` (m,) [s] since the row before; ``z`` (m, N + 5) the accelerometers [m/s^2], the gyro
    [rad/s], a stated angle and its standard uncertainty [rad], roll and yaw gyros [rad/s]; NaN where not measured."""

    dt: Array
    z: Array


class Kept(NamedTuple):
    """States kept for pictures: ``states`` (k, 2 n) receives x and its standard deviations at each ``every``-th row,
    counted from ``first``; none with 0 rows."""

    states: Array
    every: int
    first: int


NOT_KEPT = Kept(np.empty((0, 0)), 1, 0)

NO_MOTIONS = np.empty((0, MOTION))


class Memory(NamedTuple):
    """Memory of the rows of a block (b,) for a smoother; empty for b = 0.

    ``steps`` (b, d, d) the transposed transition of the states that move to each row; ``after`` (b, n + 1, n) the state
    after the row, and its covariance; ``scalars`` (b, N + 2, 2 n + 2) of each scalar its row h, P h^T, the innovation v
    and the variance S used, 0 where it was left out.
    """

    steps: Array
    after: Array
    scalars: Array


def memory(block: int, states: int, moving: int, count: int) -> Memory:
    """A memory of ``block`` rows for so many states, ``moving`` ones, and ``count`` accelerometers."""
    return Memory(
        np.empty((block, moving, moving)),
        np.empty((block, states + 1, states)),
        np.empty((block, count + 2, 2 * states + 2)),
    )


NONE = memory(0, 0, 0, 0)


@kernel
def step_of(dt: float) -> float:
    """An interval [s] to the nanosecond, so that stamps that are even but for rounding are even."""
    return round(dt / _EVEN) * _EVEN


@kernel
def congruent(P: Array, moving: Indices, F: Array, Q: Array, work: Array) -> None:
    """F P F^T + Q in the place of P (n, n), symmetric to the last digit; ``work`` (d, n) is used up.

    ``F`` and ``Q`` (d, d) are of the states at ``moving`` (d,) alone; the others do not change.
    """
    n, d = len(P), len(F)
    for i in range(d):
        f, a = F[i, i], moving[i]
        for k in range(n):
            work[i, k] = f * P[a, k]
        for j in range(d):
            f, a = F[i, j], moving[j]
            if f != 0.0 and j != i:
                for k in range(n):
                    work[i, k] += f * P[a, k]
    for i in range(d):
        a = moving[i]
        for k in range(n):
            P[a, k] = work[i, k]
            P[k, a] = work[i, k]
    # the columns of the moving states among themselves
    for i in range(d):
        for j in range(i + 1):
            total = Q[i, j]
            for k in range(d):
                total += work[i, moving[k]] * F[j, k]
            a, b = moving[i], moving[j]
            P[a, b], P[b, a] = total, total


@kernel
def go_on(belief: Belief, step: FusionStep, model: Model, F: Array, Q: Array, work: Array) -> None:
    """The state and its covariance after a step."""
    x, P, moving, roll = belief.x, belief.P, model.places.moving, model.places.roll
    d, theta, phi = len(F), 0.0, 0.0
    if roll >= 0:
        theta, phi = turning(x, step, model, F, Q)
    congruent(P, moving, F, Q, work)
    wander(P, step.dt, model)
    for i in range(d):
        work[0, i] = 0.0
        for j in range(d):
            work[0, i] += F[i, j] * x[moving[j]]
    for i in range(d):
        x[moving[i]] = work[0, i]
    if roll >= 0:
        x[0], x[roll] = theta, phi


@kernel
def update(
    P: Array, x: Array, row: SlopeRow, size: int, v: float, noise: float, gate: float, work: Array
) -> tuple[float, float]:
    """Update by one scalar, in place: innovation ``v``, of variance h P h^T + ``noise`` = S, with h the ``row``.

    ``work`` (n,) receives P h^T. Returns v over the root of S, and the S
    that was used, enlarged to v^2 / ``gate`` where v^2 is larger than ``gate`` S; 0 where S is not above zero.
    """
    places, values = row.places, row.values
    n = len(x)
    for i in range(n):
        work[i] = 0.0
    for a in range(size):
        h, k = values[a], places[a]
        for i in range(n):
            work[i] += h * P[k, i]
    variance = noise
    for a in range(size):
        variance += values[a] * work[places[a]]
    if not variance > 0.0:
        return math.nan, 0.0
    surprise = v / math.sqrt(variance)
    if v * v > gate * variance:
        variance = v * v / gate
    gain = v / variance
    for i in range(n):
        x[i] += gain * work[i]
    inverse = 1.0 / variance
    for i in range(n):
        for j in range(n):
            # in this order it is symmetric to the last digit
            P[i, j] -= work[i] * work[j] * inverse
    return surprise, variance


@kernel
def reading(i: int, at: Prediction, angle_u: float, model: Model, out: SlopeRow) -> tuple[float, float, int]:
    """Reading of scalar ``i`` of a row of measurements at a prediction, its variance, and its entries in ``out``.

    ``angle_u`` [rad] is the standard uncertainty of a stated angle; ``out`` receives the derivatives by the state.
    """
    n = model.places.accelerometers
    if i < n:
        return accelerometer(i, at, model, out)
    if i == n:
        return gyro(at, model, out)
    out.places[0], out.values[0] = 0, 1.0
    return at.x[0], angle_u * angle_u, 1


@kernel
def root(variance: float) -> float:
    """Standard deviation; 0 where rounding has made a variance negative, NaN where there is none."""
    return 0.0 if variance <= 0.0 else math.sqrt(variance)


@kernel
def significant(value: float, variance: float) -> float:
    """Share of a rate or an acceleration above noise, 0 to 1: 1 - 9 P / x^2, and 0 below three deviations."""
    squared = value * value  # which may be zero where the value is not
    return max(0.0, 1.0 - 9.0 * variance / squared) if squared > 0.0 else 0.0


@kernel
def believed(row: SlopeRow, size: int, places: Places, of_rate: float, of_acceleration: float) -> None:
    """Remove from a row the derivatives by positions and by the gyro's scale and delay where the motion is only noise.

    They multiply rate and acceleration. At rest the filter would learn them from noise, and be sure of wrong values.
    """
    at, values = row.places, row.values
    count, moved = places.accelerometers, max(of_rate, of_acceleration)
    for a in range(size):
        for b in (places.levers, places.heights):
            if b >= 0 and b <= at[a] < b + count:
                values[a] *= moved
        if places.scale >= 0 and at[a] == places.scale:
            values[a] *= of_rate
        if places.delay >= 0 and at[a] == places.delay:
            values[a] *= of_acceleration


@kernel
def beyond_first_order(P: Array, delay: int) -> float:
    """Variance of the gyro's reading by the product of a delay and an acceleration that are both uncertain, and by that
    of its square and half the jerk: where motion is lively, a derivative alone would teach a delay from noise."""
    of_delay: float = P[delay, delay]
    beyond: float = of_delay * (P[2, 2] + 0.75 * of_delay * P[3, 3])
    return beyond


@kernel
def write(x: Array, P: Array, constants: Constants, out: Array, k: int) -> None:
    """Put theta, u, rate, u, acceleration at the stamp into row ``k``: later by a common delay than the sensors."""
    tau, u = constants.common_delay, constants.common_delay_u
    out[k, 0] = x[0] + tau * x[1] + 0.5 * tau * tau * x[2]
    out[k, 2] = x[1] + tau * x[2]
    out[k, 4] = x[2]
    theta = P[0, 0] + 2.0 * tau * P[0, 1] + tau * tau * P[1, 1] + out[k, 2] * out[k, 2] * u * u
    rate = P[1, 1] + 2.0 * tau * P[1, 2] + tau * tau * P[2, 2] + x[2] * x[2] * u * u
    out[k, 1] = root(theta)
    out[k, 3] = root(rate)


@kernel
def moving(x: Array, P: Array, p: float, y: float, model: Model, out: Array) -> None:
    """Put theta, rate, acceleration and jerk into ``out`` (`MOTION`,), their covariance, cosine of the roll and rate of
    theta by yaw, the roll, its u and its rate; ``p``, ``y`` are indications of the roll and yaw gyros."""
    roll = model.places.roll
    for i in range(4):
        out[i] = x[i]
        for j in range(4):
            out[4 + 4 * i + j] = P[i, j]
    out[20], out[21], out[22], out[23], out[24] = 1.0, 0.0, math.nan, math.nan, 0.0
    if roll >= 0:
        s, c, st, ct = math.sin(x[roll]), math.cos(x[roll]), math.sin(x[0]), math.cos(x[0])
        p, y = p - x[roll + 1], y - x[roll + 2]
        out[20], out[21], out[22], out[23] = c, s * y, x[roll], root(P[roll, roll])
        out[24] = p + (x[1] * s - y * c) * st * ct / (ct * ct + 1e-4)


def advance(
    belief: Belief,
    rows: FusedRows,
    model: Model,
    out: Array,
    kept: Kept = NOT_KEPT,
    memory: Memory = NONE,
    motions: Array = NO_MOTIONS,
) -> int:
    """Go on by m rows; the number of rows done.

    ``out`` (m, `OUTPUTS` + N + 1) receives what `write` says and the innovations over their standard deviations;
    ``memory`` is filled if it has room for m rows, and so are ``motions`` (m, `MOTION`), as of `moving`.

    Ends before a row in which theta is lost: its variance is too large, it is no angle any more, or a sensor has
    surprised too often.
    """
    done: int = _advance(belief, rows, model, out, kept, memory, motions)
    return done


@allocating
def _advance(
    belief: Belief, rows: FusedRows, model: Model, out: Array, kept: Kept, memory: Memory, motions: Array
) -> int:
    """The loop of `advance`."""
    x, P, turns = belief
    intervals, z = rows
    steps, after, scalars = memory
    states, every, first = kept
    places, constants = model.places, model.constants
    n, d, m, count = places.states, len(places.moving), len(intervals), places.accelerometers
    work, line = np.empty((d, n)), np.empty(n)
    F, Q = np.empty((d, d)), np.empty((d, d))
    row, ahead = empty_row(WIDEST), np.empty(n)
    of, entry = row.places, row.values
    last, snap, spatial, remember = -1.0, 0.0, places.roll >= 0, len(steps) > 0
    surprised = (turns[2 : count + 3] >= PATIENCE).any()
    for k in range(m):
        dt = step_of(intervals[k])
        p, y = 0.0, 0.0
        if spatial:
            p, y = turned(turns, z, k, count)
        if dt != last:
            transition(dt, model, F, Q)
            last, snap = dt, Q[0, 0]
        rate, acceleration, jerk = x[1], x[2], x[3] * significant(x[3], P[3, 3])
        of_rate = significant(rate, min(P[1, 1], constants.gyro_noise))  # P of a start is no noise
        of_acceleration = significant(acceleration, P[2, 2])
        if dt > 0.0:
            go_on(belief, FusionStep(dt, p, y, snap), model, F, Q, work)
        if surprised or not (P[0, 0] < LOST and abs(x[0]) < _TURNS):
            return k
        if spatial:
            p, y = turns[0], turns[1]
        for i in range(n):
            ahead[i] = x[i]
        at = Prediction(ahead, math.sin(x[0]), math.cos(x[0]), p, y, rate, acceleration, jerk)
        for i in range(count + 2):
            surprise, variance, v, entries = math.nan, 0.0, 0.0, 0
            if abs(z[k, i]) < _READING:
                expected, noise, entries = reading(i, at, z[k, count + 2], model, row)
                believed(row, entries, places, of_rate, of_acceleration)
                if i == count and places.delay >= 0 and of_acceleration > 0.0:
                    noise += beyond_first_order(P, places.delay)
                v = z[k, i] - expected
                for a in range(entries):
                    v -= entry[a] * (x[of[a]] - ahead[of[a]])
                surprise, variance = update(P, x, row, entries, v, noise, constants.gate, line)
                if i <= count:
                    turns[2 + i] = turns[2 + i] + 1.0 if surprise * surprise > 4.0 * constants.gate else 0.0
                    surprised = surprised or turns[2 + i] >= PATIENCE
            if i <= count:
                out[k, OUTPUTS + i] = surprise
            if remember:
                for j in range(n):
                    scalars[k, i, j], scalars[k, i, n + j] = 0.0, line[j]
                for j in range(entries):
                    scalars[k, i, of[j]] = entry[j]
                scalars[k, i, 2 * n], scalars[k, i, 2 * n + 1] = v, variance
        write(x, P, constants, out, k)
        if len(motions) > 0:
            moving(x, P, p, y, model, motions[k])
        if remember:
            for i in range(d):
                for j in range(d):
                    steps[k, i, j] = F[j, i]
            for i in range(n):
                after[k, 0, i] = x[i]
                for j in range(n):
                    after[k, i + 1, j] = P[i, j]
        if len(states) > 0 and (first + k) % every == 0:
            for i in range(n):
                states[(first + k) // every, i] = x[i]
                states[(first + k) // every, n + i] = root(P[i, i])
    return m


@kernel
def turned(turns: Array, z: Array, k: int, count: int) -> tuple[float, float]:
    """Rates of roll and yaw over the step to row ``k``: the mean of both ends; ``turns`` goes on to the row."""
    p, y = turns[0], turns[1]
    if not math.isnan(z[k, count + 3]):
        turns[0] = z[k, count + 3]
    if not math.isnan(z[k, count + 4]):
        turns[1] = z[k, count + 4]
    return 0.5 * (p + turns[0]), 0.5 * (y + turns[1])
