"""A simulated Ferraris session: six positions and three turns by an instrument of known truth."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.earth import earth_rate
from inercal.foundation.geometry.rotations import conjugate, exp, log, multiply, rotate
from inercal.foundation.instruments.triad import TriadModel
from inercal.foundation.records.record import Record
from inercal.systems.imu.ferraris.names import POSITIONS, TERMS_OF_FERRARIS, TURNS, UP
from inercal.systems.imu.settings import Disturbances, FerrarisSettings, ImuSettings
from inercal.systems.imu.simulate import (
    ImuTruth,
    TriadNoise,
    as_stated,
    draw_full_truth,
    indicated,
    record_of_counts,
    trembling,
    wandering_noise,
)


@dataclass(frozen=True)
class SessionCourse:
    """The course of a session.

    ``holds`` lengths of the six positions, ``turning`` that of a turn, ``rest`` of the pauses before and after it and
    ``way`` of the motion between sections [s]; ``rate`` of samples [Hz]; ``turn`` the stated angle [rad], ``turn_u``
    and ``alignment`` the standard deviations [rad] of the true one and of the directions; ``gravity`` [m/s^2] and
    ``latitude`` [rad] of the site; ``clock`` seconds that the record's clock counts in a true second. ``headings`` are
    changes of heading [rad] before and after each turn, with a ``pause`` [s] between; none where they are 0.
    """

    holds: tuple[float, ...] = (5.0,) * 6
    turn: float = 2.0 * math.pi
    turning: float = 5.0
    rest: float = 2.0
    way: float = 2.0
    rate: float = 50.0
    alignment: float = 0.0
    turn_u: float = 0.0
    gravity: float = 9.81
    latitude: float | None = None
    clock: float = 1.0
    headings: tuple[float, float] = (0.0, 0.0)
    pause: float = 1.0


def true_values(truth: ImuTruth) -> Array:
    """The coefficients (33,) in the order of `TERMS_OF_FERRARIS`."""
    values = truth.values()
    M = truth.accelerometer.misalignment
    values |= {f"M_{i}{j}": float(M["xyz".index(i), "xyz".index(j)]) for i, j in ("yx", "zx", "zy")}
    return np.array([values[name] for name in TERMS_OF_FERRARIS])


def simulate_session(
    truth: ImuTruth,
    session: SessionCourse,
    rng: np.random.Generator,
    disturbances: Disturbances = Disturbances(),  # noqa: B008  (frozen)
) -> tuple[Record, ImuTruth]:
    """Record a session: x_p, x_a, .. z_a, then each axis upright again and turned about.

    ``disturbances`` are all but the error of the clock, which is that of the session.

    Returns
    -------
    record : Record
        Labelled, in counts, not rounded.
    truth : ImuTruth
        With the biases of this recording: their means over the positions.

    Notes
    -----
    Each position is tilted, and each turn made about an axis that is tilted in the instrument and upright in space;
    headings are drawn. Turns are quintic in time and reach rest at both ends.
    """
    q, rates, labels = [], [], []

    def add(name: str, attitudes: Array, omega: Array) -> None:
        q.append(attitudes)
        rates.append(omega)
        labels.extend([name] * len(attitudes))

    def go(to: Array) -> None:
        if q:
            step = log(multiply(conjugate(q[-1][-1]), to))
            add("", *_motion(q[-1][-1], step, session.way, session.rate))

    def stay(name: str, attitude: Array, length: float) -> None:
        samples = round(length * session.rate)
        add(name, np.broadcast_to(attitude, (samples, 4)), np.zeros((samples, 3)))

    for name, up, hold in zip(POSITIONS, UP, session.holds, strict=True):
        attitude = _upright(up, session.alignment, rng)
        go(attitude)
        stay(name, attitude, hold)
    for name, up in zip(TURNS, UP[::2], strict=True):
        axis = _tilted(up, session.alignment, rng)
        attitude = _upright(axis, 0.0, rng)
        go(attitude)
        stay("", attitude, session.rest)
        before, after = session.headings
        if before:
            add("", *_motion(attitude, before * axis, 0.5 * session.way, session.rate))
            attitude = multiply(attitude, exp(before * axis))
            stay("", attitude, session.pause)
        step = axis * (session.turn + rng.normal(0.0, session.turn_u))
        add(name, *_motion(attitude, step, session.turning, session.rate))
        attitude = multiply(attitude, exp(step))
        if after:
            stay("", attitude, session.pause)
            add("", *_motion(attitude, after * axis, 0.5 * session.way, session.rate))
            attitude = multiply(attitude, exp(after * axis))
        stay("", attitude, session.rest)
    if disturbances.restless_start > 0.0:
        size = disturbances.restless_start
        q[0], rates[0] = trembling(q[0][0], len(q[0]), session.rate, size, rng)
    return _outputs(truth, session, np.concatenate(q), np.concatenate(rates), labels, rng, disturbances)


def _outputs(
    truth: ImuTruth,
    session: SessionCourse,
    q_nb: Array,
    omega: Array,
    labels: list[str],
    rng: np.random.Generator,
    disturbances: Disturbances,
) -> tuple[Record, ImuTruth]:
    """The record that the instrument gives, and the truth with the biases of this record."""
    to_body, n, rate = conjugate(q_nb), len(q_nb), session.rate
    if session.latitude is not None:
        north, up = earth_rate(session.latitude)
        omega = omega + rotate(to_body, np.array([float(north), 0.0, float(up)]))
    f = rotate(to_body, np.array([0.0, 0.0, session.gravity]))
    f_error, f_wander = wandering_noise(truth.accelerometer_noise, n, rate, rng)
    w_error, w_wander = wandering_noise(truth.gyro_noise, n, rate, rng)
    rows = [np.flatnonzero(np.array(labels) == name) for name in TURNS]
    turned = [slice(int(each[0]), int(each[-1]) + 1) for each in rows]
    acc, gyro = indicated(truth, f, omega, (f_error, w_error), turned, rate, disturbances, rng)
    record = record_of_counts(np.arange(n, dtype=np.float64) * (session.clock / rate), acc, gyro)
    held = np.isin(labels, POSITIONS)
    return replace(record, labels=tuple(labels)), replace(
        truth,
        accelerometer=_with_mean(truth.accelerometer, f_wander[held]),
        gyro=_with_mean(truth.gyro, w_wander[held]),
    )


def _with_mean(model: TriadModel, wander: Array) -> TriadModel:
    """The triad with the mean of a wandering input [SI] in its bias."""
    return replace(model, bias=model.bias + model.gain @ wander.mean(axis=0))


def _tilted(up: Array, tilt: float, rng: np.random.Generator) -> Array:
    """A direction tilted by that standard deviation in either direction across it."""
    a, b = (axis for axis in np.eye(3) if abs(axis @ up) < 0.5)
    return rotate(exp(rng.normal(0.0, tilt) * a + rng.normal(0.0, tilt) * b), up)


def _upright(up: Array, tilt: float, rng: np.random.Generator) -> Array:
    """An attitude q_nb at a random heading with a tilted direction of the body upward."""
    direction = _tilted(up, tilt, rng)
    across = np.cross(direction, [0.0, 0.0, 1.0])
    size = float(np.linalg.norm(across))
    if size > 0.0:
        level = exp(across / size * np.arctan2(size, direction[2]))
    else:
        level = np.array([1.0, 0.0, 0.0, 0.0] if direction[2] > 0.0 else [0.0, 1.0, 0.0, 0.0])
    return multiply(exp(np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)])), level)


def _motion(start: Array, step: Array, length: float, rate: float) -> tuple[Array, Array]:
    """Attitudes (n, 4) and rates (n, 3) of a turn by a rotation vector ``step`` of the body, from rest to rest."""
    n = round(length * rate)
    s = (np.arange(n) + 0.5) / n
    angle = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    speed = 30.0 * s**2 * (1.0 - s) ** 2 / (n / rate)
    return multiply(start, exp(angle[:, None] * step)), speed[:, None] * step


def quiet(truth: ImuTruth) -> ImuTruth:
    """The same instrument without noise."""
    return replace(truth, accelerometer_noise=TriadNoise(0.0), gyro_noise=TriadNoise(0.0))


def simulate_study(settings: ImuSettings, options: FerrarisSettings, rng: np.random.Generator) -> Record:
    """The session of a study; directions and turns are off by the uncertainties that it states."""
    of, site = settings.simulation, settings.site
    truth = as_stated(draw_full_truth(rng), of)
    session = SessionCourse(
        holds=(of.hold,) * 6,
        turn=options.turn,
        turning=of.turning,
        rate=of.sample_rate,
        alignment=options.alignment or 0.0,
        turn_u=options.turn_u,
        gravity=site.gravity,
        latitude=site.latitude,
        clock=1.0 + settings.disturbances.clock,
    )
    return simulate_session(truth, session, rng, settings.disturbances)[0]
