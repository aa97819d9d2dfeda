"""One simulated calibration on a table, for campaigns that ask whether the stated uncertainties are true."""

from __future__ import annotations

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Status
from inercal.foundation.geometry.earth import EARTH_RATE, GravityInput, Site
from inercal.foundation.instruments.triad import TriadModel
from inercal.foundation.rigs.patterns import normal
from inercal.foundation.rigs.tables import turntable
from inercal.systems.imu.aided.calibration import calibrate_aided
from inercal.systems.imu.aided.simulate import AidedTruth, Program, simulate
from inercal.systems.imu.settings import AidedSettings, ImuSettings

GRAVITY, GRAVITY_U = 9.81, 2e-4
"""Gravity as stated to the calibration [m/s^2], and its standard uncertainty."""

LATITUDE = 0.8
"""Latitude of the site [rad]."""

TABLE_U = 1e-4
"""Standard deviation of each error of the table [rad]."""

ERRORS = ("dphi_y1", "dphi_z2", "dalpha_x2", "deps_y", "dbase_x", "dtheta_z")
"""Errors of the table: some of each rest, some of the whole test."""

_QUARTER = 0.5 * np.pi
PROGRAM: Program = [
    ("rest", 0.0, 6.0), ("phi2", 4.0 * _QUARTER, 8.0), ("rest", 0.0, 4.0), ("phi1", 4.0 * _QUARTER, 8.0),
    ("rest", 0.0, 4.0), ("phi2", _QUARTER, 3.0), ("rest", 0.0, 4.0), ("phi1", _QUARTER, 3.0), ("rest", 0.0, 4.0),
    ("phi1", 2.0 * _QUARTER, 5.0), ("rest", 0.0, 4.0), ("phi2", -_QUARTER, 3.0), ("rest", 0.0, 4.0),
    ("phi1", -2.0 * _QUARTER, 5.0), ("rest", 0.0, 4.0), ("phi1", 3.0 * _QUARTER, 6.0), ("rest", 0.0, 4.0),
]  # fmt: skip
"""Nine rests and whole and part turns about all axes."""


def draw_truth(rng: np.random.Generator) -> AidedTruth:
    """An instrument with 1 % errors, its biases wandering, at a random heading and beside the crossing of the axes."""

    def triad(bias: float) -> TriadModel:
        cross = rng.normal(0.0, 0.01, (3, 3))
        np.fill_diagonal(cross, 1.0)
        return TriadModel(1.0 + rng.normal(0.0, 0.01, 3), cross, rng.normal(0.0, bias, 3))

    heading = rng.uniform(-np.pi, np.pi)
    across = EARTH_RATE * np.cos(LATITUDE)
    return AidedTruth(
        acc=triad(0.1),
        gyro=triad(2e-3),
        gravity=rng.normal(GRAVITY, GRAVITY_U),
        white=(2e-3, 3e-4),
        walk=(3e-4, 3e-5),
        arms=rng.normal(0.0, 0.05, (3, 3)),
        late=rng.uniform(-0.05, 0.05),
        earth=np.array([across * np.cos(heading), across * np.sin(heading), EARTH_RATE * np.sin(LATITUDE)]),
    )


def one_calibration(rng: np.random.Generator) -> dict[str, Array]:
    """Draw an instrument, a table and a site, run the test, calibrate, and compare with the truth.

    Returns
    -------
    ``error`` and ``u`` (24,), their ``dof`` (24,), and ``sound`` (1 if the status was ok).
    """
    chain = turntable("two_axis_turntable", None, dict.fromkeys(ERRORS, normal(TABLE_U)))
    record, true = simulate(draw_truth(rng), chain, PROGRAM, rng, rate=20.0)
    site = Site(GRAVITY, (GravityInput("gravity", GRAVITY_U, "m/s^2", 1.0),), LATITUDE)
    estimate = calibrate_aided(record, ImuSettings(site), AidedSettings(chain)).estimate
    return {
        "error": estimate.values - np.array([true[name] for name in estimate.names]),
        "u": estimate.u,
        "dof": estimate.dof,
        "sound": np.array(float(estimate.status is Status.OK)),
    }
