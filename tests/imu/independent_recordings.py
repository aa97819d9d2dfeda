"""Recordings by the simulator of benchmarks/independent, calibrated by hand-held methods."""

from __future__ import annotations

import numpy as np
from independent import imu
from recordings import record_of

from inercal.foundation.geometry.earth import Site
from inercal.systems.imu.sections.outcome import CalibrationFromSections
from inercal.systems.imu.settings import ImuSettings
from inercal.systems.imu.task import calibrate

SETTINGS = ImuSettings(Site(imu.G, (), imu.LATITUDE))


def calibrated(
    seed,
    faults=None,
    settings=SETTINGS,
    poses=24,
    ups=imu.random_ups,
    k2=0.0,
    acc_noise=8e-4,
    gyro_noise=5.6e-4,
    **options,
) -> tuple[CalibrationFromSections, np.ndarray]:
    """The calibration of a simulated unit, and errors over u of its coefficients that have a truth."""
    rng = np.random.default_rng(seed)
    made = imu.unit(rng, acc_noise=acc_noise, gyro_noise=gyro_noise)
    made.k2 = np.broadcast_to(k2, 3)
    t, acc, gyro = imu.record(rng, made, ups(rng, poses), faults, **options)
    calibration = calibrate(record_of(t, acc, gyro, "m/s^2", "rad/s"), settings)
    estimate, truth = calibration.estimate, made.truth()
    errors = [
        (value - truth[name]) / u
        for name, value, u in zip(estimate.names, estimate.values, estimate.u, strict=True)
        if name in truth
    ]
    return calibration, np.array(errors)
