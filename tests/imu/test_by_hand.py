"""A log in the hand, of which a study says nothing: its poses and the moves between them, by an independent model."""

from dataclasses import replace

import numpy as np
import pytest
from moved_units import DEG, GRAVITY, LATITUDE, turned_by_hand
from recordings import arrays, record_of, shipped

from inercal.foundation.errors import StudyError
from inercal.foundation.findings import Status
from inercal.foundation.geometry.earth import Site
from inercal.systems.imu.settings import Exclusion, ImuSettings
from inercal.systems.imu.task import calibrate
from rows import for_each

SETTINGS = ImuSettings(Site(GRAVITY, (), LATITUDE))
HEADS = ("K0", "K1", "M", "D_F", "S", "T")


def log_of(record, unit=("m/s^2", "rad/s")):
    return record_of(record.t, record.acc, record.gyro, *unit)


def off(estimate, truth, heads=HEADS):
    """Errors over U by name."""
    return {
        p.name: (p.value - truth[p.name]) / p.U
        for p in map(estimate.__getitem__, estimate.names)
        if p.name.rpartition("_")[0] in heads and p.name in truth
    }


def codes(estimate):
    return [finding.code for finding in estimate.findings]


def test_a_log_in_the_hand_gives_its_coefficients():
    """24 rests found in the log: 21 values, none 2 U off, and gravity taken as exact is said."""
    record = turned_by_hand(np.random.default_rng(4601), 24)
    estimate = calibrate(log_of(record), SETTINGS).estimate
    assert estimate.status is Status.OK
    assert estimate.message == "33 coefficients from 24 sections and 23 moves"
    assert estimate.result["method"] == "multiposition"
    z = off(estimate, record.truth)
    assert len(z) == 21
    assert max(map(abs, z.values())) < 2.0
    assert estimate["S_x"].u < 6e-4
    assert codes(estimate).count("stated_exact") == 1


@pytest.mark.slow
@pytest.mark.parametrize("rests", [12, 24])
def test_coverage_of_logs_in_the_hand(rests):
    """Of 21 values in each of 12 logs 95 % are within U: of some 80 independent ones 87 %, but in 1 of 1000."""
    z = []
    for seed in range(12):
        record = turned_by_hand(np.random.default_rng([46, rests, seed]), rests)
        z.extend(off(calibrate(log_of(record), SETTINGS).estimate, record.truth).values())
    assert len(z) == 12 * 21
    assert np.mean(np.abs(z) < 1.0) > 0.87


@pytest.mark.slow
@pytest.mark.parametrize("drift", [0.1 * DEG, 1.0 * DEG])
def test_a_bias_that_drifts_does_no_harm_to_scale_factors(drift):
    """A move has the bias of the rests beside it; the drift is named where it is large."""
    z, named = [], []
    for seed in range(4):
        record = turned_by_hand(np.random.default_rng([47, seed]), 24, drift=drift)
        estimate = calibrate(log_of(record), SETTINGS).estimate
        z.extend(off(estimate, record.truth, ("S", "T", "K0", "K1", "M")).values())
        named.append("bias_drift" in codes(estimate))
    assert np.sqrt(np.mean(np.square(z))) < 0.75  # in U, of which u is 0.51
    assert all(named) or drift < DEG


def test_six_sides_twice_by_hand():
    """Directions unknown: M within 1 mrad, S within 0.1 %, T within 1 mrad, where poses alone are ill-conditioned."""
    quarter = [[np.pi / 2, 0, 0], [0, np.pi / 2, 0], [0, 0, np.pi / 2]]
    rng = np.random.default_rng(4603)
    turns = [np.array(quarter[k % 3]) + rng.normal(0, 0.03, 3) for k in range(11)]
    record = turned_by_hand(rng, 12, turns=turns)
    estimate = calibrate(log_of(record), SETTINGS).estimate
    assert estimate.status is Status.OK
    z = off(estimate, record.truth)
    assert max(map(abs, z.values())) < 2.0
    for name in estimate.names:
        if name[:2] in ("M_", "S_", "T_"):
            assert estimate[name].u < 1.5e-3, name


