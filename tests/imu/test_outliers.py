"""Outlying poses and turns are named at a stated risk, can be left out, and do not hide each other."""

from dataclasses import replace

import numpy as np
import pytest
from independent import imu
from independent_recordings import SETTINGS, calibrated
from recordings import record_of
from scipy.stats import binom, chi2

from inercal.faces.studies.imu import imu_study
from inercal.foundation.errors import StudyError
from inercal.foundation.findings import Status
from inercal.systems.imu.figures import pictures
from inercal.systems.imu.multiposition.calibration import calibrate_multiposition
from inercal.systems.imu.multiposition.deletion import LinearisedFit, held_out, outlying
from inercal.systems.imu.settings import Exclusion
from rows import for_each

SOUND = 4  # a seed whose recording is sound, and whose seventh turn tells much of the gyro


def linear(rng, n=24, p=9, shifts=()):
    """A linear fit to ``n`` rows of unit variance, some of them shifted by multiples of it."""
    jacobian, y = rng.normal(size=(n, 1, p)), rng.normal(size=(n, 1))
    for place, size in shifts:
        y[place] += size
    fitted = jacobian[:, 0] @ np.linalg.lstsq(jacobian[:, 0], y, rcond=None)[0]
    return LinearisedFit(y - fitted, jacobian, np.zeros((n, n)), np.ones(n), np.zeros((p, p)))


def test_squares_left_are_those_of_the_fit_without_the_row():
    rng = np.random.default_rng(0)
    fit = linear(rng)
    kept = np.arange(24) != 5
    rest = np.linalg.lstsq(fit.jacobian[kept, 0], fit.residuals[kept], rcond=None)[1]
    np.testing.assert_allclose(fit.only(kept).chi2(1.0), rest, rtol=1e-9)


def test_other_rows_count_as_if_they_were_items():
    """Rows of known variance beside the items give the same sum of squares as one fit to all."""
    rng = np.random.default_rng(1)
    J, y = rng.normal(size=(20, 4)), rng.normal(size=20)
    r = y - J @ np.linalg.lstsq(J, y, rcond=None)[0]
    items = LinearisedFit.beside(
        r[:12].reshape(6, 2), J[:12].reshape(6, 2, 4), np.zeros((12, 12)), np.ones(6), J[12:], r[12:]
    )
    own = float(np.linalg.lstsq(J[12:], y[12:], rcond=None)[1][0])
    assert items.fixed == 4
    np.testing.assert_allclose(items.chi2(1.0) + own, r @ r, rtol=1e-9)


def test_false_names_are_as_rare_as_stated():
    """300 sound fits: as many false names as the risk of 5e-4 allows at 99.99 %."""
    rng = np.random.default_rng(2)
    false = sum(bool(outlying(linear(rng), 5e-4)) for _ in range(300))
    assert false <= binom.ppf(0.9999, 300, 5e-4)


def test_two_outliers_do_not_hide_each_other():
    rng = np.random.default_rng(3)
    assert outlying(linear(rng, 40, 9, [(4, 12.0), (17, 12.0)]), 5e-4) == [4, 17]


def test_half_foretold_by_the_other_half_is_chi_square():
    rng = np.random.default_rng(4)
    told = [held_out(linear(rng, 30), 1.0) for _ in range(200)]
    total = sum(each.rms**2 * each.count for each in told)
    count = sum(each.count for each in told)
    assert chi2.cdf(total, count) == pytest.approx(0.5, abs=0.4999)
    inside = np.mean([each.low < each.rms < each.high for each in told])
    assert inside > 0.96
    assert held_out(linear(rng, 12), 1.0) is None


def test_the_range_of_thirty_residuals_is_that_of_the_table():
    told = held_out(linear(np.random.default_rng(5), 60), 1.0)
    assert (told.count, round(told.low, 2), round(told.high, 2)) == (30, 0.68, 1.34)


