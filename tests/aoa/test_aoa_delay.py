"""The gyro's delay against the accelerometers: found from their cross-spectrum, and taken out."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2
from sting_study import BASE, DEG, scenario, study

from inercal.systems.aoa.disturbances import Disturbances
from inercal.systems.aoa.layout import Layout
from inercal.systems.aoa.motion import MotionPlan
from inercal.systems.aoa.paper.delay import aligned, relative_delay
from inercal.systems.aoa.reading.recording import plain
from inercal.systems.aoa.simulate import simulate

LATE = Disturbances(gyro_delay=2e-3)


def recorded(settings, seed=1):
    return simulate(settings, np.random.default_rng(seed)).recording


@pytest.mark.slow
@pytest.mark.parametrize("name", ["base", "chirp", "buffet"])
def test_the_delay_is_found_within_its_uncertainty(name):
    """40 draws of 20 s: the mean square of error/u is 1 within 3 standard deviations, sqrt(2/40) each."""
    errors, us = [], []
    for seed in range(40):
        settings = replace(scenario(name, duration=20.0, sample_rate=200.0), disturbances=LATE)
        found = relative_delay(recorded(settings, seed), settings.layout)
        errors.append((found.value - 2e-3) / found.u)
        us.append(found.u)
    assert np.mean(np.square(errors)) == pytest.approx(1.0, abs=3.0 * math.sqrt(2.0 / 40.0))
    assert max(us) < 5e-5


def of_a_sine(frequency, duration, seed):
    """The delay found in a sine of 10 deg, or 2 deg/s of rate amplitude each hertz."""
    amplitude = min(10.0, 2.0 / frequency) * DEG
    motion = MotionPlan(
        "sine", duration=duration, sample_rate=100.0, mean=5.0 * DEG, amplitude=amplitude, frequency=frequency
    )
    settings = study(motion=motion, disturbances=LATE)
    return relative_delay(recorded(settings, seed), settings.layout)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("frequency", "duration"), [(0.05, 300.0), (0.2, 60.0), (1.0, 30.0), (5.0, 20.0), (20.0, 20.0)]
)
def test_u_of_the_delay_is_honest_from_slow_to_fast(frequency, duration):
    """The mean square of error/u over 12 draws is within 99.9 % of chance. Segments shorter than the period made it 12
    of slow sines, a cubic between samples 25 of fast ones."""
    found = [of_a_sine(frequency, duration, seed) for seed in range(12)]
    square = np.mean([((one.value - 2e-3) / one.u) ** 2 for one in found])
    low, high = chi2.ppf([0.0005, 0.9995], len(found)) / len(found)
    assert low < square < high


def test_a_line_of_which_too_few_periods_were_recorded_tells_no_delay():
    assert of_a_sine(0.05, 60.0, 1) is None


@pytest.mark.parametrize("delay", [-30e-3, -1.3e-3, 0.0, 7.77e-3, 60e-3])
def test_delays_of_either_sign_and_of_many_samples_are_found(delay):
    settings = replace(scenario("buffet", duration=20.0), disturbances=Disturbances(gyro_delay=delay))
    found = relative_delay(recorded(settings), settings.layout)
    assert found.value == pytest.approx(delay, abs=5.0 * found.u)
    assert found.u < 1e-5
    assert 1.0 <= found.low < found.high < 20.0
    assert found.coherence > 0.999


def test_the_uncertainty_grows_as_the_motion_shrinks():
    """A tenth of the motion is known ten times worse."""
    us = []
    for amplitude in (10.0, 1.0):
        settings = study(motion=replace(BASE, amplitude=amplitude * DEG, duration=20.0), disturbances=LATE)
        found = relative_delay(recorded(settings), settings.layout)
        assert abs(found.value - 2e-3) < 5.0 * found.u
        us.append(found.u)
    assert us[1] / us[0] == pytest.approx(10.0, rel=0.5)


def test_any_axes_that_show_angular_acceleration_will_do():
    """Five axes, none parallel to another, at heights: the centrifugal term is taken off too."""
    angle = np.array([80.0, 10.0, -60.0, -120.0, 35.0]) * DEG
    of = Layout(
        tuple(f"a{k}" for k in range(1, 6)), angle, np.array([-0.3, 0.1, 0.3, 0.2, -0.2]), np.full(5, 0.05)
    )
    settings = study(8, layout=of, motion=replace(BASE, duration=30.0), disturbances=LATE)
    found = relative_delay(recorded(settings), of)
    assert found.value == pytest.approx(2e-3, abs=5.0 * found.u)


@pytest.mark.parametrize("seed", range(6))
def test_where_nothing_moves_there_is_no_delay(seed):
    settings = study(motion=replace(BASE, amplitude=0.0, duration=30.0))
    assert relative_delay(recorded(settings, seed), settings.layout) is None


def test_without_arm_gyro_or_rows_there_is_no_delay():
    settings = study(motion=replace(BASE, duration=20.0))
    made = recorded(settings)
    assert relative_delay(replace(made, acc=made.acc[:, :2]), settings.layout.of(0, 1)) is None
    assert relative_delay(replace(made, gyro=np.full_like(made.gyro, np.nan)), settings.layout) is None
    for rows in range(3):
        short = plain(made.t[:rows], made.acc[:rows], made.gyro[:rows])
        assert relative_delay(short, settings.layout) is None


def test_a_gyro_of_the_wrong_sign_has_no_delay():
    """Half a turn of phase at every frequency is not a delay."""
    for name in ("base", "buffet"):
        settings = scenario(name, duration=20.0)
        made = recorded(settings)
        assert relative_delay(replace(made, gyro=-made.gyro), settings.layout) is None


def test_lost_rows_are_bridged_and_lost_seconds_left_out():
    settings = study(motion=replace(BASE, duration=60.0), disturbances=LATE)
    made = recorded(settings)
    rng = np.random.default_rng(3)
    kept = (rng.random(len(made.t)) < 0.98) & ~((made.t > 20.0) & (made.t < 21.0))
    acc = np.where(rng.random(made.acc.shape) < 0.01, np.nan, made.acc)
    found = relative_delay(plain(made.t[kept], acc[kept], made.gyro[kept]), settings.layout)
    assert found.value == pytest.approx(2e-3, abs=5.0 * found.u)
    assert found.u < 1e-5


def test_of_a_gyro_that_saturates_all_along_no_delay_is_claimed():
    """What straight lines across its peaks say is off by parts of a millisecond."""
    settings = study(motion=replace(BASE, duration=20.0), disturbances=LATE)
    made = recorded(settings)
    gyro = np.where(np.abs(made.gyro) < 40.0 * DEG, made.gyro, np.nan)
    assert relative_delay(replace(made, gyro=gyro), settings.layout) is None


def rows(t, gyro):
    return plain(t, np.zeros((len(t), 3)), gyro)


def test_alignment_is_exact_for_a_cubic_on_uneven_stamps():
    t = np.cumsum(np.random.default_rng(4).uniform(0.8e-3, 1.2e-3, 200))
    cubic = np.poly1d([4e4, -300.0, 5.0, 1.0])
    back = aligned(rows(t, cubic(t - 1.7e-3)), 1.7e-3).gyro
    known = np.isfinite(back)
    np.testing.assert_allclose(back[known], cubic(t[known]), rtol=1e-4, atol=2e-4)
    np.testing.assert_allclose(back[5:-5], cubic(t[5:-5]), rtol=1e-10)
    assert np.isnan(back[-1])


def test_alignment_keeps_what_is_recorded_of_a_motion():
    """15 Hz at 1 kHz, the fastest of a buffet: a cubic errs by 1e-6 of it."""
    t = np.arange(0.0, 2.0, 1e-3)
    wave = np.sin(2.0 * math.pi * 15.0 * (t - 2.5e-3))
    back = aligned(rows(t, wave), 2.5e-3).gyro
    np.testing.assert_allclose(back[5:-5], np.sin(2.0 * math.pi * 15.0 * t)[5:-5], atol=3e-6)


def test_a_whole_number_of_samples_is_a_shift():
    t = np.arange(50) * 1e-3
    values = np.random.default_rng(5).standard_normal(50)
    back = aligned(rows(t, values), 3e-3).gyro
    np.testing.assert_allclose(back[:-3], values[3:], atol=1e-9)
    assert np.isnan(back[-2:]).all()
    np.testing.assert_array_equal(aligned(rows(t, values), 0.0).gyro, values)


def test_missing_samples_stay_missing_and_gaps_are_not_bridged():
    t = np.arange(60) * 1e-3
    t[30:] += 0.5
    values = 2.0 * t
    values[10] = np.nan
    made = replace(rows(t, values), turns=np.column_stack([values, -values]))
    back = aligned(made, 0.4e-3)
    missing = np.flatnonzero(np.isnan(back.gyro)).tolist()
    assert missing == [9, 10, 29, 59]
    known = np.isfinite(back.gyro)
    np.testing.assert_allclose(back.gyro[known], 2.0 * (t[known] + 0.4e-3), rtol=1e-9)
    np.testing.assert_array_equal(back.turns, np.column_stack([back.gyro, -back.gyro]))
    np.testing.assert_array_equal(back.acc, made.acc)


def test_rows_that_do_not_go_on_in_time_are_left_out():
    t = np.arange(40) * 1e-3
    t[20] = t[18]
    back = aligned(rows(t, 3.0 * t), 0.5e-3).gyro
    assert np.isnan(back[20])
    np.testing.assert_allclose(back[[5, 19, 30]], 3.0 * (t[[5, 19, 30]] + 0.5e-3), rtol=1e-9)


def test_a_gyro_that_never_reads_stays_so():
    t = np.arange(10) * 1e-3
    assert np.isnan(aligned(rows(t, np.full(10, np.nan)), 1e-3).gyro).all()
