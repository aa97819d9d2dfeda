"""A simulated recording of a platform that turns through a plan, with the errors that real rigs add."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from inercal.arrays import Array
from inercal.errors import StudyError
from inercal.records.record import Record, record_of
from inercal.selfcal.limits import LIMITS
from inercal.selfcal.platform.coefficients import to_linear
from inercal.selfcal.platform.kinematics import all_angles, attitude
from inercal.selfcal.platform.model import Truth, simulate_truth
from inercal.selfcal.platform.plan import CommandedMotion, motion
from inercal.selfcal.platform.recording import Recording
from inercal.selfcal.platform.rig import World
from inercal.selfcal.settings import Disturbances, Noise, SelfcalSettings
from inercal.units import parse_unit


@dataclass(frozen=True, eq=False)
class Experiment:
    """A plan on a rig, ready to be simulated many times: ``motion`` as commanded; ``fine`` (n - 1, m, 3) [rad/s] the
    rates on which the platform acts in each finer step; ``truth`` (24 or K,) full vector in the linear form; ``warm``
    (n,) [K] above the temperature of the coefficients, None where that is constant."""

    world: World
    noise: Noise
    motion: CommandedMotion
    fine: Array
    truth: Array
    disturbances: Disturbances
    warm: Array | None = None


@dataclass(frozen=True, eq=False)
class Simulated:
    """A ``recording`` and its truth: ``attitude`` (n, 4) q_bp, ``angles`` (n, 3) [rad]."""

    recording: Recording
    attitude: Array
    angles: Array


def experiment(settings: SelfcalSettings) -> Experiment:
    """Prepare the simulation that a study states; raises StudyError where it has no plan or no truth."""
    if settings.plan is None:
        raise StudyError("plan", "missing, expected the turns to be simulated")
    if settings.truth is None:
        raise StudyError("truth", "missing, expected the true coefficients")
    commanded = motion(settings.plan, settings.world)
    other, truth = settings.disturbances, settings.truth
    if not truth[24:].any():
        truth = truth[:24]
    fine = _acting(commanded, other.substeps, other.command_delay)
    temperature = settings.simulated_temperature(len(commanded.t))
    warm = None if temperature is None else settings.warm(temperature)
    return Experiment(settings.world, settings.noise, commanded, fine, to_linear(truth), other, warm)


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


def simulate(experiment: Experiment, rng: np.random.Generator) -> Simulated:
    """Turn the platform once through its plan."""
    world, noise, other = experiment.world, experiment.noise, experiment.disturbances
    commanded, n = experiment.motion, len(experiment.motion.t)
    fine = experiment.fine
    dt = float(commanded.t[1] - commanded.t[0]) / fine.shape[1]
    wander = rng.standard_normal(fine.shape)
    wander *= noise.angle_random_walk / np.sqrt(dt)
    step = dt * fine.shape[1]
    if other.gyro_walk > 0.0:
        wander += wandering(other.gyro_walk, step, n, rng)[:-1, None]
    q, acc, th = np.empty((n, 4)), np.empty((n, 3)), np.empty((n, 3))
    q0 = np.array(attitude(commanded.angles[0], world.axes, world.signs))
    read = commanded.angles.copy()
    warm = np.zeros(n) if experiment.warm is None else experiment.warm
    simulate_truth(q0, fine, dt, wander, warm, experiment.truth, world, Truth(q, acc, read))
    all_angles(q, commanded.angles[0], world.axes, world.signs, th)
    acc += noise.accelerometer * rng.standard_normal((n, 3))
    if other.accelerometer_walk > 0.0:
        acc += wandering(other.accelerometer_walk, step, n, rng)
    measured = (read if len(experiment.truth) > 24 else th) + noise.encoder * rng.standard_normal((n, 3))
    for joint, order, amplitude, phase in other.harmonics:
        measured[:, joint] += amplitude * np.sin(order * th[:, joint] + phase)
    acc[0] = np.nan
    if other.dropouts > 0.0:
        lost = np.append(False, rng.random(n - 1) < other.dropouts)
        acc[lost], measured[lost] = np.nan, np.nan
    recording = Recording(commanded.t, commanded.rate, measured, acc, warm=experiment.warm)
    return Simulated(recording, q, th)


def wandering(walk: float, step: float, n: int, rng: np.random.Generator) -> Array:
    """Biases (n, 3) about their means, every ``step`` [s], of a ``walk`` [unit/sqrt(s)] within `LIMITS.walk_time`."""
    from scipy.signal import lfilter

    keep = math.exp(-step / LIMITS.walk_time)
    driven = rng.standard_normal((n, 3)) * walk * math.sqrt(0.5 * LIMITS.walk_time)
    driven[1:] *= math.sqrt(1.0 - keep**2)
    return np.asarray(lfilter([1.0], [1.0, -keep], driven, axis=0))


#: sensor -> unit of its columns in a simulated file
_UNITS = {"wc": "deg/h", "th": "deg", "acc": "m/s^2"}


def to_record(
    recording: Recording, attitude: Array | None = None, temperature: Array | None = None
) -> Record:
    """A record as a file holds it: ``t``, ``wc_x..`` (the last row's empty), ``th_x..``, ``acc_x..``, and ``q_ref_0..``
    and ``temperature`` where the true ``attitude`` (n, 4) q_bp and the temperature (n,) [degC] are given."""
    values = {
        "wc": np.vstack([recording.rate, np.full(3, np.nan)]),
        "th": recording.th,
        "acc": recording.acc,
    }
    columns = []
    for sensor, symbol in _UNITS.items():
        unit = parse_unit(symbol)
        columns += [
            (f"{sensor}_{axis}", unit, values[sensor][:, k] / unit.factor) for k, axis in enumerate("xyz")
        ]
    if attitude is not None:
        columns += [(f"q_ref_{k}", parse_unit("1"), attitude[:, k]) for k in range(4)]
    if temperature is not None:
        columns += [("temperature", parse_unit("degC"), temperature)]
    return record_of(columns, recording.t)
