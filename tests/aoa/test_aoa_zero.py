"""Wind-off zero and tare: biases go where the angle is known, and a model that moves is refused."""

import math
from dataclasses import replace

import numpy as np
import pytest
from sting_study import DEG, NOISE, G, study

from inercal.foundation.errors import RecordError
from inercal.systems.aoa.fusion.filter_result import estimate
from inercal.systems.aoa.fusion.problem import problem
from inercal.systems.aoa.motion import MotionPlan
from inercal.systems.aoa.reading.recording import plain
from inercal.systems.aoa.reading.wind_off_zero import at_rest, tare, with_zero
from inercal.systems.aoa.settings import Noise, Zero
from inercal.systems.aoa.simulate import simulate

REST = MotionPlan("buffet", duration=8.0, sample_rate=500.0, mean=20.0 * DEG, rms=0.0)
ZERO = Zero(1.0, 5.0, 20.0 * DEG, 0.003 * DEG)
POOR = Noise(1e-4 * G, 1e-3 * G, 0.2 * DEG, 5.0 * DEG / 3600.0)
"""Sensors of which it is known that their biases are of the order of 1e-3 g."""

BIASED = {"b_2": 1e-3 * G, "b_g": 1e-5}


def at_20_deg(seed=81, zero=ZERO, **changes):
    settings = study(motion=replace(REST, **changes), noise=POOR, zero=zero)
    return settings, simulate(settings, np.random.default_rng(seed), BIASED)


def last(recording, settings, posterior=None):
    """Angle and its uncertainty at the end, and what is known of the sensors."""
    found = estimate(recording, problem(settings, posterior=posterior))
    return found.theta[-1], found.u[-1], found.state


def test_a_bias_disappears_to_the_uncertainty_of_the_stated_angle():
    settings, simulated = at_20_deg()
    before, _, _ = last(simulated.recording, settings)
    assert abs(before - 20.0 * DEG) > 0.03 * DEG
    after, u, _ = last(with_zero(simulated.recording, settings), settings)
    assert abs(after - 20.0 * DEG) < 4.0 * u
    # the stated angle, and what white noise leaves in the filter at any moment
    assert 0.9 * ZERO.u < u < 3.0 * ZERO.u


def test_many_zeros_miss_by_their_uncertainty():
    # the stated angle is off by its uncertainty, drawn anew: the angle is off by as much, and says so
    squares = []
    for seed in range(40):
        rng = np.random.default_rng([82, seed])
        stated = replace(ZERO, angle=20.0 * DEG + ZERO.u * rng.standard_normal(), u=ZERO.u, end=3.0)
        settings, simulated = at_20_deg(seed, stated, duration=4.0, sample_rate=200.0)
        theta, u, _ = last(with_zero(simulated.recording, settings), settings)
        squares.append(((theta - 20.0 * DEG) / u) ** 2)
    # the filter expects a flexure of the sting that is not there: never too small, perhaps too large
    assert 0.1 < np.mean(squares) < 1.0 + 4.0 * math.sqrt(2.0 / 40.0)


def test_all_rows_together_know_the_angle_as_well_as_it_is_stated():
    settings, simulated = at_20_deg()
    recording = replace(simulated.recording, t=simulated.recording.t.copy())
    recording.t[1400:1600] = recording.t[1399]  # the clock stands still: rows that never reach the filter
    recording.acc[1700:1800, 1] = np.nan
    stated = with_zero(recording, settings).zero_angle
    rows = np.flatnonzero(np.isfinite(stated[:, 0]))
    assert set(stated[rows, 0]) == {ZERO.angle}
    assert not np.isin(np.arange(1401, 1600), rows).any()
    assert not np.isin(np.arange(1700, 1800), rows).any()
    assert (recording.t[rows] > ZERO.start).all()
    assert (recording.t[rows] <= ZERO.end).all()
    # information adds up to that of one measurement, less what is missing of the stretch
    lost = 100 / settings.motion.sample_rate / (ZERO.end - ZERO.start)
    assert np.sum(stated[rows, 1] ** -2.0) == pytest.approx((1.0 - lost) / ZERO.u**2, rel=0.01)
    assert np.isnan(simulated.recording.zero_angle).all()


def test_a_study_without_a_zero_leaves_the_recording_as_it_is():
    settings, simulated = at_20_deg(zero=None)
    assert with_zero(simulated.recording, settings) is simulated.recording
    assert tare(simulated.recording, settings) is simulated.recording


def test_tare_subtracts_the_biases_and_the_error_of_the_stated_angle_is_left():
    settings, simulated = at_20_deg()
    tared = tare(simulated.recording, settings)
    inside = (simulated.recording.t >= 1.0) & (simulated.recording.t <= 5.0)
    read = tared.acc[inside].mean(axis=0)
    assert read == pytest.approx(at_rest(settings, ZERO.angle), abs=1e-9)
    assert tared.gyro[inside].mean() == pytest.approx(0.0, abs=1e-12)
    theta = np.arctan2(tared.acc[:, 1], 0.5 * (tared.acc[:, 2] - tared.acc[:, 0]))
    rows = len(theta)
    assert abs(theta.mean() - 20.0 * DEG) < 5.0 * NOISE.accelerometer / G / math.sqrt(
        inside.sum() * rows / 4000
    )
    off = replace(settings, zero=replace(ZERO, angle=20.1 * DEG))
    tilted = tare(simulated.recording, off).acc
    theta = np.arctan2(tilted[:, 1], 0.5 * (tilted[:, 2] - tilted[:, 0]))
    assert theta.mean() == pytest.approx(20.1 * DEG, abs=1e-5)


