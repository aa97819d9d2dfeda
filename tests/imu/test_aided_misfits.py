"""Bad records of a table: each case is told, and none is called ok and wrong by more than five u without a finding.

Errors of an angle that a mounting or a scale factor imitates wholly cannot be told, and are no cases here.
"""

import re
from dataclasses import replace

import numpy as np
import pytest
from campaigns.aided import LATITUDE, PROGRAM, draw_truth
from new_studies import table_read

from inercal.foundation.errors import StudyError
from inercal.foundation.findings import Status
from inercal.foundation.geometry.earth import EARTH_RATE, Site
from inercal.foundation.records.record import Record
from inercal.foundation.rigs.patterns import normal
from inercal.foundation.rigs.tables import turntable
from inercal.systems.imu.aided.calibration import calibrate_aided
from inercal.systems.imu.aided.simulate import rests_of, simulate
from inercal.systems.imu.settings import AidedRig, AidedSettings, ImuSettings

CHAIN = turntable("two_axis_turntable", None)
ACC, GYRO = ("acc_x", "acc_y", "acc_z"), ("gyro_x", "gyro_y", "gyro_z")
SEED, RATE = 20261122, 50.0


def recorded(chain=CHAIN, seed=SEED, truth=lambda drawn: drawn):
    """A record with noise, and the true coefficients."""
    rng = np.random.default_rng(seed)
    drawn = replace(draw_truth(rng), gravity=9.81, late=0.0)
    return simulate(truth(drawn), chain, PROGRAM, rng, rate=RATE)


@pytest.fixture(scope="module")
def sound():
    return recorded()


def changed(record, names, function):
    columns = {
        n: replace(c, values=function(c.values.copy())) if n in names else c
        for n, c in record.columns.items()
    }
    return Record(columns)


def calibrated(record, azimuth_u=None, **other):
    site = Site(9.81, (), LATITUDE)
    return calibrate_aided(record, ImuSettings(site, **other), AidedSettings(CHAIN, azimuth_u)).estimate


def largest(estimate, true):
    """Largest error, in standard uncertainties."""
    return max(abs(estimate[name].value - true[name]) / estimate[name].u for name in estimate.names)


def said(estimate, code):
    """What findings of the code say; a contradiction that u allows for is an error that the model leaves out."""
    codes = ("contradiction", "unmodelled") if code == "contradiction" else (code,)
    return " ".join(finding.message for finding in estimate.findings if finding.code in codes)


def at(seconds):
    return round(seconds * RATE)


def moving(t):
    return ~np.any([(t >= a) & (t <= b) for a, b in rests_of(PROGRAM)], axis=0)


# what is no misfit


def test_a_sound_record_has_no_misfit(sound):
    estimate = calibrated(sound[0])
    assert estimate.status is Status.OK
    assert not {finding.code for finding in estimate.findings} - {"bias_drift", "blind"}
    assert largest(estimate, sound[1]) < 4.0


@pytest.mark.parametrize("times", [4.0, 30.0])
def test_a_table_that_shakes_when_it_turns_is_no_misfit(sound, times):
    record, true = sound
    rng = np.random.default_rng(1)
    shaken = record
    for names, level in ((ACC, 2e-3), (GYRO, 3e-4)):
        size = times * level * np.sqrt(RATE) * moving(record["acc_x"].t)
        shaken = changed(shaken, names, lambda v, size=size: v + size * rng.standard_normal(len(v)))
    estimate = calibrated(shaken)
    assert estimate.status is Status.OK
    assert not said(estimate, "excess_scatter")
    assert largest(estimate, true) < 4.0


# sensors


def test_a_gyro_at_the_end_of_its_range_loses_blocks_and_says_so(sound):
    record, true = sound
    estimate = calibrated(changed(record, GYRO, lambda v: np.clip(v, -0.9, 0.9)))
    assert "gyro_y" in said(estimate, "saturation")
    assert estimate.status is not Status.OK or largest(estimate, true) < 5.0


