"""Drivers of the bias of the gyro: the specific force, and the time.

Bias = D_F + G f + D_R (t - t0), G and D_R where they are asked for. t0 is the mean of the times of the poses, so
that D_F is the bias in the middle of the recording and hardly depends on whether its drift is fitted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.systems.imu.multiposition.poses import Poses
from inercal.systems.imu.recording import Recording
from inercal.systems.imu.settings import ImuSettings


@dataclass(frozen=True)
class Drivers:
    """The drivers of a recording.

    ``names`` (3 q,) of the coefficients, gyro axis by gyro axis; ``at_rest`` (n, q) the drivers in the poses,
    ``at_samples`` (samples, q) at those of the gyro: specific force [m/s^2], then time since ``t0`` [s].
    """

    names: tuple[str, ...]
    at_rest: Array
    at_samples: Array
    t0: float


def drivers_of(recording: Recording, poses: Poses, settings: ImuSettings) -> Drivers:
    """The drivers that the settings ask for; the recording must have a gyro."""
    gyro, acc = recording.gyro, recording.accelerometer
    assert gyro is not None
    t0 = float(poses.times.mean())
    columns, symbols = [(np.empty((len(poses.times), 0)), np.empty((len(gyro.t), 0)))], []
    if settings.g_sensitivity:
        f = poses.accelerometer.correct(acc.values)
        if gyro.t is not acc.t:
            f = np.column_stack([np.interp(gyro.t, acc.t, column) for column in f.T])
        columns.append((poses.accelerometer.f, f))
        symbols += [f"G_{{}}{axis}" for axis in "xyz"]
    if settings.bias_drift:
        columns.append((poses.times[:, None] - t0, gyro.t[:, None] - t0))
        symbols.append("D_R_{}")
    at_rest, at_samples = (np.hstack(parts) for parts in zip(*columns, strict=True))
    return Drivers(
        tuple(symbol.format(axis) for axis in "xyz" for symbol in symbols), at_rest, at_samples, t0
    )
