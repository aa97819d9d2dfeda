"""Simulated recordings of an IMU in the hand with what real ones add, against what each is by hand."""

from dataclasses import replace

import numpy as np
import pytest

from inercal.faces.studies.load import load_imu_study
from inercal.foundation.errors import StudyError
from inercal.foundation.findings import Status
from inercal.foundation.geometry.rotations import conjugate, exp, multiply
from inercal.systems.imu.ferraris.names import NAMES as SECTIONS
from inercal.systems.imu.settings import Disturbances
from inercal.systems.imu.simulate import draw_truth, hand_poses, simulate, with_values
from inercal.systems.imu.task import calibrate
from inercal.systems.imu.task import simulate as simulate_study

GRAVITY, RATE = 9.81, 100.0
TRUTH = draw_truth(np.random.default_rng(1))
QUIET = replace(
    TRUTH,
    accelerometer_noise=replace(TRUTH.accelerometer_noise, white=0.0, wander=0.0),
    gyro_noise=replace(TRUTH.gyro_noise, white=0.0, wander=0.0),
)
POSES = hand_poses(np.random.default_rng(2), 6)


def recorded(**disturbances):
    """Specific force and rate (n, 3) that the outputs of a quiet IMU stand for."""
    record, _ = simulate(
        QUIET, POSES, GRAVITY, 0.0, np.random.default_rng(3), start=10.0, disturbances=Disturbances(**disturbances)
    )  # fmt: skip
    return QUIET.accelerometer.correct(record.triad("acc").values), QUIET.gyro.correct(
        record.triad("gyro").values
    )


F, OMEGA = recorded()


def test_a_restless_start_is_a_motion_that_accelerometers_and_gyros_agree_on():
    """Rates integrated in fine steps keep the direction of gravity that the accelerometers read; then it is still."""
    f, omega = recorded(restless_start=np.radians(0.3))
    first, later = slice(0, 1000), slice(1001, 1250)
    tilt = np.linalg.norm(f[first] - F[first], axis=1) / GRAVITY
    assert 0.5 < np.sqrt(np.mean(tilt[:950] ** 2)) / (np.sqrt(2.0) * np.radians(0.3)) < 1.5
    np.testing.assert_allclose(f[995:1000], F[995:1000], atol=3e-3)
    np.testing.assert_allclose(omega[later], OMEGA[later], atol=1e-12)
    q = np.array([1.0, 0.0, 0.0, 0.0])
    apart = []
    moved = omega - OMEGA[0]  # without earth rate
    for k in range(1, 1000):
        q = multiply(q, exp(0.5 * (moved[k - 1] + moved[k]) / RATE))
        up = f[k] / np.linalg.norm(f[k])
        turned = multiply(multiply(conjugate(q), np.array([0.0, *(f[0] / GRAVITY)])), q)[1:]
        apart.append(np.linalg.norm(turned - up))
    assert max(apart) < 0.05 * np.radians(0.3) * np.sqrt(2.0)


def test_a_knock_turns_the_gyro_alone_by_its_angle_in_one_turn():
    f, omega = recorded(knocks=1, knock=np.radians(1.0))
    np.testing.assert_allclose(f, F, atol=1e-10)
    wrong = (omega - OMEGA) / RATE
    rows = np.flatnonzero(np.linalg.norm(wrong, axis=1) > 1e-9)
    assert np.ptp(rows) <= 2
    assert np.linalg.norm(wrong.sum(axis=0)) == pytest.approx(np.radians(1.0), rel=1e-9)
    assert np.linalg.norm(OMEGA[rows[0]]) > 1e-3


def test_a_gyro_clips_at_its_range_and_k2_bends_the_accelerometers():
    record, _ = simulate(
        QUIET, POSES, GRAVITY, 0.0, np.random.default_rng(3), start=10.0,
        disturbances=Disturbances(gyro_range=0.3, k2=3e-5),
    )  # fmt: skip
    gyro = (record.triad("gyro").values - QUIET.gyro.bias) / QUIET.gyro.scale
    assert np.abs(gyro).max() == pytest.approx(0.3, rel=1e-12)
    free = OMEGA @ QUIET.gyro.misalignment.T
    inside = np.abs(free) < 0.299
    np.testing.assert_allclose(gyro[inside], free[inside], atol=1e-9)
    s = F @ QUIET.accelerometer.misalignment.T
    acc = (record.triad("acc").values - QUIET.accelerometer.bias) / QUIET.accelerometer.scale
    np.testing.assert_allclose(acc, s + 3e-5 * s**2, atol=1e-9)


STUDY = '[site]\ngravity = "9.81 m/s^2"\nlatitude = "50 deg"\n'


