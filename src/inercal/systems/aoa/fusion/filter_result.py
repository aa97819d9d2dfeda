"""The fusion of a whole recording: angles with their uncertainties, errors of the sensors, innovations.

Where gyros for roll and yaw track the roll, the causal filter has it at each row. The smoother keeps its states at some
thousand times only; between them the roll follows the gyros,

    phi' = p + (w sin phi - y cos phi) tan theta

with the kept roll on the right side, and the drift of this sum from one kept time to the next is spread evenly between
them: this removes biases of the gyros and keeps oscillations that the kept times do not resolve.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.rotations import principal
from inercal.systems.aoa.angles import Angles
from inercal.systems.aoa.band import WHOLE
from inercal.systems.aoa.fusion import band
from inercal.systems.aoa.fusion.ahead import between, carried_on
from inercal.systems.aoa.fusion.band import BandFilter
from inercal.systems.aoa.fusion.loop import MOTION, NO_MOTIONS, OUTPUTS
from inercal.systems.aoa.fusion.problem import FusionProblem
from inercal.systems.aoa.fusion.run import FilterStart, FusionState, FusionTrace, Head, advance, initial
from inercal.systems.aoa.fusion.smoother import BLOCK, smooth
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.recording import Recording, later

KEPT = 2000
"""Number of rows, about, at which all states are kept for pictures."""

_STEEP = 50.0
"""Largest tangent of theta: near 90 deg roll and yaw are one, and the roll is that of the fusion."""

_BLOCK = 10_000
"""Rows whose states are all held at a time."""


@dataclass(frozen=True, eq=False)
class FusionResult:
    """Result of the fusion of n rows, causal or ``smoothed``; NaN in rows that were left out.

    ``theta``, ``u`` [rad], ``rate``, ``rate_u`` [rad/s] with standard uncertainties and ``acceleration`` [rad/s^2];
    ``roll`` and ``roll_u`` [rad] of the causal filter where it is estimated. ``innovations`` (n, N + 1) of
    accelerometers and gyro, of the causal filter, each over its standard deviation before the gate. ``states`` (k, m)
    and their standard deviations ``states_u`` at the times ``kept_t`` (k,) [s], in the order of the problem's names.
    ``state`` of the causal filter at the end. ``nis_mean`` is the mean of ``nis_count`` squared innovations, single
    spikes as far as the gate lets them through, after the first 2 s, or in the later half of less than 4 s. ``starts``
    are the rows at which the filter started, more than one where the angle was lost; ``seconds`` the time of the
    computation alone. ``trace`` of the causal filter, of the rows that are fused, with heads of blocks.
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
    state: FusionState
    nis_mean: float
    nis_count: int
    starts: tuple[int, ...]
    smoothed: bool
    seconds: float
    trace: FusionTrace
    roll: Array | None = None
    roll_u: Array | None = None


def estimate(
    recording: Recording, problem: FusionProblem, smoothed: bool = False, where: object = "t"
) -> FusionResult:
    """Angles of a recording, causal or from all of it; raises `RecordError` where time does not go on."""
    clock = time.perf_counter()
    if (of := band.filter_of(problem.band)) is not None:
        return replace(_limited(recording, problem, of, smoothed, where), seconds=time.perf_counter() - clock)
    return _estimate(recording, problem, smoothed, where, NO_MOTIONS)


