"""Calibration against a table's angles: round trips, true uncertainties, and what bad input is told.

The limits of coverage of one coefficient, 89.2 and 99.2 %, and of all together, 93.7 and 96.3 %, are those of
test_stated_uncertainties.
"""

from dataclasses import replace

import numpy as np
import pytest
from campaigns.aided import LATITUDE, PROGRAM, draw_truth, one_calibration
from new_studies import table_read

from inercal.faces.report.html import render
from inercal.faces.studies.imu import aided_settings
from inercal.foundation.computing.runs import run
from inercal.foundation.errors import RecordError, StudyError
from inercal.foundation.findings import Status
from inercal.foundation.geometry.earth import Site
from inercal.foundation.inference.consistency import coverage
from inercal.foundation.records.column import Column
from inercal.foundation.records.record import Record
from inercal.foundation.rigs.patterns import normal
from inercal.foundation.rigs.tables import turntable
from inercal.foundation.units import parse_quantity, parse_unit
from inercal.systems.imu.aided.calibration import calibrate_aided
from inercal.systems.imu.aided.figures import pictures
from inercal.systems.imu.aided.simulate import simulate
from inercal.systems.imu.aided.walk import whiten
from inercal.systems.imu.settings import AidedRig, AidedSettings, ImuSettings, mounting_of, mountings

CHAIN = turntable("two_axis_turntable", None)
SEED = 20261121
RUNS = 250


def quiet(rng):
    return replace(draw_truth(rng), white=(0.0, 0.0), walk=(0.0, 0.0))


def settings(gravity=9.81, **other):
    return ImuSettings(Site(gravity, (), LATITUDE), **other)


@pytest.fixture(scope="module")
def noisy():
    """A record with noise, the angles in time."""
    rng = np.random.default_rng(1)
    truth = replace(draw_truth(rng), late=0.0, gravity=9.81)
    return simulate(truth, CHAIN, PROGRAM, rng, rate=50.0)


def changed(record, **by_name):
    """The record with columns put through functions of their values; None takes a column out."""
    columns = dict(record.columns)
    for name, function in by_name.items():
        column = columns.pop(name)
        if function is not None:
            columns[name] = replace(column, values=function(column.values))
    return Record(columns)


def cut(record, seconds):
    rows = record["acc_x"].t < seconds
    t = record["acc_x"].t[rows]
    return Record({n: replace(c, values=c.values[rows], t=t) for n, c in record.columns.items()})


def calibrated(record, chain=CHAIN, **other):
    return calibrate_aided(record, settings(**other), AidedSettings(chain)).estimate


def errors(estimate, true):
    return np.array([estimate[name].value - true[name] for name in estimate.names])


# laws


@pytest.mark.parametrize("seed", [3, 4])
def test_a_test_without_noise_gives_back_the_instrument_its_place_and_the_clocks(seed):
    rng = np.random.default_rng(seed)
    truth = quiet(rng)
    record, true = simulate(truth, CHAIN, PROGRAM, rng, rate=100.0)
    estimate = calibrated(record, gravity=truth.gravity)
    assert len(estimate.names) == 24 + 11
    assert np.max(np.abs(errors(estimate, true)[:24])) < 1e-7
    assert np.max(np.abs(errors(estimate, true)[24:])) < 2e-3
    assert estimate["tau_g"].value == pytest.approx(-truth.late, abs=1e-5)
    for shift in estimate.result["time_shift_s"].values():
        assert shift["value"][0] == pytest.approx(truth.late, abs=1e-5)
    # the mean acceleration of a block by an arm is taken from rates over 0.1 s
    assert np.array(estimate.result["lever_arm_m"]["value"]) == pytest.approx(truth.arms.ravel(), abs=2e-3)


def test_a_three_axis_table_and_g_sensitivity():
    chain = turntable("three_axis_turntable", None)
    rng = np.random.default_rng(5)
    quarter = 0.5 * np.pi
    turns = [
        ("phi3", 4),
        ("phi2", 1),
        ("phi3", 1),
        ("phi1", 4),
        ("phi3", 1),
        ("phi2", 2),
        ("phi1", -4),
        ("phi3", 1),
    ]
    turns += [("phi2", -2), ("phi3", 2), ("phi2", -1), ("phi3", -1), ("phi2", 4)]
    program = [("rest", 0.0, 4.0)]
    for joint, quarters in turns:
        program += [(joint, quarters * quarter, 2.0 + 1.5 * abs(quarters)), ("rest", 0.0, 4.0)]
    truth = replace(quiet(rng), g_sensitivity=rng.normal(0.0, 1e-4, (3, 3)))
    record, true = simulate(truth, chain, program, rng, rate=100.0)
    estimate = calibrated(record, chain, gravity=truth.gravity, g_sensitivity=True)
    assert len(estimate.names) == 33 + 11
    assert np.max(np.abs(errors(estimate, true)[:33])) < 5e-6