def test_tare_keeps_what_is_missing_missing():
    settings, simulated = at_20_deg()
    recording = replace(simulated.recording, gyro=np.full_like(simulated.recording.gyro, np.nan))
    tared = tare(recording, settings)
    assert np.isnan(tared.gyro).all()
    assert np.isnan(tared.turns).all()


def test_a_wind_off_record_is_the_prior_of_the_next():
    settings, simulated = at_20_deg()
    known = problem(settings)
    _, _, state = last(with_zero(simulated.recording, settings), settings)
    places = known.nuisances
    values = {name: state.x[k] for name, k in places.items()}
    covariances = {(a, b): state.P[i, j] for a, i in places.items() for b, j in places.items()}
    following = simulate(settings, np.random.default_rng(83), BIASED)
    alone, _, _ = last(following.recording, settings)
    theta, u, _ = last(following.recording, settings, (values, covariances))
    assert abs(alone - 20.0 * DEG) > 0.03 * DEG
    assert abs(theta - 20.0 * DEG) < 4.0 * u
    assert u < 3.0 * ZERO.u


@pytest.mark.parametrize(
    ("zero", "says"),
    [
        (replace(ZERO, start=10.0, end=12.0), "found a record from 0 s to 7.998 s, expected the stretch"),
        (replace(ZERO, start=-5.0, end=-1.0), "expected the stretch"),
        (replace(ZERO, start=1.0, end=1.1), "found 51 rows with all accelerometers .* expected 80 or more"),
    ],
)
def test_a_stretch_that_is_not_there_is_refused(zero, says):
    settings, simulated = at_20_deg(zero=zero)
    for way in (with_zero, tare):
        with pytest.raises(RecordError, match=says):
            way(simulated.recording, settings)


def test_a_stretch_without_accelerometers_is_refused():
    settings, simulated = at_20_deg()
    simulated.recording.acc[:, 1] = np.nan
    with pytest.raises(RecordError, match="found 0 rows with all accelerometers"):
        with_zero(simulated.recording, settings)
    none = plain(np.zeros(0), np.zeros((0, 3)), np.zeros(0))
    with pytest.raises(RecordError, match="without rows"):
        with_zero(none, settings)


@pytest.mark.parametrize("gyro", [True, False])
@pytest.mark.parametrize(
    "motion",
    [
        MotionPlan("static", duration=8.0, sample_rate=500.0, first=19.9 * DEG, last=20.1 * DEG),
        MotionPlan(
            "sine", duration=8.0, sample_rate=500.0, mean=20.0 * DEG, amplitude=0.3 * DEG, frequency=0.1
        ),
    ],
)
def test_a_model_that_moves_is_refused(motion, gyro):
    settings = study(motion=motion, zero=ZERO)
    recording = simulate(settings, np.random.default_rng(84)).recording
    if not gyro:
        recording = replace(recording, gyro=np.full_like(recording.gyro, np.nan))
    with pytest.raises(RecordError, match=r"the angle changes by .* deg in the stretch"):
        with_zero(recording, settings)


def test_an_oscillation_about_the_angle_is_no_rest():
    motion = replace(REST, rms=0.1 * DEG, low=2.0, high=4.0)
    settings = study(motion=motion, zero=ZERO)
    with pytest.raises(RecordError, match="expected a model at rest"):
        with_zero(simulate(settings, np.random.default_rng(85)).recording, settings)


def test_a_slight_buffet_is_averaged():
    """0.03 deg rms about the known angle: over 30 draws the angle is off by its u or less, and it is told."""
    squares, expected = [], None
    for seed in range(30):
        settings, simulated = at_20_deg(
            seed, replace(ZERO, end=4.0), duration=5.0, sample_rate=250.0, rms=0.03 * DEG, low=5.0, high=15.0
        )
        zeroed = with_zero(simulated.recording, settings)
        (told,) = (each for each in zeroed.findings if each.code == "not_at_rest")
        assert "averaged" in told.message
        theta, u, _ = last(zeroed, settings)
        squares.append(((theta - simulated.theta[-1]) / u) ** 2)
        expected = u
    assert expected < 0.02 * DEG  # without the zero 0.05 deg and more
    assert 0.1 < np.mean(squares) < 1.0 + 4.0 * math.sqrt(2.0 / 30.0)


def test_a_model_at_rest_is_hardly_ever_refused():
    # the limits lie at six standard deviations of a part's mean and three of the gyro's walk
    for seed in range(40):
        settings, simulated = at_20_deg(seed, duration=6.0, sample_rate=200.0)
        with_zero(simulated.recording, settings)
