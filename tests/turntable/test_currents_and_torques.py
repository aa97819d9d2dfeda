"""Outputs that are currents or torques: a gyrowheel in mA and a gyro in uN m, simulated by formulas written out."""

from dataclasses import replace

import numpy as np
import pytest
from turntable_studies import DEG_H, GRAVITY, LATITUDE, references, study

from inercal.faces.convert.correction import apply_to
from inercal.faces.convert.models import model_of
from inercal.faces.studies.turntable import turntable_study
from inercal.foundation.errors import StudyError
from inercal.foundation.findings import Status
from inercal.foundation.geometry.earth import EARTH_RATE
from inercal.foundation.records.channels import misfit
from inercal.foundation.records.record import record_of
from inercal.foundation.rigs.plans import grid, named
from inercal.foundation.units import STANDARD_GRAVITY, parse_unit
from inercal.systems.turntable.settings import RateTest
from inercal.systems.turntable.task import calibrate, calibrate_positions

PLAN = grid((6, 6))
PER_RATE = 1e-4 / DEG_H  # 0.1 mA/(deg/h), in A/(rad/s)
TERMS = ("k_x", "k_y", "k_z", "DX_F", *(f"DX_{jk}" for jk in ("X", "Y", "Z", "XX", "YY", "XY", "XZ", "YZ")))
TRUTH = np.array(
    [
        PER_RATE,
        0.01 * PER_RATE,
        -0.02 * PER_RATE,
        *(1e-3 * np.array([5, 6, 4, 0.8, 0.2, 0.15, 0.1, 0.3, 0.25])),
    ]
)
DEGREES = parse_unit("deg")


def rows():
    """Regressors (n, 12) of the terms: w, 1, a and its products."""
    (x, y, z), w = references(PLAN.angles, {}, LATITUDE)
    return np.stack([*w, np.ones_like(x), x, y, z, x * x, y * y, x * y, x * z, y * z], axis=-1)


def test_a_gyrowheel_in_milliamperes_has_the_u_of_least_squares_and_is_applied_back():
    noise = 2e-6  # as stated; none is drawn, so that no fault of the test is in doubt, which would be in u
    y = rows() @ TRUTH
    angles = [(f"phi{k + 1}", DEGREES, np.degrees(PLAN.angles[:, k])) for k in range(2)]
    record = record_of([*angles, ("y_x", parse_unit("mA"), 1e3 * y)], np.arange(float(len(PLAN))))
    settings = study(PLAN, unit="mA", coefficients={}, noise=noise, earth_rate="fitted")
    calibration = calibrate_positions(record, settings)
    estimate = calibration.estimate
    assert estimate.status is Status.OK
    assert estimate.names == TERMS
    u = noise * np.sqrt(np.diag(np.linalg.inv(rows().T @ rows())))
    np.testing.assert_allclose(estimate.values, TRUTH, atol=1e-5 * u.min(), rtol=1e-6)
    np.testing.assert_allclose(estimate.u, u, rtol=1e-6)
    assert (estimate["k_x"].unit, estimate["DX_F"].unit) == ("A/(rad/s)", "A")
    # people see mA, per unit g
    shown = calibration.shown
    assert (shown["k_x"].unit, shown["DX_X"].unit, shown["DX_XX"].unit) == ("mA/(rad/s)", "mA/g", "mA/g^2")
    assert shown["DX_X"].value == pytest.approx(1e3 * TRUTH[4] * STANDARD_GRAVITY / GRAVITY, rel=1e-6)
    assert {item.unit for item in shown.budget} <= {"mA", "arcsec", "deg"}
    # the rate about x is left of the readings; that about z is stated by a gyro beside
    w = references(PLAN.angles, {}, LATITUDE)[1]
    corrected = apply_to(
        record_of([*angles, *_others(w, y)], np.arange(float(len(PLAN)))), model_of(estimate)
    )
    left = corrected["rate_x"].values - w[0]
    assert np.abs(left).max() < 1e-4 * noise / PER_RATE