def test_counts_give_the_same_instrument_as_physical_units(noisy):
    record, _ = noisy
    columns = {
        name: replace(c, values=1000.0 + 2000.0 * c.values, unit=parse_unit("count")) if "_" in name else c
        for name, c in record.columns.items()
    }
    ours, theirs = calibrated(Record(columns)), calibrated(record)
    for name in ours.names:
        scale, offset = (2000.0, 1000.0) if name.startswith(("K0", "D_F")) else (1.0, 0.0)
        if name.startswith(("K1", "S")):
            scale = 2000.0
        assert ours[name].value == pytest.approx(scale * theirs[name].value + offset, abs=1e-3 * ours[name].u)
        assert ours[name].u == pytest.approx(scale * theirs[name].u, rel=1e-3)


@pytest.mark.kernels
def test_whitening_is_generalised_least_squares_and_knows_the_mean_of_the_bias():
    """Against the dense covariance of the same model: white noise on a random walk of unknown start."""
    rng = np.random.default_rng(6)
    n, K = 40, 0.3
    t = np.cumsum(rng.uniform(0.5, 2.0, n))
    white = rng.uniform(0.5, 2.0, n)
    X, y = rng.normal(size=(n, 2)), rng.normal(size=n)
    V = np.diag(white) + K**2 * np.minimum.outer(t - t[0], t - t[0])
    A = np.column_stack([X, np.ones(n)])
    W = np.linalg.inv(V)
    dense = np.linalg.inv(A.T @ W @ A)
    done = whiten(np.column_stack([X, y]), t, white, K)
    ours = np.linalg.inv(done.rows[:, :2].T @ done.rows[:, :2])
    assert ours == pytest.approx(dense[:2, :2], rel=1e-10)
    assert ours @ done.rows[:, :2].T @ done.rows[:, 2] == pytest.approx((dense @ A.T @ W @ y)[:2], rel=1e-10)
    # noise and walk make up the whole variance
    noise, steps = done.information()
    assert (noise + steps)[:2, :2] == pytest.approx(done.rows[:, :2].T @ done.rows[:, :2], rel=1e-10)
    # the mean of the bias: its conditional mean and variance from the joint Gaussian
    s = t - t[0]
    with_mean = K**2 * (s - s**2 / (2.0 * s[-1]))
    one = np.ones(n)
    gls = W @ one / (one @ W @ one)
    mean = gls @ y + with_mean @ W @ (y - one * (gls @ y))
    assert done.mean[2] == pytest.approx(mean, rel=1e-9)
    weights = gls + (np.eye(n) - np.outer(gls, one)) @ W @ with_mean
    variance = weights @ V @ weights - 2.0 * weights @ with_mean + K**2 * s[-1] / 3.0
    assert done.mean_variance == pytest.approx(variance, rel=1e-9)


def test_there_are_24_mountings_all_of_them_right_handed():
    found = mountings()
    assert len(found) == 24
    assert all(np.linalg.det(rotation) == pytest.approx(1.0) for rotation in found.values())
    assert mounting_of(("+y", "+x", "+z")) is None


# uncertainties


@pytest.mark.slow
@pytest.mark.parametrize("runs", [20, pytest.param(RUNS, marks=pytest.mark.campaign)])
def test_intervals_cover_the_truth_as_often_as_they_say(runs):
    """Of 20 runs 14 hits are the exact limit of one coefficient at a risk of 4e-5; 0.88 of all together is four and
    a half standard deviations at a design effect of 3."""
    sample = run(one_calibration, runs=runs, seed=SEED)
    assert np.all(sample["sound"] == 1.0)
    found = coverage(sample["error"], sample["u"], sample["dof"])
    each, least, most = ((0.892, 0.992), 0.937, 0.963) if runs == RUNS else ((0.7, 1.0), 0.88, 1.0)
    assert np.all((found.fraction >= each[0]) & (found.fraction <= each[1])), found.table()
    assert least <= found.pooled <= most, found.table()


def test_errors_of_the_table_widen_the_uncertainties_and_are_in_the_budget(noisy):
    record, _ = noisy
    plain = calibrated(record)
    shaky = calibrated(record, turntable("two_axis_turntable", normal(1e-3)))
    assert "dphi_y1" in {item.source for item in shaky.budget}
    assert all(shaky[name].u > plain[name].u for name in ("M_xy", "M_zx", "T_xy"))
    # a mounting error turns the frame of all sensors: full weight in the part of M that is a rotation
    assert shaky["M_xy"].u >= 1e-3 / np.sqrt(2.0)


