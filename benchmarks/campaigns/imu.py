"""One simulated calibration, for campaigns that ask whether the stated uncertainties are true."""

from __future__ import annotations

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Status
from inercal.foundation.geometry.earth import GravityInput, Site
from inercal.systems.imu.settings import ImuSettings
from inercal.systems.imu.simulate import draw_truth, hand_poses, simulate
from inercal.systems.imu.task import calibrate as calibrate_imu

GRAVITY, GRAVITY_U = 9.81, 1e-4
"""Gravity as stated to the calibration [m/s^2], and its standard uncertainty."""

TIME_BASE_U = 5e-5
"""Relative standard uncertainty of the record's clock."""

LATITUDE = 0.8
"""Latitude of the site [rad]."""


def one_calibration(rng: np.random.Generator) -> dict[str, Array]:
    """Draw an instrument, a site and a clock, hold it in 24 poses, calibrate, and compare with the truth.

    Returns
    -------
    ``error`` and ``u`` (21,) in the order of the term table, their ``dof`` (21,), ``covariance`` (21, 21) and
    ``sound`` (1 if the status was ok).
    """
    return _one(rng, 0.0)


def one_calibration_with_g_sensitivity(rng: np.random.Generator) -> dict[str, Array]:
    """As `one_calibration`, with the nine g-sensitive drift coefficients drawn and estimated (30 in all)."""
    return _one(rng, 2e-4)


def _one(rng: np.random.Generator, g_sensitivity: float) -> dict[str, Array]:
    """A simulated calibration with true g-sensitivities of that standard deviation [(rad/s)/(m/s^2)]."""
    truth = draw_truth(rng, g_sensitivity)
    gravity = rng.normal(GRAVITY, GRAVITY_U)
    clock = 1.0 + rng.normal(0.0, TIME_BASE_U)
    record, truth = simulate(truth, hand_poses(rng, 24), gravity, LATITUDE, rng, rate=50.0, clock=clock)
    site = Site(GRAVITY, (GravityInput("gravity", GRAVITY_U, "m/s^2", 1.0),), LATITUDE)
    settings = ImuSettings(
        site,
        g_sensitivity=g_sensitivity > 0.0,
        g_sensitivity_u=None if g_sensitivity > 0.0 else 0.0,
        time_base_u=TIME_BASE_U,
        k2_u=0.0,
    )
    estimate = calibrate_imu(record, settings).estimate
    true = truth.values()
    return {
        "error": estimate.values - np.array([true[name] for name in estimate.names]),
        "u": estimate.u,
        "dof": estimate.dof,
        "covariance": estimate.covariance,
        "sound": np.array(float(estimate.status is Status.OK)),
    }
