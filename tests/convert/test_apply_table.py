"""Instruments calibrated on a table, in use: their drift compensated, against formulas written out by hand."""

import io
import json
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from turntable_studies import DEG_H, GRAVITY, LATITUDE, TUMBLE, WHEEL, study, table

from inercal.cli import run
from inercal.faces.convert.correction import apply_to
from inercal.faces.convert.models import model_of, worth_knowing
from inercal.faces.convert.table import TableInstrument
from inercal.foundation.errors import InputError
from inercal.foundation.geometry.earth import EARTH_RATE
from inercal.foundation.instruments.by_angle import CHANNELS, channel_model
from inercal.foundation.records.read import read
from inercal.foundation.records.record import record_of
from inercal.foundation.records.write import write_record
from inercal.foundation.results.files import save
from inercal.foundation.rigs.plans import grid
from inercal.foundation.units import parse_unit
from inercal.systems.turntable.settings import RateTest
from inercal.systems.turntable.task import calibrate, simulate

PLAN = grid((6, 6))
TABLE = [{"joint": "phi1", "axis": "y"}, {"joint": "phi2", "axis": "z"}]


def drift(axis, a, values=WHEEL):
    """Drift of a gyrowheel in deg/h at the gravity reference a, its terms one by one."""
    x, y, z = a
    D = {name.partition("_")[2]: v for name, v in values.items() if name.startswith(f"D{axis}_")}
    return (
        D["F"] + D["X"] * x + D["Y"] * y + D["Z"] * z + D["XX"] * x**2 + D["YY"] * y**2
        + D["XY"] * x * y + D["XZ"] * x * z + D["YZ"] * y * z
    )  # fmt: skip


def wheel_record(a, w, f=None, noise=0.0, seed=1, **angles):
    """Outputs [deg/h] of the gyrowheel at gravity references (3, n) and rates (3, n) [rad/s]."""
    rng = np.random.default_rng(seed)
    y = [
        WHEEL["k_x"] * w[0] + WHEEL["k_y"] * w[1] + WHEEL["k_z"] * w[2] + drift("X", a),
        WHEEL["kY_x"] * w[0] + WHEEL["kY_y"] * w[1] + WHEEL["kY_z"] * w[2] + drift("Y", a),
    ]
    deg_h, mg = parse_unit("deg/h"), parse_unit("mg")
    columns = [
        (f"y_{k}", deg_h, (v + noise * rng.standard_normal(v.shape)) / DEG_H)
        for k, v in zip("xy", y, strict=True)
    ]
    columns += [(name, parse_unit("deg"), np.degrees(v)) for name, v in angles.items()]
    if f is not None:
        columns += [(f"acc_{k}", mg, f[i] / mg.factor) for i, k in enumerate("xyz")]
    columns.append(("gyro_z", deg_h, w[2] / DEG_H))
    return record_of(columns, np.arange(len(a[0]), dtype=float))


def attitudes(rng, n):
    """Angles (2, n), gravity reference and earth rate (3, n) of the paper's table, multiplied out by hand."""
    p, q = rng.uniform(-np.pi, np.pi, (2, n))
    # Ry(p) Rz(q): rows north, west, up
    rows = [
        [np.cos(p) * np.cos(q), -np.cos(p) * np.sin(q), np.sin(p)],
        [np.sin(q), np.cos(q), np.zeros(n)],
        [-np.sin(p) * np.cos(q), np.sin(p) * np.sin(q), np.cos(p)],
    ]
    a = -np.array(rows[2])
    w = EARTH_RATE * (np.cos(LATITUDE) * np.array(rows[0]) + np.sin(LATITUDE) * np.array(rows[2]))
    return p, q, a, w


@pytest.fixture(scope="module")
def wheel():
    """A calibration of the gyrowheel without noise."""
    made = study(plan=PLAN, noise=1e-9 * DEG_H)
    return calibrate(simulate(made, np.random.default_rng(1)), made).estimate


