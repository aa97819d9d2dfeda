"""Calibration against one axis, single channels, and the attitude of another instrument, by an independent model."""

from dataclasses import replace

import numpy as np
import pytest
from independent_references import DEG, SETTINGS, as_record, simulated, steady
from new_studies import table_read
from scipy.spatial.transform import Rotation

from inercal.faces.studies.imu import aided_settings
from inercal.foundation.errors import InputError, RecordError
from inercal.foundation.findings import Status
from inercal.foundation.rigs.chain import Chain, Joint
from inercal.foundation.rigs.tables import turntable
from inercal.systems.imu.aided.calibration import calibrate_aided
from inercal.systems.imu.settings import AidedReference, AidedRig, AidedSettings, of_attitude
from rows import for_each

SEED = 20261127
RUNS = 4


def misses(estimate, made):
    """Errors over u of the coefficients of the instrument."""
    true = made.truth("case")
    return {
        name: (estimate[name].value - true[name][0]) / estimate[name].u
        for name in estimate.names
        if name in true
    }


def at_random(rng, turns=18):
    """Rests between turns about one axis after the other, of angles at random."""
    program = [(0, 0.0, 6.0)]
    for k in range(turns):
        turn = (1, 2, 0)[k % 3], float(rng.choice([-1, 1]) * rng.uniform(60, 180)), rng.uniform(1.5, 3)
        program += [turn, (0, 0.0, rng.uniform(2, 3.5))]
    return program


def beside_a_reference(rng, noise, turn=None):
    """Times, quaternions, angles, outputs and truth of a unit whose attitude is recorded on axes of its own."""
    made = steady(rng)
    t, angles, acc, gyro, attitude = simulated(made, "zyx", at_random(rng), rng, arm=(0.03, -0.02, 0.05))
    level = Rotation.from_rotvec(np.append(rng.normal(0, 0.5 * DEG, 2), rng.uniform(-3, 3)))
    body = level * attitude * (turn or Rotation.identity())
    body = body * Rotation.from_rotvec(rng.normal(0, noise * DEG, (len(t), 3)))
    return t, np.roll(body.as_quat(), 1, axis=1), angles, acc, gyro, made


def settings_of(reference=AidedReference()):  # noqa: B008  (frozen)
    return AidedSettings(of_attitude(reference, np.eye(3)), None, reference)


def named(q):
    return {f"q_ref_{k}": q[:, k] for k in range(4)}


@pytest.fixture(scope="module")
def robot():
    """A robot's flange: its attitude has 0.003 deg of noise."""
    return beside_a_reference(np.random.default_rng(SEED), 0.003)


@pytest.fixture(scope="module")
def one_axis():
    rng = np.random.default_rng(SEED)
    made = steady(rng)
    turns = [(0, 720.0, 12.0), (0, -720.0, 8.0), (0, 1440.0, 18.0), (0, -1440.0, 14.0)]
    program = [(0, 0.0, 8.0), *(leg for turn in turns for leg in (turn, (0, 0.0, 6.0)))]
    return *simulated(made, "z", program, rng, arm=(0.05, 0.02, 0.0)), made


# a reference attitude


@pytest.mark.slow
def test_values_by_a_reference_attitude_are_within_their_uncertainty():
    """Four runs of 24 values: errors over u of unit size, 1 +- 0.22, which 96 normal numbers leave once in 500."""
    found = []
    for run in range(RUNS):
        t, q, _, acc, gyro, made = beside_a_reference(np.random.default_rng([SEED, run]), 0.003)
        estimate = calibrate_aided(as_record(named(q), t, acc, gyro), SETTINGS, settings_of()).estimate
        assert estimate.status is Status.OK, estimate.message
        found += misses(estimate, made).values()
    assert len(found) == 24 * RUNS
    assert 0.78 < np.sqrt(np.mean(np.square(found))) < 1.22