def test_a_turn_with_a_knock_is_named_and_left_out():
    """17.6 mrad that the gyro misses: u(S) more than half as large again, and as without it once it is left out."""
    sound, _ = calibrated(SOUND)
    knocked, _ = calibrated(SOUND, imu.Faults(turn=0.0176))
    estimate = knocked.estimate
    assert sound.estimate.status is Status.OK
    assert estimate.status is Status.SUSPECT
    (finding,) = (f for f in estimate.findings if f.code == "outlying_turn")
    assert finding.harm
    assert knocked.outliers.turns == (7,)
    begin, _, end = finding.message.partition('exclude = ["')[2].partition('"]')[0].partition(" s .. ")
    span = float(begin), float(end.removesuffix(" s"))
    settings = replace(SETTINGS, exclude=Exclusion((span,)))
    without, error = calibrated(SOUND, imu.Faults(turn=0.0176), settings)
    assert without.estimate.status is Status.OK
    assert without.estimate.statistics["turns"] == estimate.statistics["turns"] - 1
    assert without.estimate.statistics["intervals"] == estimate.statistics["intervals"]
    assert np.max(np.abs(error)) < 5.0
    assert without.estimate["S_x"].u < 1.3 * sound.estimate["S_x"].u
    captions = " ".join(picture.caption for picture in pictures(knocked))
    assert "foretold by the others" in captions


def test_a_pose_that_was_pushed_is_named_and_left_out():
    """5 mg along the vertical in the tenth pose; the others keep their numbers without it."""
    pushed, _ = calibrated(SOUND, imu.Faults(pose=0.05))
    (finding,) = (f for f in pushed.estimate.findings if f.code == "outlying_pose")
    assert pushed.estimate.status is Status.SUSPECT
    assert 'imu.exclude = ["pose 10"]' in finding.message
    settings = replace(SETTINGS, exclude=Exclusion(poses=(10,)))
    without, error = calibrated(SOUND, imu.Faults(pose=0.05), settings)
    numbers = [row["pose"] for row in without.estimate.result["intervals"]]
    assert numbers == [n for n in range(1, 25) if n != 10]
    assert [row["from_pose"] for row in without.estimate.result["turns"]] == numbers[:-1]
    assert without.estimate.status is Status.OK
    assert np.max(np.abs(error)) < 5.0


def test_poses_beyond_the_range_of_the_accelerometers_are_named():
    """Outputs that end at 9 m/s^2, as those of a range of +-0.9 g, are short of 1 g upright."""
    rng = np.random.default_rng(SOUND)
    made = imu.unit(rng)
    t, acc, gyro = imu.record(rng, made, imu.random_ups(rng, 24))
    cut = record_of(t, np.clip(acc, -9.0, 9.0), gyro, "m/s^2", "rad/s")
    estimate = calibrate_multiposition(cut, SETTINGS).estimate
    assert estimate.status is Status.SUSPECT
    (finding,) = (f for f in estimate.findings if f.code == "saturation" and f.harm)
    # up at the start, along z
    assert "in poses 1, " in finding.message


@for_each(
    ("exclude", "sentence"),
    [
        (["pose 0"], "pose 0"),
        (["turn 3"], "turn 3"),
        (["9 s .. 5 s"], "9 s .. 5 s"),
        (["9 .. 12"], "9"),
        ([7], "7"),
    ],
)
def test_what_cannot_be_left_out_gets_a_sentence(exclude, sentence):
    with pytest.raises(StudyError, match=r"imu\.exclude") as caught:
        imu_study({"imu": {"exclude": exclude}}, "study.toml")
    assert sentence in caught.value.message


def test_a_study_leaves_out_times_and_poses():
    study = imu_study(
        {"site": {"gravity": "9.81 m/s^2"}, "imu": {"exclude": ["249 s .. 4.3 min", "pose 12"]}}, "study.toml"
    )
    assert study.exclude == Exclusion(((249.0, 258.0),), (12,))


@for_each(
    ("exclude", "sentence"),
    [
        (Exclusion(poses=(25,)), "found pose 25, expected one of 1 to 24"),
        (Exclusion(((900.0, 901.0),)), "expected a time of the record"),
        (Exclusion(poses=tuple(range(1, 16))), "found 9 poses to fit"),
    ],
)
def test_what_is_not_there_gets_a_sentence(exclude, sentence):
    with pytest.raises(StudyError, match=sentence):
        calibrated(SOUND, settings=replace(SETTINGS, exclude=exclude))
