"""The gyrowheel on a table of the validation: its study, and one simulated calibration against the truth."""

from __future__ import annotations

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Status
from inercal.foundation.geometry.earth import Site
from inercal.foundation.rigs.distribution import uniform
from inercal.foundation.rigs.plans import grid
from inercal.foundation.rigs.tables import turntable
from inercal.foundation.units import parse_unit
from inercal.systems.turntable.positions.simulate import simulate
from inercal.systems.turntable.settings import Instrument, PositionDesign, TurntableSettings
from inercal.systems.turntable.task import calibrate

TABLE = "two_axis_turntable"

TOLERANCE = np.radians(2.0 / 60.0)
"""Half width [rad] of each of the eleven errors of the table, uniform, of its usual scope."""

NOISE = 0.01
"""Standard deviation of a reading [deg/h]."""

LATITUDE, LATITUDE_U = np.radians(39.1), np.radians(0.01)
"""Latitude as stated to the calibration [rad], and its standard uncertainty: that of a value typed as 39.1 deg."""

DRIFT = {
    "F": 50.0,
    "X": 60.0,
    "Y": 40.0,
    "Z": 8.0,
    "XX": 2.0,
    "YY": 1.5,
    "XY": 1.0,
    "XZ": 3.0,
    "YZ": 2.5,
}
"""Typical drift of either axis [deg/h], after Zhao et al. 2023's gyrowheel; an instrument's own is drawn about it."""

SPREAD = 0.5
"""Relative standard deviation of an instrument's coefficients about the typical ones."""

CROSS = 0.02
"""Standard deviation of the torquers' scale factors about 1, and of their cross terms about 0."""


def one_turntable_calibration(rng: np.random.Generator) -> dict[str, Array]:
    """Draw a gyrowheel, a table and a latitude, take 36 positions, calibrate, and compare with the truth.

    Returns
    -------
    ``error`` and ``u`` (24,) in the order of the estimate, their ``dof`` (24,), ``covariance`` (24, 24) and
    ``sound`` (1 if the status was ok).
    """
    return _one(rng, NOISE, known=True)


def one_turntable_calibration_of_unknown_noise(rng: np.random.Generator) -> dict[str, Array]:
    """As `one_turntable_calibration`, with four times the noise, which the calibration is not told."""
    return _one(rng, 4.0 * NOISE, known=False)


def drawn_instrument(rng: np.random.Generator) -> dict[str, float]:
    """Coefficients of a gyrowheel, in SI."""
    deg_per_h = parse_unit("deg/h").factor
    drawn: dict[str, float] = {}
    for axis, k in (("X", "k"), ("Y", "kY")):
        drawn |= {f"{k}_{i}": rng.normal(float(i.upper() == axis), CROSS) for i in "xyz"}
        drawn |= {
            f"D{axis}_{name}": size * deg_per_h * (1.0 + SPREAD * rng.standard_normal())
            for name, size in DRIFT.items()
        }
    return drawn


def settings_of(coefficients: dict[str, float], noise: float | None, latitude: float) -> TurntableSettings:
    """A study of the test; ``noise`` [deg/h]."""
    unit = parse_unit("deg/h")
    return TurntableSettings(
        site=Site(9.8, (), latitude, LATITUDE_U),
        rig=TABLE,
        chain=turntable(TABLE, uniform(TOLERANCE)),
        plan=grid((6, 6)),
        design=PositionDesign(grid((36, 36))),
        instrument=Instrument(
            unit=unit, coefficients=coefficients, noise=None if noise is None else noise * unit.factor
        ),
    )


def _one(rng: np.random.Generator, noise: float, known: bool) -> dict[str, Array]:
    """A simulated calibration with that noise [deg/h], of which it is told if ``known``."""
    real = settings_of(drawn_instrument(rng), noise, rng.normal(LATITUDE, LATITUDE_U))
    record = simulate(real, rng)
    settings = settings_of({}, noise if known else None, LATITUDE)
    estimate = calibrate(record, settings).estimate
    true = real.instrument.coefficients
    return {
        "error": estimate.values - np.array([true[name] for name in estimate.names]),
        "u": estimate.u,
        "dof": estimate.dof,
        "covariance": estimate.covariance,
        "sound": np.array(float(estimate.status is Status.OK)),
    }
