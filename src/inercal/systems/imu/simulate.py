"""A simulated hand-held calibration: still at first, then turns and holds, by an instrument of known truth."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.earth import earth_rate
from inercal.foundation.geometry.rotations import conjugate, exp, log, multiply, rotate
from inercal.foundation.instruments.terms import (
    ACCELEROMETER_TRIAD,
    ACCELEROMETERS_IN_A_FRAME,
    GYRO_G_SENSITIVITY,
    GYRO_TRIAD,
)
from inercal.foundation.instruments.triad import TriadModel, triad_from_terms
from inercal.foundation.records.record import Record, record_of
from inercal.foundation.units import parse_unit
from inercal.systems.imu.settings import Disturbances, Simulation


@dataclass(frozen=True)
class TriadNoise:
    """Noise of a triad: ``white`` [SI/sqrt(Hz)], and a bias that wanders about its mean with standard
    deviation ``wander`` [SI] and correlation time ``wander_time`` [s] (first-order Gauss-Markov)."""

    white: float
    wander: float = 0.0
    wander_time: float = 100.0


@dataclass(frozen=True)
class ImuTruth:
    """A true instrument: triads, g-sensitive drift (3, 3) [gyro output/(m/s^2)] and noise."""

    accelerometer: TriadModel
    gyro: TriadModel
    g_sensitivity: Array
    accelerometer_noise: TriadNoise
    gyro_noise: TriadNoise

    def values(self) -> dict[str, float]:
        """True coefficients by term symbol."""
        triads = ((self.accelerometer, ACCELEROMETERS_IN_A_FRAME), (self.gyro, GYRO_TRIAD))
        coefficients: dict[str, float] = {}
        for model, symbols in triads:
            numbers = {"bias": iter(model.bias), "scale": iter(model.scale)}
            for symbol in symbols:
                head, _, axes = symbol.rpartition("_")
                if len(axes) == 2:
                    coefficients[symbol] = float(
                        model.misalignment["xyz".index(axes[0]), "xyz".index(axes[1])]
                    )
                else:
                    coefficients[symbol] = float(next(numbers["bias" if head in ("K0", "D_F") else "scale"]))
        return coefficients | dict(
            zip(GYRO_G_SENSITIVITY, map(float, self.g_sensitivity.ravel()), strict=True)
        )


def draw_truth(rng: np.random.Generator, g_sensitivity: float = 0.0) -> ImuTruth:
    """A consumer-grade MEMS unit with 16-bit outputs, its coefficients drawn at random.

    ``g_sensitivity`` is the standard deviation of the g-sensitive drift [(rad/s)/(m/s^2)].
    """
    values: dict[str, float] = {}
    for symbol in (*ACCELEROMETER_TRIAD, *GYRO_TRIAD):
        mean, spread = {"K0": (32768, 300), "K1": (415, 5), "D_F": (32768, 200), "S": (4775, 60)}.get(
            symbol.rpartition("_")[0], (0.0, 0.02)
        )
        values[symbol] = float(rng.normal(mean, spread))
    gyro = triad_from_terms(values, "S", "T", "D_F")
    return ImuTruth(
        triad_from_terms(values, "K1", "M", "K0"),
        gyro,
        rng.normal(0.0, 1.0, (3, 3)) * g_sensitivity * gyro.scale[:, None],
        TriadNoise(white=8e-4, wander=3e-4),
        TriadNoise(white=5.6e-4, wander=5e-5),
    )


def draw_full_truth(rng: np.random.Generator, g_sensitivity: float = 2e-4) -> ImuTruth:
    """As `draw_truth`, with all six misalignments of the accelerometers."""
    truth = draw_truth(rng, g_sensitivity)
    misalignment = truth.accelerometer.misalignment + np.tril(rng.normal(0.0, 0.02, (3, 3)), -1)
    return replace(truth, accelerometer=replace(truth.accelerometer, misalignment=misalignment))


def hand_poses(rng: np.random.Generator, count: int) -> Array:
    """Attitudes q_nb (count, 4), n with z up: the first level, the others spread evenly over the sphere.

    A Fibonacci lattice of up directions, each tilted by up to about 10 degrees and turned about the vertical
    at random, in random order.
    """
    k = np.arange(count) + 0.5
    height, longitude = 1.0 - 2.0 * k / count, np.pi * (1.0 + np.sqrt(5.0)) * k
    ring = np.sqrt(1.0 - height**2)
    up = np.stack([ring * np.cos(longitude), ring * np.sin(longitude), height], axis=-1)
    up = up[rng.permutation(count)] + rng.normal(0.0, 0.1, (count, 3))
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    across = np.cross(np.array([0.0, 0.0, 1.0]), up)
    angle = np.arccos(np.clip(up[:, 2], -1.0, 1.0))
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    # exp(across angle) takes z to up in the same frame; its conjugate is the attitude with `up` vertical
    level = conjugate(exp(across * angle[:, None]))
    heading = exp(np.stack([np.zeros(count), np.zeros(count), rng.uniform(-np.pi, np.pi, count)], axis=-1))
    q = multiply(heading, level)
    q[0] = [1.0, 0.0, 0.0, 0.0]
    return q


def simulate(
    truth: ImuTruth,
    poses: Array,
    gravity: float,
    latitude: float,
    rng: np.random.Generator,
    rate: float = 100.0,
    start: float = 30.0,
    hold: float = 3.0,
    turn: float = 3.0,
    clock: float = 1.0,
    disturbances: Disturbances = Disturbances(),  # noqa: B008  (frozen)
) -> tuple[Record, ImuTruth]:
    """Record a hand-held calibration.

    Parameters
    ----------
    truth : ImuTruth
    poses : (n, 4)
        Attitudes q_nb held one after the other; n has z up and x north.
    gravity, latitude : float
        Of the site [m/s^2], [rad].
    rng : Generator
    rate : float
        Sample rate [Hz].
    start, hold, turn : float
        Length of the first hold, of the others and of the turns [s].
    clock : float
        Seconds that the record's clock counts in a true second.
    disturbances : Disturbances
        All but the error of the clock.

    Returns
    -------
    record : Record
        ``acc_*`` and ``gyro_*`` in counts, not rounded (noise exceeds a count).
    truth : ImuTruth
        With the biases of this recording: the mean over the holds of what wandered. That is what a single
        recording can tell; how far the bias of another will lie from it, only other recordings can.

    Notes
    -----
    Each turn is one rotation about a fixed axis with a smooth (quintic) angle, so that the true rate and
    attitude are exact at every sample; the hand accelerates the instrument by up to 1 m/s^2 meanwhile.
    """
    steps = [log(multiply(conjugate(a), b)) for a, b in itertools.pairwise(poses)]
    q, rates, moving, holds = [], [], [], []
    for k, attitude in enumerate(poses):
        still = round((start if k == 0 else hold) * rate)
        q.append(np.broadcast_to(attitude, (still, 4)))
        rates.append(np.zeros((still, 3)))
        moving.append(np.zeros((still, 3)))
        begin = sum(map(len, rates[:-1]))
        holds.append(slice(begin, begin + still))
        if k < len(steps):
            s = np.arange(1, round(turn * rate)) / round(turn * rate)
            angle = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
            speed = 30.0 * s**2 * (1.0 - s) ** 2 / turn
            q.append(multiply(attitude, exp(angle[:, None] * steps[k])))
            rates.append(speed[:, None] * steps[k])
            moving.append(np.sin(2.0 * np.pi * s)[:, None] * rng.uniform(-1.0, 1.0, 3))
    if disturbances.restless_start > 0.0:
        q[0], rates[0] = trembling(poses[0], len(q[0]), rate, disturbances.restless_start, rng)
    q_nb = np.concatenate(q)
    to_body = conjugate(q_nb)
    north, up = earth_rate(latitude)
    omega = np.concatenate(rates) + rotate(to_body, np.array([float(north), 0.0, float(up)]))
    f = rotate(to_body, np.array([0.0, 0.0, gravity])) + np.concatenate(moving)
    n = len(q_nb)
    f_error, f_wander = wandering_noise(truth.accelerometer_noise, n, rate, rng)
    w_error, w_wander = wandering_noise(truth.gyro_noise, n, rate, rng)
    turned = [slice(a.stop, b.start) for a, b in itertools.pairwise(holds)]
    acc, gyro = indicated(truth, f, omega, (f_error, w_error), turned, rate, disturbances, rng)
    t = np.arange(n, dtype=np.float64) * (clock / rate)
    return record_of_counts(t, acc, gyro), replace(
        truth,
        accelerometer=_with_mean(truth.accelerometer, f_wander, holds),
        gyro=_with_mean(truth.gyro, w_wander, holds),
    )


def indicated(
    truth: ImuTruth,
    f: Array,
    omega: Array,
    errors: tuple[Array, Array],
    turned: Sequence[slice],
    rate: float,
    disturbances: Disturbances,
    rng: np.random.Generator,
) -> tuple[Array, Array]:
    """Outputs (n, 3) of accelerometers and gyro at specific force ``f`` and rate ``omega`` (n, 3), disturbed.

    ``errors`` (n, 3) each are those of specific force and rate, ``turned`` the samples of each turn, ``rate`` [Hz] that
    of the samples.
    """
    acc = truth.accelerometer.indicate(f + errors[0])
    if disturbances.k2:
        along = f @ truth.accelerometer.misalignment.T
        acc = acc + truth.accelerometer.scale * (disturbances.k2 * along**2)
    w_error = errors[1] + knocked(turned, rate, disturbances, len(f), rng)
    gyro = truth.gyro.indicate(omega + w_error) + f @ truth.g_sensitivity.T
    return acc, clipped(gyro, truth.gyro, disturbances)


def knocked(
    turned: Sequence[slice], rate: float, disturbances: Disturbances, n: int, rng: np.random.Generator
) -> Array:
    """Rates (n, 3) [rad/s] that a gyro reads in knocks, in turns at random, and that are none."""
    made = np.zeros((n, 3))
    for k in rng.permutation(len(turned))[: disturbances.knocks] if disturbances.knocks else ():
        made += _knock(turned[k], rate, disturbances.knock, n, rng)
    return made


def clipped(gyro: Array, model: TriadModel, disturbances: Disturbances) -> Array:
    """Outputs (n, 3) of a gyro within its range."""
    if disturbances.gyro_range is None:
        return gyro
    most = np.abs(model.scale) * disturbances.gyro_range
    return np.clip(gyro, model.bias - most, model.bias + most)


def with_values(truth: ImuTruth, values: Mapping[str, float]) -> ImuTruth:
    """The instrument with these coefficients by term symbol in the place of its own."""
    whole = truth.values() | dict(values)
    g = np.array([[whole[f"G_{i}{j}"] for j in "xyz"] for i in "xyz"])
    return replace(
        truth,
        accelerometer=triad_from_terms(whole, "K1", "M", "K0"),
        gyro=triad_from_terms(whole, "S", "T", "D_F"),
        g_sensitivity=g,
    )


def as_stated(truth: ImuTruth, of: Simulation) -> ImuTruth:
    """The instrument with the coefficients and the noise that a study states."""
    return replace(
        with_values(truth, of.coefficients),
        accelerometer_noise=TriadNoise(of.accelerometer_noise, of.accelerometer_wander),
        gyro_noise=TriadNoise(of.gyro_noise, of.gyro_wander),
    )


def trembling(
    attitude: Array, n: int, rate: float, size: float, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Attitudes (n, 4) and rates (n, 3) [rad/s] of a hold that trembles by ``size`` [rad], at 1 to 6 Hz."""
    t = np.arange(n) / rate
    frequency = 2.0 * np.pi * rng.uniform(1.0, 6.0, (6, 3, 1))
    phase = frequency * t + rng.uniform(0.0, 2.0 * np.pi, (6, 3, 1))
    part = np.clip((t[-1] - t) / 0.5, 0.0, 1.0)  # dies away over the last half second
    fade, slope = part**2 * (3.0 - 2.0 * part), np.where(part < 1.0, -12.0 * part * (1.0 - part), 0.0)
    wave = size * np.sqrt(2.0 / 6.0) * np.sin(phase).sum(axis=0)
    speed = size * np.sqrt(2.0 / 6.0) * (frequency * np.cos(phase)).sum(axis=0)
    angle, change = (fade * wave).T, (fade * speed + slope * wave).T
    # rate on the body's axes of exp(angle), to second order
    return multiply(attitude, exp(angle)), change - 0.5 * np.cross(angle, change)


