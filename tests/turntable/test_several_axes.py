"""Rate tests in which several axes turn in sequence, against a triad on a table made of SciPy's rotations."""

from dataclasses import replace

import hypothesis
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from scipy.spatial.transform import Rotation
from turntable_studies import LATITUDE, codes_of, study

from inercal.faces.convert.models import model_of, worth_knowing
from inercal.faces.convert.rate_test import RateGyros
from inercal.foundation.errors import RecordError
from inercal.foundation.findings import Status
from inercal.foundation.geometry.earth import EARTH_RATE
from inercal.foundation.records.record import record_of
from inercal.foundation.rigs.patterns import normal
from inercal.foundation.rigs.tables import turntable
from inercal.foundation.units import parse_unit
from inercal.systems.turntable.figures import page
from inercal.systems.turntable.settings import Leg, RateTest
from inercal.systems.turntable.task import calibrate, simulate

DEG, ARCSEC = np.pi / 180.0, np.pi / 648000.0
RATES = np.array([-50.0, -20.0, -5.0, 5.0, 20.0, 50.0]) * DEG
LEGS = ((1, 0.0), (1, 90.0), (2, 0.0))  # joint that turns, angle [deg] of the other
DWELL, NOISE = 72.0, 2e-7  # whole turns, so that gravity leaves the same in each stay of a leg
S = {"x": 1.003, "y": 0.997, "z": 1.001}
T = {"T_xy": 200.0, "T_xz": -100.0, "T_yx": 50.0, "T_yz": 60.0, "T_zx": -70.0, "T_zy": 80.0}
GAIN = np.array([[1.0 if i == j else T[f"T_{i}{j}"] * ARCSEC for j in "xyz"] for i in "xyz"])
DRIFT = np.array([[2e-6, -1e-6, 3e-6], [1e-6, 2e-6, 0.0], [-2e-6, 1e-6, 1e-6]])  # of each gyro by g
W_N = EARTH_RATE * np.array([np.cos(LATITUDE), 0.0, np.sin(LATITUDE)])
MOUNTING, WOBBLE = 15.0 * ARCSEC, 3.0 * ARCSEC
ERRORS = {
    **dict.fromkeys(("dtheta_x", "dtheta_y", "dtheta_z"), MOUNTING),
    **dict.fromkeys(("dalpha_x2", "dalpha_y2"), WOBBLE),
}


def readings(rng, mounting=0.0, wobble=0.0, noise=0.0, rate_error=0.0, legs=LEGS):
    """Means (n, 3) over each stay [rad/s]: joint, angle of the other and rate of each, and outputs."""
    t = DWELL * (np.arange(200) + 0.5) / 200
    fixed = Rotation.from_euler("XYZ", mounting * rng.standard_normal(3))
    made, rows = [], []
    for joint, other in legs:
        for rate in RATES:
            true, still = rate * (1.0 + rate_error), np.full(len(t), other * DEG)
            phi1, phi2 = (true * t, still) if joint == 1 else (still, true * t)
            inner = (
                Rotation.from_rotvec(np.outer(phi2, [0.0, 0.0, 1.0]))
                * Rotation.from_euler("XY", wobble * rng.standard_normal(2))
                * fixed
            )
            C_nb = Rotation.from_rotvec(np.outer(phi1, [0.0, 1.0, 0.0])) * inner
            axis = [0.0, 1.0, 0.0] if joint == 1 else [0.0, 0.0, 1.0]
            # the outer axis is turned into the instrument by all behind it, the inner by what is mounted on it
            turned = inner.inv().apply(axis)
            w = (true * turned + C_nb.inv().apply(W_N)).mean(axis=0)
            f = C_nb.inv().apply([0.0, 0.0, 1.0]).mean(axis=0)
            made.append(np.array([S[k] for k in "xyz"]) * (GAIN @ w) + DRIFT @ f)
            rows.append((joint, rate, 0.0 if joint == 1 else other, 0.0 if joint == 2 else other))
    return np.array(rows), np.array(made) + np.array([3e-6, -2e-6, 1e-6]) + noise * rng.standard_normal(
        (len(made), 3)
    )


def record(rows, y, **changed):
    given = {"joint": rows[:, 0], "rate": rows[:, 1], "phi1": rows[:, 2], "phi2": rows[:, 3], **changed}
    units = {"joint": "1", "rate": "rad/s", "phi1": "deg", "phi2": "deg"}
    columns = [(name, parse_unit(units[name]), values) for name, values in given.items()]
    columns += [(f"gyro_{axis}", parse_unit("rad/s"), y[:, k]) for k, axis in enumerate("xyz")]
    return record_of(columns, DWELL * np.arange(float(len(rows))))