def _limited(
    recording: Recording, problem: FusionProblem, of: BandFilter, smoothed: bool, where: object
) -> FusionResult:
    """The angles of a recording that is limited to a band: of the rows that are fused, carried on to all."""
    taken = later(recording.t, where=where)
    t, rows = recording.t[taken], recording.rows[taken]
    fused = (
        band.zero_phase(of, t, rows)
        if smoothed
        else band.causal(of, band.initial(of, rows.shape[1]), t, rows)
    )
    inner = replace(problem, band=WHOLE)
    motions = np.full((len(fused.t), MOTION), np.nan)
    result = _estimate(fused.recording(problem.count), inner, smoothed, where, motions)
    if smoothed:
        known = (result.theta, result.u, result.rate, result.rate_u, result.acceleration)
        angles, roll = between(fused.t, known, t), None
    else:
        # the rows by which the filter starts are answered, as they come, without an angle
        for start in result.starts:
            motions[start : start + LIMITS.starting_rows - 1] = np.nan
        there = fused.at >= 0
        angles, roll = np.full((len(t), OUTPUTS), np.nan), np.full((len(t), 2), np.nan)
        carried = carried_on(motions[fused.at[there]], t[there] - fused.t[fused.at[there]], problem.constants)
        angles[there], roll[there] = carried[:, :OUTPUTS], carried[:, OUTPUTS:]
        roll[:, 0] = principal(roll[:, 0])
    n, came = len(recording.t), taken[fused.came]
    motion, innovations = np.full((n, OUTPUTS), np.nan), np.full((n, problem.count + 1), np.nan)
    motion[taken], innovations[came] = angles, result.innovations
    rolls = np.full((n, 2), np.nan)
    if roll is not None:
        rolls[taken] = roll
    tracked = problem.spatial and not smoothed
    return replace(
        result,
        theta=motion[:, 0],
        u=motion[:, 1],
        rate=motion[:, 2],
        rate_u=motion[:, 3],
        acceleration=motion[:, 4],
        innovations=innovations,
        starts=tuple(int(came[k]) for k in result.starts),
        roll=rolls[:, 0] if tracked else None,
        roll_u=rolls[:, 1] if tracked else None,
    )


