"""Steps of which no rate was recorded: gaps between rows, and rows whose rate is no number.

The platform is taken to turn on as before, over the base: earth rate, which it is commanded to follow besides, turns in
p meanwhile, by 2 seconds of arc after 4 s at 1 deg/s.

That is a guess. So nothing measured after such a step counts before the encoders read again, and where these contradict
it, as where a turn began or ended meanwhile, the attitude is theirs from then on: coefficients and their covariance
stay, correlations with the attitude are dropped. Measured rates are dealt with in the same way, but for the noise of
the one reading that is held: it turns the platform on for T where it was averaged over dt, which makes ARW^2 T^2/dt of
the ARW^2 T of a command.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.geometry.rotations import boxminus, conjugate, exp, log, multiply, rotate
from inercal.foundation.records.places import counted, counted_names
from inercal.systems.selfcal.filters import error_state
from inercal.systems.selfcal.filters.filter_result import (
    Estimates,
    FilterResult,
    FilterState,
    Trace,
    empty_estimates,
    estimate_of,
)
from inercal.systems.selfcal.filters.problem import AttitudeStart, FilterProblem, encoders_at
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.kinematics import attitude, nearest_turn
from inercal.systems.selfcal.platform.recording import Recording, Steps
from inercal.systems.selfcal.platform.rig import World


def usual(recent: Array) -> Array:
    """The usual interval (...) [s] by the last ones (..., 9), NaN where there were fewer: their lower median."""
    count = np.count_nonzero(np.isfinite(recent), axis=-1)
    middle = np.expand_dims((count - 1) // 2, -1)
    return np.asarray(np.take_along_axis(np.sort(recent, axis=-1), middle, axis=-1)[..., 0])


def held_rate(w: Array, th: Array, world: World, middle: float, since: float, dt: float) -> Array:
    """Rate (3,) [rad/s] against inertial space, constant over a step, that turns the platform on over the base.

    ``w`` (3,) [rad/s] is the last known rate, against inertial space, in p, ``th`` (3,) [rad] are the last known
    gimbal angles. Times [s] count from these: ``middle`` when it turned at ``w``, ``since`` when the step of ``dt``
    begins.
    """
    q = np.array(attitude(th, world.axes, world.signs))
    turn = w
    for _ in range(4):  # each round is nearer by earth rate times `middle`
        turn = w - rotate(conjugate(multiply(q, exp(turn * middle))), world.earth)
    of_earth = rotate(conjugate(multiply(q, exp(turn * since))), world.earth)
    # qexp(-earth dt) q qexp(rate dt) = q qexp(turn dt)
    rotvec = log(multiply(exp(of_earth * dt), exp(turn * dt)))
    angle = float(np.linalg.norm(rotvec))
    if angle > 0.0:  # on the turn on which it is
        wanted = float(turn @ rotvec) * dt / angle
        rotvec = rotvec * (1.0 + 2.0 * math.pi * round((wanted - angle) / (2.0 * math.pi)) / angle)
    return np.asarray(rotvec / dt)


def with_held(t: Array, rate: Array, th: Array, world: World, gained: bool) -> tuple[Array, tuple[int, ...]]:
    """Rates (n - 1, 3) [rad/s] without gaps, and the steps whose rates are held.

    ``t`` (n,) [s]; ``rate`` (n - 1, 3) NaN where not recorded, ``th`` (n, 3) [rad] NaN where not measured, the first
    rows complete. ``gained``: rates are those just before the next row, and not just after theirs.
    """
    dt = np.diff(t)
    before = np.append(np.full(LIMITS.recent_intervals - 1, np.nan), dt)
    step = usual(np.lib.stride_tricks.sliding_window_view(before, LIMITS.recent_intervals))
    long = dt > LIMITS.gap_ratio * step
    rated = np.all(np.isfinite(rate), axis=1)
    held = np.flatnonzero(long | ~rated)
    of_rate, of_angles = _last(rated), _last(np.all(np.isfinite(th), axis=1))
    filled = rate.copy()
    for k in held:
        i, j = of_rate[k], of_angles[k]
        half = 0.5 * step[k]
        middle = t[i + 1] - half if gained else t[i] + half
        turning = held_rate(rate[i], th[j], world, middle - t[j], t[k] - t[j], dt[k])
        filled[k] = np.where(long[k] | ~np.isfinite(rate[k]), turning, rate[k])
    return filled, tuple(held.tolist())


def walked(t: Array, rate: Array, held: Sequence[int]) -> Array:
    """Time (n - 1,) [s] over which angle random walk gathers in each step, where rates (n - 1, 3) are measured.

    That of a step is its own length, but where a rate is held: with dt the usual interval over which it was averaged,
    and A, B the time from its row to the begin and the end of the step, ``(B^2 - A^2) / dt``, so that all steps of one
    rate together have ``B^2 / dt``. ``t`` (n,) [s]; rates are NaN where not recorded.
    """
    dt = np.diff(t)
    out, rows = dt.copy(), np.array(held, dtype=np.int64)
    if rows.size:
        before = np.append(np.full(LIMITS.recent_intervals - 1, np.nan), dt)
        step = usual(np.lib.stride_tricks.sliding_window_view(before, LIMITS.recent_intervals))[rows]
        since = t[_last(np.all(np.isfinite(rate), axis=1))[rows]]
        out[rows] = (np.square(t[rows + 1] - since) - np.square(t[rows] - since)) / step
    return out


def _last(complete: NDArray[np.bool_]) -> NDArray[np.int64]:
    """The last complete row before or at each row."""
    return np.asarray(np.maximum.accumulate(np.where(complete, np.arange(len(complete)), 0)))


def advance(
    module: ModuleType,
    state: FilterState,
    problem: FilterProblem,
    steps: Steps,
    held: Sequence[int],
    history: bool = True,
    walked: Array | None = None,
) -> tuple[FilterState, Trace]:
    """Take a recursive filter through m steps, of which those ``held`` are guesses; other arguments as of
    `inercal.systems.selfcal.filters.error_state.advance`.

    ``walked`` (m,) [s] as of `inercal.systems.selfcal.platform.recording.Recording`, the steps themselves if absent.
    """
    if not held:
        state, trace = module.advance(state, problem, steps, history)
        return state, trace
    nothing = np.full((1, 3), np.nan)
    parts, restarts, done = list[Trace](), list[int](), 0
    seen = np.all(np.isfinite(steps.th), axis=1)
    for k in doubtful(held, steps.th):
        step = steps.part(slice(k, k + 1))
        if k > done:
            state, trace = module.advance(state, problem, steps.part(slice(done, k)), history)
            parts.append(trace)
        unmeasured = step._replace(acc=nothing, th=nothing)
        own = FilterState._make(
            each.copy() for each in state
        )  # as a filter uses up the arrays that it is given
        restless = problem if walked is None else walking(problem, walked[k] / steps.dt[k])
        propagated, trace = module.advance(own, restless, unmeasured, history)
        if not seen[k]:
            state = propagated
        elif _contradicted(propagated, problem, steps.th[k]):
            state, trace = _anew(module, propagated, problem, step, history)
            restarts.append(k)
        else:
            state, trace = module.advance(state, restless, step, history)
        parts.append(trace)
        done = k + 1
    state, trace = module.advance(state, problem, steps.part(slice(done, None)), history)
    return state, joined([*parts, trace])._replace(restarts=tuple(restarts))


def initial(
    module: ModuleType, problem: FilterProblem, th: Array, rate: Array, start: AttitudeStart | None = None
) -> FilterState:
    """The state of a recursive filter at a first row: angles ``th`` (3,) [rad], rate (3,) [rad/s] from there on."""
    of_rig = (rate,) if problem.states.of_rig else ()
    state: FilterState = module.initial(problem, th, start, *of_rig)
    return state


def walking(problem: FilterProblem, factor: float) -> FilterProblem:
    """The problem with a variance of the angle random walk larger by a factor."""
    walk = math.sqrt(factor) * problem.noise.angle_random_walk
    return replace(problem, noise=replace(problem.noise, angle_random_walk=walk))


def doubtful(held: Sequence[int], th: Array) -> list[int]:
    """Steps whose measurements wait for the encoders (m, 3): held ones, and all up to the next reading."""
    seen, doubt = np.all(np.isfinite(th), axis=1), np.zeros(len(th), dtype=np.bool_)
    for k in held:
        until = k + int(np.argmax(seen[k:])) if seen[k:].any() else len(th) - 1
        doubt[k : until + 1] = True
    return [int(k) for k in np.flatnonzero(doubt)]


def broken(recording: Recording, problem: FilterProblem, start: AttitudeStart | None = None) -> list[int]:
    """Steps held that the encoders contradict, as the error-state filter sees it."""
    if not recording.held:
        return []
    state = error_state.initial(problem, recording.th[0], start)
    steps = recording.steps
    _, trace = advance(error_state, state, problem, steps, recording.held, False, recording.walked)
    seen = np.all(np.isfinite(steps.th), axis=1)
    return [
        k for k in recording.held for end in trace.restarts if k <= end and not seen[k:end].any()
    ]  # those since the encoders read last


def taken_anew(recording: Recording, result: FilterResult) -> list[Finding]:
    """``gap``: steps in which the platform did not turn on as before."""
    rows = np.array(result.restarts, dtype=np.int64)
    if not rows.size:
        return []
    text = (
        f"the platform did not turn on as before where no rate was recorded: {counted(len(rows), 'time')} the encoders "
        "contradict that, and the attitude is taken anew from them"
    )
    return [Finding("gap", text, f"t = {counted_names([f'{each:.10g} s' for each in recording.t[rows]])}")]


def _contradicted(state: FilterState, problem: FilterProblem, th: Array) -> bool:
    """True where encoder readings (3,) [rad] are far from the attitude of a state that has not seen them."""
    expected, read = estimate_of(state, problem), encoders_at(problem, th, state.coefficients, np.zeros(3))[0]
    limit = LIMITS.held_sigmas * np.hypot(expected.attitude_u[0], anew(problem, th).sigma)
    return bool((np.abs(boxminus(read, expected.attitude[0])) > limit).any())


def anew(problem: FilterProblem, th: Array) -> AttitudeStart:
    """The attitude that encoders (3,) [rad] read, with the most that they leave uncertain about any axis:
    ``1 + |sin thy|`` is the largest eigenvalue of ``J J^T``."""
    q = np.array(attitude(th, problem.world.axes, problem.world.signs))
    return AttitudeStart(q, problem.noise.encoder * math.sqrt(1.0 + abs(math.sin(th[1]))))


def _anew(
    module: ModuleType, state: FilterState, problem: FilterProblem, step: Steps, history: bool
) -> tuple[FilterState, Trace]:
    """The state with its attitude as encoders read it after one step, and the trace of that row, without an update."""
    p, th = len(problem.prior), step.th[0]
    on_turn = np.array([nearest_turn(*each) for each in zip(th, state.th, strict=True)])
    start = anew(problem, on_turn)
    begun: FilterState = module.initial(problem, on_turn, start)
    begun.covariance[-p:, -p:] = state.covariance[-p:, -p:]
    state = begun._replace(coefficients=state.coefficients, near=state.near)
    if problem.states.of_rig:
        state = error_state.with_attitude(state, problem, None, start.sigma, step.rate[0])
    out = empty_estimates(1, p, history)
    out.nis[:], out.dims[:] = math.nan, 0
    if history:
        out.innovations[:] = math.nan
        for name, row in vars(estimate_of(state, problem)).items():
            getattr(out, name)[:] = row
    return state, Trace(out, gimbal_cosine=abs(math.cos(on_turn[1])))


def joined(parts: Sequence[Trace]) -> Trace:
    """Traces one after the other as one."""
    lowest = [part.lowest_eigenvalue for part in parts if not math.isnan(part.lowest_eigenvalue)]
    return Trace(
        Estimates(*map(np.concatenate, zip(*(part.estimates for part in parts), strict=True))),
        lowest_eigenvalue=min(lowest, default=math.nan),
        fallbacks=sum(part.fallbacks for part in parts),
        gimbal_cosine=min(part.gimbal_cosine for part in parts),
    )
