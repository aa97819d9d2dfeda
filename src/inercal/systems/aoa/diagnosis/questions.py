"""Questions about a measured angle, without a list of faults: what a sensor does wrong, and by what.

Each sensor may err by order (time), by place (the angle), by its reading, and by history (what came before); and the
study may state it wrongly, or the site. Errors are columns of readings (`inercal.systems.aoa.fusion.responses`). They
are made of the motion that the filter predicts from the rows before, never of the reading itself: its noise would be
taken for a fault.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.inference.asked_pass import PassQuestion, Sized
from inercal.foundation.inference.limits import LIMITS as OF_JUDGE
from inercal.foundation.inference.scores import ErrorColumns
from inercal.foundation.units import STANDARD_GRAVITY
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.settings import AoaSettings

EDGES: Final = np.array([0.0, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9])
"""Beginnings of the blocks of time, over the length of a recording, within which an error of order is constant."""

_STEPS: Final = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8)

GYRO_SCALE: Final = "The scale of the gyro"
"""The question whether a gyro has another scale than its prior allows."""

_LAGS: Final = (0.3, 3.0)
"""Times [s] by which a reading follows its load, and the square of it."""

_TURNS: Final = {1: "once a turn", 2: "twice a turn", 3: "3 times a turn", 4: "4 times a turn"}


class PredictedMotion(NamedTuple):
    """Motion at rows (b,): ``theta`` [rad], ``rate``, ``acceleration`` and ``jerk`` in SI, ``part`` of the recording
    from 0 to 1, and ``dt`` [s] since the row before."""

    theta: Array
    rate: Array
    acceleration: Array
    jerk: Array
    part: Array
    dt: Array


class SensorSignals(NamedTuple):
    """Expected readings at rows (b,) of a motion, accelerometers first, then the gyro: ``y`` (N + 1, b), its
    ``change`` per second and that of this, ``bend``; of accelerometers (N, b) the derivatives by their ``axis`` [rad]
    and ``position`` [m] and by ``gravity`` [m/s^2], and what a mean square ``yaw`` [rad^2/s^2] and a mean square
    ``roll`` [rad^2] do to them."""

    y: Array
    change: Array
    bend: Array
    axis: Array
    position: Array
    gravity: Array
    yaw: Array
    roll: Array


def signals(settings: AoaSettings, motion: PredictedMotion) -> SensorSignals:
    """The signals of a model that pitches at its stated roll."""
    layout, g, c = settings.layout, settings.site.gravity, settings.attitude.level
    sine, cosine, w, al = np.sin(motion.theta), np.cos(motion.theta), motion.rate, motion.acceleration
    ca, sa = np.cos(layout.angle)[:, None], np.sin(layout.angle)[:, None]
    r, z = layout.r[:, None], layout.z[:, None]
    fx, fz = g * sine - r * w**2 - c * z * al, c * (g * cosine + r * al) - c * c * z * w**2
    slope = g * (ca * cosine + c * sa * sine)
    curve = g * (ca * sine - c * sa * cosine)
    return SensorSignals(
        np.vstack([ca * fx - sa * fz, c * w]),
        np.vstack([slope * w, c * al]),
        np.vstack([slope * al - curve * w**2, c * motion.jerk]),
        -sa * fx - ca * fz,
        -ca * w**2 - c * sa * al,
        ca * sine - c * sa * cosine,
        -r * (cosine**2 * ca + sine * cosine * sa),
        0.5 * g * c * sa * cosine,
    )


class SensorRanges(NamedTuple):
    """Ranges (N + 1, 1) of the sensors' predictions over a recording: the largest ``size``; over it the ``middle`` of
    their sizes, and the readings ``low`` and ``high`` beyond which they are at an end; the largest ``change`` per
    second. Each 1 where it is many times the noise of a reading, so that it means something, else 0: how ``wide`` they
    range, their ``load``, and the derivative of accelerometers by their ``axis`` (N, 1).
    """

    size: Array
    middle: Array
    low: Array
    high: Array
    change: Array
    wide: Array
    load: Array
    axis: Array

    @classmethod
    def of(cls, signal: SensorSignals, noise: Array) -> SensorRanges:
        """The ranges of signals at some rows, each not below its ``noise`` (N + 1, 1)."""
        size = np.maximum(np.abs(signal.y).max(axis=1, keepdims=True), noise)
        y = signal.y / size
        low, high = np.quantile(y, [0.15, 0.85], axis=1, keepdims=True)
        middle = np.median(np.abs(y), axis=1, keepdims=True)
        change = np.abs(signal.change).max(axis=1, keepdims=True)
        lean = np.abs(signal.axis).max(axis=1, keepdims=True)
        sizes = (np.ptp(signal.y, axis=1, keepdims=True), size, lean)
        shown = [(x > OF_JUDGE.least_range * noise[: len(x)]).astype(float) for x in sizes]
        return cls(size, middle, low, high, change, *shown)


@dataclass(eq=False)
class CourseMaker:
    """Makes the courses of a recording's questions, chunk after chunk: readings follow their load with a lag, which
    ``lagging`` (4, N + 1) carries on."""

    settings: AoaSettings
    ranges: SensorRanges
    lagging: Array | None = None

    def __call__(self, motion: PredictedMotion) -> Array:
        """Courses (b, m) of the next rows."""
        of, blocks = signals(self.settings, motion), len(EDGES)
        block = np.searchsorted(EDGES, motion.part, side="right") - 1
        shapes, count = self._shapes(of, motion.dt), len(of.axis)
        x = np.array(list(_TURNS))[:, None] * motion.theta
        waves = np.vstack([np.cos(x), np.sin(x)])
        made = np.zeros((count * (3 * blocks + 27) + 2 * blocks + 24, len(block)))
        row, at, ranges = np.arange(len(block)), 0, self.ranges
        for i in range(count + 1):
            for by in (1.0, ranges.load[i] * of.y[i], *((ranges.axis[i] * of.axis[i],) if i < count else ())):
                made[at + block, row] = by
                at += blocks
            own: tuple[Array, ...] = (of.change[i],)
            if i < count:
                own = (ranges.wide[-1] * of.position[i], of.gravity[i], of.yaw[i], of.roll[i])
            for rows in (waves, shapes[:, i], np.array(own)):
                made[at : at + len(rows)] = rows
                at += len(rows)
        return np.ascontiguousarray(made.T)

    def _shapes(self, of: SensorSignals, dt: Array) -> Array:
        """(15, N + 1, b) shapes of readings and of their history."""
        within = self.ranges
        y, size = of.y / within.size, np.abs(of.y) / within.size
        if self.lagging is None:
            self.lagging = np.stack([y[:, 0], y[:, 0], y[:, 0] ** 2, y[:, 0] ** 2])
        loads = [(load, lag) for load in (y, y**2) for lag in _LAGS]
        lagging = [_following(load, dt / lag, self.lagging[k]) for k, (load, lag) in enumerate(loads)]
        self.lagging = np.stack([followed[:, -1] for followed in lagging])
        moving = np.abs(of.change) > OF_JUDGE.near_zero * within.change
        made = np.stack(
            [
                size,
                np.sign(np.where(size > OF_JUDGE.near_zero, y, 0.0)),
                y**2,
                y**3,
                y * (size > 0.5),
                y * (size < within.middle),
                np.maximum(y - within.high, 0.0),
                np.minimum(y - within.low, 0.0),
                of.change,
                of.bend,
                np.sign(np.where(moving, of.change, 0.0)),
                lagging[0] - y,
                lagging[1] - y,
                lagging[2],
                lagging[3],
            ]
        )
        return np.asarray(within.wide * made)


def _following(x: Array, share: Array, start: Array) -> Array:
    """States (c, b) that follow x (c, b), a ``share`` (b,) of the way in each row, from a ``start`` (c,)."""
    from scipy.linalg import solve_banded

    taken = 1.0 - np.exp(-share)
    band = np.stack([np.ones(len(taken)), np.append(taken[1:] - 1.0, 0.0)])
    right = taken[:, None] * x.T
    right[0] += (1.0 - taken[0]) * start
    made = solve_banded((1, 0), band, right, overwrite_b=True, check_finite=False)
    return np.asarray(made.T)


_SHAPES: Final = (
    ("reading", "differs between its two signs", (0,)),
    ("reading", "steps where it changes its sign", (1,)),
    ("reading", "curves over its range", (2, 3)),
    ("reading", "differs above half its range", (4,)),
    ("reading", "differs in the middle of its range", (5,)),
    ("reading", "bends at its upper end", (6,)),
    ("reading", "bends at its lower end", (7,)),
    ("history", "is late, or keeps a part of the reading before", (8,)),
    ("history", "is smoothed", (9,)),
    ("history", "depends on the sense of its change", (10,)),
    ("history", "follows its load with a lag of 0.3 s", (11,)),
    ("history", "follows its load with a lag of 3 s", (12,)),
    ("history", "follows the square of its load with a lag of 0.3 s", (13,)),
    ("history", "follows the square of its load with a lag of 3 s", (14,)),
)


def _over_time() -> list[tuple[str, Array]]:
    """Verbs of what changes over time, each with its shapes (blocks, k)."""
    x = 0.5 * (EDGES + np.append(EDGES[1:], 1.0))
    return [
        ("drifts over the record", x[:, None]),
        ("bends over the record", np.stack([x, x**2, x**3], axis=1)),
        ("sways slowly", np.cos(math.pi * x[:, None] * np.arange(1, 5))),
        ("settles at the start", np.exp(-x[:, None] / np.array([0.05, 0.25]))),
        *((f"steps at {100.0 * at:.0f} % of the record", (x > at).astype(float)[:, None]) for at in _STEPS),
    ]


_OF_MODEL: Final = ("position", "gravity", "yaw", "roll")
"""Errors that all accelerometers may have alike."""


class AskedSensors(NamedTuple):
    """The questions about a layout's sensors, the column ``low`` (N + 2,) at which each channel begins, and the columns
    ``gravity`` (N,) by which gravity shows."""

    questions: tuple[PassQuestion, ...]
    low: NDArray[np.int64]
    gravity: NDArray[np.int64]


def about_sensors(settings: AoaSettings, spatial: bool) -> AskedSensors:
    """All questions about the sensors of a study; ``spatial``: gyros for roll and yaw are there."""
    names, low, questions = settings.layout.names, [0], list[PassQuestion]()
    blocks, count = len(EDGES), len(settings.layout.names)
    together: dict[str, list[int]] = {what: [] for what in _OF_MODEL}
    for i in range(count + 1):
        at, of_acc = low[-1], i < count
        name = names[i] if of_acc else "the gyro"
        for part in ("bias", "scale", "axis")[: 3 if of_acc else 2]:
            own = np.arange(at, at + blocks)
            for words, shape in _over_time():
                questions.append(
                    PassQuestion("order", f"The {part} of {name} {words}", ErrorColumns(own, by=shape))
                )
            sized = _sized(settings, part, i)
            if sized is not None:
                by = np.ones((blocks, 1))
                questions.append(
                    PassQuestion("rig", f"The {part} of {name}", ErrorColumns(own, by=by), sized=sized)
                )
            at += blocks
        for k, words in enumerate(_TURNS.values()):
            pair = np.array([at + k, at + len(_TURNS) + k])
            questions.append(
                PassQuestion("place", f"The bias of {name} changes with theta {words}", ErrorColumns(pair))
            )
        at += 2 * len(_TURNS)
        for cell, words, of in _SHAPES:
            what = f"The output of {name} {words}"
            told = _low_pass(name) if words == "is smoothed" else None
            questions.append(PassQuestion(cell, what, ErrorColumns(at + np.array(of)), sized=told))
        at += 15
        if of_acc:
            sized = _sized(settings, "position", i)
            questions.append(
                PassQuestion("rig", f"The position of {name}", ErrorColumns(np.array([at])), sized=sized)
            )
            for k, what in enumerate(_OF_MODEL):
                together[what].append(at + k)
            at += len(_OF_MODEL)
        else:
            at += 1
        low.append(at)
    for i, j in combinations(range(count), 2):
        if (apart := float(settings.layout.r[j] - settings.layout.r[i])) != 0.0:
            places = np.array([together["position"][i], together["position"][j]])
            exchanged = ErrorColumns(places, by=np.array([[apart], [-apart]]))
            said = f"The places of {names[i]} and {names[j]}"
            questions.append(PassQuestion("rig", said, exchanged, sized=_exchanged(settings, i, j)))
    for what, columns in together.items():
        if spatial and what in ("yaw", "roll"):
            continue
        own = np.array(columns)
        both = ErrorColumns(own, by=np.ones((len(own), 1)))
        questions.append(
            PassQuestion("rig", f"The {what} of the model", both, sized=_of_model(settings, what))
        )
    return AskedSensors(tuple(questions), np.array(low, dtype=np.int64), np.array(together["gravity"]))


def _sized(settings: AoaSettings, part: str, i: int) -> Sized | None:
    """Code, words and action of a constant error of sensor i, by its size [SI]."""
    layout = settings.layout
    if i == len(layout.names):
        if part == "bias":

            def of_gyro(value: float) -> tuple[str, str, str]:
                size = 3600.0 * math.degrees(value)
                advice = f'Write gyro_bias = "{abs(size):.3g} deg/h" under [noise], or take it off.'
                return "unmodelled", f"The bias of the gyro looks to be {size:.3g} deg/h", advice

            return of_gyro

        def of_scale(value: float) -> tuple[str, str, str]:
            advice = "Calibrate the gyro, or state gyro_scale under [prior]."
            return "unmodelled", f"The gyro looks to read {1.0 + value:.4g} times what it should", advice

        return of_scale
    name, angle, r = layout.names[i], float(layout.angle[i]), float(layout.r[i])

    def sized(value: float) -> tuple[str, str, str]:
        if part == "axis":
            advice = f'Write angle = "{math.degrees(angle + value):.4g} deg" under [sensors.{name}].'
            return "unmodelled", f"The axis of {name} looks turned by {math.degrees(value):.3g} deg", advice
        if part == "scale":
            advice = f"Correct the scale under [sensors.{name}]."
            return "unmodelled", f"{name} looks to read {1.0 + value:.5g} times what it should", advice
        if part == "bias":
            size = 1e3 * value / STANDARD_GRAVITY
            advice = f"State a bias under [sensors.{name}], or a larger accelerometer_bias."
            return "unmodelled", f"The bias of {name} looks to be {size:.3g} mg", advice
        advice = f'Write r = "{r + value:.4g} m" under [sensors.{name}].'
        said = f"{name} looks to sit {1e3 * value:.3g} mm further ahead than stated"
        return "unmodelled", said, advice

    return sized


def _of_model(settings: AoaSettings, what: str) -> Sized:
    """Code, words and action of an error of the model or its site, by its size [SI]."""
    gravity = settings.site.gravity

    def sized(value: float) -> tuple[str, str, str]:
        if what == "gravity":
            advice = "Correct gravity, or latitude and height, under [site]."
            return "site_suspect", f"Gravity looks to be {gravity + value:.5g} m/s^2", advice
        if what == "position":
            advice = "Correct the positions r of all sensors."
            said = f"The pivot looks to be {1e3 * value:.3g} mm further back than stated"
            return "unmodelled", said, advice
        size = math.degrees(math.sqrt(max(value, 0.0)))
        if what == "yaw":
            return (
                "unmodelled",
                f"The model looks to yaw by {size:.2g} deg/s rms",
                "Record gyro_roll and gyro_yaw.",
            )
        advice = "State roll under [model], or record gyro_roll and gyro_yaw."
        return "unmodelled", f"The model looks rolled by {size:.2g} deg rms", advice

    return sized


def _exchanged(settings: AoaSettings, i: int, j: int) -> Sized:
    """Code, words and action of two places that are exchanged by a part of their distance."""
    names, r = settings.layout.names, settings.layout.r

    def sized(value: float) -> tuple[str, str, str]:
        both = f"{names[i]} and {names[j]}"
        if abs(value - 1.0) < LIMITS.explained_share:
            return (
                "unmodelled",
                f"The places of {both} look exchanged",
                f"Exchange r of {both} under [sensors].",
            )
        at = r[i] + value * (r[j] - r[i]), r[j] - value * (r[j] - r[i])
        advice = f'Write r = "{at[0]:.4g} m" and "{at[1]:.4g} m" under [sensors].'
        return "unmodelled", f"{both} look to sit at other places than stated", advice

    return sized


def _low_pass(name: str) -> Sized:
    """Code, words and action of a low pass of the first order: beside its delay t it adds t^2 / 2 of the second
    derivative."""

    def sized(value: float) -> tuple[str, str, str]:
        if value <= 0.0:
            return (
                "by_history",
                f"The output of {name} is ahead of its motion",
                "Look for a filter within the sensor.",
            )
        corner = 1.0 / (2.0 * math.pi * math.sqrt(2.0 * value))
        said = f"The output of {name} is smoothed, as behind a low pass of {corner:.2g} Hz"
        return "by_history", said, "Switch the filter of the sensor off, or set it far above the motion."

    return sized


def courses_of(motion: PredictedMotion, settings: AoaSettings) -> CourseMaker:
    """The maker of courses of a recording, whose ``motion`` at some of its rows tells the ranges of its sensors."""
    noise = np.append(np.full(len(settings.layout.names), settings.noise.accelerometer), settings.noise.gyro)
    return CourseMaker(settings, SensorRanges.of(signals(settings, motion), noise[:, None]))