@pytest.mark.parametrize("by", ["attitude", "specific force"])
def test_a_gyrowheel_in_use_reads_the_earth_rate_whatever_gravity_does(wheel, by):
    """70 deg/h of drift are compensated to 1e-6 deg/h: by the angles, or by accelerometers that read +1 g up."""
    p, q, a, w = attitudes(np.random.default_rng(5), 200)
    log = wheel_record(a, w, phi1=p, phi2=q) if by == "attitude" else wheel_record(a, w, f=-GRAVITY * a)
    model = model_of(wheel)
    corrected = apply_to(log, model)
    assert np.abs(log["y_x"].values).max() > 70.0
    for k, axis in enumerate("xy"):
        assert corrected[f"rate_{axis}"].unit.symbol == "rad/s"
        np.testing.assert_allclose(corrected[f"rate_{axis}"].values, w[k], rtol=0, atol=1e-6 * DEG_H)
    assert "y_x" not in corrected
    back = apply_to(corrected, model, invert=True)
    np.testing.assert_allclose(back["y_x"].values, log["y_x"].si(), rtol=0, atol=1e-13 * DEG_H + 1e-18)


def test_specific_force_comes_first_and_a_wrong_sign_of_it_would_be_seen(wheel):
    p, q, a, w = attitudes(np.random.default_rng(5), 20)
    both = wheel_record(a, w, f=-GRAVITY * a, phi1=0 * p, phi2=0 * q)
    np.testing.assert_allclose(apply_to(both, model_of(wheel))["rate_x"].values, w[0], atol=1e-6 * DEG_H)
    reversed_ = wheel_record(a, w, f=GRAVITY * a)
    wrong = apply_to(reversed_, model_of(wheel))["rate_x"].values - w[0]
    assert np.abs(wrong).max() > 50.0 * DEG_H


def test_an_unknown_rate_about_the_spin_axis_is_said(wheel):
    p, q, a, w = attitudes(np.random.default_rng(5), 20)
    log = wheel_record(a, w, phi1=p, phi2=q)
    lone = replace(log, columns={n: c for n, c in log.columns.items() if n != "gyro_z"})
    corrected = apply_to(lone, model_of(wheel))
    (said,) = [each for each in corrected.findings if each.code == "not_held"]
    assert "k_z, kY_z are not applied" in said.message
    off = corrected["rate_x"].values - w[0]
    inverse = np.linalg.inv([[1.01, -0.02], [0.015, 0.99]])
    np.testing.assert_allclose(off, (inverse @ [[0.01], [-0.01]])[0] * w[2], atol=1e-9 * DEG_H)


def test_without_attitude_and_specific_force_a_drift_is_not_compensated(wheel):
    _, _, a, w = attitudes(np.random.default_rng(5), 4)
    with pytest.raises(InputError, match=r"found neither acc_x, acc_y, acc_z .* nor phi1, phi2"):
        apply_to(wheel_record(a, w), model_of(wheel))


SYMBOLS = {kind: [s for c in CHANNELS[kind] for s in channel_model(kind, c).symbols] for kind in CHANNELS}


def drawn(kind, seed):
    """Any instrument of a kind, one to three of its axes, and a record of true values."""
    rng = np.random.default_rng(seed)
    channels = tuple(rng.permutation(CHANNELS[kind])[: rng.integers(1, 1 + len(CHANNELS[kind]))])
    channels = tuple(c for c in CHANNELS[kind] if c in channels)
    values = {}
    for channel in channels:
        model = channel_model(kind, channel)
        for symbol, m in zip(model.symbols, model.monomials, strict=True):
            own = symbol.startswith(("S_", "K1_")) or symbol in ("k_x", "kY_y")
            small = 1e-4 if kind == "accelerometer" and m.order > 1 else 1e-2
            values[symbol] = (
                rng.uniform(0.5, 2.0) * rng.choice([-1, 1]) if own else small * rng.standard_normal()
            )
    output = parse_unit(str(rng.choice(["V", "count"])))
    n, t = 40, np.arange(40.0)
    si = parse_unit("m/s^2" if kind == "accelerometer" else "rad/s")
    force, rate = rng.uniform(-20, 20, (3, n)), rng.uniform(-1, 1, (3, n))
    if kind == "accelerometer":
        columns = [(f"acc_{k}", si, force[i]) for i, k in enumerate("xyz")]
    else:
        names = {c[-1]: f"rate_{c[-1]}" for c in channels}
        columns = [(names.get(k, f"gyro_{k}"), si, rate[i]) for i, k in enumerate("xyz")]
        columns += [(f"acc_{k}", parse_unit("m/s^2"), force[i]) for i, k in enumerate("xyz")]
    return TableInstrument(kind, channels, values, output, 9.8, TABLE), record_of(columns, t)


