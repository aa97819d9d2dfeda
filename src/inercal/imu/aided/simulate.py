"""Simulated tests on a table: rests and turns, with everything that the calibration allows for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from inercal.arrays import Array
from inercal.geometry.earth import EARTH_RATE
from inercal.geometry.rotations import skew
from inercal.imu.aided.blocks import small_turn
from inercal.instruments.triad import TriadModel
from inercal.records.record import Record, record_of
from inercal.rigs.chain import Chain
from inercal.units import parse_unit

Program = Sequence[tuple[str, float, float]]
"""Moves of the table: ``("rest", 0, duration)`` or (joint, angle [rad], duration), durations in seconds."""


@dataclass(frozen=True, eq=False)
class Truth:
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
    truth: Truth, chain: Chain, program: Program, rng: np.random.Generator, rate: float = 50.0
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

    Returns
    -------
    Record
        ``acc_x..z``, ``gyro_x..z`` and the chain's joints, in SI.
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
    values, biases = {}, {}
    for k, sensor in enumerate(("acc", "gyro")):
        model = truth.acc if sensor == "acc" else truth.gyro
        steps = truth.walk[k] * np.sqrt(dt) * rng.standard_normal((len(t), 3))
        bias = model.bias + np.cumsum(steps, axis=0)
        if sensor == "acc":
            felt = np.einsum(
                "ij,nij->ni", model.gain, force[:, None] + np.einsum("njk,ik->nij", arm, truth.arms)
            )
        else:
            felt = (rates + C_bn @ truth.earth) @ model.gain.T + force @ truth.g_sensitivity.T
        noise = truth.white[k] / np.sqrt(dt) * rng.standard_normal((len(t), 3))
        values[sensor] = felt + bias + noise
        biases[sensor] = bias.mean(axis=0)
    angles = angles_at(program, chain.joints, t - truth.late)
    columns = [
        (f"{sensor}_{axis}", parse_unit(unit), values[sensor][:, i])
        for sensor, unit in (("acc", "m/s^2"), ("gyro", "rad/s"))
        for i, axis in enumerate("xyz")
    ] + [(joint, parse_unit("rad"), angles[:, k]) for k, joint in enumerate(chain.joints)]
    return record_of(columns, t), _values(truth, biases)


def _values(truth: Truth, biases: Mapping[str, Array]) -> dict[str, float]:
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
    values |= {
        f"G_{i}{j}": float(truth.g_sensitivity[a, b])
        for a, i in enumerate("xyz")
        for b, j in enumerate("xyz")
    }
    return values
