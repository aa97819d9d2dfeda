"""Smaller errors: named by the constant that makes the recording fit, with its value."""

import math
import re
from dataclasses import replace

import independent.aoa as independent
import numpy as np
import pytest
from sting_study import BASE, DEG, G, scenario, study

from inercal.foundation.findings import EVERYTHING
from inercal.foundation.units import Quantity, parse_unit
from inercal.systems.aoa.diagnosis.examination import diagnose
from inercal.systems.aoa.diagnosis.fit_quality import fit_quality
from inercal.systems.aoa.diagnosis.noise_check import scatter
from inercal.systems.aoa.disturbances import Disturbances, Oscillation
from inercal.systems.aoa.motion import MotionPlan
from inercal.systems.aoa.reading.recording import plain
from inercal.systems.aoa.settings import Estimator
from inercal.systems.aoa.simulate import simulate

SWEEP = study(motion=MotionPlan("static", duration=3.0, first=-10.0 * DEG, last=60.0 * DEG))
SHORT = study(motion=replace(BASE, duration=4.0))


def recorded(settings, seed=0):
    return simulate(settings, np.random.default_rng([43, seed])).recording


def said(recording, settings):
    """Code and message of the one finding; there is none where plausibility has any."""
    (finding,) = diagnose(recording, settings)
    assert finding.harm == EVERYTHING
    return finding.code, finding.message


def stated(settings, **changes):
    return replace(settings, layout=replace(settings.layout, **changes))


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [0.5, pytest.param(-5.0, marks=pytest.mark.campaign)])
def test_an_axis_that_is_turned(degrees):
    # the sensor truly looks along 0 deg, the study says otherwise
    turned = stated(SWEEP, angle=SWEEP.layout.angle + np.array([0.0, degrees * DEG, 0.0]))
    code, message = said(recorded(SWEEP), turned)
    assert code == "unmodelled"
    number = float(re.match(r"the axis of a2 looks turned by (\S+) deg", message)[1])
    # biases of 1e-4 g make 0.006 deg each
    assert number == pytest.approx(-degrees, abs=0.03)


@pytest.mark.slow
def test_an_axis_that_is_turned_in_one_oscillation():
    """Heights and the gyro's scale take its effect, none of them by what is unlikely alone; together they are."""
    swung = study(motion=replace(BASE, mean=15.0 * DEG, duration=12.0, sample_rate=500.0))
    turned = stated(swung, angle=swung.layout.angle + np.array([0.0, 0.3 * DEG, 0.0]))
    recording = recorded(swung)
    assert np.abs(list(fit_quality(recording, turned).off.values())).max() < 4.5
    code, message = said(recording, turned)
    assert code == "unmodelled"
    number = float(re.match(r"the axis of a2 looks turned by (\S+) deg", message)[1])
    assert number == pytest.approx(-0.3, abs=0.03)


@pytest.mark.parametrize("kind", ["sine", "polar", "rest"])
def test_coefficients_together_are_as_far_from_their_priors_as_chance_has_them(kind):
    """Of twenty runs by an independent simulator, with all constants drawn, none is beyond the limit of one in 10^4;
    their mean, of three to eight squares, is a tenth to a quarter of it where the test is not blind."""
    runs = [independent.simulate(independent.Tunnel(kind, duration=12.0), seed) for seed in range(2001, 2021)]
    found = [fit_quality(plain(run.t, run.acc, run.gyro), study(8)) for run in runs]
    assert all(each.fits for each in found)
    assert np.mean([each.unlikely for each in found]) > 0.05


def test_gravity_of_another_site():
    elsewhere = replace(SWEEP, site=replace(SWEEP.site, gravity=9.78))
    code, message = said(recorded(SWEEP), elsewhere)
    assert code == "site_suspect"
    # biases of 1e-4 g are 1e-3 m/s^2
    assert float(re.match(r"gravity looks to be (\S+) m/s\^2", message)[1]) == pytest.approx(G, abs=4e-3)


@pytest.mark.slow
def test_a_scale_and_a_bias():
    recording = recorded(SWEEP)
    code, message = said(replace(recording, acc=recording.acc * [1.0, 1.01, 1.0]), SWEEP)
    assert code == "unmodelled"
    assert float(re.match(r"a2 looks to read (\S+) times", message)[1]) == pytest.approx(1.01, abs=1e-3)
    code, message = said(replace(recording, acc=recording.acc + np.array([0.0, 5e-3 * G, 0.0])), SWEEP)
    assert code == "prior_suspect"
    assert float(re.match(r"the bias of a2 looks to be (\S+) mg", message)[1]) == pytest.approx(5.0, abs=0.4)