@settings(max_examples=60, deadline=None)
@given(st.sampled_from(sorted(CHANNELS)), st.integers(0, 2**32 - 1))
def test_there_and_back_is_where_it_was_and_a_sample_alone_has_the_same_digits(kind, seed):
    model, true = drawn(kind, seed)
    outputs = apply_to(true, model, invert=True)
    assert {outputs[c].unit.symbol for c in model.channels} == {model.output.symbol}
    back = apply_to(outputs, model)
    for name in true.columns:
        np.testing.assert_allclose(back[name].values, true[name].values, rtol=1e-9, atol=1e-10)
    correct = model.correction(outputs)
    samples = {name: outputs[name].values for name in correct.reads}
    together = correct(samples)
    for row in (0, 17, 39):
        alone = correct({name: np.float64(values[row]) for name, values in samples.items()})
        for name in alone:
            assert alone[name] == together[name][row]


def test_an_accelerometer_with_every_term_reads_the_specific_force_by_hand():
    """One axis, cross forces from the attitude: y of the equation of the standard, solved."""
    values = {
        "K0_y": 0.02, "K1_y": 1.3, "M_yz": 2e-3, "M_yx": -1e-3, "K2_y": 3e-5, "K3_y": 2e-6, "Koq_y": 4e-5,
        "Kip_y": 5e-5, "Kio_y": -6e-5, "Kpo_y": 7e-5, "Kpp_y": 8e-5, "Koo_y": -9e-5,
    }  # fmt: skip
    p, q, a, _ = attitudes(np.random.default_rng(2), 50)
    o, i, pp = -9.8 * a  # x is the output axis of y, z the pendulous one
    y = values["K0_y"] + values["K1_y"] * (
        i + 2e-3 * pp - 1e-3 * o + 3e-5 * i**2 + 2e-6 * i**3 + 4e-5 * i * np.abs(i)
        + 5e-5 * i * pp - 6e-5 * i * o + 7e-5 * pp * o + 8e-5 * pp**2 - 9e-5 * o**2
    )  # fmt: skip
    model = TableInstrument("accelerometer", ("acc_y",), values, parse_unit("V"), 9.8, TABLE)
    rad, volt = parse_unit("rad"), parse_unit("V")
    log = record_of([("acc_y", volt, y), ("phi1", rad, p), ("phi2", rad, q)], np.arange(50.0))
    np.testing.assert_allclose(apply_to(log, model)["acc_y"].values, i, rtol=0, atol=1e-12)
    alone = record_of([("acc_y", volt, y)], np.arange(50.0))
    corrected = apply_to(alone, model)
    assert [each.code for each in corrected.findings].count("not_held") == 2
    assert np.abs(corrected["acc_y"].values - i).max() < 0.1  # what the cross terms do at 1 g


def test_beyond_the_extreme_of_its_polynomial_a_sample_is_no_number():
    """K2 = -0.05 /(m/s^2): the output never exceeds 5."""
    values = {"K1_x": 1.0, "K2_x": -0.05}
    model = TableInstrument("accelerometer", ("acc_x",), values, parse_unit("V"), 9.8, TABLE)
    log = record_of([("acc_x", parse_unit("V"), np.array([2.0, 5.5]))], np.arange(2.0))
    found = apply_to(log, model)["acc_x"].values
    assert found[0] == pytest.approx((1 - np.sqrt(1 - 0.4)) / 0.1, rel=1e-12)
    assert np.isnan(found[1])


