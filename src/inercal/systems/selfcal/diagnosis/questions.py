"""Questions about a platform's calibration, without a list of faults: what errs, and by what it errs.

Values err by order; gyros, accelerometers and encoders by place, by the reading and by history; and the rig has states
that are not fitted. Courses come from angles and commanded rates, never from what accelerometers read: their noise
would be taken for a fault. A course is 0 where its fault does nothing.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.rotations import conjugate, rotate
from inercal.foundation.inference.scores import ErrorColumns
from inercal.systems.selfcal.diagnosis.catalogue import (
    LATE,
    WANDERING,
    WORDS,
    Naming,
    directions,
    late,
    of_asymmetry,
    of_commands,
    of_encoder,
    of_kind,
    of_latitude,
    of_wandering,
)
from inercal.systems.selfcal.filters.problem import FilterProblem
from inercal.systems.selfcal.filters.residuals import gimbals
from inercal.systems.selfcal.filters.whitened import BLOCKS, PassErrors
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.kinematics import axes_of
from inercal.systems.selfcal.platform.recording import Recording
from inercal.systems.selfcal.platform.states import ALL, KIND_OF, STATES, TEMPERATURE, WAVE, twins

_SENSORS: Final = ("gyro", "accelerometer", "encoder")

_TURNS: Final = {
    1: "once a turn",
    2: "twice a turn",
    3: "3 times a turn",
    4: "4 times a turn",
    8: "8 times a turn",
}

_LAGS: Final = (10.0, 60.0)
"""Times [s] by which a reading follows its load, and the square of it."""

_SMOOTHED: Final = 101
"""Rows over which angles as read correct those that the rates make: at rest they vary with their noise alone."""

_STEPS: Final = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8)
"""Places of steps that are asked for, over the length of a record."""


_ASYMMETRY: Final = "The accelerometers differ in scale between their signs"

_SWAY: Final = "sway slowly"

Waves = Sequence[tuple[int, int]]
"""Joints 0, 1, 2 and numbers of periods a turn."""


class RowSignals(NamedTuple):
    """Signals of a recording that courses are made of: ``load`` (9, n) of gyros, accelerometers and encoders over the
    largest of a sensor, ``change`` (9, n) of it from row to row, what follows it with a lag, ``lagging`` (9, n), and
    its square, ``warm`` (9, n); angles ``th`` (n, 3) [rad] and the ``sense`` (n, 3) in which each joint turns; ``top``
    (3,) the largest load of gyros [rad/s], accelerometers [m/s^2] and encoders [rad/s]."""

    load: Array
    change: Array
    lagging: Array
    warm: Array
    th: Array
    sense: Array
    top: Array

    def rows(self, rows: slice) -> RowSignals:
        """Some rows."""
        load, change, lagging, warm = (signal[:, rows] for signal in self[:4])
        return RowSignals(load, change, lagging, warm, self.th[rows], self.sense[rows], self.top)


class PlatformQuestion(NamedTuple):
    """A question: the ``cell`` order, place, reading or history, or ``rig``; its ``sentence`` without a full stop;
    and the ``columns`` of the pass. ``naming`` says the cause where physics has one, believed up to a size ``most``."""

    cell: str
    sentence: str
    columns: ErrorColumns
    naming: Naming | None = None
    most: float = math.inf


@dataclass(frozen=True, eq=False)
class PassQuestions:
    """PassErrors of a pass, and the questions about their columns."""

    errors: PassErrors
    questions: tuple[PlatformQuestion, ...]


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
    tops = np.array([max(float(np.abs(x).max()), 1e-300) for x in (w, f, speed)])
    load = np.concatenate([(x / top).T for x, top in zip((w, f, speed), tops, strict=True)])
    shares = [min(float(np.median(np.diff(t))) / lag, 0.5) for lag in _LAGS]
    lagging, warm = (_lagging(x, share) for share, x in zip(shares, (load, load**2), strict=True))
    return RowSignals(load, np.diff(load, prepend=load[:, :1]), lagging - load, warm, th, sense, tops)


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
    """Errors of the rig that a problem does not fit, of those that are constant."""
    warm = recording.warm is not None and float(np.ptp(recording.warm)) > 0.0
    named = ALL[18 : WAVE + 2 * len(problem.states.harmonics)]
    return tuple(
        name for name in named if name not in problem.names and (warm or KIND_OF[name] not in TEMPERATURE)
    )


def asked(recording: Recording, problem: FilterProblem, waves: Waves = ()) -> PassQuestions:
    """All errors and questions about a recording and its problem, with those about ``waves``: joints whose encoders
    seem to err so many times a turn."""
    harmonics = problem.states.harmonics
    problem = replace(problem, vector=replace(problem.states, harmonics=(*harmonics, *waves)))
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
    return PassQuestions(
        errors,
        (
            *_of_courses(places, float(np.median(recording.dt)), signals.top),
            *_of_site(problem, len(rig)),
            *_of_rig(recording, problem, rig, len(waves)),
            *_by_order(problem),
        ),
    )


def _of_courses(
    places: Mapping[tuple[str, str], list[int]], dt: float, top: Array
) -> Iterator[PlatformQuestion]:
    """Questions about the courses at ``places`` of a pass; ``dt`` [s] between rows, ``top`` as of `RowSignals`."""
    for (cell, sentence), at in places.items():
        columns, naming = ErrorColumns(np.array(at)), None
        if sentence == _ASYMMETRY:
            naming = of_asymmetry(2.0 / float(top[1]))
        for joint, axis in enumerate("xyz"):
            for order, words in _TURNS.items():
                if sentence == f"The reading of encoder {axis} changes with th_{axis} {words}":
                    naming = of_encoder(joint, order)
        yield PlatformQuestion(cell, sentence, columns, naming)
        if sentence == "The gyros keep a part of the reading before":
            alike = ErrorColumns(np.array(at), by=np.ones((3, 1)))
            yield PlatformQuestion(
                "history", "The commands are late", alike, of_commands(-dt / float(top[0]))
            )


def _of_site(problem: FilterProblem, first: int) -> Iterator[PlatformQuestion]:
    """The earth rate, whose columns begin at ``first``."""
    at = first + np.arange(3)
    by = np.stack(directions(problem.world), axis=1)
    sentence = "The earth rate is not that of the latitude"
    yield PlatformQuestion("place", sentence, ErrorColumns(at, by=by), of_latitude(problem.world))


def _of_rig(
    recording: Recording, problem: FilterProblem, rig: tuple[str, ...], waves: int
) -> Iterator[PlatformQuestion]:
    """Errors of the rig, without those that nobody can tell from others of them on this path; the last ``waves``
    harmonics are asked for, of those before encoders are asked by place."""
    still = np.nanmax(recording.th, axis=0) - np.nanmin(recording.th, axis=0) < LIMITS.still_joint
    axes = axes_of(recording.th[0], problem.world.axes, problem.world.signs).tolist()
    hidden = twins(tuple(WORDS), np.flatnonzero(still).tolist(), axes)
    for kind in WORDS:
        names = tuple(name for name in STATES[kind].parameters if name in rig and name not in hidden)
        if not names or any(name in problem.names for name in STATES[kind].parameters):
            continue
        sentence = f"The rig has {STATES[kind].words} that are no states"
        columns = ErrorColumns(np.array([rig.index(name) for name in names]))
        yield PlatformQuestion("rig", sentence, columns, of_kind(kind, names))
    for name in LATE:
        if name in rig:
            columns = ErrorColumns(np.array([rig.index(name)]))
            most = LIMITS.small_delay
            yield PlatformQuestion("rig", f"The {LATE[name]} are late", columns, late(name), most)
    harmonics = problem.states.harmonics
    for k in range(len(harmonics) - waves, len(harmonics)):
        at = np.array([rig.index(f"harmonic_{k + 1}_{part}") for part in ("sin", "cos")])
        sentence = "The reading of an encoder changes with its angle"
        yield PlatformQuestion("place", sentence, ErrorColumns(at), of_encoder(*harmonics[k]))


def _by_order(problem: FilterProblem) -> Iterator[PlatformQuestion]:
    """Drift, bend, sway, settling and steps of the fitted values, by their kind."""
    tau = (np.arange(BLOCKS) + 0.5) / BLOCKS
    x = 2.0 * tau - 1.0
    shapes: Mapping[str, Array] = {
        "drift over the record": x[:, None],
        "bend over the record": np.stack([x, x**2, x**3], axis=1),
        "settle at the start": np.exp(-tau[:, None] / [0.05, 0.25]),
        _SWAY: np.cos(math.pi * tau[:, None] * np.arange(1, 7)),
    } | {f"step at {100 * at:.0f} % of the record": (tau > at).astype(float)[:, None] for at in _STEPS}
    kinds = np.array(
        [KIND_OF[name] for name, walks in zip(problem.names, problem.states.walks, strict=True) if not walks]
    )
    for kind in dict.fromkeys(kinds.tolist()):
        for words, course in shapes.items():
            wanders = kind in WANDERING and words == _SWAY
            naming = of_wandering(kind, course) if wanders else None
            columns = ErrorColumns(np.flatnonzero(kinds == kind), course)
            yield PlatformQuestion("order", f"The values {kind} {words}", columns, naming)