def test_a_bias_of_the_gyro_beyond_its_prior():
    swung = study(motion=replace(BASE, mean=15.0 * DEG, duration=12.0, sample_rate=500.0))
    recording = recorded(swung)
    code, message = said(replace(recording, gyro=recording.gyro + 0.1 * DEG), swung)
    assert code == "prior_suspect"
    # its own bias is of 5 deg/h
    number = float(re.match(r"the bias of the gyro looks to be (\S+) deg/h", message)[1])
    assert number == pytest.approx(360.0, abs=20.0)


def test_one_angle_cannot_tell_and_says_so():
    rest = study(motion=MotionPlan("static", duration=3.0, first=10.0 * DEG, last=10.0 * DEG))
    recording = recorded(rest)
    (found,) = diagnose(replace(recording, acc=recording.acc + np.array([0.0, 10e-3 * G, 0.0])), rest)
    assert "equally possible" in found.headline
    causes = [found.headline, *(item["equally possible"] for item in found.items)]
    assert any("the bias of a2 looks" in cause for cause in causes)


@pytest.mark.slow
def test_yaw_that_no_gyro_tells():
    amplitude, frequency = 1.0 * DEG, 8.0
    moving = replace(SHORT, disturbances=Disturbances(yaw=Oscillation(amplitude, frequency)))
    recording = recorded(moving)
    blind = replace(recording, turns=np.full_like(recording.turns, np.nan))
    code, message = said(blind, moving)
    assert code == "unmodelled"
    rate = amplitude * 2.0 * math.pi * frequency / math.sqrt(2.0) / DEG
    assert float(re.search(r"yaw to and fro by (\S+) deg/s rms", message)[1]) == pytest.approx(rate, rel=0.1)
    assert "record gyro_roll and gyro_yaw" in message


@pytest.mark.parametrize("name", ["flexure", "pivot", "heights"])
def test_too_few_states(name):
    small = scenario(name, states=8, duration=7.0)
    recording = recorded(small)
    code, message = said(recording, small)
    assert code == "unmodelled"
    assert "which 8 states leave out" in message
    assert "write states = 19" in message
    assert diagnose(recording, scenario(name, states=19, duration=7.0)) == []


@pytest.mark.parametrize(("key", "size"), [("accelerometer", 1e-4 * G), ("gyro", 0.2 * DEG)])
def test_noise_that_is_misstated(key, size):
    recording = recorded(SHORT)
    for factor, code in ((0.2, "excess_scatter"), (5.0, "low_scatter")):
        wrong = replace(SHORT, noise=replace(SHORT.noise, **{key: factor * size}))
        findings = diagnose(recording, wrong)
        assert [finding.code for finding in findings] == [code]
        assert f"write {key} = " in findings[0].message
        # 4000 samples, sixth differences: 4 % of a standard deviation
        ratio = float(re.search(r"noise is (\S+) times", findings[0].message)[1])
        assert ratio == pytest.approx(1.0 / factor, rel=0.1)


def test_noise_is_not_told_from_uneven_rows():
    # 30 % of jitter makes differences of motion that look like noise
    rng = np.random.default_rng(4)
    t = np.arange(6000) / 1000.0 + rng.uniform(-4e-4, 4e-4, 6000)
    assert scatter(t, 1e3 * np.sin(2.0 * np.pi * t)) is None


@pytest.mark.slow
def test_a_roll_that_is_not_stated():
    # a plane model sees the part of gravity and of lever arms across it times the cosine of the roll
    roll = 25.0 * DEG
    rolled = replace(SHORT, attitude=replace(SHORT.attitude, roll=Quantity(roll, 0.0, parse_unit("rad"), "")))
    code, message = said(recorded(rolled), SHORT)
    assert code == "unmodelled"
    assert float(re.match(r"the model looks rolled by (\S+) deg", message)[1]) == pytest.approx(25.0, abs=0.5)


def test_noise_is_told_from_motion():
    # sines up to 15 Hz of a thousand times the noise, at 1 kHz and at 100 Hz
    rng = np.random.default_rng(3)
    for rate in (1000.0, 100.0):
        t = np.arange(6000) / rate
        motion = sum(np.sin(2.0 * np.pi * f * t + p) for f, p in rng.uniform(1.0, 15.0, (10, 2)))
        found = scatter(t, 1e3 * motion + rng.standard_normal(len(t)))
        assert found is not None
        assert not found.certain or found.size == pytest.approx(1.0, rel=0.1)
    assert scatter(t, rng.standard_normal(6000)).size == pytest.approx(1.0, rel=0.1)


def test_a_model_livelier_than_its_snap():
    fast = study(
        motion=MotionPlan("buffet", mean=10.0 * DEG, rms=0.2 * DEG, low=2.0, high=15.0, sample_rate=100.0),
        estimator=Estimator(snap=1e7),
    )
    code, message = said(recorded(fast), fast)
    assert code == "unmodelled"
    assert "write snap = " in message