# Uncertainty.


@pytest.mark.slow
@pytest.mark.parametrize("runs", [30, pytest.param(120, marks=pytest.mark.campaign)])
def test_u_of_the_rate_is_that_of_repeated_calibrations(runs):
    """Calibrations of one gyrowheel with noise, table errors and k_x, k_y, k_z that are not what was stated; each
    corrects the same samples. Limits: 4 sigma of a standard deviation, 1/sqrt(2 (runs - 1))."""
    chain = table(np.radians(20.0 / 3600.0))
    k_u = {"k_x": 1e-2, "k_y": 1e-2, "k_z": 1e-2, "kY_x": 1e-2, "kY_y": 1e-2, "kY_z": 1e-2}
    of = study(plan=TUMBLE, chain=chain, noise=0.01 * DEG_H, coefficients_u=k_u, earth_rate="stated")
    p, q, a, w = attitudes(np.random.default_rng(5), 6)
    w[0, 3:] += (
        60.0 * DEG_H
    )  # at rest what a wrong k does cancels with the drift found by it, when turning it does not
    errors, us = [], []
    rng = np.random.default_rng(20261122)
    for _ in range(runs):
        true_k = {name: WHEEL[name] + u * rng.standard_normal() for name, u in k_u.items()}
        true = replace(of, instrument=replace(of.instrument, coefficients={**WHEEL, **true_k}))
        estimate = calibrate(simulate(true, rng), of).estimate
        y = {
            "X": true_k["k_x"] * w[0] + true_k["k_y"] * w[1] + true_k["k_z"] * w[2] + drift("X", a),
            "Y": true_k["kY_x"] * w[0] + true_k["kY_y"] * w[1] + true_k["kY_z"] * w[2] + drift("Y", a),
        }
        deg = parse_unit("deg")
        log = record_of(
            [("y_x", parse_unit("rad/s"), y["X"]), ("y_y", parse_unit("rad/s"), y["Y"]),
             ("phi1", deg, np.degrees(p)), ("phi2", deg, np.degrees(q)), ("gyro_z", parse_unit("rad/s"), w[2])],
            np.arange(6.0),
        )  # fmt: skip
        corrected = apply_to(log, model_of(estimate, uncertainty=len(us) < 1))
        if not us:
            us.append([corrected["u_rate_x"].values, corrected["u_rate_y"].values])
        errors.append([corrected["rate_x"].values - w[0], corrected["rate_y"].values - w[1]])
    ratio = np.std(errors, axis=0) / us[0]
    assert np.abs(ratio - 1.0).max() < 4.0 / np.sqrt(2 * (runs - 1))


def test_u_of_an_accelerometer_is_that_of_drawn_coefficients():
    """2000 draws of the coefficients by their covariance, each corrected by hand; limits 4 sigma."""
    values = {"K0_x": 1e-3, "K1_x": 0.0102, "M_xy": 1e-3, "M_xz": -2e-3, "K2_x": 5e-6}
    of = study(
        plan=TUMBLE, kind="accelerometer", unit="V", coefficients=values, terms=tuple(values), noise=2e-5,
    )  # fmt: skip
    estimate = calibrate(simulate(of, np.random.default_rng(3)), of).estimate
    y, p, q = np.array([0.09, -0.05, 0.1]), np.array([0.3, -2.0, 0.1]), np.array([0.5, 1.0, 0.0])
    rad = parse_unit("rad")
    log = record_of([("acc_x", parse_unit("V"), y), ("phi1", rad, p), ("phi2", rad, q)], np.arange(3.0))
    corrected = apply_to(log, model_of(estimate, uncertainty=True))
    f_y, f_z = GRAVITY * np.sin(p) * np.sin(q), GRAVITY * np.cos(p)
    draws = np.random.default_rng(9).multivariate_normal(estimate.values, estimate.covariance, 2000)
    at = {name: draws[:, k, None] for k, name in enumerate(estimate.names)}
    s = (y - at["K0_x"]) / at["K1_x"] - at["M_xy"] * f_y - at["M_xz"] * f_z
    by_hand = (np.sqrt(1.0 + 4.0 * at["K2_x"] * s) - 1.0) / (2.0 * at["K2_x"])
    ratio = np.std(by_hand, axis=0) / corrected["u_acc_x"].values
    assert np.abs(ratio - 1.0).max() < 4.0 / np.sqrt(2 * 1999)
    assert list(corrected.columns)[-1] == "u_acc_x"


