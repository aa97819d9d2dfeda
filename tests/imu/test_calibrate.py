"""The whole calibration: truth comes back, invariances hold, and bad recordings end with the right verdict."""

from dataclasses import replace

import numpy as np
import pytest
from recordings import arrays, record_of, shipped

from inercal.foundation.errors import InputError
from inercal.foundation.findings import Status
from inercal.foundation.geometry.earth import GravityInput, Site
from inercal.foundation.geometry.rotations import conjugate, exp, rotate
from inercal.systems.imu.multiposition.calibration import calibrate_multiposition as calibrate
from inercal.systems.imu.multiposition.poses import sweep
from inercal.systems.imu.recording import prepare
from inercal.systems.imu.settings import ImuSettings
from inercal.systems.imu.simulate import TriadNoise, draw_truth, hand_poses, simulate
from rows import for_each

SITE = Site(9.81, (), 0.8)
SETTINGS = ImuSettings(SITE)


def recording(seed=1, poses=20, quiet=False, g_sensitivity=0.0, **options):
    rng = np.random.default_rng(seed)
    truth = draw_truth(rng, g_sensitivity)
    if quiet:
        truth = replace(truth, accelerometer_noise=TriadNoise(1e-7), gyro_noise=TriadNoise(1e-8))
    return simulate(truth, hand_poses(rng, poses), SITE.gravity, 0.8, rng, **{"rate": 50.0} | options)


def compare(estimate, truth):
    true = truth.values()
    return estimate.values - np.array([true.get(name, 0.0) for name in estimate.names])


@pytest.mark.parametrize("g_sensitivity", [0.0, 2e-4])
def test_without_noise_the_truth_comes_back(g_sensitivity):
    """The horizontal part of earth rate included, which this good a gyro measures itself."""
    record, truth = recording(quiet=True, g_sensitivity=g_sensitivity)
    estimate = calibrate(record, replace(SETTINGS, g_sensitivity=g_sensitivity > 0, k2=True)).estimate
    assert estimate.status is Status.OK
    error = dict(zip(estimate.names, compare(estimate, truth), strict=True))
    for name, value in error.items():
        size = {
            "K0": 415.0,
            "K1": 415.0,
            "K2": 0.1,
            "M": 1.0,
            "D_F": 4775.0,
            "S": 4775.0,
            "T": 1.0,
            "G": 478.0,
        }
        relative = abs(value) / size[name.rpartition("_")[0]]
        assert relative < (1e-5 if name[0] in "KM" else 2e-5), name


@pytest.mark.parametrize("g_sensitivity", [0.0, 2e-4])
def test_a_bias_that_drifts_is_followed(g_sensitivity):
    """A ramp of 0.2 mrad/s over the recording comes back, D_F is the bias in the middle, nothing else moves."""
    record, truth = recording(seed=30, poses=24, quiet=True, g_sensitivity=g_sensitivity)
    t, acc, gyro = arrays(record)
    ramp = np.array([1.0, -0.5, 0.25]) / t[-1]  # counts a second
    drifting = record_of(t, acc, gyro + t[:, None] * ramp)
    asked = replace(SETTINGS, g_sensitivity=g_sensitivity > 0, bias_drift=True, k2=True)
    found = calibrate(drifting, asked).estimate
    assert found.status is Status.OK
    middle = found.result["bias_time_s"]
    true = truth.values()
    for axis, slope in zip("xyz", ramp, strict=True):
        assert found[f"D_R_{axis}"].value == pytest.approx(slope, abs=2e-5)
        assert found[f"D_R_{axis}"].unit == "count/s"
        assert found[f"D_F_{axis}"].value == pytest.approx(true[f"D_F_{axis}"] + slope * middle, abs=1e-3)
        assert found[f"S_{axis}"].value == pytest.approx(true[f"S_{axis}"], rel=2e-6)
    assert not any(finding.code == "bias_drift" for finding in found.findings)