def test_too_few_poses_name_what_they_leave_open_and_the_pose_to_add():
    """Three poses with 60 degrees about the vertical between them tell one axis of the accelerometers."""
    record = turned_by_hand(
        np.random.default_rng(4612), 3, turns=[[0, 0, 1.0], [0, 0, -1.0]], swing=0.0, level=True
    )
    estimate = calibrate(log_of(record), SETTINGS).estimate
    assert estimate.status is Status.UNOBSERVABLE
    assert "open: add a rest with" in estimate.message
    assert not estimate.names


def test_ten_poses_of_a_real_recording_name_what_they_hardly_tell():
    """No two of its poses show M_xy: it leans on what is usual, and says so."""
    estimate = calibrate(*shipped("mpu6050")).estimate
    (finding,) = (one for one in estimate.findings if one.code == "by_prior")
    assert "M_xy" in {item["term"] for item in finding.items}
    assert estimate["M_xy"].u > 10 * estimate["M_xz"].u


@pytest.mark.slow
@pytest.mark.parametrize("rests", [6, 8])
def test_few_moves_of_a_restless_gyro_are_within_U(rests):
    """A slow error of 0.3 deg/s in each move, which few moves hardly tell from S and T: of the 12 values of a gyro
    in each of 6 logs 95 % are within U: of some 36 independent ones 86 %, but in 1 of 100."""
    z = []
    for seed in range(6):
        record = turned_by_hand(np.random.default_rng([48, rests, seed]), rests, walk=0.3 * DEG)
        z.extend(off(calibrate(log_of(record), SETTINGS).estimate, record.truth, ("D_F", "S", "T")).values())
    assert len(z) == 6 * 12
    assert np.mean(np.abs(z) < 1.0) > 0.86


def test_accelerometers_alone():
    record = turned_by_hand(np.random.default_rng(4604), 20)
    estimate = calibrate(record_of(record.t, record.acc, acc_unit="m/s^2"), SETTINGS).estimate
    assert estimate.status is Status.OK
    assert {name.rpartition("_")[0] for name in estimate.names} == {"K0", "K1", "M", "K2"}
    assert "gyro_missing" in codes(estimate)
    assert max(map(abs, off(estimate, record.truth).values())) < 2.0


@for_each(
    "change, code, words",
    [
        (lambda w: w * [1, -1, 1], "sign_suspect", "gyro_y measures -y"),
        (lambda w: w[:, [1, 0, 2]], "channel_swap", "gyro_x measures +y, gyro_y measures +x"),
    ],
)
@pytest.mark.parametrize("unit", [("m/s^2", "rad/s"), ("count", "count")])
def test_a_wrong_map_of_the_gyro_is_named(change, code, words, unit):
    """The accelerometers stay: what can be trusted."""
    record = turned_by_hand(np.random.default_rng(4605), 12)
    record.gyro[:] = change(record.gyro)
    estimate = calibrate(log_of(record, unit), SETTINGS).estimate
    assert estimate.status is Status.INCONSISTENT
    assert "contradict" in estimate.message
    assert any(finding.code == code and words in finding.headline for finding in estimate.findings)
    assert not any(name.startswith(("S_", "T_")) for name in estimate.names)


@for_each(
    "unit, part, code, named",
    [
        (("m/s^2", "deg/s"), 1.0, "unit_suspect", "S_x"),
        (("m/s^2", "rad/s"), 1 / GRAVITY, "implausible", "K1_x"),
    ],
)
def test_a_wrong_unit_is_no_sound_calibration(unit, part, code, named):
    """Rates in rad/s said to be in deg/s; specific force in g said to be in m/s^2."""
    record = turned_by_hand(np.random.default_rng(4606), 16)
    estimate = calibrate(record_of(record.t, record.acc * part, record.gyro, *unit), SETTINGS).estimate
    assert estimate.status is not Status.OK
    (finding,) = (one for one in estimate.findings if one.code == code)
    assert named in finding.harm


def test_moves_that_cannot_be_integrated_are_left_out_and_said():
    record = turned_by_hand(np.random.default_rng(4607), 16)
    gyro = record.gyro.copy()
    for k in range(15):
        begin = record.rests[k][1]
        gyro[begin + 60 : begin + 70] = np.nan
    log = record_of(record.t, record.acc, gyro, "count", "count")
    estimate = calibrate(log, SETTINGS).estimate
    assert estimate.status is Status.TOO_FEW_INTERVALS
    assert "no move between them can be used" in estimate.message
    assert not any(name.startswith("S_") for name in estimate.names)
    (finding,) = (one for one in estimate.findings if one.code == "poor_section")
    assert "15 of 15 moves" in finding.headline