# A rate test.


def test_what_lies_beyond_the_calibration_is_said(wheel):
    """Outputs beyond its readings, and a specific force beyond gravity; what lies within says nothing."""
    p, q, a, w = attitudes(np.random.default_rng(5), 20)
    model = model_of(wheel)
    assert not apply_to(wheel_record(a, w, f=-GRAVITY * a), model).findings
    thrice = apply_to(wheel_record(3.0 * a, w, f=-3.0 * GRAVITY * a), model).findings
    assert {each.code for each in thrice} == {"outside_range"}
    assert {each.message.split()[0] for each in thrice} == {"y_x", "y_y", "acc_x", "acc_y", "acc_z"}
    fast = apply_to(wheel_record(a, w + 1e-3, phi1=p, phi2=q), model).findings
    assert [each.message.split()[0] for each in fast] == ["y_x", "y_y"]
    assert "the calibration holds from" in fast[0].message


def test_a_gyro_of_a_rate_test_reads_the_rate_with_its_asymmetry_undone():
    truth = {"S_z": 1.0002, "D_F_z": 0.5 * DEG_H, "S_asym_z": 400e-6, "S2_z": 2e-4, "S3_z": -1e-4}
    rates = np.radians([-100.0, -75, -50, -25, -10, 10, 25, 50, 75, 100])
    of = study(
        kind="gyro", unit="deg/s", coefficients=truth, noise=1e-12,
        dwell=36.0,
    )  # fmt: skip
    of = replace(of, rate_test=RateTest(rates=tuple(rates), order=3))
    estimate = calibrate(simulate(of, np.random.default_rng(1)), of).estimate
    x = np.radians([-90.0, -0.1, 0.0, 33.0, 130.0])
    bent = x + 200e-6 * np.abs(x) + 2e-4 * x**2 - 1e-4 * x**3
    y = 0.5 * DEG_H + 1.0002 * bent
    log = record_of([("gyro_z", parse_unit("deg/s"), np.degrees(y))], np.arange(5.0))
    model = model_of(estimate)
    corrected = apply_to(log, model)
    np.testing.assert_allclose(corrected["rate_z"].values, x, rtol=0, atol=1e-9)
    assert [f.code for f in corrected.findings] == ["outside_range"]
    assert "S_nl" in worth_knowing(estimate)[0].message
    back = apply_to(corrected, model, invert=True)
    np.testing.assert_allclose(back["gyro_z"].values, y, rtol=1e-14, atol=1e-18)


# The command.


@pytest.mark.parametrize("more", [[], ["--uncertainty"], ["--invert"]])
def test_the_command_and_a_stream_of_the_same_lines_give_the_same_bytes(
    wheel, more, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    save(wheel, tmp_path / "cal.json")
    p, q, a, w = attitudes(np.random.default_rng(5), 50)
    log = wheel_record(a, w, phi1=p, phi2=q)
    if more == ["--invert"]:
        log = apply_to(log, model_of(wheel))
    write_record(log, tmp_path / "log.csv")
    assert run(["apply", "cal.json", "log.csv", "--out", "x.csv", "--json", *more]) == 0
    assert json.loads(capsys.readouterr().out)["findings"] == []
    names = list(read(tmp_path / "x.csv").columns)
    assert ("y_x" if more == ["--invert"] else "rate_x") in names
    assert ("u_rate_x" in names) == (more == ["--uncertainty"])
    data = (tmp_path / "log.csv").read_bytes()
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(data)))
    assert run(["apply", "cal.json", "--stream", "--quiet", *more]) == 0
    assert capsys.readouterr().out == (tmp_path / "x.csv").read_text()