def test_the_earth_rate_that_is_subtracted_is_said_with_its_unit():
    plan = named("24-position")
    angles = [(f"phi{k + 1}", DEGREES, np.degrees(plan.angles[:, k])) for k in range(2)]
    record = record_of([*angles, ("y_x", parse_unit("mA"), np.zeros(len(plan)))], np.arange(float(len(plan))))
    settings = study(plan, unit="mA", coefficients={"k_x": PER_RATE}, noise=2e-6)
    found = {each.code: each.message for each in calibrate_positions(record, settings).estimate.findings}
    assert f"k_x = {1e3 * PER_RATE:.6g} mA/(rad/s), k_y = 0 mA/(rad/s)" in found["stated_earth_rate"]


def _others(w, y):
    """The output of the wheel [uA], and rates about y and z."""
    rate = parse_unit("rad/s")
    return [("y_x", parse_unit("uA"), 1e6 * y), ("gyro_y", rate, w[1]), ("gyro_z", rate, w[2])]


def test_a_rate_test_in_micronewton_metres_gives_rates_back():
    rates = np.array([-20.0, -10.0, -5.0, 5.0, 10.0, 20.0]) * np.pi / 180.0
    scale, bias, noise = 1.1e-3, 3e-8, 1e-9
    rng = np.random.default_rng(20261122)
    x = rates + EARTH_RATE * np.sin(LATITUDE)
    y = bias + scale * x + noise * rng.standard_normal(len(rates))
    still = np.zeros(len(rates))
    columns = [
        ("rate", parse_unit("rad/s"), rates),
        ("phi1", DEGREES, still),
        ("gyro_z", parse_unit("uN m"), 1e6 * y),
    ]
    record = record_of(columns, np.arange(float(len(rates))))
    settings = study(PLAN, kind="gyro", unit="mN m", coefficients={}, noise=noise)
    calibration = calibrate(record, replace(settings, rate_test=RateTest("phi2")))
    S = calibration.estimate["S_z"]
    assert S.unit == "N*m/(rad/s)"
    assert abs(S.value - scale) < 4.5 * S.u
    assert S.u < 1e-5 * scale
    assert calibration.shown["S_z"].unit == "uN*m/(rad/s)"
    corrected = apply_to(record, model_of(calibration.estimate))
    np.testing.assert_allclose(corrected["rate_z"].values, x, atol=6.0 * noise / scale)


def test_a_study_states_currents_and_torques():
    def coefficients(unit, **stated):
        return turntable_study(
            {
                "site": {"latitude": "40 deg", "gravity": "9.78 m/s^2"},
                "rig": {"kind": "two_axis_turntable"},
                "instrument": {
                    "kind": "gyrowheel",
                    "unit": unit,
                    "noise": f"2 {unit}",
                    "coefficients": stated,
                },
            },
            "study.toml",
        ).instrument

    read = coefficients("mA", k_x="0.5 mA/(deg/h)", DX_X="30 uA/g")
    assert read.noise == pytest.approx(2e-3)
    assert read.coefficients["k_x"] == pytest.approx(0.5e-3 / DEG_H)
    assert read.coefficients["DX_X"] == pytest.approx(30e-6 * 9.78 / STANDARD_GRAVITY)
    assert coefficients("N·m", k_x="2 mN m/(rad/s)").coefficients["k_x"] == pytest.approx(2e-3)
    with pytest.raises(StudyError, match=r"instrument.coefficients.k_x: found '2 V/\(rad/s\)'"):
        coefficients("mA", k_x="2 V/(rad/s)")


def test_sensors_in_amperes_are_no_angles_or_temperatures():
    assert misfit("acc_x", parse_unit("mA")) is None
    assert "current" in str(misfit("phi1", parse_unit("mA")))
    assert "torque" in str(misfit("temperature", parse_unit("N m")))