@pytest.mark.slow
def test_a_noisy_body_that_sits_anyhow_finds_its_mounting():
    """Cameras' body is turned by some 60 deg: values are on the axes that the result states."""
    turn = Rotation.from_rotvec([0.3, 0.9, -0.4])
    t, q, _, acc, gyro, made = beside_a_reference(np.random.default_rng(SEED + 1), 0.03, turn)
    estimate = calibrate_aided(as_record(named(q), t, acc, gyro), SETTINGS, settings_of()).estimate
    codes = [finding.code for finding in estimate.findings]
    assert "mounting_found" in codes
    assert "blind" in codes  # cameras are noisier than this gyro
    frame = np.array(estimate.result["mounting"]).T @ turn.inv().as_matrix()  # from the case
    on_axes = replace(made, M=made.M @ frame.T, T=made.T @ frame.T)
    A, B = on_axes.K1[:, None] * on_axes.M, on_axes.S[:, None] * on_axes.T
    for i, axis in enumerate("xyz"):
        assert abs(estimate[f"K1_{axis}"].value - A[i, i]) < 1.5 * estimate[f"K1_{axis}"].U
        assert abs(estimate[f"S_{axis}"].value - B[i, i]) < 1.5 * estimate[f"S_{axis}"].U
    for i, j in ((0, 1), (1, 2), (2, 0)):
        name = f"{'xyz'[i]}{'xyz'[j]}"
        assert abs(estimate[f"M_{name}"].value - A[i, j] / A[i, i]) < 1.5 * estimate[f"M_{name}"].U
        assert abs(estimate[f"T_{name}"].value - B[i, j] / B[i, i]) < 1.5 * estimate[f"T_{name}"].U


@pytest.mark.slow
def test_three_angles_say_what_a_quaternion_says(robot):
    """Angles of a robot pass through a right angle, where they jump and the attitude does not."""
    t, q, _, acc, gyro, _ = robot
    yaw_pitch_roll = Rotation.from_quat(np.roll(q, -1, axis=1)).as_euler("ZYX")
    angles = {f"phi{k + 1}": yaw_pitch_roll[:, k] for k in range(3)}
    assert np.max(np.abs(yaw_pitch_roll[:, 1])) > 80 * DEG
    estimates = [
        calibrate_aided(as_record(reference, t, acc, gyro), SETTINGS, settings_of()).estimate
        for reference in (named(q), angles)
    ]
    assert estimates[0].values == pytest.approx(estimates[1].values, abs=1e-9)


@for_each(
    ("change", "words"),
    [
        (lambda q: np.roll(q, -1, axis=1), 'imu.aided.reference.scalar = "last"'),
        (lambda q: q * [1, -1, -1, -1], 'imu.aided.reference.sense = "reference to body"'),
    ],
)
def test_a_quaternion_of_another_convention_is_named(robot, change, words):
    t, q, _, acc, gyro, _ = robot
    estimate = calibrate_aided(as_record(named(change(q)), t, acc, gyro), SETTINGS, settings_of()).estimate
    assert estimate.status is Status.INCONSISTENT
    assert words in estimate.message


@for_each(
    ("change", "words"),
    [
        (lambda q: q * 1.05, "found the norm 1.05"),
        (
            lambda q: np.where(np.arange(len(q))[:, None] < 3000, q, q[:, [1, 0, 3, 2]]),
            "the attitude jumps by",
        ),
        (lambda q: q[:, :3], "found no attitude of a reference"),
    ],
)
def test_what_is_no_attitude_is_refused(robot, change, words):
    t, q, _, acc, gyro, _ = robot
    changed = change(q)
    columns = {f"q_ref_{k}": changed[:, k] for k in range(changed.shape[1])}
    with pytest.raises(RecordError, match=words):
        calibrate_aided(as_record(columns, t, acc, gyro), SETTINGS, settings_of())