def _estimate(
    recording: Recording, problem: FusionProblem, smoothed: bool, where: object, motions: Array
) -> FusionResult:
    """Angles of a recording without a band; ``motions`` as of `inercal.systems.aoa.fusion.run.advance`."""
    clock = time.perf_counter()
    taken = later(recording.t, where=where)
    whole = len(taken) == len(recording.t)
    t = recording.t if whole else recording.t[taken]
    every = max(1, len(t) // KEPT)
    kept = np.full(((len(t) + every - 1) // every, 2 * problem.size), np.nan)
    if smoothed:
        rows, rolls = (recording.rows if whole else recording.rows[taken]), None
        state, trace = advance(initial(problem), problem, t, rows, last=True, motions=motions, block=BLOCK)
        angles = smooth(problem, t, rows, trace, kept, every)
    else:
        chosen = recording if whole else recording.of(taken)
        state, trace, rolls = _causal(chosen, problem, kept, every, motions)
        angles = trace.out[:, :OUTPUTS]
    seconds = time.perf_counter() - clock
    innovations = trace.out[:, OUTPUTS:]
    settled = int(np.argmax(t - t[:1] >= min(LIMITS.settling_time, (t[-1] - t[0]) / 2.0))) if len(t) else 0
    # column by column, which is a few copies of one and not of all
    squared = [_without_spikes(each[settled:], problem.constants.gate) for each in innovations.T]
    power, count = sum(each for each, _ in squared), sum(each for _, each in squared)
    motion = angles
    if not whole:
        motion, innovations = _at(taken, len(recording.t), angles), _at(taken, len(recording.t), innovations)
        rolls = None if rolls is None else _at(taken, len(recording.t), rolls)
    m = problem.size
    return FusionResult(
        theta=motion[:, 0],
        u=motion[:, 1],
        rate=motion[:, 2],
        rate_u=motion[:, 3],
        acceleration=motion[:, 4],
        innovations=innovations,
        kept_t=t[::every],
        states=kept[:, :m],
        states_u=kept[:, m:],
        state=state,
        nis_mean=power / count if count else float("nan"),
        nis_count=count,
        starts=tuple(int(taken[each.row]) for each in trace.starts),
        smoothed=smoothed,
        seconds=seconds,
        trace=trace,
        roll=None if rolls is None else rolls[:, 0],
        roll_u=None if rolls is None else rolls[:, 1],
    )


def _at(taken: NDArray[np.int64], n: int, values: Array) -> Array:
    """Columns (n, k) that hold ``values`` (m, k) in the rows ``taken``, NaN elsewhere."""
    out = np.full((n, values.shape[1]), np.nan)
    out[taken] = values
    return out


def _without_spikes(innovations: Array, gate: float) -> tuple[float, int]:
    """Sum and number of squared innovations (n,), of single spikes as far as the gate lets them: they say nothing
    against the rest."""
    with np.errstate(invalid="ignore"):
        squared = np.square(innovations)
        beyond = np.pad(squared > gate, 1)
    squared[beyond[1:-1] & ~beyond[:-2] & ~beyond[2:]] = gate
    finite = np.isfinite(squared)
    return float(np.sum(squared if finite.all() else squared[finite])), int(finite.sum())


def roll_of(problem: FusionProblem, kept: Array) -> Array:
    """Roll, in (-pi, pi], and its standard uncertainty (k, 2) [rad] from kept states (k, 2 m)."""
    k = problem.places.roll
    return np.column_stack([principal(kept[:, k]), kept[:, problem.size + k]])


def _causal(
    recording: Recording, problem: FusionProblem, kept: Array, every: int, motions: Array
) -> tuple[FusionState, FusionTrace, Array | None]:
    """The causal filter's state and trace, and roll (n, 2) where it is tracked; ``kept`` as of `advance`.

    Rows, and where the roll is tracked all states, are held for some rows at a time: else they would fill the memory.
    """
    state, done, t = initial(problem), 0, recording.t
    starts: list[FilterStart] = []
    heads: list[Head] = []
    out = np.empty((len(t), OUTPUTS + problem.count + 1))
    rolls = np.empty((len(t), 2)) if problem.spatial else None
    for a in range(0, max(1, len(t)), _BLOCK):
        b, held = min(a + _BLOCK, len(t)), len(state.held)
        rows, last, moved = recording.of(slice(a, b)).rows, b == len(t), motions[a - held : b]
        if rolls is None:
            state, trace = advance(
                state, problem, t[a:b], rows, kept, every, last, moved, block=BLOCK, first=done
            )
        else:
            states = np.full((held + b - a, 2 * problem.size), np.nan)
            state, trace = advance(state, problem, t[a:b], rows, states, 1, last, moved, block=BLOCK)
            each = states[-done % every : len(trace.out) : every]
            kept[-(-done // every) :][: len(each)] = each
            rolls[done : done + len(trace.out)] = roll_of(problem, states[: len(trace.out)])
        starts += [each._replace(row=each.row + done) for each in trace.starts]
        heads += [
            head._replace(rows=slice(head.rows.start + done, head.rows.stop + done)) for head in trace.heads
        ]
        out[done : done + len(trace.out)] = trace.out
        done += len(trace.out)
    return state, FusionTrace(out[:done], tuple(starts), tuple(heads)), rolls


def fusion_label(smoothed: bool, states: int) -> str:
    """Name of the fusion by its ``states`` (of three accelerometers): ``fusion 19``, ``smoothed 19``."""
    return f"{'smoothed' if smoothed else 'fusion'} {states}"


def of_fusion(filtered: FusionResult, states: int) -> Angles:
    """The angles of the fusion, named by its ``states``."""
    return Angles(
        fusion_label(filtered.smoothed, states), filtered.theta, filtered.u, filtered.rate, filtered.rate_u
    )


def tracked_roll(
    recording: Recording, problem: FusionProblem, filtered: FusionResult
) -> tuple[Array, Array] | None:
    """Roll (n,) and its standard uncertainty (n,) [rad] at each row, NaN where theta is; None where it is not tracked.

    The uncertainty of a smoothed roll is interpolated between the kept times.
    """
    if not problem.spatial:
        return None
    if filtered.roll is not None and filtered.roll_u is not None:
        return filtered.roll, filtered.roll_u
    k = problem.names.index("phi")
    finite = np.isfinite(filtered.states_u[:, k])
    roll, roll_u = np.full((2, len(recording.t)), np.nan)
    taken = later(recording.t)
    taken = taken[np.isfinite(filtered.theta[taken])]
    if not finite.any() or not len(taken):
        return roll, roll_u
    t, kept = recording.t[taken], filtered.kept_t[finite]
    phi = np.unwrap(filtered.states[finite, k])
    coarse = np.interp(t, kept, phi)
    tangent = np.tan(filtered.theta[taken])
    tangent = np.where(np.abs(tangent) < _STEEP, tangent, 0.0)
    p, y = np.nan_to_num(recording.turns[taken]).T
    speed = p + (np.nan_to_num(recording.gyro[taken]) * np.sin(coarse) - y * np.cos(coarse)) * tangent
    run = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(t))])
    fine = run + np.interp(t, kept, phi - np.interp(kept, t, run))
    roll[taken] = principal(fine)
    roll_u[taken] = np.interp(t, kept, filtered.states_u[finite, k])
    return roll, roll_u