def settings(sizes=None, noise=None, rate_u=0.0, **test):
    chain = turntable(
        "two_axis_turntable", None, {name: normal(size) for name, size in (sizes or {}).items()}
    )
    made = study(chain=chain, kind="gyro", unit="rad/s", coefficients={}, dwell=DWELL, noise=noise)
    return replace(made, rate_test=RateTest(rate_u=rate_u, **test))


def test_all_scale_factors_and_misalignments_from_one_file():
    """Gravity drifts each gyro by other amounts in each leg."""
    rows, y = readings(np.random.default_rng(1))
    calibrated = calibrate(record(rows, y), settings())
    found = calibrated.estimate
    assert found.status is Status.OK, found.message
    assert set(found.names) >= {*T, *(f"S_{axis}" for axis in "xyz")}
    for name, value in T.items():
        assert found[name].value == pytest.approx(value * ARCSEC, abs=0.2 * ARCSEC), name
    for axis, value in S.items():
        assert found[f"S_{axis}"].value == pytest.approx(value, rel=2e-6)
    assert not codes_of(found)
    assert found.result["plan"]["joint"] == "phi1, phi2"
    assert "T_zy" in page(calibrated)


def test_applied_to_a_recording_it_gives_the_rates_of_the_triad():
    rows, y = readings(np.random.default_rng(1))
    estimate = calibrate(record(rows, y), settings()).estimate
    assert not any("T_" in each.message for each in worth_knowing(estimate))
    rng = np.random.default_rng(2)
    true = rng.uniform(-0.8, 0.8, (50, 3))
    bias = np.array([estimate[f"D_F_{axis}"].value for axis in "xyz"])
    outputs = np.array([S[k] for k in "xyz"]) * (true @ GAIN.T) + bias
    columns = [(f"gyro_{axis}", parse_unit("rad/s"), outputs[:, k]) for k, axis in enumerate("xyz")]
    log = record_of(columns, np.arange(50.0))
    correction = model_of(estimate).correction(log)
    made = correction({f"gyro_{axis}": outputs[:, k] for k, axis in enumerate("xyz")})
    np.testing.assert_allclose(np.stack([made[f"rate_{axis}"] for axis in "xyz"], axis=-1), true, atol=4e-6)
    # and back
    truth = record_of(
        [(f"rate_{axis}", parse_unit("rad/s"), true[:, k]) for k, axis in enumerate("xyz")], log["gyro_x"].t
    )
    back = model_of(estimate).correction(truth, invert=True)
    again = back({f"rate_{axis}": made[f"rate_{axis}"] for axis in "xyz"})
    for k, axis in enumerate("xyz"):
        np.testing.assert_allclose(again[f"gyro_{axis}"], outputs[:, k], rtol=1e-12, atol=1e-15)
    # one gyro alone: the rates about the others are not known, and that is said
    alone = model_of(estimate).correction(record_of(columns[:1], np.arange(50.0)))
    assert [each.code for each in alone.findings] == ["not_held"]
    assert "T_xy, T_xz" in alone.findings[0].message


@given(st.integers(0, 2**32 - 1))
@hypothesis.settings(max_examples=30, deadline=None)
def test_a_triad_of_a_rate_test_goes_there_and_back(seed):
    """Whatever the coefficients, a sample alone has the digits it has among others."""
    rng = np.random.default_rng(seed)
    sizes = {"D_F": 1e-3, "S_asym": 1e-3, "S2": 1e-3, "S3": 1e-3}
    values = {f"{symbol}_{i}": size * rng.standard_normal() for symbol, size in sizes.items() for i in "xyz"}
    values |= {f"S_{i}": rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 2.0) for i in "xyz"}
    values |= {name: 0.03 * rng.standard_normal() for name in T}
    gyros = RateGyros("xyz", values, parse_unit("rad/s"), (-2.0, 2.0))
    true = {f"rate_{i}": rng.uniform(-2.0, 2.0, 20) for i in "xyz"}
    rates = record_of([(name, parse_unit("rad/s"), each) for name, each in true.items()], np.arange(20.0))
    outputs = gyros.correction(rates, invert=True)(true)
    given = {name: outputs[name] for name in ("gyro_x", "gyro_y", "gyro_z")}
    log = record_of([(name, parse_unit("rad/s"), each) for name, each in given.items()], np.arange(20.0))
    correction = gyros.correction(log)
    made = correction(given)
    alone = correction({name: each[3:4] for name, each in given.items()})
    for name, each in true.items():
        np.testing.assert_allclose(made[name], each, rtol=1e-11, atol=1e-13)
        assert made[name][3] == alone[name][0]


