"""Simulated tests on a table: rests and turns, with everything that the calibration allows for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.earth import EARTH_RATE, earth_rate
from inercal.foundation.geometry.rotations import skew
from inercal.foundation.instruments.triad import TriadModel
from inercal.foundation.records.record import Record, record_of
from inercal.foundation.rigs.chain import Chain
from inercal.foundation.units import parse_unit
from inercal.systems.imu.aided.blocks import small_turn
from inercal.systems.imu.settings import AidedSettings, Disturbances, ImuSettings
from inercal.systems.imu.simulate import clipped, draw_full_truth, knocked, with_values

Program = Sequence[tuple[str, float, float]]
"""Moves of the table: ``("rest", 0, duration)`` or (joint, angle [rad], duration), durations in seconds."""


@dataclass(frozen=True, eq=False)
class AidedTruth:
    """An IMU and the circumstances of a test, in SI.

    ``white`` [output sqrt(s)] and ``walk`` [output/sqrt(s)] of (accelerometers, gyro); ``arms`` (3, 3) [m] places of
    the accelerometers beside the crossing of the axes; ``late`` [s] by which the angles come late; ``earth`` (3,)
    [rad/s] earth rate in n; ``g_sensitivity`` (3, 3) [(rad/s)/(m/s^2)] of the gyro.
    """

    acc: TriadModel
    gyro: TriadModel
    gravity: float = 9.81
    white: tuple[float, float] = (0.0, 0.0)
    walk: tuple[float, float] = (0.0, 0.0)
    arms: Array = field(default_factory=lambda: np.zeros((3, 3)))
    late: float = 0.0
    earth: Array = field(default_factory=lambda: np.array([0.6, 0.0, 0.8]) * EARTH_RATE)
    g_sensitivity: Array = field(default_factory=lambda: np.zeros((3, 3)))


def angles_at(program: Program, joints: Sequence[str], t: Array) -> Array:
    """Angles (n, joints) [rad] at times ``t`` (n,) [s]: turns begin and end smoothly, ``x - sin(2 pi x)/(2 pi)``."""
    angles, begin = np.zeros((len(t), len(joints))), 0.0
    for what, angle, duration in program:
        if what != "rest":
            x = np.clip((t - begin) / duration, 0.0, 1.0)
            angles[:, joints.index(what)] += angle * (x - np.sin(2.0 * np.pi * x) / (2.0 * np.pi))
        begin += duration
    return angles


def rests_of(program: Program) -> Array:
    """Begin and end (k, 2) [s] of the rests."""
    ends = np.cumsum([duration for *_, duration in program])
    spans = [
        (end - duration, end)
        for (what, _, duration), end in zip(program, ends, strict=True)
        if what == "rest"
    ]
    return np.array(spans)


def simulate(
    truth: AidedTruth,
    chain: Chain,
    program: Program,
    rng: np.random.Generator,
    rate: float = 50.0,
    disturbances: Disturbances = Disturbances(),  # noqa: B008  (frozen)
    units: tuple[str, str] = ("m/s^2", "rad/s"),
) -> tuple[Record, Mapping[str, float]]:
    """Run a test.

    Parameters
    ----------
    truth : Truth
    chain : Chain
        The table; its errors are drawn, those of scope ``position`` for each rest with straight lines between.
    program : Program
    rng : Generator
    rate : float
        Sample rate [Hz].
    disturbances : Disturbances
        Knocks, range of the gyro, clock and K2 of them.
    units : (accelerometers, gyro)
        Units of the outputs of ``truth``.

    Returns
    -------
    Record
        ``acc_x..z``, ``gyro_x..z`` in those units and the chain's joints in rad.
    dict
        True coefficients by symbol; biases are means over the test.
    """
    dt = 1.0 / rate
    t = np.arange(0.0, sum(duration for *_, duration in program), dt)
    rests = rests_of(program)
    middles = rests.mean(axis=1) if len(rests) else np.zeros(0)
    table_errors = chain.draw(rng, angles_at(program, chain.joints, middles))

    def attitude(at: Array) -> Array:
        errors = np.stack(
            [np.interp(at, rests.ravel(), np.repeat(column, 2)) for column in table_errors.T], axis=-1
        ) if table_errors.shape[1] else np.zeros((len(at), 0))  # fmt: skip
        return chain.attitude(angles_at(program, chain.joints, at), errors)

    edges = attitude(np.append(t - 0.5 * dt, t[-1] + 0.5 * dt))
    rates = small_turn(np.swapaxes(edges[:-1], 1, 2) @ edges[1:]) / dt
    C_bn = np.swapaxes(attitude(t), 1, 2)
    spin = skew(rates)
    arm = skew(np.gradient(rates, dt, axis=0)) + spin @ spin
    force = truth.gravity * C_bn[:, :, 2]
    turned = [
        slice(*np.searchsorted(t, (a, b)).tolist()) for a, b in zip(rests[:-1, 1], rests[1:, 0], strict=True)
    ]
    wrong = knocked(turned, rate, disturbances, len(t), rng)
    values, biases = {}, {}
    for k, sensor in enumerate(("acc", "gyro")):
        model = truth.acc if sensor == "acc" else truth.gyro
        steps = truth.walk[k] * np.sqrt(dt) * rng.standard_normal((len(t), 3))
        bias = model.bias + np.cumsum(steps, axis=0)
        if sensor == "acc":
            at_arms = force[:, None] + np.einsum("njk,ik->nij", arm, truth.arms)
            felt = np.einsum("ij,nij->ni", model.gain, at_arms)
            felt += disturbances.k2 * felt**2 / model.scale
        else:
            felt = (rates + wrong + C_bn @ truth.earth) @ model.gain.T + force @ truth.g_sensitivity.T
        noise = truth.white[k] / np.sqrt(dt) * rng.standard_normal((len(t), 3))
        values[sensor] = felt + bias + noise
        if sensor == "gyro":
            values[sensor] = clipped(values[sensor], model, disturbances)
        biases[sensor] = bias.mean(axis=0)
    angles = angles_at(program, chain.joints, t - truth.late)
    columns = [
        (f"{sensor}_{axis}", parse_unit(unit), values[sensor][:, i])
        for sensor, unit in zip(("acc", "gyro"), units, strict=True)
        for i, axis in enumerate("xyz")
    ] + [(joint, parse_unit("rad"), angles[:, k]) for k, joint in enumerate(chain.joints)]
    return record_of(columns, t * (1.0 + disturbances.clock)), _values(truth, biases)


def _values(truth: AidedTruth, biases: Mapping[str, Array]) -> dict[str, float]:
    """True coefficients by symbol."""
    values: dict[str, float] = {}
    for sensor, model, (bias, scale, cross) in (
        ("acc", truth.acc, ("K0", "K1", "M")),
        ("gyro", truth.gyro, ("D_F", "S", "T")),
    ):
        for i, axis in enumerate("xyz"):
            values[f"{bias}_{axis}"] = float(biases[sensor][i])
            values[f"{scale}_{axis}"] = float(model.scale[i])
            for j, other in enumerate("xyz"):
                if i != j:
                    values[f"{cross}_{axis}{other}"] = float(model.misalignment[i, j])
    values |= {f"r_{i}{j}": float(truth.arms[a, b]) for a, i in enumerate("xyz") for b, j in enumerate("xyz")}
    values |= {"tau_a": -truth.late, "tau_g": -truth.late}
    values |= {
        f"G_{i}{j}": float(truth.g_sensitivity[a, b])
        for a, i in enumerate("xyz")
        for b, j in enumerate("xyz")
    }
    return values


def program_of(joints: Sequence[str], first: float, rest: float, quarter: float) -> Program:
    """Rests between whole and part turns of each joint, the inner one first, that tell all coefficients of an IMU.

    ``first`` is the length of the first rest, ``rest`` that of the others and ``quarter`` that of a turn by 90 deg [s];
    a longer turn takes half as long again for each quarter more.
    """
    inner, outer = joints[-1], joints[0]
    moves = [(joint, 4) for joint in reversed(joints)]
    moves += [(outer, 1), (inner, 1), (inner, 2), (outer, -1), (inner, -2), (inner, 3)]
    program = [("rest", 0.0, first)]
    for joint, quarters in moves:
        program.append((joint, 0.5 * np.pi * quarters, 0.5 * quarter * (1 + abs(quarters))))
        program.append(("rest", 0.0, rest))
    return program


def simulate_study(settings: ImuSettings, options: AidedSettings, rng: np.random.Generator) -> Record:
    """The test of a study: a heading at random, errors of the table by its tolerances, outputs in counts."""
    of, site, more = settings.simulation, settings.site, settings.disturbances
    imu = with_values(draw_full_truth(rng, 0.0), of.coefficients)
    heading = rng.uniform(-np.pi, np.pi)
    across, up = earth_rate(site.latitude or 0.0)
    # a bias that wanders as a random walk does over the correlation time of 100 s
    walks = (np.sqrt(2.0 / 100.0) * wander for wander in (of.accelerometer_wander, of.gyro_wander))
    scales = [float(np.mean(model.scale)) for model in (imu.accelerometer, imu.gyro)]
    white = np.array([of.accelerometer_noise, of.gyro_noise]) * scales
    walk = np.array(list(walks)) * scales
    truth = AidedTruth(
        imu.accelerometer,
        imu.gyro,
        site.gravity,
        (float(white[0]), float(white[1])),
        (float(walk[0]), float(walk[1])),
        rng.normal(0.0, more.lever_arm, (3, 3)),
        more.delay,
        np.array([across * np.cos(heading), across * np.sin(heading), up]),
        imu.g_sensitivity,
    )
    program = program_of(options.chain.joints, of.start, of.hold, of.turning)
    return simulate(truth, options.chain, program, rng, of.sample_rate, more, ("count", "count"))[0]
