"""The one pass that judges a recording: what each question's error does to innovations, angle and coefficients."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.inference.asked_pass import (
    PassAnswer,
    PassQuestion,
    answers,
    asked,
    blind_of,
    speaking,
)
from inercal.foundation.inference.scores import ErrorColumns, PassSums
from inercal.systems.aoa.diagnosis.questions import PredictedMotion, about_sensors, courses_of
from inercal.systems.aoa.fusion import loop
from inercal.systems.aoa.fusion.band import fused
from inercal.systems.aoa.fusion.filter_result import FusionResult
from inercal.systems.aoa.fusion.problem import FusionProblem
from inercal.systems.aoa.fusion.responses import respond
from inercal.systems.aoa.fusion.run import unknown
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.recording import Recording, later
from inercal.systems.aoa.settings import AoaSettings

ANGLE = "theta"

_LOOK: Final = {
    "order": "Look for warm-up, a loose mount, or a supply that changed.",
    "place": "Look for a cable that pulls, a sting that bends, or an axis of a sensor that is not as stated.",
    "reading": "Look for the end of a range, a switched range, or a term that the sensor has and the study has not.",
    "history": "Look for a filter or a delay within the sensor, hysteresis, or heat by load.",
    "rig": "Correct it in the study.",
}


@dataclass(frozen=True, eq=False)
class AnglePass:
    """A pass along a filter's own: the coefficients are its states, so that none is left in the ``sums``.

    ``products`` (m, m) of what one unit of each column does to theta, over its u, mean after the settling time;
    ``ends`` (p, m) what it does to the coefficients ``names`` at the end, over their u. ``by_constants`` (p, p)
    products of the covariances of theta with the coefficients, mean after the settling time; ``by_gravity`` (1 + p,)
    change of theta, rms, and of the coefficients with gravity [m/s^2]. ``faded``: constants faded on the way.
    ``slow`` (N + 1,) squares of innovations summed over a tenth of a second, of each sensor, and ``slow_count``, their
    number.
    """

    names: tuple[str, ...]
    questions: tuple[PassQuestion, ...]
    sums: PassSums
    products: Array
    ends: Array
    by_constants: Array
    by_gravity: Array
    faded: bool
    slow: Array
    slow_count: int

    def chance(self, answer: PassAnswer) -> float:
        """Chance of an answer where innovations that it leaves are larger than their noise over some groups: vibration
        of low frequency that the model has not, such as a slight plunge, is no fault of a sensor."""
        from scipy.special import chdtrc

        explained = answer.score.explained
        left = float(((self.slow - explained) / max(self.slow_count, 1)).max())
        return float(chdtrc(answer.score.degrees, explained / max(left, 1.0)))

    def reach(self, columns: ErrorColumns) -> Array:
        """Shift (1 + p, k) of theta, rms, and of the coefficients by one unit of each column, in u."""
        by = np.eye(len(columns.at)) if columns.by is None else columns.by
        angle = by.T @ self.products[np.ix_(columns.at, columns.at)] @ by
        return np.vstack([np.sqrt(np.maximum(np.diag(angle), 0.0)), self.ends[:, columns.at] @ by])

    def shift(self, columns: ErrorColumns, b: Array) -> Array:
        """Shift (1 + p,) of theta, rms, and of the coefficients by an error of sizes ``b`` (k,), in u."""
        by = b if columns.by is None else columns.by @ b
        angle = float(by @ self.products[np.ix_(columns.at, columns.at)] @ by)
        return np.append(np.sqrt(max(angle, 0.0)), self.ends[:, columns.at] @ by)


def pass_of(
    recording: Recording, problem: FusionProblem, settings: AoaSettings, filtered: FusionResult
) -> AnglePass | None:
    """The pass along the ``filtered`` rows of a recording; None where the filter has no angle, or lost it."""
    recording, problem = fused(recording, problem)
    trace = filtered.trace
    if len(trace.starts) != 1 or not trace.heads or not np.isfinite(trace.out[-1, 0]):
        return None
    taken = later(recording.t)
    t, rows = recording.t[taken], recording.of(taken).rows
    table, start = about_sensors(settings, problem.spatial), trace.starts[0].row
    names, at = tuple(problem.nuisances), list(problem.nuisances.values())
    n, m, channels = problem.size, int(table.low[-1]), problem.count + 1
    step = float(np.median(np.diff(t)))
    every = max(1, round(LIMITS.summed_time / step))
    some = np.arange(start + 1, len(t), max(1, len(t) // LIMITS.ranged_rows))
    known = np.zeros(len(t))
    for head in trace.heads:
        known[head.rows] = np.sqrt(head.belief.P[2, 2])
    courses = courses_of(_predicted(t, trace.out, some, known[some]), settings)
    S, delay = np.zeros((n, m)), problem.constants.common_delay
    squares, count, across = 0.0, 0, np.zeros(m)
    products, of_angle, settled = np.zeros((m, m)), np.zeros((m, m)), 0
    by_constants, lean = np.zeros((len(at), len(at))), 0.0
    slow, slow_count, long = (
        np.zeros(channels),
        0,
        5,
    )  # groups: vibration of low frequency shows over a tenth of a second
    longest = max(head.rows.stop - head.rows.start for head in trace.heads)
    memory = loop.memory(longest, n, len(problem.places.moving), problem.count)
    out, dt = np.empty((longest, loop.OUTPUTS + channels)), np.diff(t, prepend=t[:1])
    dt[start] = 0.0
    for heads in (trace.heads[a : a + 16] for a in range(0, len(trace.heads), 16)):
        begin = heads[0].rows.start
        some = np.arange(begin, heads[-1].rows.stop)
        made = courses(_predicted(t, trace.out, some, known[some]))
        for block, before, F in heads:
            if F is not None:
                S = np.ascontiguousarray(F @ S)
            if block.start == start:
                S[unknown(problem)] = 0.0
            belief = loop.Belief(*(part.copy() for part in before))
            part = loop.FusedRows(dt[block], rows[block])
            done = loop.advance(belief, part, problem.model, out, memory=memory)
            k = np.arange(block.start, block.start + done)
            group = (k - block.start) // every
            groups = int(group[-1]) + 1
            z, X = np.zeros((groups, channels)), np.zeros((groups, channels, m))
            angle = np.zeros((groups, m))
            own = made[block.start - begin : block.start - begin + done]
            respond(S, memory, problem.places.moving, table.low, own, group, z, X, angle)
            read = np.isfinite(out[:done, loop.OUTPUTS :])
            first = np.searchsorted(group, np.arange(groups))
            seen = np.add.reduceat(read.astype(float), first, axis=0)
            root = np.sqrt(np.maximum(seen, 1.0))
            begun = k[first] >= start + LIMITS.starting_rows
            of_groups = (z / root)[begun]
            whole = of_groups[: len(of_groups) // long * long].reshape(-1, long, channels).sum(axis=1)
            slow += np.sum(np.square(whole), axis=0) / long
            slow_count += len(whole)
            white = of_groups.ravel()
            columns = (X / root[:, :, None])[begun].reshape(-1, m).astype(np.float32)
            squares += float(white @ white)
            count += int((seen[begun] > 0.0).sum())
            across += white.astype(np.float32) @ columns
            products += columns.T @ columns
            last = np.append(first[1:], done) - 1
            judged = (t[k[last]] - t[0] >= LIMITS.settling_time) & (out[last, 1] > 0.0)
            by_u = (angle[judged] / out[last[judged], 1][:, None]).astype(np.float32)
            of_angle += by_u.T @ by_u
            settled += int(judged.sum())
            lean += float(np.sum(np.square(angle[judged][:, table.gravity].sum(axis=1))))
            of_theta = memory.after[last[judged], 1] + delay * memory.after[last[judged], 2]
            by_constants += of_theta[:, at].T @ of_theta[:, at]
    if not (settled and count and np.isfinite(products).all() and np.isfinite(S).all()):
        return None
    u = np.sqrt(np.diag(belief.P)[at])
    whole = np.array([[[squares]]])
    sums = PassSums(np.zeros(0), np.zeros(0), whole, across[None, None, :], products, squares, count)
    by_gravity = np.append(np.sqrt(lean / settled), S[at][:, table.gravity].sum(axis=1))
    return AnglePass(
        (ANGLE, *names),
        table.questions,
        sums,
        of_angle / settled,
        S[at] / u[:, None],
        by_constants / settled,
        by_gravity,
        any(head.F is not None for head in trace.heads),
        slow,
        slow_count,
    )


def heard(passed: AnglePass) -> Finding | None:
    """The finding of the question that speaks (`inercal.foundation.inference.asked_pass`), if any does."""

    def shifts(answer: PassAnswer) -> Array:
        return passed.shift(answer.question.columns, answer.score.b)

    hits, limit = answers(passed.sums, passed.questions)
    hits = [hit for hit in hits if passed.chance(hit) < limit]
    return speaking(passed.sums, hits, limit, passed.names, shifts, _LOOK)


def hidden(passed: AnglePass) -> list[Finding]:
    """The finding about faults that the motion of a recording would not show."""
    return list(blind_of(asked(passed.sums, passed.questions), passed.names, passed.reach))


def _predicted(t: Array, out: Array, k: NDArray[np.int64], acceleration_u: Array) -> PredictedMotion:
    """The motion at rows ``k`` (b,) as the rows before them have it, as far as it is more than noise; the angular
    acceleration is known to ``acceleration_u`` (b,) [rad/s^2]."""
    before, earlier = np.maximum(k - 1, 0), np.maximum(k - 2, 0)
    theta, w, w_u, al = (np.nan_to_num(out[before, c]) for c in (0, 2, 3, 4))
    dt = t[k] - t[before]
    jerk = (al - np.nan_to_num(out[earlier, 4])) / np.maximum(t[before] - t[earlier], 1e-9)
    part = (t[k] - t[0]) / max(float(t[-1] - t[0]), 1e-300)
    plain = theta + w * dt + 0.5 * al * dt * dt
    shown = _shown(al, acceleration_u)
    return PredictedMotion(plain, _shown(w + al * dt, w_u), shown, jerk * (shown != 0.0), part, dt)


def _shown(x: Array, u: Array) -> Array:
    """Values as far as they are more than noise of size ``u``, as the filter takes them."""
    squared = np.square(x)
    return x * np.maximum(0.0, 1.0 - 9.0 * np.square(u) / np.maximum(squared, 1e-300))
