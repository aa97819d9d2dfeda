"""The offline smoother: angles from all of a recording, in bounded memory; compiled.

Modified Bryson-Frazier form (Bierman, Factorization Methods for Discrete Sequential Estimation, 1977, chapter 10): the
filter's rows are gone through backward, each scalar with the row, gain and variance by which it was put in,

    lam := (I - K h)^T lam - h^T v / S        Lam := (I - K h)^T Lam (I - K h) + h^T h / S
    x_s = x_pred - P_pred lam                 P_s = P_pred - P_pred Lam P_pred
    lam := F^T lam                            Lam := F^T Lam F

No covariance is inverted. The filter is run once to keep its state at the head of each block of rows, and again over
each block, last block first, to have its rows; so memory goes with the block and not with the recording.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from inercal._jit import kernel
from inercal.aoa.fusion import Start, moving_states
from inercal.aoa.model import COUNT, GATE, MOVING, ROLL, STATES, WIDEST, transition
from inercal.aoa.problem import Problem
from inercal.aoa.recursion import go_on, row_of, step_of, turned, update, write

Array: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.int64]

BLOCK = 256
"""Rows from one kept state to the next."""

SMOOTHED = 5
"""Columns of a row of output: as of `inercal.aoa.recursion.write`."""


def smooth(
    problem: Problem,
    t: Array,
    rows: Array,
    starts: tuple[Start, ...],
    kept: Array | None = None,
    every: int = 1,
) -> Array:
    """Angles from all rows: (m, 5) theta, u [rad], rate, u [rad/s], acceleration [rad/s^2]; NaN before the first start.

    Parameters
    ----------
    problem : Problem
    t, rows
        As `inercal.aoa.fusion.advance` took them.
    starts : tuple of Start
        Where the filter started: between two of them motion is not connected, while what is known of sensors is.
    kept : (k, 2 n) or None
        Receives states and standard deviations at each ``every``-th row.
    """
    n = problem.size
    out = np.full((len(t), SMOOTHED), np.nan)
    if kept is None:
        kept = np.empty((0, 2 * n))
    lam, Lam = np.zeros(n), np.zeros((n, n))
    end = len(t)
    for begin in reversed(starts):
        part = slice(begin.row, end)
        dt = np.diff(t[part], prepend=t[begin.row])
        _smooth(
            begin.x, begin.P, begin.turns, dt, rows[part], problem.geometry, problem.places, problem.constants,
            lam, Lam, out[part], kept, every, begin.row, BLOCK,
        )  # fmt: skip
        # nothing of the motion is known across a start, nor of the sting's
        moving = moving_states(problem)
        lam[moving] = 0.0
        Lam[moving, :] = 0.0
        Lam[:, moving] = 0.0
        end = begin.row
    return out


@kernel
def _smooth(
    x: Array, P: Array, turns: Array, dt: Array, z: Array, geometry: Array, places: Indices, constants: Array,
    lam: Array, Lam: Array, out: Array, kept: Array, every: int, first: int, block: int,
) -> None:  # fmt: skip
    """Smooth a stretch that begins with ``x``, ``P``; ``lam`` and ``Lam`` go from its end to its beginning."""
    n, m, count, d = places[STATES], len(dt), places[COUNT], places[MOVING]
    scalars = count + 2
    blocks = (m + block - 1) // block
    heads, spreads, rates = np.empty((blocks, n)), np.empty((blocks, n, n)), np.empty((blocks, 2))
    rows, work, line = np.empty(d, np.int64), np.empty((d, n)), np.empty(n)
    F, Q = np.empty((block, d, d)), np.empty((d, d))
    x_pred, P_pred = np.empty((block, n)), np.empty((block, n, n))
    at, row = np.empty((block, scalars, WIDEST), np.int64), np.empty((block, scalars, WIDEST))
    entries = np.empty((block, scalars), np.int64)
    Ph, told = np.empty((block, scalars, n)), np.empty((block, scalars, 2))
    along, small = np.empty(n), np.empty((4, 3))
    now, spread, rate = x.copy(), P.copy(), turns.copy()
    for b in range(blocks):
        heads[b], spreads[b], rates[b] = now, spread, rate
        if b < blocks - 1:
            _forward(
                now, spread, rate, b * block, block, dt, z, geometry, places, constants, False,
                rows, F, Q, work, line, x_pred, P_pred, at, row, entries, Ph, told,
            )  # fmt: skip
    for b in range(blocks - 1, -1, -1):
        begin = b * block
        size = min(block, m - begin)
        now[:], spread[:, :], rate[:] = heads[b], spreads[b], rates[b]
        _forward(
            now, spread, rate, begin, size, dt, z, geometry, places, constants, True,
            rows, F, Q, work, line, x_pred, P_pred, at, row, entries, Ph, told,
        )  # fmt: skip
        for k in range(size - 1, -1, -1):
            for i in range(scalars - 1, -1, -1):
                if entries[k, i] > 0:
                    _back(lam, Lam, entries[k, i], at[k, i], row[k, i], Ph[k, i], told[k, i], along)
            whole = len(kept) > 0 and (first + begin + k) % every == 0
            _read(x_pred[k], P_pred[k], lam, Lam, constants, out[begin + k], line, small)
            if whole:
                _keep(x_pred[k], P_pred[k], lam, Lam, kept[(first + begin + k) // every], line)
            _transposed(lam, Lam, rows, F[k], d, work)


@kernel
def _forward(
    x: Array, P: Array, turns: Array, begin: int, size: int, dt: Array, z: Array, geometry: Array, places: Indices,
    constants: Array, keep: bool, rows: Indices, F: Array, Q: Array, work: Array, line: Array,
    x_pred: Array, P_pred: Array, at: Indices, row: Array, entries: Indices, Ph: Array, told: Array,
) -> None:  # fmt: skip
    """The filter over ``size`` rows from ``begin`` on, to the digits of `inercal.aoa.recursion.advance`; its rows are
    kept if asked for."""
    count = places[COUNT]
    last, base, spatial = -1.0, 0.0, places[ROLL] >= 0
    for k in range(size):
        a = k if keep else 0
        step = step_of(dt[begin + k])
        p, y = 0.0, 0.0
        if spatial:
            p, y = turned(turns, z, begin + k, count)
        if step != last:
            transition(step, places, constants, rows, F[a], Q)
            last, base = step, Q[0, 0]
        elif keep:
            F[a] = F[a - 1]
        if step > 0.0:
            go_on(x, P, step, p, y, places, constants, rows, F[a], Q, base, work)
        if keep:
            x_pred[k], P_pred[k] = x, P
        if spatial:
            p, y = turns[0], turns[1]
        for i in range(count + 2):
            entries[a, i] = 0
            if math.isnan(z[begin + k, i]):
                continue
            expected, number, noise = row_of(
                i, x, z[begin + k], geometry, places, constants, p, y, at[a, i], row[a, i]
            )
            v = z[begin + k, i] - expected
            _, variance = update(P, x, v, number, at[a, i], row[a, i], noise, constants[GATE], Ph[a, i])
            if variance > 0.0:
                entries[a, i] = number
                told[a, i, 0], told[a, i, 1] = v, variance


@kernel
def _back(
    lam: Array, Lam: Array, count: int, at: Indices, row: Array, Ph: Array, told: Array, along: Array
) -> None:
    """Go back over one scalar, in place; its gain is ``Ph`` / S."""
    n = len(lam)
    v, inverse = told[0], 1.0 / told[1]
    total = 0.0
    for i in range(n):
        total += Ph[i] * lam[i]
        along[i] = 0.0
    for j in range(n):
        gain = Ph[j] * inverse
        for i in range(n):
            along[i] += Lam[j, i] * gain
    both = inverse
    for i in range(n):
        both += along[i] * Ph[i] * inverse
    for a in range(count):
        k = at[a]
        lam[k] -= row[a] * inverse * (total + v)
    for a in range(count):
        k, h = at[a], row[a]
        for i in range(n):
            Lam[k, i] -= h * along[i]
            Lam[i, k] -= h * along[i]
        for b in range(count):
            Lam[k, at[b]] += h * row[b] * both


@kernel
def _read(
    x: Array, P: Array, lam: Array, Lam: Array, constants: Array, out: Array, line: Array, small: Array
) -> None:
    """Smoothed angle, rate and acceleration and their uncertainties, from the prediction of a row.

    ``small`` (4, 3) is used up.
    """
    n = len(x)
    for i in range(3):
        total = 0.0
        for j in range(n):
            total += P[i, j] * lam[j]
            line[j] = 0.0
        small[3, i] = x[i] - total
        for k in range(n):
            f = P[i, k]
            for j in range(n):
                line[j] += f * Lam[k, j]
        for j in range(i + 1):
            total = P[i, j]
            for k in range(n):
                total -= line[k] * P[j, k]
            small[i, j], small[j, i] = total, total
    write(small[3], small, constants, out)


@kernel
def _keep(x: Array, P: Array, lam: Array, Lam: Array, kept: Array, line: Array) -> None:
    """All smoothed states of a row, and their standard deviations."""
    n = len(x)
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += P[i, j] * lam[j]
            line[j] = 0.0
        kept[i] = x[i] - total
        for k in range(n):
            for j in range(n):
                line[j] += P[i, k] * Lam[k, j]
        variance = P[i, i]
        for k in range(n):
            variance -= line[k] * P[i, k]
        kept[n + i] = math.sqrt(max(variance, 0.0))


@kernel
def _transposed(lam: Array, Lam: Array, rows: Indices, F: Array, d: int, work: Array) -> None:
    """F^T lam and F^T Lam F, in place."""
    n = len(lam)
    for j in range(d):
        total = 0.0
        for i in range(d):
            total += F[i, j] * lam[rows[i]]
        work[0, j] = total
    for j in range(d):
        lam[rows[j]] = work[0, j]
    for j in range(d):
        for k in range(n):
            work[j, k] = 0.0
        for i in range(d):
            f = F[i, j]
            if f != 0.0:
                a = rows[i]
                for k in range(n):
                    work[j, k] += f * Lam[a, k]
    for j in range(d):
        a = rows[j]
        for k in range(n):
            Lam[a, k] = work[j, k]
            Lam[k, a] = work[j, k]
    for i in range(d):
        for j in range(d):
            total = 0.0
            for k in range(d):
                total += work[i, rows[k]] * F[k, j]
            Lam[rows[i], rows[j]] = total
    for i in range(d):
        for j in range(i):
            Lam[rows[i], rows[j]] = Lam[rows[j], rows[i]]
