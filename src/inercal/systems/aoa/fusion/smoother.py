"""The offline smoother: angles from all of a recording, in bounded memory.

Modified Bryson-Frazier form (Bierman, Factorization Methods for Discrete Sequential Estimation, 1977, chapter 10): the
filter's rows are gone through backward, each scalar with the row, gain and variance by which it was put in,

    lam := (I - K h)^T lam - h^T v / S        Lam := (I - K h)^T Lam (I - K h) + h^T h / S
    lam := F^T lam                            Lam := F^T Lam F

and between the row's last scalar and the next row x_s = x - P lam, P_s = P - P Lam P, of the filter's x and P after
the row: those before it are so wide where the filter starts that digits would be lost. No covariance is inverted. The
filter keeps its state at the head of each block of rows, and is run again over each block, last block first, for its
rows; so memory grows with the block and hardly with the recording. Constants fade between blocks
(`inercal.systems.aoa.fusion.run`), lam := F^T lam there too.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from inercal.foundation._jit import allocating, kernel
from inercal.systems.aoa.fusion import loop
from inercal.systems.aoa.fusion.loop import (
    NOT_KEPT,
    OUTPUTS,
    Belief,
    FusedRows,
    Kept,
    Memory,
    congruent,
    root,
    write,
)
from inercal.systems.aoa.fusion.model import Model
from inercal.systems.aoa.fusion.problem import FusionProblem
from inercal.systems.aoa.fusion.run import FusionTrace, Head, unknown

Array: TypeAlias = NDArray[np.float64]

BLOCK = 256
"""Rows from one kept state to the next."""


def smooth(
    problem: FusionProblem,
    t: Array,
    rows: Array,
    trace: FusionTrace,
    kept: Array | None = None,
    every: int = 1,
) -> Array:
    """Angles from all rows: (m, 5) theta, u [rad], rate, u [rad/s], acceleration [rad/s^2].

    ``t`` and ``rows`` as `inercal.systems.aoa.fusion.run.advance` took them, with blocks of `BLOCK`, and its ``trace``;
    across its starts the motion is not continuous, but the errors of the sensors are. NaN before the first start, and
    where theta was lost, until the next. ``kept`` (k, 2 n) receives states and standard deviations at each ``every``-th
    row.
    """
    n, model = problem.size, problem.model
    out, dt = np.full((len(t), OUTPUTS), np.nan), np.diff(t, prepend=t[:1])
    states = NOT_KEPT.states if kept is None else kept
    rows = np.ascontiguousarray(rows)
    lam, Lam, new = np.zeros(n), np.zeros((n, n)), unknown(problem)
    starts = {each.row: each for each in trace.starts}
    dt[list(starts)] = 0.0
    longest = max((head.rows.stop - head.rows.start for head in trace.heads), default=0)
    memory = loop.memory(longest, n, len(model.places.moving), problem.count)
    causal = np.empty((longest, OUTPUTS + problem.count + 1))
    for block, before, F in reversed(trace.heads):
        belief = Belief(*(each.copy() for each in before))
        done = loop.advance(belief, FusedRows(dt[block], rows[block]), model, causal, memory=memory)
        _backward(lam, Lam, memory, done, model, out[block], Kept(states, every, block.start))
        if F is not None:
            with np.errstate(over="ignore", invalid="ignore"):  # what has lost its numbers stays without
                lam[:], Lam[:] = F.T @ lam, F.T @ Lam @ F
        if (begin := starts.get(block.start)) is not None:
            forgotten = slice(None) if begin.anew else new
            lam[forgotten] = 0.0
            Lam[forgotten, :] = 0.0
            Lam[:, forgotten] = 0.0
    return out


def load_kernels(problem: FusionProblem) -> None:
    """Load, or compile, the kernels."""
    x, P = problem.mean.copy(), problem.covariance.copy()
    head = Head(slice(0, 1), Belief(x, P, np.zeros(problem.count + 3)), None)
    none = np.full((1, problem.count + loop.BESIDE), np.nan)
    smooth(problem, np.zeros(1), none, FusionTrace(np.empty((1, 0)), (), (head,)))


@allocating
def _backward(
    lam: Array, Lam: Array, memory: Memory, size: int, model: Model, out: Array, kept: Kept
) -> None:
    """Go back over ``size`` rows that the filter remembers: ``lam`` and ``Lam`` from their end to their beginning."""
    steps, after, scalars = memory
    states, every, first = kept
    moving = model.places.moving
    n, d = model.places.states, len(moving)
    work, line, none = np.empty((d, n)), np.empty(n), np.zeros((d, d))
    mean, spread = np.empty(n), np.empty((n, n))
    for k in range(size - 1, -1, -1):
        whole = len(states) > 0 and (first + k) % every == 0
        for i in range(n if whole else 3):
            mean[i] = _smoothed(after, k, i, lam, Lam, line)
            for j in range(i + 1):
                spread[i, j] = after[k, i + 1, j]
                for m in range(n):
                    spread[i, j] -= line[m] * after[k, j + 1, m]
                spread[j, i] = spread[i, j]
            if whole:
                states[(first + k) // every, i] = mean[i]
                states[(first + k) // every, n + i] = root(spread[i, i])
        write(mean, spread, model.constants, out, k)
        for i in range(model.places.accelerometers + 1, -1, -1):
            if scalars[k, i, 2 * n + 1] > 0.0:
                _back(lam, Lam, scalars, k, i, line)
        for i in range(d):
            line[i] = 0.0
            for j in range(d):
                line[i] += steps[k, i, j] * lam[moving[j]]
        for i in range(d):
            lam[moving[i]] = line[i]
        congruent(Lam, moving, steps[k], none, work)


@kernel
def _back(lam: Array, Lam: Array, scalars: Array, k: int, i: int, along: Array) -> None:
    """Go back over scalar ``i`` of row ``k``, in place."""
    n = len(lam)
    v, inverse = scalars[k, i, 2 * n], 1.0 / scalars[k, i, 2 * n + 1]
    total = 0.0
    for j in range(n):
        total += scalars[k, i, n + j] * lam[j]
        along[j] = 0.0
    for j in range(n):
        gain = scalars[k, i, n + j] * inverse
        for m in range(n):
            along[m] += Lam[j, m] * gain
    both = inverse
    for j in range(n):
        both += along[j] * scalars[k, i, n + j] * inverse
    # Lam K h and its transpose are taken away, h^T (K^T Lam K + 1 / S) h is put in: half of it in each
    for j in range(n):
        along[j] -= 0.5 * both * scalars[k, i, j]
    for j in range(n):
        h = scalars[k, i, j]
        if h != 0.0:
            lam[j] -= h * inverse * (total + v)
            for m in range(n):
                Lam[j, m] -= h * along[m]
                Lam[m, j] -= h * along[m]


@kernel
def _smoothed(after: Array, k: int, i: int, lam: Array, Lam: Array, line: Array) -> float:
    """State ``i`` of row ``k``; ``line`` (n,) receives its row of P Lam."""
    n = len(lam)
    total: float = after[k, 0, i]
    for j in range(n):
        total -= after[k, i + 1, j] * lam[j]
        line[j] = 0.0
    for m in range(n):
        p = after[k, i + 1, m]
        for j in range(n):
            line[j] += p * Lam[m, j]
    return total
