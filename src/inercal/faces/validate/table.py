"""Cases of validation of a turntable: positions of instruments, and gyrowheels."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np

from inercal.faces.studies.turntable import turntable_study
from inercal.faces.validate.case import Case
from inercal.foundation.arrays import Array
from inercal.foundation.findings import Status
from inercal.foundation.geometry.earth import Site
from inercal.foundation.records.record import record_of
from inercal.foundation.results.result import Estimate
from inercal.foundation.rigs.patterns import uniform
from inercal.foundation.rigs.plans import grid, listed
from inercal.foundation.rigs.tables import turntable
from inercal.foundation.units import parse_unit
from inercal.systems.turntable.settings import (
    Disturbances,
    Instrument,
    PositionDesign,
    RateTest,
    TurntableSettings,
)
from inercal.systems.turntable.simulate import simulate_positions
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
    record = simulate_positions(real, rng)
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


_ARCSEC = np.radians(1.0 / 3600.0)
_DEG_PER_H = parse_unit("deg/h").factor
_WHEEL = {f"DX_{name}": value * _DEG_PER_H for name, value in DRIFT.items()} | {
    "k_x": 1.01,
    "k_y": -0.02,
    "k_z": 0.01,
}
_SIZE = {"k": 1.0, "D": 50.0 * _DEG_PER_H}


def _perfect() -> TurntableSettings:
    """A study of one axis of the gyrowheel on a table without errors, with next to no noise."""
    return replace(settings_of(_WHEEL, 1e-6, np.radians(39.1)), chain=turntable(TABLE, None))


def _noiseless(settings: TurntableSettings) -> TurntableSettings:
    """The same without noise."""
    return replace(settings, instrument=replace(settings.instrument, noise=None))


def _off(estimate: Estimate) -> dict[str, float]:
    """Coefficients less the true ones, over the sizes of their kinds: 1 and 50 deg/h."""
    return {name: (estimate[name].value - true) / _SIZE[name[0]] for name, true in _WHEEL.items()}


_RAMP = 0.3 * _DEG_PER_H


def _drift() -> list[float]:
    """Slope of a linear drift over the true one, and the coefficients; the bias is that of the middle of the test."""
    settings = _perfect()
    real = replace(_noiseless(settings), disturbances=Disturbances(ramp=_RAMP))
    fitted = replace(settings, instrument=replace(settings.instrument, bias_drift="linear"))
    estimate = calibrate(simulate_positions(real, np.random.default_rng(1)), fitted).estimate
    off = _off(estimate)
    off["DX_F"] -= 0.5 * _RAMP / _SIZE["D"]
    return [estimate.result["nuisances"][0]["value"] / _RAMP, *off.values()]


_POSITIONS, _NOISE, _AMPLITUDE, _GRAVITY = 12, 1e-4, 20.0 * _ARCSEC, 9.8
_CIRCLE = """
site = {{ latitude = "39.1(1) deg", gravity = "9.8 m/s^2" }}
[rig]
kind = "two_axis_turntable"
errors.dphi_y1 = {{ {error} }}
[positions]
list = {positions}
[instrument]
kind = "accelerometer"
unit = "m/s^2"
noise = "{noise} m/s^2"
terms = ["K0_x", "K1_x", "M_xz"]
coefficients = {{ K1_x = 1.0 }}
"""


def _on_a_circle(error: str, times: int = 1) -> Array:
    """u of bias, scale factor and misalignment of an accelerometer that is turned through a circle so many times, with
    this error of the encoder and root of so many of the noise; the readings have none."""
    positions = [[f"{30 * k} deg", "0 deg"] for k in range(_POSITIONS)] * times
    text = _CIRCLE.format(error=error, positions=positions, noise=_NOISE * times**0.5)
    settings = turntable_study(tomllib.loads(text), Path("study.toml"))
    perfect = replace(_noiseless(settings), chain=turntable(TABLE, None))
    return calibrate(simulate_positions(perfect, np.random.default_rng(1)), settings).estimate.u


def _six_times() -> Array:
    """u where the plan is taken six times with root six of the noise, over u where it is taken once."""
    error = 'normal = "20 arcsec", scope = "angle"'
    return _on_a_circle(error, 6) / _on_a_circle(error)


def _bias_beside_a_harmonic() -> float:
    """u of the bias by the closed form: with the error a cos + b sin the reading g sin of an accelerometer becomes
    larger by ``g (a + a cos 2 + b sin 2) / 2``; the second harmonic of the readings tells a as well as it does."""
    told = _AMPLITUDE**-2 + _GRAVITY**2 * _POSITIONS / (8.0 * _NOISE**2)
    return float(np.sqrt(_NOISE**2 / _POSITIONS + _GRAVITY**2 / 4.0 / told))


def _harmonic() -> list[float]:
    """u of the bias beside a first harmonic of unknown phase, over the closed form."""
    u = _on_a_circle('harmonics = [{ order = 1, amplitude = "20 arcsec" }]')
    return [u[0] / _bias_beside_a_harmonic()]


_MEASURED = """
site.latitude = "39.1(1) deg"
site.gravity = "9.8 m/s^2"
[rig]
kind = "two_axis_turntable"
[rig.errors]
dphi_y1 = { value = "120(1) arcsec", harmonics = [{ order = 2, amplitude = "90(1) arcsec", phase = "30(1) deg" }] }
dphi_z2 = { value = "-200(1) arcsec" }
[instrument]
unit = "deg/h"
noise = "1e-6 deg/h"
"""


def _measured() -> list[float]:
    """Coefficients where the joints stand elsewhere than commanded, by what certificates say."""
    real = _noiseless(_perfect())
    commanded = real.plan.angles
    true = commanded + _ARCSEC * np.array([120.0, -200.0])
    true[:, 0] += 90.0 * _ARCSEC * np.sin(2.0 * commanded[:, 0] + np.radians(30.0))
    record = simulate_positions(replace(real, plan=listed(true)), np.random.default_rng(1))
    for k, name in enumerate(("phi1", "phi2")):
        record[name].values[:] = np.degrees(commanded[:, k])
    settings = turntable_study(tomllib.loads(_MEASURED), Path("study.toml"))
    return list(_off(calibrate(record, settings).estimate).values())


_FULL, _CURVE = np.radians(100.0), 1e-6
"""Full scale [rad/s] of a gyro, and deviation from its straight line over that."""


def _rate_test(deviation: Array, u: Array) -> Estimate:
    """The result of a rate test about the vertical at rates ``u``, readings without noise; both over full scale."""
    settings = replace(_perfect(), rate_test=RateTest("phi2"))
    gyro = replace(settings.instrument, kind="gyro", coefficients={}, noise=1e-12)
    rate, unit = parse_unit("rad/s"), parse_unit("rad")
    columns = [
        ("rate", rate, _FULL * u),
        ("phi1", unit, 0.0 * u),
        ("gyro_z", rate, _FULL * (u + deviation)),
    ]
    record = record_of(columns, np.arange(float(len(u))))
    return calibrate(record, replace(settings, instrument=gyro)).estimate


def _deviations() -> list[float]:
    """Non-linearity of a cubic curve and hysteresis of two ways, over theirs.

    The largest deviation of u^3 from its straight line is at the ends, 1 less the slope, sum u^4 over sum u^2.
    """
    up = np.concatenate([np.arange(-10.0, 0.0), np.arange(1.0, 11.0)]) / 10.0
    u, way = np.concatenate([up, up[::-1]]), np.repeat([0.5, -0.5], len(up))
    largest = 1.0 - np.sum(u**4) / np.sum(u**2)
    non_linear, two_ways = _rate_test(_CURVE * u**3, u), _rate_test(_CURVE * way, u)
    return [
        non_linear["S_nl_z"].value / (_CURVE * largest),
        two_ways["S_hyst_z"].value / _CURVE,
    ]


TABLE_CASES = (
    Case(
        "turntable-drift",
        "A linear drift of a gyrowheel's bias without noise is found as it is, and 12 coefficients are the true ones",
        "truth",
        [1.0] + [0.0] * 12,
        1e-8,
        _drift,
    ),
    Case(
        "turntable-angle",
        "Errors of scope angle do not average out: a plan taken six times with root six of the noise has the same u",
        "closed form",
        [1.0] * 3,
        1e-6,
        _six_times,
    ),
    Case(
        "turntable-harmonic",
        "u of an accelerometer's bias beside a harmonic of unknown phase is that of the closed form",
        "closed form",
        [1.0],
        1e-6,
        _harmonic,
    ),
    Case(
        "turntable-measured",
        "12 coefficients are the true ones where values and a harmonic from certificates are corrected for",
        "truth",
        [0.0] * 12,
        1e-8,
        _measured,
    ),
    Case(
        "rate-deviations",
        "Non-linearity of a cubic curve is 1 - sum u^4 / sum u^2 of its size, hysteresis the difference of the ways",
        "closed form",
        [1.0, 1.0],
        1e-5,
        _deviations,
    ),
)
"""Cases of tables in their ways beside tolerances."""