def test_one_leg_with_a_column_joint_is_the_test_without_it():
    rows, y = readings(np.random.default_rng(1), noise=NOISE, legs=LEGS[2:])
    told = calibrate(record(rows, y), settings(joint="phi1")).estimate
    columns = {k: each for k, each in record(rows, y).columns.items() if k != "joint"}
    plain = calibrate(replace(record(rows, y), columns=columns), settings(joint="phi2")).estimate
    assert told.names == plain.names
    np.testing.assert_array_equal(told.values, plain.values)
    np.testing.assert_array_equal(told.covariance, plain.covariance)


def test_u_is_that_of_mounting_written_out():
    """T_ij and T_ji take the turn of the instrument about the third axis, with opposite signs; S only its square."""
    rows, y = readings(np.random.default_rng(1))
    found = calibrate(record(rows, y), settings({"dtheta_z": MOUNTING}, noise=1e-9)).estimate
    for name in ("T_xy", "T_yx"):
        assert found[name].u == pytest.approx(MOUNTING, rel=1e-3)
    at = [found.names.index(name) for name in ("T_xy", "T_yx")]
    covariance = found.covariance[np.ix_(at, at)]
    assert covariance[0, 1] == pytest.approx(-(MOUNTING**2), rel=1e-3)
    assert found["T_zx"].u < 1e-3 * MOUNTING
    assert found["S_x"].u == pytest.approx(MOUNTING**2 / np.sqrt(2.0), rel=0.05)


def test_what_a_file_does_not_tell_is_said():
    rows, y = readings(np.random.default_rng(1), noise=NOISE)
    two = rows[:, 0] == 1
    found = calibrate(record(rows[two], y[two]), settings()).estimate
    assert found.status is Status.OK
    assert "T_xy" in found.names
    assert not {"S_z", "T_xz"} & set(found.names)
    assert any("gyro_z is left out: it has no stays" in each.message for each in found.findings)
    slanted = rows.copy()
    slanted[6:12, 3] = 45.0
    found = calibrate(record(slanted, y), settings()).estimate
    assert any("no axis of the instrument lies along" in each.message for each in found.findings)
    assert "S_x" not in found.names
    few = [0, 1, 2, 3, 6, 7, 8, 9, 12]  # one rate alone about z
    found = calibrate(record(rows[few], y[few]), settings()).estimate
    assert any("it has one rate alone" in each.message for each in found.findings)
    y[:, 1] = 0.5
    assert "dead_channel" in codes_of(calibrate(record(rows, y), settings()).estimate)
    for wrong in (0.0, 3.0, 1.5):
        with pytest.raises(RecordError, match="expected 1 to 2, 1 for phi1"):
            calibrate(record(rows, y, joint=np.full(len(rows), wrong)), settings())


def test_a_simulated_test_by_legs():
    """Each error of the table keeps its value from leg to leg; the file says which joint turns."""
    legs = (Leg(joint="phi1"), Leg(joint="phi1", phi2=90.0 * DEG), Leg(joint="phi2"))
    of = settings(ERRORS, noise=NOISE, rates=tuple(RATES), legs=legs)
    given = {f"S_{axis}": value for axis, value in S.items()} | {k: v * ARCSEC for k, v in T.items()}
    of = replace(of, instrument=replace(of.instrument, coefficients=given))
    made = simulate(of, np.random.default_rng(3))
    np.testing.assert_array_equal(made["joint"].values, np.repeat([1.0, 1.0, 2.0], 6))
    found = calibrate(made, of).estimate
    assert found.status is Status.OK, found.message
    z = np.array([(found[name].value - value) / found[name].u for name, value in given.items()])
    assert np.abs(z).max() < 4.0


@pytest.mark.slow
@pytest.mark.parametrize("runs", [10, pytest.param(24, marks=pytest.mark.campaign)])
def test_intervals_cover_as_they_say(runs):
    """Triads with mounting, wobble, table rate and noise drawn: rms of the errors in u."""
    rng = np.random.default_rng(20261122)
    names = [*T, *(f"S_{axis}" for axis in "xyz")]
    true = np.array([*(value * ARCSEC for value in T.values()), *S.values()])
    z = np.empty((runs, len(names)))
    for run in range(runs):
        rows, y = readings(rng, MOUNTING, WOBBLE, NOISE, 1e-3 * rng.standard_normal())
        made = settings(ERRORS, NOISE if run % 2 else None, rate_u=1e-3)
        found = calibrate(record(rows, y), made).estimate
        assert found.status is Status.OK, found.message
        z[run] = (np.array([found[name].value for name in names]) - true) / [found[name].u for name in names]
    low, high = stats.chi2.ppf([2e-4, 1.0 - 2e-4], runs) / runs
    squares = np.mean(z**2, axis=0)
    assert np.all((low < squares) & (squares < high)), dict(zip(names, squares, strict=True))
