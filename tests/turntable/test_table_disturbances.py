"""Disturbances of simulated tests, each against what it is by hand."""

from dataclasses import replace

import numpy as np
import pytest
from new_studies import load_turntable_study
from turntable_studies import DEG_H, LATITUDE, WHEEL, references, study, wheel_output

from inercal.foundation.errors import StudyError
from inercal.foundation.geometry.earth import EARTH_RATE
from inercal.foundation.rigs.plans import grid
from inercal.systems.turntable.settings import Disturbances, RateTest, TableHarmonic
from inercal.systems.turntable.simulate import simulate_positions
from inercal.systems.turntable.task import simulate as simulate_test

PLAN = grid((6, 6))


def outputs(settings, seed=1, **disturbances):
    """Outputs (n, 2) [rad/s] of the gyrowheel, and their times from the first [s]."""
    record = simulate_positions(
        replace(settings, disturbances=Disturbances(**disturbances)), np.random.default_rng(seed)
    )
    y = np.stack([record[f"y_{axis}"].si() for axis in "xy"], axis=-1)
    return y, record["y_x"].t - record["y_x"].t[0]


CLEAN, T = outputs(study(plan=PLAN))
BIAS = np.array([WHEEL["DX_F"], WHEEL["DY_F"]])
PART = (T / T[-1])[:, None]


def test_what_acts_on_outputs_over_time():
    deg_h = DEG_H
    ramp, _ = outputs(study(plan=PLAN), ramp=0.2 * deg_h)
    np.testing.assert_allclose(ramp - CLEAN, 0.2 * deg_h * PART * np.ones(2), atol=1e-18)
    warm, _ = outputs(study(plan=PLAN), warm_up=3.0 * deg_h, warm_up_time=300.0)
    np.testing.assert_allclose((warm - CLEAN)[:, 0], 3.0 * deg_h * np.exp(-T / 300.0), atol=1e-18)
    scale, _ = outputs(study(plan=PLAN), scale_drift=20e-6)
    np.testing.assert_allclose(scale - CLEAN, 20e-6 * PART * (CLEAN - BIAS), atol=1e-18)


def test_a_random_walk_ends_at_its_standard_deviation():
    """300 walks of both outputs; limits 4 sigma of a standard deviation."""
    ends, middle = [], []
    for seed in range(300):
        y, _ = outputs(study(plan=PLAN), seed, random_walk=1.0)
        ends.append(y[-1] - CLEAN[-1])
        middle.append(y[18] - CLEAN[18])
    for walks, part in ((ends, 1.0), (middle, float(PART[18, 0]))):
        assert abs(np.std(walks) / np.sqrt(part) - 1.0) < 4.0 / np.sqrt(2 * 600)


def test_a_dead_zone_and_hysteresis():
    dead, _ = outputs(study(plan=PLAN), dead_zone=20.0 * DEG_H)
    inside = np.abs(CLEAN - BIAS) < 20.0 * DEG_H
    assert inside.any()
    np.testing.assert_array_equal(dead[inside], np.broadcast_to(BIAS, CLEAN.shape)[inside])
    np.testing.assert_array_equal(dead[~inside], CLEAN[~inside])
    late, _ = outputs(study(plan=PLAN), hysteresis=2.0 * DEG_H)
    rises = np.diff(CLEAN, axis=0)
    np.testing.assert_allclose(
        (late - CLEAN)[1:][np.abs(rises) > 1e-12], (np.sign(rises) * DEG_H)[np.abs(rises) > 1e-12]
    )


