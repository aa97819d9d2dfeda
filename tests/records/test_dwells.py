"""Static intervals: the windowed variance against its definition, and cuts where the time axis breaks."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inercal.foundation.records.dwells import (
    Dwell,
    breaks,
    static_intervals,
    window_samples,
    windowed_variance,
)


def direct(x, window):
    """The definition: the sample variances of three axes in each window, and the root of their squares' sum."""
    size = np.full(len(x), np.inf)
    for i in range(window // 2, len(x) - window // 2):
        part = x[i - window // 2 : i + window // 2 + 1]
        if np.isfinite(part).all():
            size[i] = np.linalg.norm(np.var(part, axis=0, ddof=1))
    return size


odd = st.integers(1, 12).map(lambda k: 2 * k + 1)


# The variance.


@settings(deadline=None)
@given(st.integers(1, 80), odd, st.integers(0, 2**32 - 1))
def test_equals_the_definition(n, window, seed):
    x = np.random.default_rng(seed).standard_normal((n, 3))
    np.testing.assert_allclose(windowed_variance(x, window), direct(x, window), rtol=1e-9)


@settings(deadline=None)
@given(st.integers(11, 80), odd, st.integers(0, 2**32 - 1), st.data())
def test_windows_that_touch_no_number_are_never_still(n, window, seed, data):
    x = np.random.default_rng(seed).standard_normal((n, 3))
    junk = st.tuples(st.integers(0, n - 1), st.integers(0, 2), st.sampled_from([np.nan, np.inf, -np.inf]))
    for row, axis, value in data.draw(st.lists(junk, max_size=4)):
        x[row, axis] = value
    np.testing.assert_allclose(windowed_variance(x, window), direct(x, window), rtol=1e-9)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_nothing_but_junk(value):
    assert np.all(windowed_variance(np.full((30, 3), value), 11) == np.inf)


@pytest.mark.parametrize(("offset", "noise"), [(1e6, 1e-3), (9.81, 1e-8), (-3e4, 1.0)])
def test_keeps_its_digits_far_from_zero(offset, noise):
    """Tiny noise on a large output (counts), over several blocks of the running sums.

    The samples themselves are rounded to 2^-53 of the offset, so the noise cannot be known better.
    """
    x = offset + noise * np.random.default_rng(1).standard_normal((20_000, 3))
    np.testing.assert_allclose(windowed_variance(x, 101), direct(x, 101), rtol=1e-6)


def test_keeps_its_digits_after_large_motion():
    """Noise of 0.1 mg between swings of 10 g: the swings leave no residue in the running sums.

    The sums of squares reach 1e8 m^2/s^4 within a block, so residues are of the order of 1e8 eps / 101.
    """
    rng = np.random.default_rng(2)
    x = 1e-3 * rng.standard_normal((6000, 3))
    x[1000:2000] += 100.0 * rng.standard_normal((1000, 3))
    x[4000:5000] += 100.0 * rng.standard_normal((1000, 3))
    np.testing.assert_allclose(windowed_variance(x, 101), direct(x, 101), rtol=1e-3)


@settings(deadline=None)
@given(st.integers(15, 60), st.integers(0, 2**32 - 1), st.floats(-1e3, 1e3), st.floats(1e-3, 1e3))
def test_offset_unit_and_order_of_time(n, seed, offset, unit):
    x = np.random.default_rng(seed).standard_normal((n, 3))
    size = windowed_variance(x, 11)
    np.testing.assert_allclose(windowed_variance(unit * (x + offset), 11), unit**2 * size, rtol=1e-6)
    np.testing.assert_allclose(windowed_variance(x[::-1], 11), size[::-1], rtol=1e-9)
    np.testing.assert_allclose(windowed_variance(x[:, [2, 0, 1]], 11), size, rtol=1e-9)


@settings(deadline=None)
@given(st.integers(1, 10).map(lambda k: 2 * k + 1), st.floats(1e-3, 1e3))
def test_over_a_step(window, height):
    """k of w samples after a step of height h: variance h^2 k (w - k) / (w (w - 1)); largest in the middle."""
    n, step = 8 * window, 4 * window
    x = np.zeros((n, 3))
    x[step:, 1] = height
    size = windowed_variance(x, window)
    for i in range(window // 2, n - window // 2):
        k = np.clip(i + window // 2 + 1 - step, 0, window)
        expected = height**2 * k * (window - k) / (window * (window - 1))
        assert size[i] == pytest.approx(expected, rel=1e-9, abs=1e-12 * height**2)


def test_a_long_recording_across_the_blocks():
    """Blocks are an implementation's affair: where they meet, nothing shows."""
    x = np.random.default_rng(3).standard_normal((8192 * 2 + 150, 3))
    for window in (11, 101):
        size, expected = windowed_variance(x, window), direct(x, window)
        np.testing.assert_allclose(size[8000:8400], expected[8000:8400], rtol=1e-9)
        np.testing.assert_allclose(size[-400:], expected[-400:], rtol=1e-9)


# The window.


def test_a_hundred_and_one_samples_at_100_hz():
    assert window_samples(100.0) == 101


@settings(deadline=None)
@given(st.floats(11.0, 1e5))
def test_the_window_has_one_length_in_seconds_at_every_rate(rate):
    samples = window_samples(rate)
    assert samples % 2 == 1
    assert samples >= 11
    assert abs(samples / rate - 1.01) <= 1.0 / rate * (1 + 1e-9)


@settings(deadline=None)
@given(st.floats(1e-3, 11.0))
def test_at_low_rates_the_window_keeps_enough_samples(rate):
    assert window_samples(rate) == 11


# Where the time axis breaks.


def steady(n=100, interval=0.01):
    return interval * np.arange(n)


def test_no_break_in_a_steady_jittered_or_coarsely_stamped_time_axis():
    assert breaks(steady(), 0.5).tolist() == []
    jitter = np.random.default_rng(4).uniform(-0.004, 0.004, 100)
    assert breaks(steady() + jitter, 0.5).tolist() == []
    assert breaks(np.floor(steady(interval=0.008) * 100) / 100, 0.5).tolist() == []


@pytest.mark.parametrize(
    ("change", "where"),
    [
        (lambda t: np.delete(t, slice(40, 44)), []),  # some samples lost, less than `longest`
        (lambda t: np.where(np.arange(100) >= 40, t + 5.0, t), [40]),
        (lambda t: np.where(np.arange(100) >= 40, t - 0.01, t), []),  # repeated
        (lambda t: np.where(np.arange(100) >= 40, t - 3.0, t), [40]),  # backward
        (lambda t: np.where(np.arange(100) == 40, np.nan, t), [40, 41]),  # no stamp
    ],
    ids=["short gap", "long gap", "duplicate", "backward", "nan"],
)
def test_breaks(change, where):
    assert breaks(change(steady()), 0.1).tolist() == where


@pytest.mark.parametrize("t", [[], [1.0], [np.nan, np.nan]])
def test_hardly_a_time_axis(t):
    assert breaks(np.array(t), 1.0).tolist() == list(range(1, len(t)))


# Intervals.

NONE = np.array([], dtype=np.int64)


def test_intervals_of_a_known_pattern():
    still = np.array([1, 1, 1, 0, 0, 1, 1, 1, 1, 0, 1], dtype=bool)
    assert static_intervals(still, NONE, 1) == (Dwell(0, 3), Dwell(5, 9), Dwell(10, 11))
    assert static_intervals(still, NONE, 3) == (Dwell(0, 3), Dwell(5, 9))
    assert static_intervals(still, np.array([7]), 2) == (Dwell(0, 3), Dwell(5, 7), Dwell(7, 9))
    assert static_intervals(still, np.array([8]), 3) == (Dwell(0, 3), Dwell(5, 8))
    assert static_intervals(still, np.array([0, 3, 5, 9, 11]), 1) == static_intervals(still, NONE, 1)


@settings(deadline=None)
@given(st.lists(st.booleans(), max_size=60), st.sets(st.integers(0, 60)), st.integers(1, 5))
def test_intervals_are_the_longest_that_are_still_and_unbroken(pattern, cuts, shortest):
    still = np.array(pattern, dtype=bool)
    found = static_intervals(still, np.array(sorted(cuts), dtype=np.int64), shortest)
    covered = np.zeros(len(still), dtype=int)
    for dwell in found:
        assert dwell.samples == dwell.stop - dwell.start >= shortest
        assert still[dwell.start : dwell.stop].all()
        assert not cuts & set(range(dwell.start + 1, dwell.stop))
        # it cannot be extended to either side
        assert dwell.start == 0 or not still[dwell.start - 1] or dwell.start in cuts
        assert dwell.stop == len(still) or not still[dwell.stop] or dwell.stop in cuts
        covered[dwell.start : dwell.stop] += 1
    assert covered.max(initial=0) <= 1
    if shortest == 1:
        assert covered.tolist() == still.astype(int).tolist()


def test_rows_of_a_dwell():
    np.testing.assert_array_equal(Dwell(2, 4).of(np.arange(12).reshape(6, 2)), [[4, 5], [6, 7]])
