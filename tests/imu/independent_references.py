"""Tests against a reference, simulated by the independent forward model of `protocols.physics`."""

from __future__ import annotations

import numpy as np
from protocols.physics import DEG, EARTH_RATE, GRAVITY, LATITUDE, Unit, unit
from scipy.spatial.transform import Rotation

from inercal.faces.python.recordings import record
from inercal.foundation.geometry.earth import Site
from inercal.foundation.records.record import Record
from inercal.systems.imu.settings import ImuSettings

FS = 100.0


def steady(rng: np.random.Generator) -> Unit:
    """A unit whose biases do not wander, without drift by force and second order, which the tests do not estimate."""
    made = unit(rng)
    return made.given(G=0.0 * made.G, K2=0.0 * made.K2, acc_walk=0.0, gyro_walk=0.0)


SETTINGS = ImuSettings(Site(GRAVITY, (), LATITUDE))


def smooth(program: list[tuple[int, float, float]], joints: int, t: np.ndarray) -> np.ndarray:
    """Angles (n, joints) [rad] at times: (joint, angle [deg], duration [s]); an angle of 0 is a rest."""
    angles, begin = np.zeros((len(t), joints)), 0.0
    for joint, angle, duration in program:
        s = np.clip((t - begin) / duration, 0.0, 1.0)
        angles[:, joint] += angle * DEG * (10 * s**3 - 15 * s**4 + 6 * s**5)
        begin += duration
    return angles


def simulated(
    made: Unit,
    axes: str,
    program: list[tuple[int, float, float]],
    rng: np.random.Generator,
    arm: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, Rotation]:
    """Times, angles (n, joints), outputs of both triads (n, 3) and attitudes body to world of a chain of joints.

    Rates and accelerations by an arm [m] are differences of attitudes at eight times the sample rate.
    """
    fine = 8
    t = np.arange(round(sum(duration for *_, duration in program) * FS)) / FS
    h = 1.0 / FS / fine
    at = np.stack([t - h, t, t + h], axis=1)
    angles = smooth(program, len(axes), at.ravel())
    attitude = Rotation.from_euler(axes.upper(), angles)
    C = attitude.as_matrix().reshape(len(t), 3, 3, 3)
    before, now, after = (Rotation.from_matrix(C[:, k]) for k in range(3))
    rate = (before.inv() * after).as_rotvec() / (2 * h)
    place = C @ np.asarray(arm)
    moved = (place[:, 2] - 2 * place[:, 1] + place[:, 0]) / h**2
    force = now.inv().apply(np.array([0.0, 0.0, GRAVITY]) + moved)
    acc, gyro = made.outputs(force, rate + now.inv().apply(np.tile(EARTH_RATE, (len(t), 1))), FS, rng)
    return t, angles.reshape(len(t), 3, -1)[:, 1], acc, gyro, now


def as_record(
    reference: dict[str, np.ndarray], t: np.ndarray, acc: np.ndarray, gyro: np.ndarray, *channels: str
) -> Record:
    """A record of reference columns and the ``channels`` of the sensors, of all if none are named."""
    whole = {
        f"{sensor}_{i}": values[:, k]
        for sensor, values in (("acc", acc), ("gyro", gyro))
        for k, i in enumerate("xyz")
    }
    return record(reference | {name: whole[name] for name in channels or whole}, t=t)


__all__ = ["DEG", "SETTINGS", "as_record", "simulated", "steady"]