def test_the_drift_of_a_steady_bias_is_nothing_within_its_uncertainty():
    record, _ = recording(seed=31, poses=24)
    found = calibrate(record, replace(SETTINGS, bias_drift=True)).estimate
    assert all(abs(found[f"D_R_{axis}"].value) < 4.5 * found[f"D_R_{axis}"].u for axis in "xyz")


def test_every_coefficient_within_five_standard_uncertainties():
    record, truth = recording(seed=2, poses=30, g_sensitivity=2e-4)
    estimate = calibrate(record, replace(SETTINGS, g_sensitivity=True)).estimate
    assert estimate.names[-1] == "G_zz"
    assert np.max(np.abs(compare(estimate, truth) / estimate.u)) < 5.0


def test_another_output_unit_is_the_same_instrument():
    """Outputs in m/s^2 and deg/s instead of counts: scaled coefficients, equal angles."""
    record, _ = recording(seed=3)
    t, acc, gyro = arrays(record)
    counts = calibrate(record, SETTINGS).estimate
    other = calibrate(record_of(t, acc / 400.0, gyro / 80.0, "m/s^2", "deg/s"), SETTINGS).estimate
    for name in counts.names:
        factor = {"K": 400.0, "D": 80.0, "S": 80.0}.get(name[0], 1.0)
        # the fit of the turns stops at 1e-9 of the sum of squares, a millionth of the uncertainty
        assert abs(other[name].value * factor - counts[name].value) < 1e-3 * counts[name].u
        assert other[name].u * factor == pytest.approx(counts[name].u, rel=1e-3)
    assert other["K1_x"].unit == "(m/s^2)/(m/s^2)"
    assert other["S_x"].unit == "(deg/s)/(rad/s)"


def test_turning_the_axes_of_the_frame_turns_the_coefficients():
    """Relabelling x->y->z->x permutes biases and scales (misalignments follow another frame)."""
    record, _ = recording(seed=4)
    t, acc, gyro = arrays(record)
    a = calibrate(record, SETTINGS).estimate
    b = calibrate(record_of(t, np.roll(acc, 1, axis=1), np.roll(gyro, 1, axis=1)), SETTINGS).estimate
    for here, there in zip("xyz", "yzx", strict=True):
        assert abs(a[f"K0_{here}"].value - b[f"K0_{there}"].value) < 0.05 * a[f"K0_{here}"].u
        assert abs(a[f"D_F_{here}"].value - b[f"D_F_{there}"].value) < 0.05 * a[f"D_F_{here}"].u
        # scale factors to second order in the misalignments, 0.02 rad each
        assert a[f"K1_{here}"].value == pytest.approx(b[f"K1_{there}"].value, rel=3e-3)
        assert a[f"S_{here}"].value == pytest.approx(b[f"S_{there}"].value, rel=3e-3)


def test_more_gravity_uncertainty_reaches_the_scales_only():
    record, _ = recording(seed=5)
    sure = calibrate(record, SETTINGS).estimate
    unsure = calibrate(
        record, ImuSettings(Site(9.81, (GravityInput("gravity", 0.01, "m/s^2", 1.0),), 0.8))
    ).estimate
    assert unsure["K1_x"].u == pytest.approx(
        np.hypot(sure["K1_x"].u, sure["K1_x"].value * 0.01 / 9.81), rel=1e-3
    )
    assert unsure["K0_x"].u == pytest.approx(sure["K0_x"].u, rel=1e-9)
    assert unsure["S_x"].u == pytest.approx(sure["S_x"].u, rel=1e-9)
    item = next(item for item in unsure.budget if item.source == "gravity")
    assert item.type == "B"
    assert item.share["K1_x"] > 0.9
    correlated = unsure.correlation[unsure.names.index("K1_x"), unsure.names.index("K1_y")]
    assert correlated > 0.9