def test_a_mounting_known_to_a_tenth_of_a_degree_makes_no_ill_conditioned_test(noisy):
    """It turns the frame of all sensors: the misalignments are no better known, but no motion would help."""
    record, _ = noisy
    u = np.radians(0.1)
    estimate = calibrated(record, turntable("two_axis_turntable", None, {"dtheta_x": normal(u)}))
    assert estimate.status is Status.OK
    assert estimate.statistics["condition"] == pytest.approx(
        calibrated(record).statistics["condition"], rel=0.01
    )
    for name in ("M_yz", "M_zy", "T_yz", "T_zy"):
        assert estimate[name].u == pytest.approx(u, rel=0.1)
    assert estimate["M_xy"].u < 0.1 * u


# bad input


def test_angles_in_rad_said_to_be_deg_are_told_with_their_factor(noisy):
    record, _ = noisy
    wrong = changed(record, phi1=np.radians, phi2=np.radians)
    estimate = calibrated(wrong)
    assert estimate.status is Status.INCONSISTENT
    assert "the angles are 57.3 times as large" in estimate.message


@pytest.mark.parametrize(("name", "said"), [("phi1", "the sign of phi1"), ("phi2", "the sign of phi2")])
def test_a_reversed_angle_is_told(noisy, name, said):
    estimate = calibrated(changed(noisy[0], **{name: lambda v: -v}))
    assert estimate.status is Status.INCONSISTENT
    assert said in estimate.message


def test_exchanged_angles_are_told(noisy):
    record, _ = noisy
    columns = dict(record.columns)
    columns["phi1"], columns["phi2"] = (
        replace(columns["phi2"], name="phi1"),
        replace(columns["phi1"], name="phi2"),
    )
    assert "the columns phi1, phi2 are exchanged" in calibrated(Record(columns)).message


def test_a_mounting_that_was_not_stated_is_told(noisy):
    chain = turntable("two_axis_turntable", None, mounting=mounting_of(("+y", "-x", "+z")))
    assert 'imu.aided.mounting = ["+x", "+y", "+z"]' in calibrated(noisy[0], chain).message


def test_a_reversed_gyro_axis_is_told(noisy):
    assert "gyro_z measures -z" in calibrated(changed(noisy[0], gyro_z=lambda v: -v)).message


def test_a_gyro_in_the_wrong_unit_is_told(noisy):
    wrong = changed(noisy[0], gyro_x=np.degrees, gyro_y=np.degrees, gyro_z=np.degrees)
    estimate = calibrated(wrong)
    assert estimate.status is Status.INCONSISTENT
    assert "check the unit of gyro" in estimate.message


def test_missing_angles_are_an_error(noisy):
    with pytest.raises(RecordError, match="no column phi2"):
        calibrated(changed(noisy[0], phi2=None))


def test_commanded_steps_are_no_angles_of_an_encoder(noisy):
    with pytest.raises(RecordError, match="jumps by"):
        calibrated(changed(noisy[0], phi1=lambda v: 0.5 * np.pi * np.round(v / (0.5 * np.pi))))


def test_angles_of_another_test_are_an_error(noisy):
    record, _ = noisy
    later = record["phi1"].t + 1e4
    columns = {n: replace(c, t=later) if n.startswith("phi") else c for n, c in record.columns.items()}
    with pytest.raises(RecordError, match="within the time of the table's angles"):
        calibrated(Record(columns))


def test_without_a_gyro_the_accelerometers_are_calibrated(noisy):
    record, true = noisy
    estimate = calibrated(changed(record, gyro_x=None, gyro_y=None, gyro_z=None))
    assert estimate.status is Status.OK
    assert len(estimate.names) == 12 + 10
    assert any(finding.code == "gyro_missing" for finding in estimate.findings)
    assert np.all(np.abs(errors(estimate, true)) < 4.0 * estimate.u)


def test_too_few_turns_are_told_with_the_axis(noisy):
    estimate = calibrated(cut(noisy[0], 17.0))
    assert estimate.status is Status.UNOBSERVABLE
    assert "next to nothing" in estimate.message


def test_a_table_that_never_turns_is_told(noisy):
    estimate = calibrated(cut(noisy[0], 6.0))
    assert estimate.status is Status.UNOBSERVABLE
    assert "the table turns by 0 deg only" in estimate.message