def test_a_coarse_gyro_has_a_bias_no_better_than_a_step():
    """Steps larger than twice the noise: every pose rounds alike."""
    record = turned_by_hand(np.random.default_rng(4608), 16, noise=(8e-3, 1e-4))
    step = 1e-3
    estimate = calibrate(
        record_of(record.t, record.acc, step * np.round(record.gyro / step), "m/s^2", "rad/s"), SETTINGS
    ).estimate
    assert "resolution" in codes(estimate)
    assert all(estimate[f"D_F_{axis}"].u > 0.99 * step / np.sqrt(12) for axis in "xyz")
    assert max(map(abs, off(estimate, record.truth).values())) < 2.0
    assert any(item.source == "gyro resolution" for item in estimate.budget)


def test_a_pose_and_a_move_that_are_off_are_named_at_once_and_can_be_left_out():
    record = turned_by_hand(np.random.default_rng([20, 2]), 24)
    record.gyro[3850:3860] += 10 * DEG / np.sqrt(3)
    record.acc[5500:5800] += [0.02, -0.01, 0.01]
    log = log_of(record)
    estimate = calibrate(log, SETTINGS).estimate
    assert estimate.status is Status.SUSPECT
    said = [one for one in estimate.findings if one.code == "outlying_section"]
    assert {one.headline.split(" lies")[0] for one in said} == {"pose 12", "move 8"}
    assert all(one.harm for one in said)
    of_pose, of_move = sorted(said, key=lambda one: "pose" not in one.headline)
    assert 'imu.exclude = ["pose 12"]' in of_pose.action
    begin, _, end = of_move.action.partition('exclude = ["')[2].partition('"]')[0].partition(" s .. ")
    exclude = Exclusion(((float(begin), float(end.removesuffix(" s"))),), (12,))
    without = calibrate(log, replace(SETTINGS, exclude=exclude)).estimate
    assert without.status is Status.OK
    names = [row["section"] for row in without.result["sections"] if row["kind"] == "rest"]
    assert names == [f"pose {k}" for k in range(1, 25) if k != 12]
    # without pose 12 one move goes on from pose 11 to 13
    assert sum(row["kind"] == "move" for row in without.result["sections"]) == 21
    assert max(map(abs, off(without, record.truth).values())) < 2.0


@for_each(
    "exclude, sentence",
    [
        (Exclusion(poses=(13,)), "found pose 13, expected one of 1 to 12"),
        (Exclusion(((900.0, 901.0),)), "expected a time of the record"),
    ],
)
def test_what_is_not_there_cannot_be_left_out(exclude, sentence):
    record = turned_by_hand(np.random.default_rng(4609), 12)
    with pytest.raises(StudyError, match=sentence):
        calibrate(log_of(record), replace(SETTINGS, exclude=exclude))


@for_each("start, sentence", [(8.0, "still period: the instrument moves"), (1e6, "length of the record")])
def test_a_still_start_that_is_none_gets_a_sentence(start, sentence):
    record = turned_by_hand(np.random.default_rng(4609), 12)
    assert calibrate(log_of(record), replace(SETTINGS, static_start=2.8)).estimate.names
    with pytest.raises(StudyError, match=sentence):
        calibrate(log_of(record), replace(SETTINGS, static_start=start))


def test_poses_beyond_the_range_of_the_accelerometers_do_not_count():
    record = turned_by_hand(np.random.default_rng(4610), 30)
    limit = 0.85 * GRAVITY
    log = record_of(record.t, np.clip(record.acc, -limit, limit), record.gyro, "m/s^2", "rad/s")
    estimate = calibrate(log, SETTINGS).estimate
    (said,) = (
        one for one in estimate.findings if one.code == "saturation" and one.items and "pose" in one.items[0]
    )
    assert said.harm == ()
    assert max(map(abs, off(estimate, record.truth, ("K0", "K1", "M")).values())) < 2.0


