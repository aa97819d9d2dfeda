"""Allan variance against NIST's published values, closed forms and the statistics of simulated noise."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from inercal.faces.validate.foundation import thousand
from inercal.foundation.instruments.noise import BIAS_FLOOR
from inercal.foundation.noise.dwell_means import (
    AllanFit,
    equivalent_dof,
    fit,
    overlapping_variance,
    running_sums,
)


def flicker(rng, n, channels, B, interval):
    """Bias instability: two-sided density B^2 / (2 pi f), cut from a series four times as long."""
    f = np.fft.rfftfreq(4 * n, interval)
    one_sided = np.zeros_like(f)
    one_sided[1:] = B**2 / (np.pi * f[1:])
    z = rng.standard_normal((2, len(f), channels)) * np.sqrt(one_sided / 2 * 4 * n / (2 * interval))[:, None]
    return np.fft.irfft(z[0] + 1j * z[1], axis=0)[:n]


# Published values.


def test_nbs14():
    """NBS Monograph 140, annex 8.E (and NIST SP 1065, table 30): nine frequency values."""
    x = np.array([892.0, 809, 823, 798, 671, 644, 883, 903, 677])
    assert np.sqrt(overlapping_variance(running_sums(x), 1)) == pytest.approx(91.22945, abs=5e-6)
    assert np.sqrt(overlapping_variance(running_sums(x), 2)) == pytest.approx(85.95287, abs=5e-6)


def test_the_1000_point_set_of_nist():
    """NIST SP 1065, section 12.4, table 31: overlapping deviation of 1000 numbers of a stated generator."""
    x = thousand()
    assert x.mean() == pytest.approx(4.897745e-01, abs=5e-8)
    assert x.std(ddof=1) == pytest.approx(2.884664e-01, abs=5e-8)
    for m, deviation in ((1, 2.922319e-01), (10, 9.159953e-02), (100, 3.241343e-02)):
        assert np.sqrt(overlapping_variance(running_sums(x), m)) == pytest.approx(deviation, rel=5e-7)


# Closed forms.


@settings(deadline=None)
@given(st.integers(2, 60), st.data(), st.integers(0, 2**32 - 1))
def test_half_the_mean_square_of_the_differences_of_adjacent_means(n, data, seed):
    m = data.draw(st.integers(1, n // 2))
    x = np.random.default_rng(seed).standard_normal(n)
    squares = [(x[i + m : i + 2 * m].mean() - x[i : i + m].mean()) ** 2 for i in range(n - 2 * m + 1)]
    assert overlapping_variance(running_sums(x), m) == pytest.approx(
        np.mean(squares) / 2, rel=1e-9, abs=1e-20
    )


@settings(deadline=None)
@given(st.integers(1, 50), st.floats(1e-3, 1e3), st.floats(-1e3, 1e3))
def test_a_ramp(m, slope, start):
    """R^2 tau^2 / 2, exactly."""
    x = start + slope * np.arange(200)
    assert overlapping_variance(running_sums(x), m) == pytest.approx(slope**2 * m**2 / 2, rel=1e-6)


@settings(deadline=None)
@given(st.integers(1, 40), st.integers(0, 2**32 - 1), st.floats(-1e6, 1e6), st.floats(1e-6, 1e6))
def test_offset_and_unit(m, seed, offset, unit):
    x = np.random.default_rng(seed).standard_normal(80)
    assert overlapping_variance(running_sums(unit * (x + offset)), m) == pytest.approx(
        unit**2 * overlapping_variance(running_sums(x), m), rel=1e-6
    )


def test_channels_are_separate():
    x = np.random.default_rng(1).standard_normal((50, 2, 3))
    one_by_one = [[overlapping_variance(running_sums(x[:, i, j]), 5) for j in range(3)] for i in range(2)]
    np.testing.assert_allclose(overlapping_variance(running_sums(x), 5), one_by_one, rtol=1e-12)


def mean_within(samples, expected, sigmas=4.5):
    """The mean of independent samples agrees with its expectation within its own standard error."""
    error = np.std(samples, ddof=1) / np.sqrt(len(samples))
    assert abs(np.mean(samples) - expected) < sigmas * error


@pytest.mark.parametrize("m", [1, 5, 20, 64])
def test_white_noise_averages_out(m):
    """sigma^2 / m, the slope of -1/2 of the deviation."""
    x = 3.0 * np.random.default_rng(2).standard_normal((256, 2000))
    mean_within(overlapping_variance(running_sums(x), m), 9.0 / m)


@pytest.mark.parametrize("m", [1, 5, 20, 64])
def test_a_random_walk_grows(m):
    """K^2 tau / 3, with the factor 1 + 1/(2 m^2) of a walk in steps: the slope of +1/2."""
    x = 0.5 * np.cumsum(np.random.default_rng(3).standard_normal((256, 2000)), axis=0)
    mean_within(overlapping_variance(running_sums(x), m), 0.25 * m / 3 * (1 + 1 / (2 * m**2)))


def test_bias_instability_is_a_floor():
    """B^2 (2 ln 2) / pi at every averaging time, so that B = floor / 0.664."""
    assert np.sqrt(BIAS_FLOOR) == pytest.approx(0.664, abs=5e-4)
    x = flicker(np.random.default_rng(4), 4096, 400, 0.1, 0.01)
    for m in (16, 64, 256):  # above the few samples in which the simulated band ends
        mean = overlapping_variance(running_sums(x), m).mean()
        assert mean == pytest.approx(0.01 * BIAS_FLOOR, rel=0.05)


# Degrees of freedom.


@pytest.mark.parametrize("m", [1, 2, 5, 16, 64])
def test_degrees_of_freedom_match_the_scatter(m):
    """2 mean^2 / variance of 6000 Allan variances of white noise, itself known to about 3 %."""
    x = np.random.default_rng(5).standard_normal((256, 6000))
    variance = overlapping_variance(running_sums(x), m)
    assert equivalent_dof(256, m) == pytest.approx(2 * variance.mean() ** 2 / variance.var(), rel=0.15)


@pytest.mark.parametrize(("m", "most"), [(1, 0.96), (10, 0.96), (50, 0.98)])
def test_chi_square_intervals_hold(m, most):
    """95 % intervals of the variance by its degrees of freedom: within 1 %, or wider at a quarter of the record."""
    x = np.random.default_rng(6).standard_normal((200, 6000))
    dof = equivalent_dof(200, m)
    variance = overlapping_variance(running_sums(x), m)
    low, high = (dof * variance / stats.chi2.ppf(q, dof) for q in (0.975, 0.025))
    held = np.mean((low <= 1 / m) & (1 / m <= high))
    slack = 4 * np.sqrt(0.95 * 0.05 / 6000)
    assert 0.94 - slack < held < most + slack


@settings(deadline=None)
@given(st.integers(16, 10**7), st.data())
def test_degrees_of_freedom_lie_between_one_and_the_samples(n, data):
    m = data.draw(st.integers(1, n // 2))
    assert 1.0 <= equivalent_dof(n, m) <= n
    assert equivalent_dof(n, m) >= equivalent_dof(n, m + 1)


# The fit.

N, K, INTERVAL = 0.1, 0.3, 0.01


def white(rng, n, channels):
    """Angle random walk N: standard deviation N / sqrt(interval) a sample."""
    return N / np.sqrt(INTERVAL) * rng.standard_normal((n, channels))


def walk(rng, n, channels):
    """Rate random walk K: steps of K sqrt(interval)."""
    return K * np.sqrt(INTERVAL) * np.cumsum(rng.standard_normal((n, channels)), axis=0)


def test_fit_recovers_white_noise():
    """N^2 of 200 recordings: right on average, and each within 5 standard uncertainties of its degrees of freedom."""
    x = white(np.random.default_rng(7), 8192, 200)
    ratio = fit(x, INTERVAL).coefficients[0] / N**2
    mean_within(ratio, 1.0)
    best = equivalent_dof(8192, 8192 // 512)  # of the shortest averaging time used
    np.testing.assert_allclose(ratio, 1.0, atol=5 * np.sqrt(2 / best))


def test_fit_recovers_a_random_walk():
    """K^2 of 200 recordings, on average within 10 %.

    Octaves taken for independent leave 5 % of bias towards small values; weights from the data left 20 %.
    """
    ratio = fit(walk(np.random.default_rng(8), 8192, 200), INTERVAL).coefficients[2] / K**2
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.10)
    assert np.median(ratio) == pytest.approx(1.0, abs=0.15)


def test_fit_recovers_bias_instability():
    """B^2 of 200 recordings, on average within 10 %, and hardly anything taken for the other noises."""
    x = flicker(np.random.default_rng(9), 8192, 200, 0.05, INTERVAL)
    found = fit(x, INTERVAL)
    assert np.mean(found.coefficients[1]) == pytest.approx(0.05**2, rel=0.10)
    assert found.variance(np.array([2.0])).mean() == pytest.approx(0.05**2 * BIAS_FLOOR, rel=0.10)


@settings(deadline=None)
@given(st.floats(1e-6, 1e6), st.floats(1e-3, 1e3), st.integers(0, 2**32 - 1))
def test_fit_knows_no_units(unit, second, seed):
    """N^2 goes as unit^2 time, B^2 as unit^2, K^2 as unit^2 / time."""
    rng = np.random.default_rng(seed)
    x = white(rng, 512, 2) + walk(rng, 512, 2)
    plain, other = fit(x, INTERVAL), fit(unit * x, second * INTERVAL)
    factors = unit**2 * np.array([second, 1.0, 1.0 / second])[:, None]
    largest = (plain.variance(np.array([1.0])) * unit**2).max()
    np.testing.assert_allclose(
        other.coefficients, plain.coefficients * factors, rtol=1e-5, atol=1e-9 * largest
    )


def test_what_does_not_vary_has_no_noise():
    x = np.column_stack([np.full(1000, 9.81), np.random.default_rng(10).standard_normal(1000)])
    coefficients = fit(x, INTERVAL).coefficients
    assert coefficients[:, 0].tolist() == [0.0, 0.0, 0.0]
    assert coefficients[:, 1].any()


def test_variance_and_degrees_of_freedom_of_a_fit():
    found = AllanFit(np.array([[4.0, 0.0], [0.0, 9.0], [6.0, 0.0]]), 1000, 0.1)
    np.testing.assert_allclose(
        found.variance(np.array([2.0])), [[4 / 2 + 6 * 2 / 3, 9 * 2 * np.log(2) / np.pi]]
    )
    assert found.variance(np.ones((3, 4))).shape == (3, 4, 2)
    assert found.dof(2.0) == equivalent_dof(1000, 20)
    assert found.dof(1e-9) == equivalent_dof(1000, 1)


# What the fit is for: the variance of the mean over a dwell.


@pytest.mark.parametrize("samples", [100, 400])
def test_variance_of_dwell_means_under_white_noise(samples):
    """Predicted from recordings at rest, counted over 4000 dwells elsewhere."""
    rng = np.random.default_rng(11)
    predicted = fit(white(rng, 8192, 100), INTERVAL).variance(np.array([samples * INTERVAL]))[0]
    means = white(rng, samples, 4000).mean(axis=0)
    # standard errors: of the predictions by their scatter, of the counted variance by chi-square
    relative = np.hypot(predicted.std() / predicted.mean() / 10, np.sqrt(2 / 4000))
    assert predicted.mean() / means.var(ddof=1) == pytest.approx(1.0, abs=4.5 * relative)


def test_variance_of_dwell_means_under_drift():
    """With a random walk, about the bias at the start of the dwell: within 10 % (the bias of the fit)."""
    rng, samples = np.random.default_rng(12), 400
    recording = white(rng, 8192, 200) + walk(rng, 8192, 200)
    predicted = fit(recording, INTERVAL).variance(np.array([samples * INTERVAL]))[0].mean()
    means = (white(rng, samples, 4000) + walk(rng, samples, 4000)).mean(axis=0)
    assert predicted / means.var() == pytest.approx(1.0, abs=0.10 + 4 * np.sqrt(2 / 4000))
    assert means.var() > 5 * N**2 / (samples * INTERVAL)  # white noise alone would promise far too much