def test_the_clock_reaches_the_gyro_scales_only():
    record, _ = recording(seed=6)
    sure = calibrate(record, SETTINGS).estimate
    unsure = calibrate(record, replace(SETTINGS, time_base_u=1e-3)).estimate
    assert unsure["S_y"].u == pytest.approx(np.hypot(sure["S_y"].u, sure["S_y"].value * 1e-3), rel=1e-3)
    assert unsure["T_xy"].u == pytest.approx(sure["T_xy"].u, rel=1e-9)


def test_a_slow_clock_changes_the_gyro_scale_in_proportion():
    record, _ = recording(seed=7)
    t, acc, gyro = arrays(record)
    a = calibrate(record, SETTINGS).estimate
    b = calibrate(record_of(1.01 * t, acc, gyro), SETTINGS).estimate
    assert b["S_x"].value / a["S_x"].value == pytest.approx(1.01, rel=2e-4)
    assert b["K1_x"].value == pytest.approx(a["K1_x"].value, rel=1e-4)


def test_accelerometers_alone():
    record, truth = recording(seed=8)
    t, acc, _ = arrays(record)
    estimate = calibrate(record_of(t, acc), SETTINGS).estimate
    assert estimate.status is Status.OK
    assert estimate.names[-1] == "M_yz"
    assert [finding.code for finding in estimate.findings] == ["gyro_missing", "unmodelled_k2"]
    assert estimate.findings[1].harm == ()
    assert np.max(np.abs(compare(estimate, truth) / estimate.u)) < 5.0


def test_a_gyro_on_its_own_clock():
    """Gyro at twice the rate, stamps of its own: the same answer within the noise of the extra samples."""
    rng = np.random.default_rng(9)
    truth = draw_truth(rng)
    record, truth = simulate(truth, hand_poses(rng, 20), 9.81, 0.8, rng, rate=100.0)
    t, acc, gyro = arrays(record)
    mixed = record_of(t[::2], acc[::2], gyro, gyro_t=t)
    estimate = calibrate(mixed, SETTINGS).estimate
    assert estimate.status is Status.OK
    assert np.max(np.abs(compare(estimate, truth) / estimate.u)) < 5.0


def test_too_few_poses_say_how_many_were_found_and_what_to_do():
    record, _ = recording(seed=10, poses=6)
    estimate = calibrate(record, SETTINGS).estimate
    assert estimate.status is Status.TOO_FEW_INTERVALS
    assert estimate.message.startswith("found 6 static intervals")
    assert "threshold" in estimate.message
    assert not estimate.names


def test_ten_poses_of_a_real_recording_are_ill_conditioned_and_name_the_misalignment():
    record, settings = shipped("mpu6050")
    estimate = calibrate(record, settings).estimate
    assert estimate.status is Status.ILL_CONDITIONED
    assert "M_xy" in estimate.message
    assert "+x +y" in estimate.message
    found = estimate["M_xy"]
    # by its residual alone the luckiest threshold would claim a hundredth of what the noise allows
    candidates = list(sweep(prepare(record, settings.static_start), settings.site.gravity))
    alone = [p.accelerometer.fit.unit_covariance[6, 6] * p.accelerometer.fit.chi2 for p in candidates]
    assert np.sqrt(min(alone)) < 0.02 * found.u
    # an independent fit of the same data: 0.066 +- 0.025 rad
    assert abs(found.value - 0.066) < np.hypot(found.u, 0.025) * 2.0
    assert 0.01 < found.u < 0.1
    with pytest.raises(Exception, match="M_xy"):
        estimate.raise_for_status()


@pytest.mark.parametrize(
    ("change", "code", "words"),
    [
        (lambda g: g * [1, -1, 1], "sign_suspect", "gyro_y seems to measure -y"),
        (lambda g: g[:, [1, 0, 2]], "channel_swap", "gyro_x seems to measure +y, gyro_y seems to measure +x"),
    ],
)
def test_a_wrong_map_of_the_gyro_is_named(change, code, words):
    record, _ = recording(seed=11)
    t, acc, gyro = arrays(record)
    estimate = calibrate(record_of(t, acc, change(gyro)), SETTINGS).estimate
    assert estimate.status is Status.INCONSISTENT
    assert any(f.code == code and words in f.message for f in estimate.findings)
    assert "contradict" in estimate.message
    # no absurd numbers: what can be trusted is the accelerometers
    assert estimate.names[-1] == "M_yz"