def _knock(turn: slice, rate: float, angle: float, n: int, rng: np.random.Generator) -> Array:
    """Rates (n, 3) [rad/s] that a gyro reads in some 20 ms of a turn and that are none, by ``angle`` [rad] in all."""
    length = max(1, round(0.02 * rate))
    begin = int(rng.integers(turn.start, max(turn.start + 1, turn.stop - length)))
    axis = rng.standard_normal(3)
    made = np.zeros((n, 3))
    made[begin : begin + length] = angle * rate / length * axis / np.linalg.norm(axis)
    return made


def wandering_noise(noise: TriadNoise, n: int, rate: float, rng: np.random.Generator) -> tuple[Array, Array]:
    """White noise plus wandering bias, and the latter alone, (n, 3) each, in SI units, at a sample ``rate`` [Hz]."""
    from scipy.signal import lfilter

    white = rng.normal(0.0, noise.white * np.sqrt(rate), (n, 3))
    decay = np.exp(-1.0 / (noise.wander_time * rate))
    drive = rng.normal(0.0, noise.wander * np.sqrt(1.0 - decay**2), (n, 3))
    drive[0] = rng.normal(0.0, noise.wander, 3)
    wander = np.asarray(lfilter([1.0], [1.0, -decay], drive, axis=0))
    return white + wander, wander


def _with_mean(model: TriadModel, wander: Array, holds: list[slice]) -> TriadModel:
    """The triad with the mean over the holds of a wandering input [SI] in its bias."""
    mean = np.mean([wander[hold].mean(axis=0) for hold in holds], axis=0)
    return replace(model, bias=model.bias + model.gain @ mean)


def record_of_counts(t: Array, acc: Array, gyro: Array) -> Record:
    """A record of accelerometer and gyro outputs (n, 3) in counts at times ``t`` (n,) [s]."""
    count = parse_unit("count")
    return record_of(
        (
            (f"{sensor}_{axis}", count, values[:, i])
            for sensor, values in (("acc", acc), ("gyro", gyro))
            for i, axis in enumerate("xyz")
        ),
        t,
    )
