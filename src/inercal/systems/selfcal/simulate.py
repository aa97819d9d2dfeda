"""A simulated recording of a platform that turns through a plan, with the errors that real rigs add."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.errors import StudyError
from inercal.foundation.geometry.rotations import exp, multiply
from inercal.foundation.records.record import Record, record_of
from inercal.foundation.units import parse_unit
from inercal.systems.selfcal.disturbances import Disturbances
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.coefficients import to_linear
from inercal.systems.selfcal.platform.driven import Driven, drive
from inercal.systems.selfcal.platform.joint_limits import beyond
from inercal.systems.selfcal.platform.kinematics import all_angles, attitude
from inercal.systems.selfcal.platform.layout import StateLayout
from inercal.systems.selfcal.platform.plan import CommandedMotion, motion
from inercal.systems.selfcal.platform.recording import Recording
from inercal.systems.selfcal.platform.rig import World
from inercal.systems.selfcal.platform.states import StateVector
from inercal.systems.selfcal.platform.truth import PlatformTruth, simulate_truth
from inercal.systems.selfcal.settings import Noise, SelfcalSettings


@dataclass(frozen=True, eq=False)
class Experiment:
    """A plan on a rig, ready to be simulated many times: ``motion`` as commanded; ``fine`` (n - 1, m, 3) [rad/s] the
    rates on which the platform acts in each finer step; ``truth`` (K,) full vector in the linear form; ``warm``
    (n,) [K] above the temperature of the coefficients, None where that is constant. Where joints are ``fixed``, motors
    drive the others, and the gyros measure."""

    world: World
    noise: Noise
    motion: CommandedMotion
    fine: Array
    truth: Array
    disturbances: Disturbances
    warm: Array | None = None
    fixed: tuple[int, ...] = ()

    @cached_property
    def layout(self) -> StateLayout:
        """The layout of a truth, for kernels."""
        return StateVector((), self.truth).layout


@dataclass(frozen=True, eq=False)
class SimulatedPlatform:
    """A ``recording`` and its truth: ``attitude`` (n, 4) q_bp, ``angles`` (n, 3) [rad]."""

    recording: Recording
    attitude: Array
    angles: Array


def experiment(settings: SelfcalSettings) -> Experiment:
    """Prepare the simulation that a study states; raises StudyError where it has no truth, no plan, or one beyond the
    limits of the joints."""
    if settings.plan is None:
        raise StudyError("plan", "missing, expected the turns to be simulated")
    truth = settings.true_values
    if truth is None:
        raise StudyError("truth", "missing, expected the true coefficients")
    if too_far := settings.plan.beyond(settings.limits):
        low, high = (math.degrees(end) for end in settings.limits[too_far[0]])
        text = f"found turns that take {too_far[0]} beyond rig.limits"
        raise StudyError("plan", f"{text}, expected them within {low:.6g} deg to {high:.6g} deg")
    if others := beyond(settings.plan, {}, settings.joints):
        raise StudyError(
            "plan", f"found {others[0]} beyond the limits of the rig, expected turns within them"
        )
    commanded = motion(settings.plan, settings.world)
    other = settings.disturbances
    if settings.unread and (other.command_delay > 0.0 or other.servo_jitter > 0.0):
        name = "command_delay" if other.command_delay > 0.0 else "servo_jitter"
        text = "found it of a rig with fixed joints, whose platform nobody commands, expected none"
        raise StudyError(f"disturbances.{name}", text)
    fine = _acting(commanded, other.substeps, other.command_delay)
    temperature = settings.simulated_temperature(len(commanded.t))
    warm = None if temperature is None else settings.warm(temperature)
    world, fixed = settings.world, settings.unread
    return Experiment(world, settings.noise, commanded, fine, to_linear(truth), other, warm, fixed)


def _acting(commanded: CommandedMotion, m: int, delay: float) -> Array:
    """Rates (n - 1, m, 3) [rad/s] on which the platform acts in each of ``m`` parts of a step: at t on what was
    commanded at t - ``delay`` [s], at the ends on the first and last command."""
    n = len(commanded.rate)
    if delay == 0.0:
        return np.ascontiguousarray(np.repeat(commanded.rate[:, None], m, axis=1))
    t = commanded.t
    ends = t[0] + (t[-1] - t[0]) / (n * m) * np.arange(n * m + 1) - delay
    turned = np.vstack([np.zeros(3), np.cumsum(commanded.rate * np.diff(t)[:, None], axis=0)])
    at = np.stack([np.interp(ends, t, turned[:, k]) for k in range(3)], axis=-1)
    at += np.minimum(ends - t[0], 0.0)[:, None] * commanded.rate[0]
    at += np.maximum(ends - t[-1], 0.0)[:, None] * commanded.rate[-1]
    return np.ascontiguousarray(np.diff(at, axis=0).reshape(n, m, 3) * (n * m) / (t[-1] - t[0]))


def simulate(experiment: Experiment, rng: np.random.Generator) -> SimulatedPlatform:
    """Turn the platform once through its plan."""
    noise, other, t = experiment.noise, experiment.disturbances, experiment.motion.t
    n, step = len(t), float(t[1] - t[0])
    rate, q, acc, read, th = (_driven if experiment.fixed else _commanded)(experiment, rng)
    acc += noise.accelerometer * rng.standard_normal((n, 3))
    if other.vibration > 0.0:  # sampled more slowly than it is
        acc += other.vibration * rng.standard_normal((n, 3))
    if other.accelerometer_walk > 0.0:
        acc += wandering(other.accelerometer_walk, step, n, rng)
    if other.flicker > 0.0:
        acc += flicker(other.flicker, n, rng)
    measured = read + noise.encoder * rng.standard_normal((n, 3))
    for wave in other.harmonics:
        joint = "xyz".index(wave.axis)
        measured[:, joint] += wave.amplitude * np.sin(wave.order * th[:, joint] + wave.phase)
    if other.base_sway and not experiment.fixed:
        swayed = np.empty((n, 3))
        world, about = experiment.world, _swaying(experiment, rng)
        all_angles(multiply(exp(-about), q), experiment.motion.angles[0], world.axes, world.signs, swayed)
        measured += swayed - th
    if other.quantisation > 0.0:
        measured = other.quantisation * np.round(measured / other.quantisation)
    acc[0] = np.nan
    if other.dropouts > 0.0:
        lost = np.append(False, rng.random(n - 1) < other.dropouts)
        acc[lost], measured[lost] = np.nan, np.nan
    if other.stamp_jitter > 0.0:
        t = t + other.stamp_jitter * rng.standard_normal(n)
        if np.diff(t).min() <= 0.0:
            text = (
                f"found {other.stamp_jitter:.3g} s for rows every {step:.3g} s, expected time that increases"
            )
            raise StudyError("disturbances.stamp_jitter", text)
    measured[:, experiment.fixed] = experiment.motion.angles[:, experiment.fixed]
    recording = Recording(
        t, rate, measured, acc, bool(experiment.fixed), warm=experiment.warm, fixed=experiment.fixed
    )
    made = SimulatedPlatform(recording, q, th)
    if other.lost_rows == 0.0:
        return made
    return _rows(made, np.flatnonzero(np.append(True, rng.random(n - 1) >= other.lost_rows)))


def _commanded(experiment: Experiment, rng: np.random.Generator) -> tuple[Array, ...]:
    """Rates (n - 1, 3), attitudes (n, 4), accelerometers, encoders and true angles (n, 3) of a platform that turns as
    its gyros say, which are commanded."""
    world, other, commanded = experiment.world, experiment.disturbances, experiment.motion
    n, rate, fine = len(commanded.t), commanded.rate, experiment.fine
    if other.servo_jitter > 0.0:
        own = other.servo_jitter * rng.standard_normal(rate.shape)
        rate, fine = rate + own, fine + own[:, None]
    dt = float(commanded.t[1] - commanded.t[0]) / fine.shape[1]
    wander = rng.standard_normal(fine.shape)
    wander *= experiment.noise.angle_random_walk / np.sqrt(dt)
    wander += _of_biases(experiment, rng)[:, None]
    q, acc, th = np.empty((n, 4)), np.empty((n, 3)), np.empty((n, 3))
    q0 = np.array(attitude(commanded.angles[0], world.axes, world.signs))
    read = commanded.angles.copy()
    warm = np.zeros(n) if experiment.warm is None else experiment.warm
    simulate_truth(
        q0, fine, dt, wander, warm, experiment.truth, experiment.layout, world, PlatformTruth(q, acc, read)
    )
    all_angles(q, commanded.angles[0], world.axes, world.signs, th)
    return rate, q, acc, read if experiment.layout.read_off else th.copy(), th


def _driven(experiment: Experiment, rng: np.random.Generator) -> tuple[Array, ...]:
    """The same of a platform whose joints are driven by motors, and whose gyros measure."""
    angles, t = experiment.motion.angles, experiment.motion.t
    n, dt = len(t), float(t[1] - t[0])
    wander = experiment.noise.angle_random_walk / math.sqrt(dt) * rng.standard_normal((n - 1, 3))
    wander += _of_biases(experiment, rng)
    sway = _swaying(experiment, rng) if experiment.disturbances.base_sway else np.zeros((n, 3))
    warm = np.zeros(n) if experiment.warm is None else experiment.warm
    out = Driven(np.empty((n, 4)), np.empty((n - 1, 3)), np.empty((n, 3)), np.empty((n, 3)))
    drive(angles, sway, dt, wander, warm, experiment.truth, experiment.layout, experiment.world, out)
    return out.rate, out.q, out.acc, out.th, angles


def _of_biases(experiment: Experiment, rng: np.random.Generator) -> Array:
    """Noise (n - 1, 3) [rad/s] of the gyros that is not white."""
    other, t = experiment.disturbances, experiment.motion.t
    wander = np.zeros((len(t), 3))
    if other.gyro_walk > 0.0:
        wander += wandering(other.gyro_walk, float(t[1] - t[0]), len(t), rng)
    if other.gyro_flicker > 0.0:
        wander += flicker(other.gyro_flicker, len(t), rng)
    return wander[:-1]


def _swaying(experiment: Experiment, rng: np.random.Generator) -> Array:
    """Turns (n, 3) [rad] of the base about level axes, in b."""
    sway = experiment.disturbances.base_sway
    assert sway is not None
    swing = 2.0 * math.pi * (sway.frequency * experiment.motion.t + rng.random())
    return np.asarray(
        sway.amplitude * np.stack([np.cos(swing), np.sin(swing)], axis=-1) @ _level(experiment.world)
    )


def _rows(made: SimulatedPlatform, rows: NDArray[np.int64]) -> SimulatedPlatform:
    """Some of the rows; the others are not in the file, with their rates."""
    whole = made.recording
    recording = replace(
        whole,
        t=whole.t[rows],
        rate=whole.rate[rows[:-1]],
        th=whole.th[rows],
        acc=whole.acc[rows],
        warm=None if whole.warm is None else whole.warm[rows],
    )
    return SimulatedPlatform(recording, made.attitude[rows], made.angles[rows])


def _level(world: World) -> Array:
    """Two level axes (2, 3) in b."""
    up = world.up / np.linalg.norm(world.up)
    first = np.cross(up, np.eye(3)[int(np.argmin(np.abs(up)))])
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(up, first)])


def flicker(level: float, n: int, rng: np.random.Generator) -> Array:
    """1/f noise (n, 3) whose Allan deviation has its floor at a level: white noise, ``sqrt(pi / (2 ln 2))`` as large,
    integrated by half (N. J. Kasdin, Discrete simulation of colored noise and stochastic processes and 1/f^a
    power law noise generation, Proceedings of the IEEE 83 (1995) 802)."""
    from scipy.signal import fftconvolve

    k = np.arange(1, n)
    response = np.cumprod(np.append(1.0, (k - 0.5) / k))
    white = rng.standard_normal((n, 3)) * level * math.sqrt(0.5 * math.pi / math.log(2.0))
    return np.asarray(fftconvolve(white, response[:, None], axes=0)[:n])


def wandering(walk: float, step: float, n: int, rng: np.random.Generator) -> Array:
    """Biases (n, 3) about their means, every ``step`` [s], of a ``walk`` [unit/sqrt(s)] within `LIMITS.walk_time`."""
    from scipy.signal import lfilter

    keep = math.exp(-step / LIMITS.walk_time)
    driven = rng.standard_normal((n, 3)) * walk * math.sqrt(0.5 * LIMITS.walk_time)
    driven[1:] *= math.sqrt(1.0 - keep**2)
    return np.asarray(lfilter([1.0], [1.0, -keep], driven, axis=0))


#: sensor -> unit of its columns in a simulated file
_UNITS = {"wc": "deg/h", "gyro": "deg/h", "th": "deg", "acc": "m/s^2"}


def to_record(
    recording: Recording, attitude: Array | None = None, temperature: Array | None = None
) -> Record:
    """A record as a file holds it: ``t``, ``wc_x..`` (the last row's empty), or ``gyro_x..`` where rates are measured,
    ``th_x..`` but of fixed joints, ``acc_x..``, and ``q_ref_0..`` and ``temperature`` where the true ``attitude``
    (n, 4) q_bp and the temperature (n,) [degC] are given."""
    values = {
        "gyro" if recording.measured else "wc": np.vstack([recording.rate, np.full(3, np.nan)]),
        "th": recording.th,
        "acc": recording.acc,
    }
    columns = []
    for sensor, channels in values.items():
        unit = parse_unit(_UNITS[sensor])
        columns += [
            (f"{sensor}_{axis}", unit, channels[:, k] / unit.factor)
            for k, axis in enumerate("xyz")
            if sensor != "th" or k not in recording.fixed
        ]
    if attitude is not None:
        columns += [(f"q_ref_{k}", parse_unit("1"), attitude[:, k]) for k in range(4)]
    if temperature is not None:
        columns += [("temperature", parse_unit("degC"), temperature)]
    return record_of(columns, recording.t)