def test_a_base_that_is_turned_and_tilted():
    """By hand: where the heading is off by h, the Earth turns about (cos h, -sin h) of the table's north and west."""
    h, tilt = np.radians(3.0), np.radians(0.2)
    turned, _ = outputs(study(plan=PLAN), heading=h)
    p, q = PLAN.angles.T
    rows = np.array(
        [
            [np.cos(p) * np.cos(q), -np.cos(p) * np.sin(q), np.sin(p)],
            [np.sin(q), np.cos(q), np.zeros(len(p))],
            [-np.sin(p) * np.cos(q), np.sin(p) * np.sin(q), np.cos(p)],
        ]
    )
    north, up = EARTH_RATE * np.cos(LATITUDE), EARTH_RATE * np.sin(LATITUDE)
    w = north * (np.cos(h) * rows[0] - np.sin(h) * rows[1]) + up * rows[2]
    for k, axis in enumerate("xy"):
        np.testing.assert_allclose(
            turned[:, k], wheel_output(axis, WHEEL, -rows[2], w), rtol=1e-9, atol=1e-15
        )
    tilted, _ = outputs(study(plan=PLAN), tilt_north=tilt)
    a = -(np.cos(tilt) * rows[2] + np.sin(tilt) * rows[1])
    w = north * rows[0] + up * (np.cos(tilt) * rows[2] + np.sin(tilt) * rows[1])
    np.testing.assert_allclose(tilted[:, 0], wheel_output("x", WHEEL, a, w), rtol=1e-9, atol=1e-15)


def test_encoders_that_err():
    amplitude, phase = np.radians(0.1), 0.4
    wavy, _ = outputs(study(plan=PLAN), harmonics=(TableHarmonic("phi2", 2, amplitude, phase),))
    angles = PLAN.angles.copy()
    angles[:, 1] += amplitude * np.sin(2 * angles[:, 1] + phase)
    a, w = references(angles, {})
    np.testing.assert_allclose(wavy[:, 0], wheel_output("x", WHEEL, a, w), rtol=1e-9, atol=1e-15)
    twice = study(plan=replace(PLAN, angles=np.vstack([PLAN.angles, PLAN.angles])))
    again, _ = outputs(twice, angle=np.radians(0.1))
    np.testing.assert_array_equal(again[:36], again[36:])  # comes back at each commanded angle
    assert np.abs(again[:36] - CLEAN).max() > 0.01 * DEG_H


def test_a_field_of_the_ground():
    drawn, _ = outputs(study(plan=PLAN), magnetic=0.5 * DEG_H, dip=np.radians(60.0))
    p, q = PLAN.angles.T
    along = 0.5 * (np.cos(p) * np.cos(q)) - np.sin(np.radians(60.0)) * (-np.sin(p) * np.cos(q))
    np.testing.assert_allclose((drawn - CLEAN)[:, 0], 0.5 * DEG_H * along, atol=1e-17)


def test_a_rate_test_takes_what_goes_with_time_and_refuses_the_rest():
    of = study(kind="gyro", unit="deg/s", coefficients={"S_z": 1.0, "D_F_z": 0.0}, dwell=36.0)
    of = replace(of, rate_test=RateTest(rates=(-1.0, -0.5, 0.5, 1.0)))
    one, other = (
        simulate_test(replace(of, disturbances=each), np.random.default_rng(1))["gyro_z"].si()
        for each in (Disturbances(), Disturbances(ramp=1e-3))
    )
    np.testing.assert_allclose(other - one, 1e-3 * np.arange(4) / 3.0, atol=1e-16)
    with pytest.raises(StudyError, match=r"disturbances.angle: found in a study of a rate test"):
        simulate_test(replace(of, disturbances=Disturbances(angle=1e-5)), np.random.default_rng(1))


TEXT = """
[site]
latitude = "39.1 deg"
[rig]
kind = "two_axis_turntable"
[instrument]
kind = "accelerometer"
unit = "V"
[disturbances]
"""


def test_sizes_are_in_the_unit_of_the_outputs(tmp_path):
    path = tmp_path / "s.toml"
    path.write_text(TEXT + 'ramp = "2 mV"\nheading = "1 deg"\n')
    other = load_turntable_study(path).disturbances
    assert other.ramp == pytest.approx(2e-3)
    assert other.heading == pytest.approx(np.radians(1.0))
    for line, words in (
        ('ramp = "0.2 deg/h"', "disturbances.ramp: found"),
        ('dead_zone = "-1 mV"', "disturbances.dead_zone: found '-1 mV', expected a value of 0 or more"),
        ('harmonics = [{ joint = "phi3", order = 1, amplitude = "1 arcsec" }]', "expected phi1 or phi2"),
        ('ramps = "2 mV"', "ramp"),
    ):
        path.write_text(TEXT + line)
        with pytest.raises(StudyError, match=words):
            load_turntable_study(path)