@pytest.mark.parametrize("late", [0.012, -7.3, 20.0])
def test_a_shift_of_the_clocks_is_found_said_and_corrected(noisy, late):
    record, true = noisy
    t = record["phi1"].t + late
    columns = {n: replace(c, t=t) if n.startswith("phi") else c for n, c in record.columns.items()}
    estimate = calibrated(Record(columns))
    assert estimate.status is Status.OK
    shift = estimate.result["time_shift_s"]["gyro"]
    assert abs(shift["value"][0] - late) < 5.0 * shift["u"][0]
    (said, _) = [finding for finding in estimate.findings if finding.code == "command_shift"]
    assert ("late" if late > 0 else "early") in said.message
    moved = {name: true[name] - late for name in ("tau_a", "tau_g")}
    assert np.all(np.abs(errors(estimate, true | moved)) < 6.0 * estimate.u)


def test_encoders_that_wrap_and_are_read_less_often_and_lost_samples_do_no_harm(noisy):
    record, true = noisy
    t = record["phi1"].t[::5]
    columns = {
        n: replace(c, t=t, values=np.mod(c.values[::5], 2.0 * np.pi)) if n.startswith("phi") else c
        for n, c in record.columns.items()
    }
    gyro = columns["gyro_y"].values.copy()
    gyro[500:560] = np.nan
    columns["gyro_y"] = replace(columns["gyro_y"], values=gyro)
    estimate = calibrated(Record(columns))
    assert estimate.status is Status.OK
    assert np.all(np.abs(errors(estimate, true)) < 4.0 * estimate.u)


@pytest.mark.parametrize("channels", ["acc gyro phi", "phi", "acc gyro"])
def test_stray_stamps_are_left_out_and_a_clock_set_back_is_refused(noisy, channels):
    record, true = noisy

    def on(t):
        named = tuple(channels.split())
        return Record({n: replace(c, t=t) if n.startswith(named) else c for n, c in record.columns.items()})

    t = record["acc_x"].t
    stray = t.copy()
    stray[[300, 700, 701, -1]] = t[300] + 100.0, t[600], t[601], np.nan
    estimate = calibrated(on(stray))
    assert estimate.status is Status.OK
    assert np.all(np.abs(errors(estimate, true)) < 4.0 * estimate.u)
    back = np.where(t > 40.0, t - 20.0, t)
    with pytest.raises(RecordError, match=r"the clock of (acc|phi1) falls back from 40 s to 20\.\d+ s"):
        calibrated(on(back))


def test_the_temperature_is_that_stated_or_else_that_recorded(noisy):
    columns = dict(noisy[0].columns)
    t = columns["acc_x"].t
    columns["temperature"] = Column(
        "temperature", parse_unit("K"), 295.15 + np.sin(t), t, columns["acc_x"].source
    )
    recorded = calibrated(Record(columns)).conditions["temperature"]
    assert recorded == {
        "value": pytest.approx(22.0 + np.sin(t).mean()),
        "u": pytest.approx(np.sin(t).std()),
        "unit": "degC",
    }
    stated = parse_quantity("20 degC", "temperature", "temperature")
    assert calibrated(Record(columns), temperature=stated).conditions["temperature"] == {
        "value": 20.0,
        "u": 0.0,
        "unit": "degC",
    }
    assert calibrated(noisy[0]).conditions["temperature"] is None


# faces


def test_the_study_says_how_the_instrument_sits():
    options = aided_settings(table_read(AidedRig, {"mounting": ["+y", "+x", "-z"]}), "study")
    assert options.azimuth_u is None
    assert options.chain.attitude([0.0, 0.0]) == pytest.approx(mounting_of(("+y", "+x", "-z")))
    rig = {"kind": "two_axis_turntable", "base": {"azimuth": "90.0(1) deg"}}
    told = aided_settings(table_read(AidedRig, {"rig": rig}), "study")
    assert told.azimuth_u == pytest.approx(np.radians(0.1))
    other = {"kind": "three_axis_turntable", "errors": {"deps_x": {"normal": "3 arcsec"}}}
    with pytest.raises(StudyError, match=r"imu\.aided\.rig\.errors\.deps_x: .* did you mean deps_x1"):
        aided_settings(table_read(AidedRig, {"rig": other}), "study")
    with pytest.raises(StudyError, match="right-handed"):
        table_read(AidedRig, {"mounting": ["+x", "+y", "-z"]})


@pytest.mark.slow
def test_pictures_of_sound_and_failed_calibrations(noisy):
    for record in (
        noisy[0],
        changed(noisy[0], phi1=lambda v: -v),
        changed(noisy[0], gyro_x=None, gyro_y=None, gyro_z=None),
    ):
        found = calibrate_aided(record, settings(), AidedSettings(CHAIN))
        drawn = pictures(found)
        fitted = found.fit is not None
        assert drawn[fitted].title == "The reference"
        assert len(drawn) == (4 + len(found.fit.identified) if fitted else 1)
        assert all(len(picture.svg) < 300_000 for picture in drawn)
        render(found.estimate, drawn, "Table")
