"""The causal fusion, row by row or in blocks: the same digits either way.

The first rows are held until there are enough to start from; their angles come then, all at once. Where theta is lost,
as over a long gap, rows are held again, and the filter starts anew with the errors of the sensors that it has learned;
with the prior where sensors kept contradicting it. Each row must be later than that before it.

Fading: a row is linearised at a motion that is itself estimated, so it says a little too much about the constants,
always in the same sense. Within a minute that is small beside u. But a combination that a motion hardly shows (under
one sine the gyro's scale, positions and heights together, which only harmonics separate) would be carried away over
hours. So from `memory_time` (`inercal.systems.aoa.limits.Limits`) on the information of the data on the constants fades
with that time constant, and that of the prior does not; in information, each `fading_interval`,

    P'^-1 = (1 - e) P^-1 + e P0^-1        P'^-1 x' = (1 - e) P^-1 x + e P0^-1 x0

with x0, P0 the prior. What is known of the motion, given the constants, stays: otherwise readings would contradict that
these have moved, and teach the filter that they were at their prior all the time. A constant that the data show well
stays as sure as the memory makes it, one that they hardly show stays at its prior, and a bias that wanders is followed.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from inercal.foundation.arrays import Array
from inercal.systems.aoa.fusion import loop
from inercal.systems.aoa.fusion.loop import BESIDE, OUTPUTS, Belief, FusedRows, Kept
from inercal.systems.aoa.fusion.model import GYRO_BIAS
from inercal.systems.aoa.fusion.problem import START, FusionProblem
from inercal.systems.aoa.limits import LIMITS

_STEP = LIMITS.fading_interval
_FIRST = math.floor(LIMITS.memory_time / _STEP)


class FusionState(NamedTuple):
    """State of the filter between two rows.

    ``x`` (n,) and ``P`` (n, n) of the states of the problem; ``turns`` (N + 3,) as of
    `inercal.systems.aoa.fusion.loop.advance`; ``t`` [s] of the last row, -inf before the first; ``started``: the filter
    runs. Until it does ``held`` (k, N + 6) are the rows that wait, time first. ``since`` [s] is the row from which it
    has learned, NaN before.
    """

    x: Array
    P: Array
    turns: Array
    t: float
    started: bool
    held: Array
    since: float


class FilterStart(NamedTuple):
    """A start of the filter: the ``row``, counted in the trace, the state before the update of that row, ``anew`` where
    all of it is of the prior, as at first and after surprises without end, and ``since`` [s] the row from which it has
    learned."""

    row: int
    x: Array
    P: Array
    turns: Array
    anew: bool
    since: float


class Head(NamedTuple):
    """The state at the start of a block, from which a smoother goes back: ``rows`` are those of the block in the trace,
    ``F`` (n, n) the fading of the constants that is already in the state, None where nothing fades."""

    rows: slice
    belief: Belief
    F: Array | None


class FusionTrace(NamedTuple):
    """Estimates of the filter at m rows: ``out`` (m, OUTPUTS + N + 1) as of `inercal.systems.aoa.fusion.loop.advance`,
    its ``starts``, and the ``heads`` of blocks where they were asked for."""

    out: Array
    starts: tuple[FilterStart, ...]
    heads: tuple[Head, ...] = ()


def initial(problem: FusionProblem) -> FusionState:
    """Before the first row."""
    none = np.empty((0, problem.count + BESIDE + 1))
    x, P = problem.mean.copy(), problem.covariance.copy()
    return FusionState(x, P, np.zeros(problem.count + 3), -math.inf, False, none, math.nan)


def advance(
    state: FusionState,
    problem: FusionProblem,
    t: Array,
    rows: Array,
    kept: Array | None = None,
    every: int = 1,
    last: bool = False,
    motions: Array = loop.NO_MOTIONS,
    block: int = 0,
    first: int = 0,
) -> tuple[FusionState, FusionTrace]:
    """Go on by rows at the times ``t`` (m,) [s], increasing; ``rows`` (m, N + 5) as of
    `inercal.systems.aoa.fusion.loop.advance`.

    The state handed in is used up. Rows that are held have no row in the trace yet: it comes with a later block, or at
    the end, if ``last``. ``kept`` receives states and their standard deviations at each ``every``-th row of the
    trace, ``motions`` (m, `loop.MOTION`) what the angle is carried on from. The trace has heads of blocks of so many
    rows, or fewer; of ``block`` 0 none. ``first`` is the number of the first row of the trace for ``every``.
    """
    if kept is None:
        kept = np.empty((0, 2 * problem.size))
    if len(state.held):
        t, rows = np.append(state.held[:, 0], t), np.vstack([state.held[:, 1:], rows])
    rows = np.ascontiguousarray(rows)
    m, at = len(t), 0
    out = np.empty((m, OUTPUTS + problem.count + 1))
    x, P, turns, earlier, running, _, since = state
    dt, starts, heads = np.diff(t, prepend=earlier), [], []
    while at < m:
        F = None
        if not running:
            end = min(at + LIMITS.starting_rows, m)
            if end - at < LIMITS.starting_rows and not last:
                break
            out[at:end] = np.nan
            anew = bool((turns[2:] >= loop.PATIENCE).any())
            if anew:  # the learned errors of the sensors are not to be believed either
                x[:], P[:] = problem.mean, problem.covariance
            if not start(x, P, turns, problem, t[at:end], rows[at:end]):
                at = end
                continue
            since = float(t[at]) if anew or math.isnan(since) else since
            starts.append(FilterStart(at, x.copy(), P.copy(), turns.copy(), anew, since))
            dt[at] = 0.0
        elif steps := fading_steps(float(t[at - 1]) if at else earlier, float(t[at]), since):
            F = fade(x, P, problem, steps)
        stop = next_fading(t, at, since)
        stop = min(stop, at + block) if block else stop
        part = FusedRows(dt[at:stop], rows[at:stop])
        belief, keep = Belief(x, P, turns), Kept(kept, every, first + at)
        before = _apart(belief) if block else belief
        done = loop.advance(belief, part, problem.model, out[at:stop], keep, motions=motions[at:stop])
        if block:
            heads.append(Head(slice(at, at + done), before, F))
        # an angle that is lost in the row of its start is none
        at, running = (at + done, at + done == stop) if done or running else (end, False)
    latest = float(t[at - 1]) if at else earlier
    held = np.column_stack([t[at:], rows[at:]])
    return FusionState(x, P, turns, latest, running, held, since), FusionTrace(
        out[:at], tuple(starts), tuple(heads)
    )


def _apart(belief: Belief) -> Belief:
    """A belief in arrays of its own."""
    return Belief(*(each.copy() for each in belief))


def unknown(problem: FusionProblem) -> list[int]:
    """Places of the states that a start finds anew: motion, flexure of the sting, and roll."""
    flexure, roll = problem.places.resonators, problem.places.roll
    of_flexure = range(flexure, flexure + 4) if flexure >= 0 else ()
    return [0, 1, 2, 3, *of_flexure, *((roll,) if roll >= 0 else ())]


def start(x: Array, P: Array, turns: Array, problem: FusionProblem, t: Array, rows: Array) -> bool:
    """Put the motion at the first of a few rows into ``x`` and ``P``; False where these show no angle.

    Theta fits the medians of the accelerometers best, the rate is the gyro's or, without one, the slope of theta, and
    the acceleration fits the rest (Tan et al. with three axes: atan2(A2, (A3 - A1)/2) and (A1 + A3)/(r3 - r1)). The
    other `unknown` states are set to the prior; errors of the sensors stay.
    """
    n, spatial = problem.count, problem.spatial
    new = unknown(problem)
    fresh = new[4:]
    x[fresh] = problem.mean[fresh]
    together = t - t[0] <= 3.0 * LIMITS.starting_rows * _medians(np.diff(t, prepend=t[0])[:, None])[0]
    t, rows = t[together], rows[together]
    level = math.cos(x[problem.places.roll]) if spatial else problem.constants.roll_cosine
    middle = _medians(rows)
    seen = np.flatnonzero(np.isfinite(middle[:n]))
    if not problem.layout.of(*seen).spans:
        return False
    cosine, sine, r, z = problem.geometry[seen].T
    axes = np.stack([cosine, -sine], axis=-1)
    # forward and upward specific force (2,) that fit readings along axes best
    fit = np.linalg.solve(axes.T @ axes, axes.T)
    if math.isfinite(middle[n]) and abs(level) > LIMITS.level_cosine:
        rate = (middle[n] - x[GYRO_BIAS]) / level
    else:
        forces = (rows[:, seen] - x[5 + seen]) @ fit.T
        rate = _slope(t, np.array([_angle(force, level, problem) for force in forces]))
    # A = (g sin theta - r w^2) cos lambda - level (g cos theta - level z w^2) sin lambda + arm al
    read = middle[seen] - x[5 + seen] + rate**2 * (cosine * r - sine * level**2 * z)
    arms = -level * (z * cosine + r * sine)
    arms = arms - axes @ (fit @ arms)
    power = float(arms @ arms)
    acceleration = float(arms @ read) / power if power > LIMITS.pair_arm**2 else 0.0
    x[:4] = _angle(fit @ read, level, problem), rate, acceleration, 0.0
    x[0] -= 0.5 * rate * (t[-1] - t[0])
    P[new, :] = 0.0
    P[:, new] = 0.0
    P[[0, 1, 2, 3], [0, 1, 2, 3]] = START**2
    P[fresh, fresh] = problem.covariance[fresh, fresh]
    turns[2:] = 0.0
    for k in range(2):
        if math.isfinite(middle[n + 3 + k]):
            turns[k] = middle[n + 3 + k]
    return True


def _medians(rows: Array) -> Array:
    """Medians of the columns; NaN of those without a number."""
    ordered, count = np.sort(rows, axis=0), np.isfinite(rows).sum(axis=0)  # NaN come last
    column = np.arange(rows.shape[1])
    middle = ordered[np.maximum(count - 1, 0) // 2, column], ordered[count // 2, column]
    return np.asarray(0.5 * (middle[0] + middle[1]))


def _angle(force: Array, level: float, problem: FusionProblem) -> float:
    """Theta that forward and upward specific force (2,) show at rest; NaN where they are."""
    forward, up = force.tolist()
    if abs(level) > LIMITS.level_cosine:
        return math.atan2(forward, up / level)
    g = problem.constants.gravity
    return math.asin(min(1.0, max(-1.0, forward / g))) if math.isfinite(forward) else math.nan


def _slope(t: Array, angles: Array) -> float:
    """Rate [rad/s] of angles, 0 where there are not three."""
    finite = np.isfinite(angles)
    if finite.sum() < 3:
        return 0.0
    t, angles = t[finite] - t[finite].mean(), np.unwrap(angles[finite])
    return float(t @ angles / (t @ t))


def fading_steps(before: float, t: float, since: float) -> int:
    """Number of steps of fading due before the row at ``t`` [s]; ``before`` [s] is the row before it, and ``since`` [s]
    the row from which the filter has learned."""
    late, early = math.floor((t - since) / _STEP), math.floor((before - since) / _STEP)
    return max(late, _FIRST) - max(early, _FIRST)


def next_fading(t: Array, at: int, since: float) -> int:
    """The first row after ``at`` of ``t`` (m,) [s], increasing, before which constants fade; m where none is."""
    passed = max(math.floor((t[at] - since) / _STEP), _FIRST) + 1
    # rounding may have it a row earlier or later
    k = max(at + 1, int(np.searchsorted(t, since + passed * _STEP)) - 1)
    while k < len(t) and not fading_steps(float(t[k - 1]), float(t[k]), since):
        k += 1
    return k


def fade(x: Array, P: Array, problem: FusionProblem, steps: int) -> Array:
    """Let the constants of the state ``x`` (n,), ``P`` (n, n) fade by so many steps, in place.

    Returns F (n, n) of x' = F x + the part of the prior. Of the other states what is known given the constants stays.
    """
    kept = math.exp(-_STEP * steps / LIMITS.memory_time)
    prior, F = problem.covariance, np.eye(len(x))
    at = np.array([k for k in problem.nuisances.values() if prior[k, k] > 0.0], dtype=int)
    if not len(at):
        return F
    rest = np.setdiff1d(np.arange(len(x)), at)
    scale, own, beside = np.sqrt(np.diag(prior)[at]), np.ix_(at, at), np.ix_(rest, at)
    units = np.outer(scale, scale)
    current, given, across = P[own] / units, prior[own] / units, P[beside] / scale
    lost = 1.0 - kept
    mixed = np.linalg.pinv(kept * given + lost * current, hermitian=True)
    shown = np.linalg.pinv(current, hermitian=True)
    F[own] -= lost * (current @ mixed) * np.outer(scale, 1.0 / scale)
    F[beside] = -lost * (across @ mixed) / scale
    x[:] = x + (F - np.eye(len(x)))[:, at] @ (x[at] - problem.mean[at])
    motion = P[np.ix_(rest, rest)] + lost * across @ shown @ (given - current) @ mixed @ across.T
    P[np.ix_(rest, rest)] = 0.5 * (motion + motion.T)
    P[beside] = across @ mixed @ given * scale
    P[np.ix_(at, rest)] = P[beside].T
    faded = current @ mixed @ given * units
    P[own] = 0.5 * (faded + faded.T)
    return F