def test_what_cannot_be_integrated_is_left_out_and_said():
    record, truth = recording(seed=12, poses=24)
    t, acc, gyro = arrays(record)
    middle = np.searchsorted(t, 31.5)  # in the first turn
    gyro[middle : middle + 4] = np.nan
    limit = gyro[middle + 300 : middle + 310, 0].max() + 1e6
    gyro[middle + 300 : middle + 310, 0] = limit  # flat at an extreme in the second turn
    estimate = calibrate(record_of(t, acc, gyro), SETTINGS).estimate
    said = [f for f in estimate.findings if f.code == "skipped_turn"]
    assert len(said) == 2
    assert {"samples are missing", "the gyro saturates"} == {f.message.split(": ")[1] for f in said}
    assert np.max(np.abs(compare(estimate, truth) / estimate.u)) < 5.0


def test_a_gap_in_a_hold_does_not_join_what_it_parts():
    record, _ = recording(seed=13)
    t, acc, gyro = arrays(record)
    t = t + np.where(np.arange(len(t)) >= 600, 5.0, 0.0)  # five seconds lost in the first hold
    found = calibrate(record_of(t, acc, gyro), SETTINGS)
    assert all(not (d.start < 600 < d.stop) for d in found.poses.dwells)


def heading_kept(rng, count):
    """Poses reached without turning about the vertical: every one at nearly the same heading."""
    q = hand_poses(rng, count)
    up = rotate(conjugate(q), np.array([0.0, 0.0, 1.0]))
    across = np.cross([0.0, 0.0, 1.0], up)
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    kept = conjugate(exp(across * np.arccos(np.clip(up[:, 2:], -1, 1))))
    kept[0] = [1.0, 0.0, 0.0, 0.0]
    return kept


@pytest.mark.slow
@pytest.mark.parametrize(
    ("white", "latitude_known"),
    [
        (2e-6, True),
        pytest.param(8.7e-5, False, marks=pytest.mark.campaign),
        pytest.param(2e-6, False, marks=pytest.mark.campaign),
        pytest.param(8.7e-5, True, marks=pytest.mark.campaign),
    ],
)
@pytest.mark.parametrize("runs", [12, pytest.param(24, marks=pytest.mark.campaign)])
def test_earth_rate_is_in_the_uncertainty_also_at_one_heading(white, latitude_known, runs):
    """Calibrations whose heading never changes: error/u of the biases must not exceed what u says.

    The sum of squares of error/u over n runs and 3 axes, correlated within a run, stays below 3 n + 5 sigma
    (sigma from n independent runs of three equal values: 3 sqrt(2 n)), which is 176 for 24. With the horizontal part
    left out of the fit it is some 1000 then for the fine gyro and 290 for the coarse one.
    """
    total = 0.0
    for seed in range(runs):
        rng = np.random.default_rng(900 + seed)
        truth = replace(draw_truth(rng), gyro_noise=TriadNoise(white))
        record, truth = simulate(truth, heading_kept(rng, 14), 9.81, 0.8, rng, rate=25.0, start=15.0)
        site = Site(9.81, (), 0.8 if latitude_known else None)
        estimate = calibrate(record, ImuSettings(site)).estimate
        scaled = dict(zip(estimate.names, compare(estimate, truth) / estimate.u, strict=True))
        total += sum(scaled[f"D_F_{axis}"] ** 2 for axis in "xyz")
        assert not any(finding.code == "g_sensitivity" for finding in estimate.findings)
    assert total < 3 * runs + 5 * 3 * np.sqrt(2 * runs)


