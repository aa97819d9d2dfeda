"""One covariance for accelerometers and gyro: every error of the estimate traced to the scatter behind it.

All estimates are linear in three kinds of independent errors: of the specific force in the poses (scatter of
the accelerometers), of the verticals carried through the turns (the gyro's random walk), and of the mean
gyro outputs in the poses. Their gains give the covariance of all parameters together, and the same gains
give the covariance that the sensors' noise alone would cause.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.earth import Site
from inercal.foundation.results.budget import TypeA, TypeB
from inercal.systems.imu.multiposition.accelerometer import AccelerometerFit
from inercal.systems.imu.multiposition.gyro import GyroFit


@dataclass(frozen=True)
class PoseScatter:
    """Standard deviation of |f| in a pose about the fit [m/s^2], its degrees of freedom, and whether it
    exceeds what the sensors' noise explains."""

    s: float
    dof: float
    excess: bool
    over_noise: float


def radial(fit: AccelerometerFit) -> Array:
    """(n, 3 n): errors of |f| in the poses by errors of f."""
    n = len(fit.f)
    out = np.zeros((n, n, 3))
    out[range(n), range(n)] = fit.directions
    return out.reshape(n, 3 * n)


def force_error(fit: AccelerometerFit) -> Array:
    """(3 n, 3 n): errors of the calibrated specific force by independent errors of f in the poses."""
    by_parameter = fit.force_sensitivity().reshape(3 * len(fit.f), -1)
    return np.asarray(np.eye(3 * len(fit.f)) + by_parameter @ fit.fit.gain() @ radial(fit))


@dataclass(frozen=True)
class JointTriads:
    """Names, values and gains of accelerometers and gyro together (p parameters).

    ``by_force`` (p, 3 n), ``by_turn`` (p, 3 m) and ``by_output`` (p, 3 n) take the three kinds of errors to
    errors of the parameters.
    """

    names: tuple[str, ...]
    values: Array
    by_force: Array
    by_turn: Array
    by_output: Array
    accelerometer: AccelerometerFit
    gyro: GyroFit | None


def join(accelerometer: AccelerometerFit, gyro: GyroFit | None) -> JointTriads:
    """Stack the two fits."""
    by_force = accelerometer.fit.gain() @ radial(accelerometer)
    names, values = accelerometer.names, accelerometer.fit.x
    if gyro is None:
        empty = np.zeros((len(names), 0))
        return JointTriads(names, values, by_force, empty, empty, accelerometer, None)
    turns, poses = gyro.vertical_error.shape[0], by_force.shape[1]
    to_turn, to_output = gyro.gain[:, :turns], gyro.gain[:, turns:]
    pad = len(names)
    return JointTriads(
        names + gyro.names,
        np.concatenate([values, gyro.x]),
        np.vstack([by_force, to_turn @ gyro.vertical_error]),
        np.vstack([np.zeros((pad, turns)), to_turn]),
        np.vstack([np.zeros((pad, poses)), to_output]),
        accelerometer,
        gyro,
    )


def type_a(joint: JointTriads, scatter: PoseScatter, gyro_unit: str) -> list[TypeA]:
    """Uncertainties of the parameters by scatter in the data; ``gyro_unit`` is that of the gyro's output."""
    sources = [
        TypeA(
            "pose scatter", scatter.s, "m/s^2", scatter.s**2 * joint.by_force @ joint.by_force.T, scatter.dof
        )
    ]
    if joint.gyro is None:
        return sources
    gyro = joint.gyro
    turn = np.repeat(gyro.durations, 3) * gyro.walk**2
    sources.append(
        TypeA("turn scatter", gyro.walk, "rad/sqrt(s)", (joint.by_turn * turn) @ joint.by_turn.T, gyro.dof)
    )
    output = np.tile(gyro.static.scatter**2, joint.by_output.shape[1] // 3)
    size = float(np.sqrt(np.mean(gyro.static.scatter**2)))
    covariance = (joint.by_output * output) @ joint.by_output.T
    sources.append(TypeA("gyro output at rest", size, gyro_unit, covariance, gyro.static.dof))
    return sources


def type_b(
    joint: JointTriads, site: Site, time_base_u: float, resolution: Array, gyro_unit: str
) -> list[TypeB]:
    """Uncertainties of the parameters by gravity, the record's clock, earth rate and the gyro's resolution.

    ``resolution`` (3,) [``gyro_unit``] is the step of gyro outputs too coarse for their noise, else 0: then every
    pose has the same rounding error, u = step/sqrt(12) (GUM F.2.2.1), where scatter shows nothing.

    Gravity sets the scale of specific force: K1, K2 and G go as 1/g. The clock sets the scale of rate: S goes as
    the length of the record's second. The parts of earth rate that are not known act through the fit.
    """

    def scaled(factor: float, *prefixes: str) -> Array:
        values = zip(joint.names, joint.values, strict=True)
        return np.array([factor * value if name.startswith(prefixes) else 0.0 for name, value in values])

    by_gravity = scaled(-1.0 / site.gravity, "K1_", "K2_", "G_")
    sources = [TypeB(i.source, i.u, i.unit, by_gravity * i.sensitivity) for i in site.inputs]
    if joint.gyro is None:
        return sources
    if time_base_u > 0:
        sources.append(TypeB("time base", time_base_u, "1", scaled(1.0, "S_")))
    if site.horizontal_rate_u > 0 and joint.gyro.rate_gain.size:
        padded = np.vstack(
            [np.zeros((len(joint.accelerometer.names), joint.gyro.rate_gain.shape[1])), joint.gyro.rate_gain]
        )
        sources.append(TypeB("earth rate", site.horizontal_rate_u, "rad/s", padded / site.horizontal_rate_u))
    if np.any(resolution > 0):
        largest = float(np.max(resolution))
        own = np.zeros((len(joint.names), 3))
        for i, axis in enumerate("xyz"):
            own[joint.names.index(f"D_F_{axis}"), i] = resolution[i] / largest
        sources.append(TypeB("gyro resolution", largest / math.sqrt(12.0), gyro_unit, own))
    return sources


def noise_covariance(joint: JointTriads, pose: Array, walk: Array, output: Array) -> Array:
    """(p, p): covariance by the sensors' noise alone.

    Parameters
    ----------
    pose : (3 n,)
        Variance of the specific force in each pose [(m/s^2)^2].
    walk : (3,)
        Angle random walk squared of the gyro axes [rad^2/s].
    output : (3 n,)
        Variance of the mean gyro output in each pose [output^2].
    """
    covariance = (joint.by_force * pose) @ joint.by_force.T
    if joint.gyro is not None:
        # the frames of the turns differ, so the mean of the axes stands for each
        turn = np.repeat(joint.gyro.durations, 3) * float(np.mean(walk))
        covariance = covariance + (joint.by_turn * turn) @ joint.by_turn.T
        covariance = covariance + (joint.by_output * output) @ joint.by_output.T
    return np.asarray(covariance)
