"""Drift of gyros with squares and products of specific force, against formulas and least squares written out."""

from dataclasses import replace

import numpy as np
import pytest
from new_studies import load_turntable_study
from turntable_studies import DEG_H, GRAVITY, LATITUDE, references, study, u_without_doubts

from inercal.faces.convert.correction import apply_to
from inercal.faces.convert.models import model_of
from inercal.foundation.errors import StudyError
from inercal.foundation.findings import Status
from inercal.foundation.geometry.earth import EARTH_RATE
from inercal.foundation.records.record import record_of
from inercal.foundation.rigs.plans import grid
from inercal.foundation.units import STANDARD_GRAVITY, parse_unit
from inercal.systems.turntable.settings import RateTest
from inercal.systems.turntable.task import calibrate_positions, simulate

PLAN = grid((6, 6))
PRODUCTS = ("xx", "yy", "xy", "xz", "yz")
TERMS = ("D_F_x", "S_x", "T_xy", "T_xz", "G_xx", "G_xy", "G_xz", *(f"G_x{jk}" for jk in PRODUCTS))
TRUTH = dict(zip(TERMS, (3.0, 1.002, 2e-4, -1e-4, 5.0, -2.0, 1.0, 0.4, -0.3, 0.2, 0.5, -0.6), strict=True))


def rows():
    """Regressors (n, 12) of the linear model: 1, w, f, products of f [per g]."""
    a, w = references(PLAN.angles, {}, LATITUDE)
    f = -np.array(a) * GRAVITY / STANDARD_GRAVITY
    products = [f["xyz".index(j)] * f["xyz".index(k)] for j, k in PRODUCTS]
    return np.stack([np.ones(len(PLAN)), *w, *f, *products], axis=-1)


def linear():
    S = TRUTH["S_x"]
    drift = np.array([TRUTH[name] for name in TERMS]) * DEG_H
    return np.concatenate([drift[:1], [S, S * TRUTH["T_xy"], S * TRUTH["T_xz"]], drift[4:]])


def readings(noise=0.0):
    y = rows() @ linear() + noise * np.random.default_rng(20261122).standard_normal(len(PLAN))
    degrees, deg_h = parse_unit("deg"), parse_unit("deg/h")
    columns = [(f"phi{k + 1}", degrees, np.degrees(PLAN.angles[:, k])) for k in range(2)]
    return record_of([*columns, ("gyro_x", deg_h, y / DEG_H)], np.arange(float(len(PLAN)))), y


def settings(**more):
    return study(PLAN, kind="gyro", coefficients={}, terms=TERMS, earth_rate="fitted", **more)


def test_squares_and_products_are_those_of_least_squares():
    noise = 0.02 * DEG_H
    record, y = readings(noise)
    estimate = calibrate_positions(record, settings(noise=noise)).estimate
    assert estimate.status is Status.OK
    u_of = dict(zip(estimate.names, u_without_doubts(estimate), strict=True))
    c = np.linalg.lstsq(rows(), y, rcond=None)[0]
    u = noise * np.sqrt(np.diag(np.linalg.inv(rows().T @ rows())))
    for k, name in enumerate(TERMS):
        if name.startswith("G_"):
            per = STANDARD_GRAVITY ** (len(name) - 3)
            assert estimate[name].value == pytest.approx(c[k] / per, rel=1e-6, abs=1e-5 * u[k] / per)
            assert u_of[name] == pytest.approx(u[k] / per, rel=1e-6)
            assert abs(c[k] - linear()[k]) < 4.5 * u[k]
    assert estimate["G_xxy"].unit == "(rad/s)/(m/s^2)^2"


def test_all_three_squares_beside_the_bias_are_not_told_apart():
    record, _ = readings()
    made = settings()
    made = replace(made, instrument=replace(made.instrument, terms=(*TERMS, "G_xzz")))
    estimate = calibrate_positions(record, made).estimate
    assert estimate.status is Status.UNOBSERVABLE
    (words,) = estimate.result["null_vectors"]
    assert {"D_F_x", "G_xxx", "G_xyy", "G_xzz"} <= set(words.replace("(", " ").replace(")", " ").split())


def test_in_use_the_drift_is_compensated():
    record, _ = readings()
    estimate = calibrate_positions(record, settings()).estimate
    model = model_of(estimate)
    _, w = references(PLAN.angles, {}, LATITUDE)
    rate = apply_to(record, model)["rate_x"].si()
    # one axis alone: what it is misaligned by stays in its rate
    expected = w[0] + TRUTH["T_xy"] * w[1] + TRUTH["T_xz"] * w[2]
    np.testing.assert_allclose(rate, expected, atol=1e-6 * EARTH_RATE)


def test_a_study_states_them_per_g_squared(tmp_path):
    file = tmp_path / "gyro.toml"
    file.write_text(
        '[site]\nlatitude = "39.1 deg"\n[rig]\nkind = "two_axis_turntable"\n[instrument]\nkind = "gyro"\n'
        '[instrument.coefficients]\nS_x = 1\nG_xxy = "0.5 deg/h/g^2"\n'
    )
    made = load_turntable_study(file)
    assert made.instrument.coefficients["G_xxy"] == pytest.approx(0.5 * DEG_H / STANDARD_GRAVITY**2)
    turning = replace(made, rate_test=RateTest("phi2", rates=(-1.0, 1.0, 2.0)))
    with pytest.raises(StudyError, match="found G_xxy, expected no squares of force"):
        simulate(turning, np.random.default_rng(1))