def test_where_saturation_leaves_too_little_the_cure_is_not_more_turns(sound):
    estimate = calibrated(changed(sound[0], GYRO, lambda v: np.clip(v, -0.02, 0.02)))
    assert estimate.status in (Status.ILL_CONDITIONED, Status.UNOBSERVABLE, Status.INCONSISTENT)
    assert "saturated" in estimate.message or "saturates" in estimate.message


def test_a_gyro_at_the_end_of_its_range_with_noise_on_the_rail_is_inconsistent(sound):
    rng = np.random.default_rng(2)

    def limited(v):
        return np.clip(v, -0.9 + 1e-3 * rng.random(len(v)), 0.9 + 1e-3 * rng.random(len(v)))

    estimate = calibrated(changed(sound[0], GYRO, limited))
    assert estimate.status is Status.INCONSISTENT
    assert "range" in said(estimate, "by_reading")


def test_outputs_that_are_not_linear_are_told(sound):
    record, true = sound
    estimate = calibrated(changed(record, ["acc_y"], lambda v: v + 1e-4 * v**2))
    assert "curve with the square of specific force" in said(estimate, "unmodelled_k2")
    assert estimate.status is not Status.OK or largest(estimate, true) < 5.0


def test_a_gyro_that_feels_the_force_is_told_with_the_setting_that_helps():
    record, true = recorded(truth=lambda drawn: replace(drawn, g_sensitivity=np.full((3, 3), 1e-4)))
    plain = calibrated(record)
    assert "Set imu.g_sensitivity = true" in said(plain, "g_sensitivity")
    assert plain.status is not Status.OK or largest(plain, true) < 5.0
    with_it = calibrated(record, g_sensitivity=True)
    assert with_it.status is Status.OK
    assert not said(with_it, "g_sensitivity")


def test_a_slow_filter_is_told(sound):
    record, true = sound
    from scipy.signal import lfilter

    a = np.exp(-1.0 / RATE / 0.1)
    estimate = calibrated(changed(record, GYRO, lambda v: lfilter([1.0 - a], [1.0, -a], v - v[0]) + v[0]))
    assert "smoothed over some" in said(estimate, "contradiction")
    assert estimate.status is not Status.OK or largest(estimate, true) < 5.0


def test_a_knock_is_left_out_with_its_time(sound):
    record, true = sound

    def knocked(v):
        v[at(20.02) : at(20.12)] += 50.0
        return v

    estimate = calibrated(changed(record, ACC, knocked))
    assert "at t 20." in said(estimate, "outlier")
    assert estimate.status is Status.OK
    assert largest(estimate, true) < 4.0


# angles


@pytest.mark.parametrize(("factor", "word"), [(1.005, "less"), (0.999, "more")])
def test_an_angle_of_a_wrong_scale_is_inconsistent_and_named(sound, factor, word):
    estimate = calibrated(changed(sound[0], ["phi1"], lambda v: factor * v))
    assert estimate.status is Status.INCONSISTENT
    found = re.search(r"turns by ([\d.]+) % (more|less) than the angles phi1 say", estimate.message)
    assert float(found[1]) == pytest.approx(100.0 * abs(factor - 1.0), rel=0.05)
    assert found[2] == word


def test_a_wrong_zero_of_the_outer_axis_is_inconsistent_and_named(sound):
    estimate = calibrated(changed(sound[0], ["phi1"], lambda v: v + np.radians(0.2)))
    assert estimate.status is Status.INCONSISTENT
    assert "the angles phi1 are wrong by -0.2 deg throughout" in estimate.message


def test_an_encoder_off_its_centre_is_named(sound):
    record, true = sound
    estimate = calibrated(changed(record, ["phi1"], lambda v: v + 2e-3 * np.sin(v)))
    assert "The input phi1 errs once a turn" in said(estimate, "by_place")
    assert estimate.status is not Status.OK or largest(estimate, true) < 5.0


def test_clocks_that_run_apart_are_told_with_the_factor(sound):
    record, true = sound
    t = record["phi1"].t * (1.0 + 1e-3)
    columns = {n: replace(c, t=t) if n.startswith("phi") else c for n, c in record.columns.items()}
    estimate = calibrated(Record(columns))
    found = re.search(r"multiply the times of the angles by ([\d.]+)", said(estimate, "command_shift"))
    assert float(found[1]) == pytest.approx(1.0 / (1.0 + 1e-3), abs=1e-4)
    assert estimate.status is not Status.OK or largest(estimate, true) < 5.0


