"""The loop of the causal filter, compiled and free of allocation.

A row is predicted, then updated by one scalar after the other: accelerometers in their order, the gyro, and an angle
that is stated, each relinearised at the state that it finds. An innovation v that is larger than five
standard deviations enlarges its own variance, S = v^2 / 25: what is merely surprising still pulls, by five standard
deviations, while a gate that shuts would lock the filter out for good once it is off.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from inercal._jit import kernel
from inercal.aoa.model import (
    COMMON_DELAY,
    COMMON_DELAY_U,
    COUNT,
    GATE,
    MOVING,
    RESONATORS,
    ROLL,
    STATES,
    WIDEST,
    accelerometer,
    gyro,
    transition,
    turning,
)

Array: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.int64]

LOST = 0.09
"""Variance of theta [rad^2] at which linearisation ends: theta is found anew from the accelerometers."""

OUTPUTS = 5
"""Columns of a row of output before the innovations: theta, its u, rate, its u, acceleration."""

BESIDE = 5
"""Columns of a row of measurements after the accelerometers: gyro, an angle that is stated and its u, roll and yaw."""

_EVEN = 1e-9


@kernel
def step_of(dt: float) -> float:
    """An interval [s] to the nanosecond, so that stamps that are even but for their rounding are."""
    return round(dt / _EVEN) * _EVEN


@kernel
def predict(P: Array, rows: Indices, F: Array, Q: Array, d: int, work: Array) -> None:
    """Covariance of one step on, in place; symmetric to the last digit. ``work`` (d, n) is used up."""
    n = len(P)
    for i in range(d):
        for k in range(n):
            work[i, k] = 0.0
        for j in range(d):
            f = F[i, j]
            if f != 0.0:
                a = rows[j]
                for k in range(n):
                    work[i, k] += f * P[a, k]
    for i in range(d):
        a = rows[i]
        for k in range(n):
            P[a, k] = work[i, k]
            P[k, a] = work[i, k]
    # the columns of the moving states among themselves
    for i in range(d):
        for j in range(d):
            total = Q[i, j]
            for k in range(d):
                total += work[i, rows[k]] * F[j, k]
            P[rows[i], rows[j]] = total
    for i in range(d):
        for j in range(i):
            P[rows[i], rows[j]] = P[rows[j], rows[i]]


@kernel
def go_on(
    x: Array, P: Array, dt: float, p: float, y: float, places: Indices, constants: Array,
    rows: Indices, F: Array, Q: Array, base: float, work: Array,
) -> None:  # fmt: skip
    """The state and its covariance after ``dt``."""
    d = places[MOVING]
    if places[ROLL] >= 0:
        theta, phi = turning(x, dt, p, y, places, constants, F, Q, base)
        x[places[ROLL]] = phi
    else:
        theta = x[0] + x[1] * dt + 0.5 * x[2] * dt * dt + x[3] * dt * dt * dt / 6.0
    predict(P, rows, F, Q, d, work)
    x[0] = theta
    x[1] += x[2] * dt + 0.5 * x[3] * dt * dt
    x[2] += x[3] * dt
    for b in range(4, 8 if places[RESONATORS] >= 0 else 4, 2):
        s, v = x[rows[b]], x[rows[b + 1]]
        x[rows[b]] = F[b, b] * s + F[b, b + 1] * v
        x[rows[b + 1]] = F[b + 1, b] * s + F[b + 1, b + 1] * v


@kernel
def update(
    P: Array, x: Array, v: float, count: int, at: Indices, row: Array, noise: float, gate: float, work: Array
) -> tuple[float, float]:
    """Update by one scalar, in place: innovation ``v``, of variance h P h^T + ``noise`` = S.

    ``at[:count]`` and ``row[:count]`` hold h. ``work`` (n,) receives P h^T. Returns v over the root of S, and the S
    that was used, enlarged to v^2 / ``gate`` where v^2 is larger than ``gate`` S; 0 where S is not above zero.
    """
    n = len(x)
    for i in range(n):
        work[i] = 0.0
    for a in range(count):
        h, k = row[a], at[a]
        for i in range(n):
            work[i] += h * P[k, i]
    variance = noise
    for a in range(count):
        variance += row[a] * work[at[a]]
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
        of_row = work[i] * inverse
        for j in range(n):
            P[i, j] -= of_row * work[j]
    return surprise, variance


@kernel
def row_of(
    i: int, x: Array, z: Array, geometry: Array, places: Indices, constants: Array, p: float, y: float,
    at: Indices, row: Array,
) -> tuple[float, int, float]:  # fmt: skip
    """Scalar ``i`` of a row of measurements: what it should read, entries of its row, its variance."""
    n = places[COUNT]
    if i < n:
        return accelerometer(x, i, geometry, places, constants, p, y, at, row)
    if i == n:
        return gyro(x, places, constants, at, row)
    at[0], row[0] = 0, 1.0
    return x[0], 1, z[n + 2] * z[n + 2]


@kernel
def write(x: Array, P: Array, constants: Array, out: Array) -> None:
    """Theta, u, rate, u, acceleration at the stamp: by a common delay later than what the sensors read."""
    tau, u = constants[COMMON_DELAY], constants[COMMON_DELAY_U]
    out[0] = x[0] + tau * x[1] + 0.5 * tau * tau * x[2]
    out[2] = x[1] + tau * x[2]
    out[4] = x[2]
    theta = P[0, 0] + 2.0 * tau * P[0, 1] + tau * tau * P[1, 1] + x[1] * x[1] * u * u
    rate = P[1, 1] + 2.0 * tau * P[1, 2] + tau * tau * P[2, 2] + x[2] * x[2] * u * u
    out[1], out[3] = math.sqrt(max(theta, 0.0)), math.sqrt(max(rate, 0.0))


@kernel
def advance(
    x: Array, P: Array, turns: Array, dt: Array, z: Array, geometry: Array, places: Indices, constants: Array,
    out: Array, kept: Array, every: int, first: int,
) -> int:  # fmt: skip
    """Go on by the rows of ``dt`` (m,) [s] and ``z`` (m, N + 5); the number of rows done.

    ``x`` (n,), ``P`` (n, n) and ``turns`` (2,), the last indications of the roll and yaw gyros, are changed in place. A
    row of ``z`` holds the accelerometers [m/s^2], the gyro [rad/s], an angle stated and its standard uncertainty [rad],
    roll and yaw gyros [rad/s]; NaN where not measured. ``out`` (m, `OUTPUTS` + N + 1) receives what `write` says and
    the innovations over their standard deviations. ``kept`` (k, 2 n) receives x and its standard deviations at each
    ``every``-th row, counted from ``first``; none for 0 rows.

    Ends before a row in which theta is lost, its variance over `LOST` or no number.
    """
    n, m, count = places[STATES], len(dt), places[COUNT]
    rows, work, line = np.empty(places[MOVING], np.int64), np.empty((places[MOVING], n)), np.empty(n)
    F, Q = np.empty((places[MOVING], places[MOVING])), np.empty((places[MOVING], places[MOVING]))
    at, row = np.empty(WIDEST, np.int64), np.empty(WIDEST)
    last, base, spatial = -1.0, 0.0, places[ROLL] >= 0
    for k in range(m):
        step = step_of(dt[k])
        p, y = 0.0, 0.0
        if spatial:
            p, y = turned(turns, z, k, count)
        if step != last:
            transition(step, places, constants, rows, F, Q)
            last, base = step, Q[0, 0]
        if step > 0.0:
            go_on(x, P, step, p, y, places, constants, rows, F, Q, base, work)
        if not P[0, 0] < LOST:
            return k
        if spatial:
            p, y = turns[0], turns[1]
        for i in range(count + 2):
            if i <= count:
                out[k, OUTPUTS + i] = math.nan
            if math.isnan(z[k, i]):
                continue
            expected, entries, noise = row_of(i, x, z[k], geometry, places, constants, p, y, at, row)
            surprise, _ = update(P, x, z[k, i] - expected, entries, at, row, noise, constants[GATE], line)
            if i <= count:
                out[k, OUTPUTS + i] = surprise
        write(x, P, constants, out[k])
        if len(kept) > 0 and (first + k) % every == 0:
            for i in range(n):
                kept[(first + k) // every, i] = x[i]
                kept[(first + k) // every, n + i] = math.sqrt(max(P[i, i], 0.0))
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