def test_coarse_stamps_lost_samples_and_a_joined_log_are_calibrated():
    """Stamps of a clock of 60 Hz, of 100 samples a second; single samples lost; a clock that was set back in a rest."""
    record = turned_by_hand(np.random.default_rng(4611), 16)
    kept = np.random.default_rng(1).random(len(record.t)) > 0.01
    a, b = record.rests[8]
    back = record.t - 20.0 * (np.arange(len(record.t)) > (a + b) // 2)
    for t, rows in (
        (np.floor(record.t * 60.0) / 60.0, slice(None)),
        (record.t, kept),
        (back, slice(None)),
    ):
        log = record_of(t[rows], record.acc[rows], record.gyro[rows], "m/s^2", "rad/s")
        estimate = calibrate(log, SETTINGS).estimate
        assert estimate.status is Status.OK
        assert estimate.statistics["intervals"] >= 16
        assert max(map(abs, off(estimate, record.truth).values())) < 2.0


# laws of holds --------------------------------------------------------------------------------------------------------


def hand():
    record = turned_by_hand(np.random.default_rng(4620), 20)
    return record.t, record.acc, record.gyro


def table():
    """A good unit, put down for 6 s each time."""
    record = turned_by_hand(np.random.default_rng(4621), 16, rest=6.0, noise=(4e-4, 5e-4), swing=0.2)
    return record.t, record.acc, record.gyro


def smooth():
    """Turns as slow as the rests are long."""
    record = turned_by_hand(np.random.default_rng(4622), 16, rest=3.0, move=6.0, noise=(8e-3, 2e-3))
    return record.t, record.acc, record.gyro


RECORDINGS = {
    "xsens": (lambda: arrays(shipped("xsens")[0]), ("count", "count")),
    "hand": (hand, ("m/s^2", "rad/s")),
    "table": (table, ("m/s^2", "rad/s")),
    "smooth turns": (smooth, ("m/s^2", "rad/s")),
}


def variants(t, acc, gyro):
    """What is done to a recording, the share of its samples that stay, and the sign of the gyro's bias then."""
    n = len(t)
    for k, phase in ((2, 1), (3, 0)):
        yield f"1 in {k}", t[phase::k], acc[phase::k], gyro[phase::k], 1.0 / k, 1.0
    yield "reversed", t[0] + t[-1] - t[::-1], acc[::-1], -gyro[::-1], 1.0, -1.0
    yield "no gyro", t, acc, None, 1.0, 1.0
    yield "first tenth cut", t[n // 10 :], acc[n // 10 :], gyro[n // 10 :], 0.9, 1.0
    yield "last tenth cut", t[: -n // 10], acc[: -n // 10], gyro[: -n // 10], 0.9, 1.0


def most_growth(what, head):
    """Growth of u at most, beyond that by the number of samples: where poses, or all moves, are lost, 3; of biases of a
    gyro, whose noise may be told by 8 degrees of freedom, so that u scatters by 1/sqrt(16), 1.3 (1 + 2/sqrt(16))."""
    if "cut" in what or what == "no gyro":
        return 3.0
    return 1.95 if head == "D_F" else 1.3


@pytest.mark.slow
@pytest.mark.parametrize("name", RECORDINGS)
def test_values_stay_whatever_is_done_to_a_recording(name):
    """A value moves by at most 3 sqrt(|u'^2 - u^2|) + 0.3 u, u' at least as large as white noise makes it, and u' is at
    most 1.3/sqrt(share of the samples) of u."""
    make, unit = RECORDINGS[name]
    t, acc, gyro = make()
    settings = replace(SETTINGS, site=Site(9.81744)) if name == "xsens" else SETTINGS
    whole = calibrate(record_of(t, acc, gyro, *unit), settings).estimate
    wrong = []
    for what, time, f, w, share, sign in variants(t, acc, gyro):
        part = calibrate(record_of(time, f, w, *unit), settings).estimate
        for here in map(part.__getitem__, part.names):
            head, there = here.name.rpartition("_")[0], whole[here.name]
            if head not in HEADS:
                continue
            value = here.value * (sign if head == "D_F" else 1.0)
            u = max(here.u, there.u / np.sqrt(share)) if share < 1.0 else here.u
            allowed = 3.0 * np.sqrt(abs(u**2 - there.u**2)) + 0.3 * there.u
            moved, grown = abs(value - there.value) / allowed, here.u / there.u * np.sqrt(share)
            if moved > 1.0 or grown > most_growth(what, head):
                wrong.append((what, here.name, round(moved, 2), round(grown, 2)))
    assert wrong == []