def test_glitches_of_an_encoder_are_left_out_with_their_times(sound):
    record, true = sound

    def glitched(v):
        v[[at(5.0), at(22.0), at(40.0), at(60.0)]] += np.radians(10.0)
        return v

    estimate = calibrated(changed(record, ["phi1"], glitched))
    assert "4 readings of phi1" in said(estimate, "outlier")
    assert "5.00, 22.00, 40.00, 60.00" in said(estimate, "outlier")
    assert estimate.status is Status.OK
    assert largest(estimate, true) < 4.0


@pytest.mark.parametrize("names", [("dphi_y1", "dphi_z2"), ("dbase_x", "deps_y")])
def test_errors_of_the_table_that_are_not_stated_are_told(names):
    size = 3e-3 if "dphi_y1" in names else 1e-3
    record, true = recorded(turntable("two_axis_turntable", None, dict.fromkeys(names, normal(size))))
    estimate = calibrated(record)
    assert said(estimate, "excess_scatter") + said(estimate, "contradiction")
    assert estimate.status is not Status.OK or largest(estimate, true) < 6.0


# azimuth


def turned(degrees, noise):
    """Earth rate for an azimuth that is off by that much, and a gyro of that noise."""
    angle, across = np.radians(degrees), EARTH_RATE * np.cos(LATITUDE)
    earth = np.array([across * np.cos(angle), -across * np.sin(angle), EARTH_RATE * np.sin(LATITUDE)])
    return lambda drawn: replace(drawn, earth=earth, white=(2e-3, noise), walk=(3e-4, 0.1 * noise))


def test_a_wrong_azimuth_is_told_where_the_gyro_is_fine_enough():
    fine, _ = recorded(truth=turned(40.0, 3e-6))
    assert "the azimuth of the table" in said(calibrated(fine, azimuth_u=0.0), "site_suspect")
    right, true = recorded(truth=turned(0.0, 3e-6))
    estimate = calibrated(right, azimuth_u=0.0)
    assert not said(estimate, "site_suspect")
    assert largest(estimate, true) < 4.0


def test_a_coarse_gyro_cannot_contradict_an_azimuth_nor_is_it_hurt():
    record, true = recorded(truth=turned(40.0, 3e-4))
    estimate = calibrated(record, azimuth_u=0.0)
    assert not said(estimate, "contradiction")
    assert not said(estimate, "site_suspect")
    assert largest(estimate, true) < 4.5


# study


def test_limits_of_the_axes_are_refused_for_they_would_change_nothing():
    rig = {"kind": "two_axis_turntable", "limits": {"phi1": ["-90 deg", "90 deg"]}}
    with pytest.raises(StudyError, match=r"found rig\.limits, expected none"):
        table_read(AidedRig, {"rig": rig})


def with_squares(sound, k2):
    """The record with K1 K2 l^2 added to its accelerometers, l by the true coefficients."""
    record, true = sound
    for axis in "xyz":
        bias, scale = true[f"K0_{axis}"], true[f"K1_{axis}"]
        record = changed(
            record,
            (f"acc_{axis}",),
            lambda y, bias=bias, scale=scale: y + scale * k2 * ((y - bias) / scale) ** 2,
        )
    return record


def test_squares_of_the_force_are_named_and_fitted(sound):
    """K2 of 3 mg/g^2: named where it is not fitted; fitted, it comes back within its u, and all others stay."""
    k2 = 3e-4
    record = with_squares(sound, k2)
    left = calibrated(record)
    assert said(left, "unmodelled_k2") or left.status is not Status.OK
    fitted = calibrated(record, k2=True)
    assert fitted.status is Status.OK
    assert not said(fitted, "unmodelled_k2")
    assert largest(fitted, sound[1] | {f"K2_{axis}": k2 for axis in "xyz"}) < 4.5
    assert fitted["K2_x"].unit == "1/(m/s^2)"
