"""A long recording by means over blocks of rows: as many rows as a diagnosis needs, which say the same.

Between two rows a filter knows the motion, but for a walk of the gyros that is small within a block, so that all
readings of a block are readings at its middle row r. With q_k the attitude found at r, taken to row k by the rates, and
h the model with the coefficients found,

    a = h(q_r) + mean_k (a_k - h(q_k)),   th the angles at which encoders show q_r exp(mean_k log(q_k^-1 q(th_k)))

have the noise of a row over the root of the number of rows in a block. What is not yet known of the coefficients is
multiplied by the mean of sines over a block in the place of that at its middle, 1 - phi^2/24 for a turn by phi.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inercal.foundation._jit import allocating, merged
from inercal.foundation.arrays import Array
from inercal.foundation.geometry.kernels import Quaternion, exp, log, multiply
from inercal.systems.selfcal.filters.filter_result import FilterResult
from inercal.systems.selfcal.filters.gaps import doubtful
from inercal.systems.selfcal.filters.problem import FilterProblem
from inercal.systems.selfcal.filters.residuals import gimbals
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.layout import StateLayout
from inercal.systems.selfcal.platform.model import (
    EncoderWorld,
    Rates,
    Room,
    accelerometers,
    base_of,
    encoders,
    force_within,
    propagate,
    room,
    turning,
)
from inercal.systems.selfcal.platform.recording import Recording
from inercal.systems.selfcal.platform.rig import World


def averaged(
    recording: Recording, problem: FilterProblem, found: FilterResult
) -> tuple[Recording, FilterProblem]:
    """A recording by means over blocks, with the problem that has their noise; both themselves where it has no more
    than `LIMITS.judged_rows` rows. ``found`` is the result, with a history, of a filter for them.

    Sensors that read in less than half of a block have no reading there, nor has any where the attitude was taken anew
    from the encoders within it.
    """
    m = block(recording)
    if m == 1 or not found.converged or found.history is None:
        return recording, problem
    count = len(recording.t) // m
    warm = np.zeros(len(recording.t)) if recording.warm is None else recording.warm
    read, acc = np.asarray(np.isfinite(recording.th).all(axis=1)), recording.acc.copy()
    waiting = np.array(doubtful(recording.held, recording.th[1:]), dtype=np.int64) + 1
    acc[waiting[~read[waiting]]] = np.nan  # as in the filter
    rows = _Rows(recording.t, recording.rate, acc, recording.th, warm)
    middle = _middle(read, m, count)
    out = _BlockMeans(np.empty((count, 3)), np.empty((count, 3)), np.empty((count - 1, 3)))
    full = problem.states.full(found.coefficients)
    q = found.history.attitude
    _average(q, rows, middle, m, full, problem.states.layout, problem.world, out)
    th = recording.th[middle]
    _, joints = gimbals(np.where(read[middle, None], th, 0.0), problem.world)
    by = np.einsum("kij,kj->ki", np.linalg.pinv(joints, rcond=1e-3), out.turned)
    th = th + np.where(problem.states.layout.turning, by, 0.0)  # a fixed joint is where it is
    anew = np.unique(np.array(found.restarts, dtype=np.int64) // m)
    anew = anew[(anew > 0) & (anew < count)]
    th[anew], out.acc[anew] = np.nan, np.nan
    walked = None
    if recording.walked is not None:
        through = np.append(0.0, np.cumsum(recording.walked))
        walked = np.diff(through[middle])
    fewer = replace(
        recording, t=recording.t[middle], rate=out.rate, th=th, acc=out.acc, walked=walked,
        held=tuple((anew - 1).tolist()), reference=None, warm=None if recording.warm is None else warm[middle],
    )  # fmt: skip
    noise, root = problem.noise, math.sqrt(m)
    noise = replace(
        noise,
        encoder=noise.encoder / root,
        accelerometer=noise.accelerometer / root,
        base_sway=noise.base_sway / root,
    )
    return fewer, replace(problem, noise=noise)


def load_kernels(problem: FilterProblem) -> None:
    """Load, or compile, the kernel of `averaged`."""
    none = np.empty((0, 3))
    rows = _Rows(np.empty(0), none, none, none, np.empty(0))
    full = problem.states.full(problem.mean)
    nothing = np.empty(0, dtype=np.int64)
    _average(
        np.empty((0, 4)),
        rows,
        nothing,
        1,
        full,
        problem.states.layout,
        problem.world,
        _BlockMeans(none, none, none),
    )


def block(recording: Recording) -> int:
    """Rows of a block, an odd number: so many that `LIMITS.judged_rows` blocks are left, and through which the platform
    turns by no more than `LIMITS.block_turn`."""
    fewest = -(-len(recording.t) // LIMITS.judged_rows)
    turn = float(np.max(np.linalg.norm(recording.rate, axis=1) * recording.dt, initial=0.0))
    most = int(LIMITS.block_turn / turn) if turn * fewest > 0.0 else fewest
    return max(min(fewest | 1, most - 1 | 1), 1) if fewest > 1 else 1


def _middle(read: NDArray[np.bool_], m: int, count: int) -> NDArray[np.int64]:
    """(count,) the row of each block that is nearest to its middle of those (n,) whose angles were ``read``."""
    far = np.abs(np.arange(m) - m // 2) + np.where(read[: m * count].reshape(count, m), 0, m)
    return np.asarray(np.arange(0, m * count, m) + np.argmin(far, axis=1))


class _Rows(NamedTuple):
    """Rows of a recording, as in `Recording`; ``warm`` is 0 where it has none."""

    t: Array
    rate: Array
    acc: Array
    th: Array
    warm: Array


class _BlockMeans(NamedTuple):
    """Of b blocks: ``acc`` (b, 3) [m/s^2]; ``turned`` (b, 3) [rad] of the mean of the encoders against their reading at
    the middle row, about the axes of p; ``rate`` (b - 1, 3) [rad/s] from one middle row to the next."""

    acc: Array
    turned: Array
    rate: Array


@allocating
def _average(
    q: Array,
    rows: _Rows,
    middle: NDArray[np.int64],
    m: int,
    c: Array,
    layout: StateLayout,
    world: World,
    out: _BlockMeans,
) -> None:
    """Means over blocks of ``m`` rows about their ``middle`` ones; ``q`` (n, 4) attitudes, ``c`` the full vector."""
    t, rate = rows.t, rows.rate
    own, base = room(), base_of(c, layout.based, world)
    for b in range(len(middle)):
        r = middle[b]
        if b + 1 < len(middle):
            whole = (1.0, 0.0, 0.0, 0.0)
            for k in range(r, middle[b + 1]):
                dt = t[k + 1] - t[k]
                whole = multiply(whole, exp((rate[k, 0] * dt, rate[k, 1] * dt, rate[k, 2] * dt)))
            turn, lasts = log(whole), t[middle[b + 1]] - t[r]
            for i in range(3):
                out.rate[b, i] = turn[i] / lasts
        begin = b * m
        at = (q[r, 0], q[r, 1], q[r, 2], q[r, 3])
        for k in range(r, begin, -1):
            at = _moved(at, rows, k - 1, -1.0, base, c, layout, own)
        angles, force, read, sensed = np.zeros(3), np.zeros(3), 0, np.zeros(3)
        here, shown = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        for k in range(begin, begin + m):
            if k > begin:
                at = _moved(at, rows, k - 1, 1.0, base, c, layout, own)
            before, after = max(k - 1, 0), min(k, len(rate) - 1)
            of = Rates(
                (rate[before, 0], rate[before, 1], rate[before, 2]),
                (rate[after, 0], rate[after, 1], rate[after, 2]),
            )
            th = rows.th[k]
            if not (math.isnan(th[0]) or math.isnan(th[1]) or math.isnan(th[2])):
                to = encoders(th, of, base, c, layout, world, own)
                miss = log(multiply((at[0], -at[1], -at[2], -at[3]), to))
                read += 1
                for i in range(3):
                    angles[i] += miss[i]
                if k == r:
                    here = miss
            expected, _ = accelerometers(at, of, rows.warm[k], base, c, layout, own)
            if k == r:
                shown = expected
            for i in range(3):
                if not math.isnan(rows.acc[k, i]):
                    force[i] += rows.acc[k, i] - expected[i]
                    sensed[i] += 1.0
        for i in range(3):
            out.turned[b, i] = angles[i] / read - here[i] if 2 * read > m else math.nan
            out.acc[b, i] = shown[i] + force[i] / sensed[i] if 2.0 * sensed[i] > m else math.nan


@merged
def _moved(
    q: Quaternion,
    rows: _Rows,
    step: int,
    way: float,
    base: EncoderWorld,
    c: Array,
    layout: StateLayout,
    own: Room,
) -> Quaternion:
    """The attitude after a step, or before it where ``way`` is -1."""
    w, dt = (
        (rows.rate[step, 0], rows.rate[step, 1], rows.rate[step, 2]),
        way * (rows.t[step + 1] - rows.t[step]),
    )
    f = force_within(q, w, 0.5 * dt, base.up, layout.by_force)
    return propagate(q, turning(w, f, rows.warm[step], c, layout, own), base.earth, dt)