def test_at_the_pole_earth_rate_is_known_altogether():
    rng = np.random.default_rng(24)
    record, truth = simulate(draw_truth(rng), hand_poses(rng, 16), 9.81, np.pi / 2, rng, rate=50.0)
    estimate = calibrate(record, ImuSettings(Site(9.81, (), np.pi / 2))).estimate
    assert estimate.status is Status.OK
    assert not any(item.source == "earth rate" for item in estimate.budget)
    assert np.max(np.abs(compare(estimate, truth) / estimate.u)) < 5.0


@pytest.mark.parametrize(
    ("unit", "factor", "words"),
    [
        (("count", "deg/s"), 80.0 * 57.29578, "gyro"),  # rad/s labelled deg/s
        (("count", "rad/s"), 80.0, "gyro"),  # deg/s labelled rad/s
    ],
)
def test_a_wrong_physical_unit_is_no_sound_calibration(unit, factor, words):
    record, _ = recording(seed=18)
    t, acc, gyro = arrays(record)
    estimate = calibrate(record_of(t, acc, gyro / factor, *unit), SETTINGS).estimate
    assert estimate.status is Status.INCONSISTENT
    assert words in estimate.message
    assert "check the unit" in estimate.message


def test_specific_force_in_g_labelled_as_metres_per_second_squared():
    record, _ = recording(seed=18)
    t, acc, gyro = arrays(record)
    estimate = calibrate(record_of(t, acc / 415.0 / 9.80665, gyro, "m/s^2"), SETTINGS).estimate
    assert estimate.status is Status.INCONSISTENT
    assert "acc are 0.1" in estimate.message


@pytest.mark.parametrize("share", [0.001, 0.01])
def test_missing_values_anywhere_are_missing_samples_and_no_movement(share):
    """Single cells lost at random, in the rest at the start too: as many poses and turns, hardly other values."""
    record, truth = recording(seed=33, poses=24)
    t, acc, gyro = arrays(record)
    whole = calibrate(record_of(t, acc, gyro), SETTINGS).estimate
    rng = np.random.default_rng(33)
    for values in (acc, gyro):
        values[rng.random(values.shape) < share] = np.nan
    acc[100, 0] = np.nan
    holed = calibrate(record_of(t, acc, gyro), SETTINGS).estimate
    assert holed.status is Status.OK
    assert holed.statistics["intervals"] == whole.statistics["intervals"]
    assert holed.statistics["turns"] >= whole.statistics["turns"] - 2
    assert np.all(np.abs(compare(holed, truth)) < 5.0 * holed.u)


def test_a_missing_accelerometer_sample_in_a_turn_does_no_harm_to_g_sensitivity():
    record, truth = recording(seed=19, poses=24, g_sensitivity=2e-4)
    t, acc, gyro = arrays(record)
    acc[np.searchsorted(t, 31.5), 1] = np.nan
    estimate = calibrate(record_of(t, acc, gyro), replace(SETTINGS, g_sensitivity=True)).estimate
    assert estimate.status is Status.OK
    assert np.max(np.abs(compare(estimate, truth) / estimate.u)) < 5.0


def test_lost_samples_jitter_and_coarse_stamps_do_not_stop_a_calibration():
    record, truth = recording(seed=20, poses=24, rate=100.0)
    t, acc, gyro = arrays(record)
    rng = np.random.default_rng(20)
    kept = rng.random(len(t)) > 0.01
    cases = {
        "lost": (t[kept], acc[kept], gyro[kept]),
        "jitter": (t + rng.uniform(-0.003, 0.003, len(t)), acc, gyro),
        "coarse": (np.floor(t * 60.0) / 60.0, acc, gyro),
    }
    for name, (tt, a, w) in cases.items():
        estimate = calibrate(record_of(tt, a, w), SETTINGS).estimate
        assert estimate.status is Status.OK, name
        assert estimate.statistics["intervals"] == 24, name
        assert np.max(np.abs(compare(estimate, truth) / estimate.u)) < 5.0, name


