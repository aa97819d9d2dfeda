"""Pitch of a wind-tunnel model as a function of time, with rate and acceleration, as a study plans it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import InputError, StudyError
from inercal.foundation.keys import FREQUENCY, TIME, option, quantity, within
from inercal.systems.aoa.disturbances import SIZE, Oscillation, Shaking

MotionKind = Literal["static", "pitch-pause", "sine", "two-tone", "chirp", "buffet", "file"]
Course: TypeAlias = Callable[[Array], tuple[Array, Array, Array]]
"""A value, its rate and its acceleration at times (n,) [s]."""

SINES = 150
"""Sines of a buffet."""

_SHAKING = 40
"""Sines of a vibration of the sting."""

_BLOCK = 64
"""Even times that are computed from one."""


_PITCH = within(-2.0 * math.pi, 2.0 * math.pi, "an angle from -360 deg to 360 deg")
_SINES = ("sine", "two-tone", "chirp")
_RANDOM = ("pitch-pause", "chirp", "buffet")
_STEPS = ("static", "pitch-pause")


@dataclass(frozen=True)
class MotionPlan:
    """Pitch of the model in a simulation: its kind, and the keys of that kind.

    ``static``: a sweep from ``first`` to ``last`` at a constant rate, over all of the duration. ``pitch-pause``: pauses
    at ``first``, by ``step``, to ``last``, quintic moves between, and a buffet (its duration follows). ``sine``:
    ``mean`` + ``amplitude`` sin 2 pi ``frequency`` t. ``two-tone``: with a second sine. ``chirp``: about ``mean``,
    from ``low`` to ``high``. ``buffet``: about ``mean``, 150 equal sines of random frequency and phase from ``low`` to
    ``high``, ``rms`` in all. ``file``: the columns t and theta_ref of ``path``, for ``duration`` at most.
    """

    kind: MotionKind = option(
        "static: a sweep; pitch-pause: steps with pauses; sine; two-tone; chirp; buffet: random; file: as recorded"
    )
    duration: float = quantity(
        "of all kinds but pitch-pause; of a file all if absent", "time", "60 s", bounds=TIME,
        kinds=("static", *_SINES, "buffet", "file"),
    )  # fmt: skip
    sample_rate: float = quantity("samples per second", "frequency", "1 kHz", bounds=FREQUENCY)
    mean: float = quantity(
        "of sine, two-tone, chirp and buffet", "angle", "0 deg", example="30 deg", bounds=_PITCH,
        kinds=(*_SINES, "buffet"),
    )  # fmt: skip
    amplitude: float = quantity(
        "of sine, two-tone and chirp",
        "angle",
        0.0,
        example="10 deg",
        bounds=SIZE,
        kinds=_SINES,
        needed=_SINES,
    )
    frequency: float = quantity(
        "of sine and two-tone", "frequency", 1.0, example="1 Hz", bounds=FREQUENCY,
        kinds=_SINES[:2], needed=_SINES[:2],
    )  # fmt: skip
    second_amplitude: float = quantity(
        "of the second sine of two-tone", "angle", 0.0, example="2 deg", bounds=SIZE,
        kinds=("two-tone",), needed=("two-tone",),
    )  # fmt: skip
    second_frequency: float = quantity(
        "of the second sine of two-tone", "frequency", 1.0, example="3 Hz", bounds=FREQUENCY,
        kinds=("two-tone",), needed=("two-tone",),
    )  # fmt: skip
    low: float = quantity(
        "lowest frequency of chirp, buffet and of the buffet in a pitch-pause", "frequency", 2.0,
        example="0.1 Hz", bounds=FREQUENCY, kinds=_RANDOM, needed=_RANDOM[1:],
    )  # fmt: skip
    high: float = quantity(
        "highest frequency of those", "frequency", 15.0, example="5 Hz", bounds=FREQUENCY,
        kinds=_RANDOM, needed=_RANDOM[1:],
    )  # fmt: skip
    rms: float = quantity(
        "of the buffet, in all; in a pitch-pause none if absent", "angle", 0.0, example="0.2 deg", bounds=SIZE,
        kinds=("pitch-pause", "buffet"), needed=("buffet",),
    )  # fmt: skip
    first: float = quantity(
        "angle at the start of static and pitch-pause", "angle", 0.0, example="-10 deg", bounds=_PITCH,
        kinds=_STEPS, needed=_STEPS,
    )  # fmt: skip
    last: float = quantity(
        "angle at the end of static and pitch-pause", "angle", 0.0, example="90 deg", bounds=_PITCH,
        kinds=_STEPS, needed=_STEPS,
    )  # fmt: skip
    step: float = quantity(
        "of pitch-pause, negative downward", "angle", 0.0, example="10 deg", bounds=_PITCH,
        kinds=_STEPS[1:], needed=_STEPS[1:],
    )  # fmt: skip
    move: float = quantity("time of a move of pitch-pause", "time", "1.5 s", bounds=TIME, kinds=_STEPS[1:])
    pause: float = quantity("time of a pause of pitch-pause", "time", "4 s", bounds=TIME, kinds=_STEPS[1:])
    path: Path | None = option(
        "of kind file: a record beside the study with the columns t and theta_ref", None, example="pitch.csv",
        name="file", kinds=("file",), needed=("file",),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Sines:
    """A sum of sines: ``amplitude``, ``omega`` [rad/s] and ``phase`` [rad], (k,) each."""

    amplitude: Array
    omega: Array
    phase: Array

    def __call__(self, t: Array) -> tuple[Array, Array, Array]:
        """Value, rate and acceleration at times (n,) [s].

        Of even times one in so many is computed, the others from it by products of exponentials.
        """
        n = len(t)
        step = (t[-1] - t[0]) / (n - 1) if n > _BLOCK else 0.0
        if n > _BLOCK and np.ptp(np.diff(t)) < 1e-9 * step + 4.0 * np.spacing(np.abs(t).max()):
            begin = self.amplitude * np.exp(1j * (np.multiply.outer(t[::_BLOCK], self.omega) + self.phase))
            since = np.exp(1j * np.multiply.outer(self.omega, step * np.arange(_BLOCK)))
            value = (begin @ since).imag.ravel()[:n]
            begin *= self.omega
            rate = (begin @ since).real.ravel()[:n]
            begin *= -self.omega
            return value, rate, (begin @ since).imag.ravel()[:n]
        value, rate, acceleration = np.zeros((3, n))
        for a, om, phase in zip(self.amplitude, self.omega, self.phase, strict=True):
            s, c = a * np.sin(om * t + phase), a * om * np.cos(om * t + phase)
            value += s
            rate += c
            acceleration -= om * om * s
        return value, rate, acceleration


def buffet(rms: float, low: float, high: float, rng: np.random.Generator, count: int = SINES) -> Sines:
    """``count`` equal sines of random frequency from ``low`` to ``high`` [Hz] and random phase, ``rms`` in all."""
    omega = 2.0 * math.pi * rng.uniform(low, high, count)
    return Sines(np.full(count, rms * math.sqrt(2.0 / count)), omega, rng.uniform(0.0, 2.0 * math.pi, count))


def shaking(of: Shaking | None, rng: np.random.Generator, count: int = _SHAKING) -> Sines:
    """A vibration as ``count`` sines; no sine without one."""
    return _sines() if of is None else buffet(of.rms, of.low, of.high, rng, count)


def tones(levels: Sequence[float], frequencies: Sequence[float], rng: np.random.Generator) -> Sines:
    """Sines of given amplitudes and frequencies [Hz], and random phases."""
    omega = 2.0 * math.pi * np.array(frequencies, dtype=float)
    return Sines(np.array(levels, dtype=float), omega, rng.uniform(0.0, 2.0 * math.pi, len(omega)))


def oscillation(of: Oscillation | None) -> Sines:
    """An oscillation as one sine; no sine without one."""
    return _sines() if of is None else _sines((of.amplitude, of.frequency))


def _sines(*tones: tuple[float, float]) -> Sines:
    """Sines of given amplitudes and frequencies [Hz], 0 at time 0."""
    amplitude, frequency = np.reshape(tones, (-1, 2)).T
    return Sines(amplitude, 2.0 * math.pi * frequency, np.zeros(len(tones)))


def duration(plan: MotionPlan) -> float:
    """Length [s] of a motion: as stated, of all pauses and moves, or of its file if that is shorter.

    Raises `StudyError` for a file of motion that cannot be used.
    """
    if plan.kind == "pitch-pause":
        return plan.pause + moves(plan) * (plan.move + plan.pause)
    if plan.kind == "file":
        t, _ = _measured(plan)
        return min(plan.duration, float(t[-1] - t[0]))
    return plan.duration


def moves(plan: MotionPlan) -> int:
    """Number of moves of a pitch-pause."""
    return round((plan.last - plan.first) / plan.step) if plan.step else 0


def course(plan: MotionPlan, rng: np.random.Generator) -> Course:
    """The pitch of a plan; its random parts are drawn here. Raises `StudyError` as `duration` does."""
    if plan.kind == "static":
        return _sweep(plan)
    if plan.kind == "pitch-pause":
        return _sum(_steps(plan), buffet(plan.rms, plan.low, plan.high, rng))
    if plan.kind in ("sine", "two-tone"):
        tones = [(plan.amplitude, plan.frequency), (plan.second_amplitude, plan.second_frequency)]
        return _sum(_constant(plan.mean), _sines(*tones[: 1 if plan.kind == "sine" else 2]))
    if plan.kind == "chirp":
        return _sum(_constant(plan.mean), _chirp(plan))
    if plan.kind == "buffet":
        return _sum(_constant(plan.mean), buffet(plan.rms, plan.low, plan.high, rng))
    return _from_file(plan)


def point_numbers(plan: MotionPlan, t: Array) -> Array | None:
    """(n,) number of the pause, from 1, that a time lies in, NaN between; None for other motions."""
    if plan.kind != "pitch-pause":
        return None
    number = np.floor(t / (plan.pause + plan.move))
    return np.where(t - number * (plan.pause + plan.move) < plan.pause, number + 1.0, np.nan)


def _sum(*parts: Course) -> Course:
    """Courses added up."""

    def total(t: Array) -> tuple[Array, Array, Array]:
        value, rate, acceleration = (sum(each) for each in zip(*(part(t) for part in parts), strict=True))
        return np.asarray(value), np.asarray(rate), np.asarray(acceleration)

    return total


def _constant(value: float) -> Course:
    """At rest."""
    return lambda t: (np.full(len(t), value), np.zeros(len(t)), np.zeros(len(t)))


def _sweep(plan: MotionPlan) -> Course:
    """From first to last at a constant rate."""
    rate = (plan.last - plan.first) / plan.duration
    return lambda t: (plan.first + rate * t, np.full(len(t), rate), np.zeros(len(t)))


def _steps(plan: MotionPlan) -> Course:
    """Pauses, and moves by a quintic that begins and ends at rest."""
    n = moves(plan)

    def steps(t: Array) -> tuple[Array, Array, Array]:
        period = plan.pause + plan.move
        number = np.clip(np.floor(t / period), 0.0, max(n - 1, 0))
        s = np.clip((t - number * period - plan.pause) / plan.move, 0.0, 1.0) if n else np.zeros(len(t))
        value = s**3 * (10.0 + s * (6.0 * s - 15.0))
        rate = 30.0 * s**2 * (1.0 - s) ** 2 / plan.move
        acceleration = 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / plan.move**2
        return plan.first + plan.step * (number + value), plan.step * rate, plan.step * acceleration

    return steps


def _chirp(plan: MotionPlan) -> Course:
    """A sine whose frequency grows linearly from low to high."""
    growth = (plan.high - plan.low) / plan.duration

    def chirp(t: Array) -> tuple[Array, Array, Array]:
        phase = 2.0 * math.pi * (plan.low + 0.5 * growth * t) * t
        omega = 2.0 * math.pi * (plan.low + growth * t)
        s, c = plan.amplitude * np.sin(phase), plan.amplitude * np.cos(phase)
        return s, omega * c, 2.0 * math.pi * growth * c - omega**2 * s

    return chirp


def _measured(plan: MotionPlan) -> tuple[Array, Array]:
    """Times (n,) [s] and angles (n,) [rad] of a file."""
    from inercal.foundation.records.read import read

    assert plan.path is not None
    try:
        column = read(plan.path)["theta_ref"]
        t, theta = column.t, column.si()
    except InputError as error:
        raise StudyError(
            "motion.file", f"{error} (a CSV with the header t [s],theta_ref [deg] holds a motion)"
        ) from error
    if len(t) < 6 or not (np.diff(t) > 0.0).all() or not np.isfinite(theta).all():
        raise StudyError(
            "motion.file",
            f"found no motion in {plan.path}, expected 6 rows or more with t increasing and a number in theta_ref",
        )
    return t, theta


def _from_file(plan: MotionPlan) -> Course:
    """The motion in a file, through a spline with a continuous acceleration."""
    from scipy.interpolate import make_interp_spline

    t, theta = _measured(plan)
    spline = make_interp_spline(t - t[0], theta, k=5)
    rate, acceleration = spline.derivative(1), spline.derivative(2)

    def followed(at: Array) -> tuple[Array, Array, Array]:
        at = np.clip(at, 0.0, t[-1] - t[0])
        return spline(at), rate(at), acceleration(at)

    return followed
