"""Noise sample by sample against the same computed at once."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inercal.foundation.noise.dwell_means import overlapping_variance, running_sums
from inercal.foundation.noise.running import cascade, empty_octaves, empty_window, slide
from inercal.foundation.records.dwells import windowed_variance


def variances(x, window):
    """Mean and variance (n, channels) in the window that ends at each sample, one sample after the other."""
    state, found = empty_window(window, x.shape[1]), []
    for row in x:
        slide(row, *state)
        found.append(np.stack([state.mean, state.variance]))
    return np.array(found).swapaxes(0, 1)


def allan(x):
    """Octaves of samples taken one after the other."""
    state = empty_octaves(x.shape[1])
    for row in x:
        cascade(row, *state)
    return state


def adjacent_means(x, m):
    """The definition: half the mean square of the differences of adjacent means that do not overlap."""
    means = x[: len(x) // m * m].reshape(-1, m, x.shape[1]).mean(axis=1)
    return np.mean(np.diff(means, axis=0) ** 2, axis=0) / 2


# The window.


@pytest.mark.kernels
@settings(deadline=None, max_examples=40)
@given(st.integers(1, 60), st.integers(2, 20), st.integers(1, 4), st.integers(0, 2**32 - 1))
def test_the_window_equals_its_definition(n, window, channels, seed):
    x = np.random.default_rng(seed).standard_normal((n, channels))
    mean, variance = variances(x, window)
    assert np.isnan(mean[: window - 1]).all()
    assert np.isnan(variance[: window - 1]).all()
    for i in range(window - 1, n):
        part = x[i - window + 1 : i + 1]
        np.testing.assert_allclose(mean[i], part.mean(axis=0), rtol=1e-9, atol=1e-13)
        np.testing.assert_allclose(variance[i], part.var(axis=0, ddof=1), rtol=1e-9, atol=1e-13)


def test_the_window_equals_that_of_a_recording():
    """The size of the variance of three axes is that of the centred window half a window before."""
    x = np.random.default_rng(1).standard_normal((500, 3)) + 9.81
    size = np.linalg.norm(variances(x, 11)[1], axis=1)
    np.testing.assert_allclose(size[10:], windowed_variance(x, 11)[5:-5], rtol=1e-10)


@pytest.mark.parametrize(("offset", "noise"), [(1e6, 1e-3), (9.81, 1e-8), (-3e4, 1.0)])
def test_the_window_keeps_its_digits_for_ever(offset, noise):
    """After 30 000 samples far from zero, and drift by a thousand times the noise."""
    x = offset + noise * np.random.default_rng(2).standard_normal((30_000, 2))
    x += np.linspace(0.0, 1e3 * noise, len(x))[:, None]
    variance = variances(x, 101)[1]
    for i in (150, 9999, 29_990, 29_999):
        assert variance[i] == pytest.approx(x[i - 100 : i + 1].var(axis=0, ddof=1), rel=1e-6)


def test_motion_leaves_nothing_behind():
    """Noise of 0.1 mg after swings of 10 g: two windows later all is as if they had not been."""
    rng = np.random.default_rng(3)
    x = 1e-3 * rng.standard_normal((1500, 3))
    x[300:700] += 100.0 * rng.standard_normal((400, 3))
    variance = variances(x, 101)[1]
    for i in range(902, 1500, 7):
        assert variance[i] == pytest.approx(x[i - 100 : i + 1].var(axis=0, ddof=1), rel=1e-9)


def test_a_cleared_window_begins_anew():
    x = np.random.default_rng(4).standard_normal((40, 2))
    state = empty_window(7, 2)
    for row in x[:20]:
        slide(row, *state)
    state.clear()
    for i, row in enumerate(x[20:]):
        slide(row, *state)
        assert np.isfinite(state.variance).all() == (i >= 6)
    np.testing.assert_allclose(state.variance, x[-7:].var(axis=0, ddof=1), rtol=1e-12)


# The octaves.


@pytest.mark.kernels
@settings(deadline=None, max_examples=40)
@given(st.integers(2, 200), st.integers(1, 3), st.integers(0, 2**32 - 1))
def test_each_octave_equals_its_definition(n, channels, seed):
    x = np.random.default_rng(seed).standard_normal((n, channels)) + 100.0
    state = allan(x)
    longest = state.longest(1)
    assert longest == int(np.log2(n / 2))
    for octave in range(longest + 1):
        m = 2**octave
        assert state.clusters[octave] == n // m
        variance, _ = state.variance(octave)
        np.testing.assert_allclose(variance, adjacent_means(x, m), rtol=1e-9, atol=1e-20)


def test_agrees_with_the_overlapping_variance():
    """Two estimates of one thing, at m = 1 the same; else apart by their scatter, of some 2/dof relative."""
    x = np.random.default_rng(5).standard_normal((4096, 4))
    state = allan(x)
    assert state.variance(0)[0] == pytest.approx(overlapping_variance(running_sums(x), 1), rel=1e-12)
    for octave in range(1, 7):
        variance, dof = state.variance(octave)
        assert variance / overlapping_variance(running_sums(x), 2**octave) == pytest.approx(
            1.0, abs=4 * np.sqrt(2 / dof)
        )


def test_a_ramp():
    """R^2 tau^2 / 2, exactly."""
    state = allan(3.0 + 0.5 * np.arange(256.0)[:, None])
    for octave in range(8):
        assert state.variance(octave)[0] == pytest.approx(0.25 * 4.0**octave / 2, rel=1e-12)


@pytest.mark.parametrize(("n", "octave"), [(2, 0), (3, 0), (64, 0), (64, 3), (64, 5)])
def test_degrees_of_freedom_match_the_scatter(n, octave):
    """2 mean^2 / variance over 8000 series of white noise, itself known to about 3 %."""
    state = allan(np.random.default_rng(6).standard_normal((n, 8000)))
    variance, dof = state.variance(octave)
    assert dof == pytest.approx(2 * variance.mean() ** 2 / variance.var(), rel=0.15)
    assert abs(variance.mean() * 2**octave - 1) < 4.5 * np.sqrt(2 / dof / 8000)


def test_cleared_octaves_begin_anew():
    x = np.random.default_rng(7).standard_normal((100, 2))
    state = allan(x[:37])
    state.clear()
    assert state.longest(1) == -1
    for row in x[37:]:
        cascade(row, *state)
    np.testing.assert_allclose(state.variance(2)[0], adjacent_means(x[37:], 4), rtol=1e-12)