def test_the_study_states_a_reference_or_a_table():
    table = table_read(
        AidedRig, {"reference": {"up": "-y", "level": "0.1 deg"}, "mounting": ["+y", "-x", "+z"]}
    )
    settings = aided_settings(table, "study")
    assert settings.chain.factors == ("dlevel_x", "dlevel_y")
    assert settings.chain.std == pytest.approx([0.1 * DEG] * 2)
    with pytest.raises(InputError, match="rig beside reference"):
        table_read(AidedRig, {"reference": {}, "rig": {"kind": "two_axis_turntable"}})


# one axis, and single channels


def test_one_axis_tells_a_part_and_names_the_rest(one_axis):
    t, angles, acc, gyro, _, made = one_axis
    record = as_record({"phi1": angles[:, 0]}, t, acc, gyro)
    estimate = calibrate_aided(record, SETTINGS, AidedSettings(Chain((Joint("phi1", "z"),)))).estimate
    assert estimate.status is Status.OK
    found = misses(estimate, made)
    assert set(found) == {"D_F_x", "D_F_y", "D_F_z", "S_z", "T_xz", "T_yz"}
    assert max(map(abs, found.values())) < 3.5
    assert estimate["S_z"].u < 1e-5
    assert next(f for f in estimate.findings if f.code == "by_prior").headline.startswith("One axis tells")


def test_a_single_gyro_beside_an_encoder(one_axis):
    t, angles, acc, gyro, _, made = one_axis
    record = as_record({"phi1": angles[:, 0]}, t, acc, gyro, "gyro_z")
    estimate = calibrate_aided(record, SETTINGS, AidedSettings(Chain((Joint("phi1", "z"),)))).estimate
    assert estimate.status is Status.OK
    assert set(misses(estimate, made)) == {"D_F_z", "S_z"}
    assert max(map(abs, misses(estimate, made).values())) < 3.5
    lost = next(finding for finding in estimate.findings if finding.code == "axis_missing")
    assert "gyro_x" in lost.headline


def test_an_axis_that_hardly_turns_tells_no_scale_factor(one_axis):
    t, angles, acc, gyro, _, _ = one_axis
    record = as_record({"phi1": 0.0 * angles[:, 0]}, t, acc, gyro)
    estimate = calibrate_aided(record, SETTINGS, AidedSettings(Chain((Joint("phi1", "z"),)))).estimate
    assert estimate.status is Status.UNOBSERVABLE
    assert "the table turns by" in estimate.message


@pytest.mark.parametrize("channels", [("acc_x",), ("acc_y", "acc_z"), ("acc_x", "acc_y", "acc_z", "gyro_y")])
def test_some_channels_on_two_axes(channels):
    """Each channel by itself: its bias, scale factor and the two misalignments that it has."""
    rng = np.random.default_rng(SEED)
    made = steady(rng)
    program = [(0, 0.0, 8.0)]
    for joint, quarters in ((1, 4), (0, 4), (0, 1), (1, 1), (1, 2), (0, -1), (1, -2), (1, 3), (0, 1), (1, 1)):
        program += [(joint, 90.0 * quarters, 1.5 * (1 + abs(quarters))), (0, 0.0, 4.0)]
    t, angles, acc, gyro, _ = simulated(made, "yz", program, rng)
    record = as_record({"phi1": angles[:, 0], "phi2": angles[:, 1]}, t, acc, gyro, *channels)
    estimate = calibrate_aided(
        record, SETTINGS, AidedSettings(turntable("two_axis_turntable", None))
    ).estimate
    assert estimate.status is Status.OK
    found = misses(estimate, made)
    assert len(found) == 4 * len(channels)
    assert max(map(abs, found.values())) < 4


def test_channels_of_two_units_are_refused(one_axis):
    t, angles, acc, gyro, _, _ = one_axis
    record = as_record({"phi1": angles[:, 0]}, t, acc, gyro, "gyro_y", "gyro_z")
    column = record["gyro_z"]
    other = replace(column, t=column.t.copy())
    changed = replace(record, columns={**record.columns, "gyro_z": other})
    with pytest.raises(RecordError, match="another unit or clock than gyro_y"):
        calibrate_aided(changed, SETTINGS, AidedSettings(Chain((Joint("phi1", "z"),))))
