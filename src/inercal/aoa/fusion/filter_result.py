"""The fusion of a whole recording: angles with their uncertainties, what was learned of the sensors, innovations."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from inercal.aoa.angles import Angles
from inercal.aoa.fusion.loop import OUTPUTS
from inercal.aoa.fusion.model import ROLL
from inercal.aoa.fusion.problem import FilterProblem
from inercal.aoa.fusion.run import Start, State, Trace, advance, initial
from inercal.aoa.fusion.smoother import smooth
from inercal.aoa.reading.clock import later
from inercal.aoa.reading.recording import Recording
from inercal.arrays import Array
from inercal.geometry.rotations import principal

SETTLED = 2.0
"""Time [s] after the first row from which innovations are judged."""

KEPT = 2000
"""Rows, about, of which all states are kept for pictures."""

_BLOCK = 10_000
"""Rows of which all states are there at a time."""


@dataclass(frozen=True, eq=False)
class FilterResult:
    """What the fusion found.

    Attributes
    ----------
    theta, u, rate, rate_u, acceleration : (n,)
        Angle, its standard uncertainty [rad], rate, its standard uncertainty [rad/s], and acceleration [rad/s^2], at
        each row of the recording, causal or ``smoothed``; NaN in rows that were left out.
    innovations : (n, N + 1)
        Of accelerometers and gyro, of the causal filter, each over its standard deviation before the gate; NaN where
        not measured.
    roll, roll_u : (n,) or None
        Roll and its standard uncertainty [rad] at each row of the causal filter, where it is estimated.
    kept_t : (k,) s
        Times at which all states were kept, ``states`` (k, m) and their standard deviations ``states_u`` (k, m), in the
        order of the problem's names; causal or smoothed as the angles.
    state : State
        Of the causal filter at the end: what it learned of the sensors.
    nis_mean : float
        Mean of the squared innovations after the first 2 s, or in the later half of less than 4 s; NaN without any.
    nis_count : int
        Innovations in that mean.
    starts : tuple of int
        Rows at which the filter started: one, and more where the angle was lost.
    seconds : float
        Time of the computation alone.
    """

    theta: Array
    u: Array
    rate: Array
    rate_u: Array
    acceleration: Array
    innovations: Array
    kept_t: Array
    states: Array
    states_u: Array
    state: State
    nis_mean: float
    nis_count: int
    starts: tuple[int, ...]
    smoothed: bool
    seconds: float
    roll: Array | None = None
    roll_u: Array | None = None


def estimate(
    recording: Recording, problem: FilterProblem, smoothed: bool = False, where: object = "t"
) -> FilterResult:
    """Angles of a recording, causal or from all of it.

    Raises
    ------
    RecordError
        Time does not go on.
    """
    clock = time.perf_counter()
    taken = later(recording.t, where=where)
    t, rows = recording.t[taken], recording.rows[taken]
    every = max(1, len(t) // KEPT)
    if problem.spatial and not smoothed:
        state, trace, kept, rolls = _with_roll(problem, t, rows, every)
    else:
        rolls = None
        kept = np.full(((len(t) + every - 1) // every, 2 * problem.size), np.nan)
        state, trace = advance(initial(problem), problem, t, rows, kept, every, last=True)
    angles = trace.out[:, :OUTPUTS]
    if smoothed:
        kept[:] = np.nan
        angles = smooth(problem, t, rows, trace.starts, kept, every)
    n = len(recording.t)
    told, innovations = np.full((n, OUTPUTS), np.nan), np.full((n, problem.count + 1), np.nan)
    told[taken], innovations[taken] = angles, trace.out[:, OUTPUTS:]
    roll = np.full((n, 2), np.nan)
    if rolls is not None:
        roll[taken] = rolls
    seconds = time.perf_counter() - clock
    judged = innovations[taken][t - t[0] >= min(SETTLED, (t[-1] - t[0]) / 2.0)] if len(t) else innovations
    squared = np.square(judged[np.isfinite(judged)])
    m = problem.size
    return FilterResult(
        theta=told[:, 0],
        u=told[:, 1],
        rate=told[:, 2],
        rate_u=told[:, 3],
        acceleration=told[:, 4],
        innovations=innovations,
        kept_t=t[::every],
        states=kept[:, :m],
        states_u=kept[:, m:],
        state=state,
        nis_mean=float(squared.mean()) if squared.size else float("nan"),
        nis_count=squared.size,
        starts=tuple(int(taken[each.row]) for each in trace.starts),
        smoothed=smoothed,
        seconds=seconds,
        roll=None if rolls is None else roll[:, 0],
        roll_u=None if rolls is None else roll[:, 1],
    )


def roll_of(problem: FilterProblem, kept: Array) -> Array:
    """Roll, in (-pi, pi], and its standard uncertainty (k, 2) [rad] from kept states (k, 2 m)."""
    k = int(problem.places[ROLL])
    return np.column_stack([principal(kept[:, k]), kept[:, problem.size + k]])


def _with_roll(
    problem: FilterProblem, t: Array, rows: Array, every: int
) -> tuple[State, Trace, Array, Array]:
    """The causal filter's state and trace, states kept at each ``every``-th row, and roll (n, 2) at each.

    All states of all rows would be many: they are there for some rows at a time.
    """
    state, done = initial(problem), 0
    starts: list[Start] = []
    parts = []
    for a in range(0, max(1, len(t)), _BLOCK):
        b, held = min(a + _BLOCK, len(t)), len(state.held)
        states = np.full((held + b - a, 2 * problem.size), np.nan)
        state, trace = advance(state, problem, t[a:b], rows[a:b], states, last=b == len(t))
        told = len(trace.out)
        starts += [each._replace(row=each.row + done) for each in trace.starts]
        parts.append((trace.out, states[-done % every : told : every], roll_of(problem, states[:told])))
        done += told
    out, kept, rolls = (np.concatenate(each) for each in zip(*parts, strict=True))
    return state, Trace(out, tuple(starts)), kept, rolls


def of_fusion(filtered: FilterResult, states: int) -> Angles:
    """The angles of the fusion with so many ``states`` (of three accelerometers): ``fusion 19``, ``smoothed 19``."""
    way = "smoothed" if filtered.smoothed else "fusion"
    return Angles(f"{way} {states}", filtered.theta, filtered.u, filtered.rate, filtered.rate_u)
