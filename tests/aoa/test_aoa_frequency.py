"""The frequency of an oscillation, from the past alone."""

import math

import numpy as np
import pytest
from sting_study import DEG, NOISE, layout

from inercal.systems.aoa.paper.lever import oscillation_frequency
from inercal.systems.aoa.paper.limits import LIMITS

THREE = layout()


def recorded(frequency, amplitude=0.5, duration=25.0, fs=1000.0, seed=1, noise=1.0, reads=1.0):
    """Times, accelerometers that read only the tangential term, and the gyro, of an oscillation [deg, Hz]."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, duration, 1.0 / fs)
    om = 2.0 * math.pi * frequency
    al = -amplitude * DEG * om**2 * np.sin(om * t)
    acc = al[:, None] * np.array([0.25, 0.0, 0.25]) + 9.0 * np.array([-1.0, 0.4, 1.0])
    acc += noise * NOISE.accelerometer * rng.standard_normal(acc.shape)
    gyro = reads * amplitude * DEG * om * np.cos(om * t) + noise * NOISE.gyro * rng.standard_normal(len(t))
    return t, acc, gyro


@pytest.mark.parametrize("frequency", [0.43, 0.78, 1.0, 2.718, 9.3, 37.0])
def test_an_oscillation_is_found_to_a_thousandth_of_its_frequency(frequency):
    """The bins of the window are 0.1 Hz apart."""
    t, acc, gyro = recorded(frequency)
    found = oscillation_frequency(t, acc, gyro, THREE)
    np.testing.assert_allclose(found[t > LIMITS.oscillation_window], frequency, rtol=1e-3)


def test_a_micro_oscillation_of_a_hundredth_of_a_degree_is_found():
    """0.01 deg at 0.78 Hz, of the paper's table: 0.004 rad/s^2 in noise of 0.0028 a sample."""
    t, acc, gyro = recorded(0.78, amplitude=0.01)
    np.testing.assert_allclose(
        oscillation_frequency(t, acc, gyro, THREE)[t > LIMITS.oscillation_window], 0.78, atol=5e-3
    )


def test_without_noise_it_is_exact_to_what_the_other_side_of_the_spectrum_leaks():
    t, acc, gyro = recorded(2.5, noise=0.0)
    np.testing.assert_allclose(
        oscillation_frequency(t, acc, gyro, THREE)[t > LIMITS.oscillation_window], 2.5, rtol=1e-4
    )


def test_rows_to_come_change_nothing():
    """Cut anywhere, and going on in another way: the same digits up to there."""
    t, acc, gyro = recorded(1.3)
    whole = oscillation_frequency(t, acc, gyro, THREE)
    assert np.isfinite(whole).any()
    for cut in (2, 700, 4999, 12345, 20000):
        np.testing.assert_array_equal(
            oscillation_frequency(t[:cut], acc[:cut], gyro[:cut], THREE), whole[:cut]
        )
    other = acc.copy()
    other[12000:] *= 3.0
    np.testing.assert_array_equal(oscillation_frequency(t, other, gyro, THREE)[:12000], whole[:12000])


def test_it_follows_a_change_within_the_window():
    t, acc, gyro = recorded(1.0)
    _, later_acc, later_gyro = recorded(2.0)
    after = t >= 12.0
    acc[after], gyro[after] = later_acc[after], later_gyro[after]
    found = oscillation_frequency(t, acc, gyro, THREE)
    np.testing.assert_allclose(found[(t > 10.0) & (t < 12.0)], 1.0, rtol=1e-3)
    np.testing.assert_allclose(found[t > 12.5 + LIMITS.oscillation_window], 2.0, rtol=1e-3)


def test_three_periods_must_have_gone_by():
    t, acc, gyro = recorded(0.5)
    found = oscillation_frequency(t, acc, gyro, THREE)
    assert np.isnan(found[t < 6.0]).all()
    assert np.isfinite(found[t > 8.0]).all()
    t, acc, gyro = recorded(0.2, duration=40.0)
    assert np.isnan(oscillation_frequency(t, acc, gyro, THREE)).all()


@pytest.mark.parametrize("seed", range(8))
def test_at_rest_there_is_none(seed):
    """40 windows each; noise alone exceeds the limit in one of a million."""
    t, acc, gyro = recorded(1.0, amplitude=0.0, seed=seed)
    assert np.isnan(oscillation_frequency(t, acc, gyro, THREE)).all()


def test_what_the_gyro_does_not_show_is_no_oscillation():
    """Antiparallel accelerometers that are shaken against each other, or that lie about the amplitude."""
    for reads in (0.0, 3.0):
        t, acc, gyro = recorded(3.0, reads=reads)
        assert np.isnan(oscillation_frequency(t, acc, gyro, THREE)).all()
    np.testing.assert_allclose(
        oscillation_frequency(t, acc, np.full(len(t), np.nan), THREE)[t > LIMITS.oscillation_window],
        3.0,
        rtol=1e-3,
    )


def test_uneven_stamps_gaps_and_missing_samples_do_no_harm():
    t, acc, gyro = recorded(1.7, duration=40.0)
    rng = np.random.default_rng(2)
    kept = (rng.random(len(t)) < 0.7) & ~((t > 13.0) & (t < 14.0))
    t, acc, gyro = t[kept] + rng.uniform(0.0, 3e-4, kept.sum()), acc[kept], gyro[kept]
    acc[rng.random(len(t)) < 0.1, 0] = np.nan
    found = oscillation_frequency(t, acc, gyro, THREE)
    np.testing.assert_allclose(found[t > LIMITS.oscillation_window], 1.7, rtol=2e-3)


def test_axes_that_show_no_angular_acceleration_show_no_frequency():
    t, acc, gyro = recorded(1.0)
    assert np.isnan(oscillation_frequency(t, acc[:, :2], gyro, THREE.of(0, 1))).all()
    assert np.isnan(oscillation_frequency(t[:1], acc[:1], gyro[:1], THREE)).all()
