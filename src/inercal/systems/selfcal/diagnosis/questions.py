"""Questions about a platform's calibration, without a list of faults: what errs, and by what it errs.

Values err by order; gyros, accelerometers and encoders by place, by the reading and by history; and the rig has states
that are not fitted. Courses come from angles and commanded rates, never from what accelerometers read: their noise
would be taken for a fault. A course is 0 where its fault does nothing.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.rotations import conjugate, rotate
from inercal.foundation.inference.asked_pass import PassQuestion
from inercal.foundation.inference.scores import ErrorColumns
from inercal.systems.selfcal.filters.problem import FilterProblem
from inercal.systems.selfcal.filters.residuals import gimbals
from inercal.systems.selfcal.filters.whitened import BLOCKS, PassErrors
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.recording import Recording
from inercal.systems.selfcal.platform.states import ALL, KIND_OF, STATES, TEMPERATURE, WAVE

_SENSORS: Final = ("gyro", "accelerometer", "encoder")

_TURNS: Final = {
    1: "once a turn",
    2: "twice a turn",
    3: "3 times a turn",
    4: "4 times a turn",
    8: "8 times a turn",
}

_NAMED: Final = (
    "The reading of encoder x changes",
    "The reading of encoder y changes",
    "The reading of encoder z changes",
    "The gyros differ in scale between",
    "The accelerometers differ in scale between",
    "The accelerometers curve",
)
"""Beginnings of the sentences of questions that a hypothesis says, too."""

_LAGS: Final = (10.0, 60.0)
"""Times [s] by which a reading follows its load, and the square of it."""

_SMOOTHED: Final = 101
"""Rows over which angles as read correct those that the rates make: at rest they vary with their noise alone."""

_STEPS: Final = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8)
"""Places of steps that are asked for, over the length of a record."""


class RowSignals(NamedTuple):
    """Signals of a recording that courses are made of: ``load`` (9, n) of gyros, accelerometers and encoders over the
    largest of a sensor, ``change`` (9, n) of it from row to row, what follows it with a lag, ``lagging`` (9, n), and
    its square, ``warm`` (9, n); angles ``th`` (n, 3) [rad] and the ``sense`` (n, 3) in which each joint turns."""

    load: Array
    change: Array
    lagging: Array
    warm: Array
    th: Array
    sense: Array

    def rows(self, rows: slice) -> RowSignals:
        """Some rows."""
        load, change, lagging, warm = (signal[:, rows] for signal in self[:4])
        return RowSignals(load, change, lagging, warm, self.th[rows], self.sense[rows])


@dataclass(frozen=True, eq=False)
class PassQuestions:
    """PassErrors of a pass, and the questions about their columns."""

    errors: PassErrors
    questions: tuple[PassQuestion, ...]


def _signals(recording: Recording, problem: FilterProblem) -> RowSignals:
    """The signals of a recording."""
    t, th = recording.t, np.array(recording.th)
    for j in range(3):
        ok = np.isfinite(th[:, j])
        th[:, j] = np.interp(t, t[ok], th[ok, j])
    q, joints = gimbals(th, problem.world)
    f, earth = rotate(conjugate(q), problem.world.up), rotate(conjugate(q), problem.world.earth)
    w = np.vstack([recording.rate[:1], recording.rate])
    square = np.einsum("kji,kjl->kil", joints, joints) + 1e-6 * np.eye(3)  # no infinite speed at gimbal lock
    speed = np.linalg.solve(square, np.einsum("kji,kj->ki", joints, w - earth)[:, :, None])[:, :, 0]
    turned = np.vstack([np.zeros(3), np.cumsum(speed[1:] * np.diff(t)[:, None], axis=0)])
    th = turned + _smoothed(th - turned, _SMOOTHED)  # as driven, without noise
    top = max(float(np.abs(speed).max()), 1e-300)
    sense = np.where(np.abs(speed) > 0.05 * top, np.sign(speed), 0.0)
    load = np.concatenate([(x / max(float(np.abs(x).max()), 1e-300)).T for x in (w, f, speed)])
    shares = [min(float(np.median(np.diff(t))) / lag, 0.5) for lag in _LAGS]
    lagging, warm = (_lagging(x, share) for share, x in zip(shares, (load, load**2), strict=True))
    return RowSignals(load, np.diff(load, prepend=load[:, :1]), lagging - load, warm, th, sense)


def _smoothed(x: Array, n: int) -> Array:
    """Means (m, k) of n rows about each row of x (m, k), the ends repeated."""
    sums = np.cumsum(np.pad(x, [(n // 2 + 1, n - 1 - n // 2), (0, 0)], mode="edge"), axis=0)
    return np.asarray((sums[n:] - sums[:-n]) / n)


def _lagging(x: Array, share: float) -> Array:
    """Exponentially weighted means (k, m) of x (k, m), of which each row takes a ``share`` anew."""
    from scipy.linalg import solve_banded

    n = x.shape[1]
    band = np.stack([np.ones(n), np.full(n, share - 1.0)])
    return np.asarray(solve_banded((1, 0), band, share * x.T).T)


def _courses(of: RowSignals, channel: int, joints: tuple[int, ...]) -> Iterator[tuple[str, str, list[Array]]]:
    """Cell, sentence and courses of the questions about a channel, which depends on the angles of some joints."""
    sensor, axis = _SENSORS[channel // 3], "xyz"[channel % 3]
    what = f"The reading of encoder {axis}" if channel >= 6 else f"The {sensor} biases"
    verb = "s" if channel >= 6 else ""
    load, change = of.load[channel], of.change[channel]
    for j in joints:
        for k, words in _TURNS.items():
            x = k * of.th[:, j]
            yield "place", f"{what} change{verb} with th_{'xyz'[j]} {words}", [np.cos(x), np.sin(x)]
        yield "history", f"{what} depend{verb} on the sense in which th_{'xyz'[j]} turns", [of.sense[:, j]]
    if channel >= 6:
        yield "history", f"{what} lags behind its joint", [load]
        return
    whole, size = f"The {sensor}s", np.abs(load)
    yield "reading", f"{whole} differ in scale between their signs", [size]
    yield "reading", f"{whole} step where they change their sign", [np.sign(np.where(size > 1e-3, load, 0.0))]
    yield "reading", f"{whole} curve over their range", [load**2, load**3]
    yield "reading", f"{whole} differ above half their range", [load * (size > 0.5)]
    yield "reading", f"{whole} differ in the middle of their range", [load * (size < 0.2)]
    yield "history", f"{whole} keep a part of the reading before", [change]
    sense = np.sign(np.where(np.abs(change) > 1e-4, change, 0.0))
    yield "history", f"{whole} depend on the sense of change", [sense]
    yield "history", f"{whole} follow the load with a lag", [of.lagging[channel]]
    yield "history", f"{whole} follow the square of the load with a lag", [of.warm[channel]]


def rig_names(recording: Recording, problem: FilterProblem) -> tuple[str, ...]:
    """PassErrors of the rig that a problem does not fit, of those that are constant."""
    warm = recording.warm is not None and float(np.ptp(recording.warm)) > 0.0
    named = ALL[18 : WAVE + 2 * len(problem.states.harmonics)]
    return tuple(
        name for name in named if name not in problem.names and (warm or KIND_OF[name] not in TEMPERATURE)
    )


def asked(recording: Recording, problem: FilterProblem) -> PassQuestions:
    """All errors and questions about a recording and its problem."""
    signals, rig = _signals(recording, problem), rig_names(recording, problem)
    turning = tuple(j for j in range(3) if float(np.ptp(signals.th[:, j])) > LIMITS.place_turn)

    def of_channels(some: RowSignals) -> Iterator[tuple[int, str, str, list[Array]]]:
        for channel in range(9):
            joints = turning if channel < 6 else tuple(j for j in turning if j == channel - 6)
            if channel < 6 or joints:
                for cell, sentence, made in _courses(some, channel, joints):
                    yield channel, cell, sentence, made

    counts, places = np.zeros(9, dtype=np.int64), dict[tuple[str, str], list[int]]()
    first = len(rig) + 6
    for channel, cell, sentence, made in of_channels(signals.rows(slice(0, 1))):
        begin = first + int(counts.sum())
        places.setdefault((cell, sentence), []).extend(range(begin, begin + len(made)))
        counts[channel] += len(made)

    def courses(rows: slice) -> Array:
        found = [x for _, _, _, made in of_channels(signals.rows(rows)) for x in made]
        return np.ascontiguousarray(np.stack(found, axis=1))

    errors = PassErrors(rig, True, tuple(counts.tolist()), courses)
    questions = [
        PassQuestion(cell, sentence, ErrorColumns(np.array(at)), sentence.startswith(_NAMED))
        for (cell, sentence), at in places.items()
    ]
    kinds = np.array([KIND_OF[name] for name in rig])
    for kind in dict.fromkeys(kinds.tolist()):
        if kind == "harmonics":  # of angles as read; those of encoders are asked by place
            continue
        sentence = f"The rig has {STATES[kind].words} that are no states".replace(
            ", in the extended model", ""
        )
        questions.append(PassQuestion("rig", sentence, ErrorColumns(np.flatnonzero(kinds == kind)), True))
    return PassQuestions(errors, (*questions, *_by_order(problem)))


def _by_order(problem: FilterProblem) -> Iterator[PassQuestion]:
    """Drift, bend, sway, settling and steps of the fitted values, by their kind."""
    tau = (np.arange(BLOCKS) + 0.5) / BLOCKS
    x = 2.0 * tau - 1.0
    shapes: Mapping[str, Array] = {
        "drift over the record": x[:, None],
        "bend over the record": np.stack([x, x**2, x**3], axis=1),
        "settle at the start": np.exp(-tau[:, None] / [0.05, 0.25]),
        "sway slowly": np.cos(math.pi * tau[:, None] * np.arange(1, 7)),
    } | {f"step at {100 * at:.0f} % of the record": (tau > at).astype(float)[:, None] for at in _STEPS}
    kinds = np.array(
        [KIND_OF[name] for name, walks in zip(problem.names, problem.states.walks, strict=True) if not walks]
    )
    for kind in dict.fromkeys(kinds.tolist()):
        for words, course in shapes.items():
            yield PassQuestion(
                "order",
                f"The values {kind} {words}",
                ErrorColumns(np.flatnonzero(kinds == kind), course),
                kind in ("kg0", "ka0"),
            )