def test_a_coarse_gyro_says_so_and_its_bias_is_no_better_than_a_step():
    """Output in steps of 1/16.4 deg/s with less noise than half a step: u(D_F) is at least step/sqrt(12)."""
    rng = np.random.default_rng(21)
    truth = replace(draw_truth(rng), gyro_noise=TriadNoise(2e-5))
    record, truth = simulate(truth, hand_poses(rng, 20), 9.81, 0.8, rng, rate=50.0)
    t, acc, gyro = arrays(record)
    step = 4775.0 / 57.3 / 16.4
    estimate = calibrate(record_of(t, acc, step * np.round(gyro / step)), SETTINGS).estimate
    codes = [finding.code for finding in estimate.findings]
    assert "resolution" in codes
    assert "g_sensitivity" not in codes
    assert all(estimate[f"D_F_{axis}"].u > 0.99 * step / np.sqrt(12) for axis in "xyz")
    assert np.max(np.abs(compare(estimate, truth) / estimate.u)) < 5.0


@pytest.mark.parametrize("sensor", ["acc", "gyro"])
def test_a_dead_axis_is_named(sensor):
    record, _ = recording(seed=22)
    t, acc, gyro = arrays(record)
    (acc if sensor == "acc" else gyro)[:, 1] = 32768.0
    with pytest.raises(InputError, match=f"{sensor}_y never changes"):
        calibrate(record_of(t, acc, gyro), SETTINGS)


def test_a_gyro_that_could_not_be_calibrated_is_no_sound_calibration():
    record, _ = recording(seed=23)
    t, acc, gyro = arrays(record)
    for lost in range(5):  # a hole in every turn
        gyro[1600 + lost :: 40] = np.nan
    estimate = calibrate(record_of(t, acc, gyro), SETTINGS).estimate
    assert estimate.status is not Status.OK
    assert any(finding.code == "gyro_missing" for finding in estimate.findings)
    assert "S_x" not in estimate.names


def test_a_drifting_gyro_is_named():
    record, _ = recording(seed=14)
    t, acc, gyro = arrays(record)
    estimate = calibrate(record_of(t, acc, gyro + 0.5 * t[:, None]), SETTINGS).estimate
    assert any(f.code == "bias_drift" for f in estimate.findings)
    assert not any(f.code == "bias_drift" for f in calibrate(record, SETTINGS).estimate.findings)


def test_g_sensitivity_is_named_where_it_is_not_estimated():
    record, _ = recording(seed=15, g_sensitivity=1e-3)
    codes = [f.code for f in calibrate(record, SETTINGS).estimate.findings]
    assert "g_sensitivity" in codes


@for_each(
    ("spoil", "sentence"),
    [
        (lambda t, a, w: (t[:5], a[:5], w[:5]), "samples"),
        (lambda t, a, w: (t, a * np.nan, w), "expected"),
        (lambda t, a, w: (t, np.zeros_like(a) + 7, w), "never changes"),
        (lambda t, a, w: (t + np.arange(len(t)) // 30, a, w), "nowhere"),
        (lambda t, a, w: (t * 0.0, a, w), "time"),
        (lambda t, a, w: (t, a * 1e250, w), "values up to"),
        (lambda t, a, w: (t, a, w * 1e-250), "values up to"),
    ],
)
def test_a_recording_that_cannot_be_used_gets_a_sentence(spoil, sentence):
    record, _ = recording(seed=16)
    with pytest.raises(InputError, match=sentence):
        calibrate(record_of(*spoil(*arrays(record))), SETTINGS)


@pytest.mark.parametrize("start", [2.0, 60.0, 1e6])
def test_a_static_start_that_does_not_fit_gets_a_sentence(start):
    record, _ = recording(seed=17)
    with pytest.raises(InputError, match=r"imu\.static_start: found"):
        calibrate(record, replace(SETTINGS, static_start=start))