def test_a_study_states_course_truth_and_disturbances(tmp_path):
    path = tmp_path / "imu.toml"
    path.write_text(
        STUDY + '[simulation]\nposes = 5\nstart = "6 s"\nsample_rate = "50 Hz"\n'
        '[simulation.coefficients]\nK1_x = "4000 count/g"\nM_xy = "1 deg"\n'
        '[disturbances]\nclock = "1 %"\nk2 = "30 ug/g^2"\n'
    )
    of = load_imu_study(path)
    assert of.simulation.coefficients["K1_x"] == pytest.approx(4000.0 / 9.80665)
    assert of.disturbances.k2 == pytest.approx(30e-6 / 9.80665)
    record = simulate_study(of, np.random.default_rng(1))
    assert np.median(np.diff(record["acc_x"].t)) == pytest.approx(0.02 * 1.01)
    assert (
        with_values(TRUTH, of.simulation.coefficients).values()["K1_x"] == of.simulation.coefficients["K1_x"]
    )
    for text, words in (
        (STUDY.replace('latitude = "50 deg"\n', ""), "no latitude"),
        (STUDY + '[imu]\nmethod = "means"\n', "imu.method: found another method"),
    ):
        path.write_text(text)
        with pytest.raises(StudyError, match=words):
            simulate_study(load_imu_study(path), np.random.default_rng(1))
    for text, words in (
        (
            STUDY + '[simulation.coefficients]\nK9_x = "1 count"\n',
            "simulation.coefficients.K9_x: unknown term",
        ),
        (STUDY + '[disturbances]\nk2 = "30 ug"\n', "disturbances.k2: found"),
        (STUDY + '[disturbances]\nrestless_start = "-1 deg"\n', "a size of 0 or more"),
        (
            STUDY + '[disturbances]\ndelay = "20 ms"\n',
            "disturbances.delay: found with method = 'multiposition'",
        ),
        (
            STUDY + '[imu]\nmethod = "ferraris"\n[simulation]\nposes = 9\n',
            "simulation.poses: found with method = 'ferraris', expected it with multiposition or sections only",
        ),
        (
            STUDY + '[imu]\nmethod = "aided"\n[disturbances]\nrestless_start = "1 deg"\n',
            "expected it with multiposition or ferraris or sections only",
        ),
    ):
        path.write_text(text)
        with pytest.raises(StudyError, match=words):
            load_imu_study(path)


FERRARIS = STUDY + (
    '[imu]\nmethod = "ferraris"\n[imu.ferraris]\nturn = "360(0.2) deg"\nalignment = "0.3 deg"\n'
    '[simulation]\nhold = "6 s"\nturning = "5 s"\n'
)
TABLE = STUDY + (
    '[imu]\nmethod = "aided"\n[imu.aided.rig]\nkind = "two_axis_turntable"\n[imu.aided.rig.errors]\n'
    'default = { normal = "10 arcsec" }\n[simulation]\nstart = "6 s"\nhold = "4 s"\nturning = "4 s"\n'
    'sample_rate = "25 Hz"\n'
)
TRUE = {"K1_x": 420.0, "M_yx": 0.01, "S_z": 4800.0, "T_xy": -0.02}
COEFFICIENTS = "[simulation.coefficients]\n" + "".join(
    f'{name} = "{value}{unit}"\n'
    for (name, value), unit in zip(
        TRUE.items(), (" count/(m/s^2)", " rad", " count/(rad/s)", " rad"), strict=True
    )
)


def round_trip(tmp_path, text, disturbances=""):
    """The calibration of the recording that a study simulates, by the same study."""
    path = tmp_path / "study.toml"
    path.write_text(text + COEFFICIENTS + "[disturbances]\n" + disturbances)
    of = load_imu_study(path)
    record = simulate_study(of, np.random.default_rng(5))
    return record, calibrate(record, of).estimate


def codes(estimate):
    return {finding.code for finding in estimate.findings}


def test_six_positions_and_three_turns_come_back(tmp_path):
    record, estimate = round_trip(tmp_path, FERRARIS)
    assert estimate.status is Status.OK
    assert set(record.labels) == {"", *SECTIONS}
    for name, value in TRUE.items():
        assert abs(estimate[name].value - value) < 4.0 * estimate[name].u, name


def test_faults_of_a_session_are_seen_as_they_are(tmp_path):
    """A restless position, a clipped turn; a clock shifts the scale factors by itself, closed form."""
    _, sound = round_trip(tmp_path, FERRARIS)
    _, restless = round_trip(tmp_path, FERRARIS, 'restless_start = "0.5 deg"\n')
    assert restless.status is Status.INCONSISTENT
    assert "poor_section" in codes(restless)
    _, clipped = round_trip(tmp_path, FERRARIS, 'gyro_range = "100 deg/s"\n')
    assert "saturation" in codes(clipped)
    _, slow = round_trip(tmp_path, FERRARIS, 'clock = "1 %"\n')
    for axis in "xyz":
        assert slow[f"S_{axis}"].value / sound[f"S_{axis}"].value == pytest.approx(1.01, rel=1e-4)
    _, bent = round_trip(tmp_path, FERRARIS, 'k2 = "100 ug/g^2"\n')
    moved = (bent["K0_x"].value - sound["K0_x"].value) / sound["K1_x"].value
    assert 0.5 < moved / (100e-6 / 9.80665 * 9.81**2) < 1.01


@pytest.mark.slow
def test_a_test_on_a_table_comes_back_with_lever_arms_and_a_delay(tmp_path):
    _, estimate = round_trip(tmp_path, TABLE, 'lever_arm = "50 mm"\ndelay = "20 ms"\n')
    assert estimate.status is Status.OK
    assert "command_shift" in codes(estimate)
    for name, value in TRUE.items():
        assert abs(estimate[name].value - value) < 4.0 * estimate[name].u, name
    shift = estimate.result["time_shift_s"]["acc"]
    assert abs(shift["value"][0] - 0.02) < 4.0 * shift["u"][0]


@pytest.mark.slow
def test_faults_on_a_table_are_named(tmp_path):
    _, knocked = round_trip(tmp_path, TABLE, 'knocks = 1\nknock = "1 deg"\n')
    assert "outlier" in codes(knocked)
    _, bent = round_trip(tmp_path, TABLE, 'gyro_range = "40 deg/s"\nk2 = "1000 ug/g^2"\n')
    assert {"saturation", "unmodelled_k2"} <= codes(bent)
