"""One simulated Ferraris calibration, for campaigns that ask whether the stated uncertainties are true."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Status
from inercal.foundation.geometry.earth import GravityInput, Site
from inercal.systems.imu.ferraris.calibration import calibrate_ferraris
from inercal.systems.imu.ferraris.names import TERMS_OF_FERRARIS
from inercal.systems.imu.ferraris.simulate import SessionCourse, simulate_session, true_values
from inercal.systems.imu.settings import FerrarisSettings, ImuSettings
from inercal.systems.imu.simulate import ImuTruth, TriadNoise, draw_full_truth

ALIGNMENT = math.radians(0.5)
"""Standard deviation of each direction of a position and of the axis of a turn, in either direction across it [rad]."""

TURN_U = math.radians(0.2)
"""That of the angle of a turn [rad]."""

GRAVITY, GRAVITY_U = 9.81, 1e-3
"""Gravity as stated to the calibration [m/s^2], and its standard uncertainty."""

TIME_BASE_U = 1e-4
"""Relative standard uncertainty of the record's clock."""

LATITUDE = 0.8
"""Latitude of the site [rad]."""


def noisy_truth(rng: np.random.Generator) -> ImuTruth:
    """An instrument of the consumer grade whose biases wander."""
    truth = draw_full_truth(rng)
    return replace(truth, accelerometer_noise=TriadNoise(8e-4, 1e-4), gyro_noise=TriadNoise(5.6e-4, 5e-5))


def one_calibration(rng: np.random.Generator) -> dict[str, Array]:
    """Draw an instrument, a site, a clock and a session with the alignment stated, and compare with the truth.

    Returns
    -------
    ``error`` and ``u`` (33,) in the order of `inercal.systems.imu.ferraris.names.TERMS_OF_FERRARIS`, their ``dof``
    (33,), and ``sound`` (1 if the status was ok).
    """
    return _one(rng, ALIGNMENT)


def one_calibration_by_scatter(rng: np.random.Generator) -> dict[str, Array]:
    """As `one_calibration`, with the alignment left to the scatter of the positions."""
    return _one(rng, None)


def _one(rng: np.random.Generator, stated: float | None) -> dict[str, Array]:
    """A simulated calibration with that alignment stated."""
    truth = noisy_truth(rng)
    session = SessionCourse(
        alignment=ALIGNMENT,
        turn_u=TURN_U,
        gravity=rng.normal(GRAVITY, GRAVITY_U),
        latitude=LATITUDE,
        clock=1.0 + rng.normal(0.0, TIME_BASE_U),
    )
    record, truth = simulate_session(truth, session, rng)
    site = Site(GRAVITY, (GravityInput("gravity", GRAVITY_U, "m/s^2", 1.0),), LATITUDE)
    options = FerrarisSettings(turn_u=TURN_U, alignment=stated)
    estimate = calibrate_ferraris(
        record, ImuSettings(site, time_base_u=TIME_BASE_U, k2_u=0.0), options
    ).estimate
    at = [estimate.names.index(name) for name in TERMS_OF_FERRARIS]
    return {
        "error": estimate.values[at] - true_values(truth),
        "u": estimate.u[at],
        "dof": estimate.dof[at],
        "sound": np.array(float(estimate.status is Status.OK)),
    }
