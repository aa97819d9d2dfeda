"""Overlapping Allan deviation with limits and gaps: against plain NumPy, closed forms and counted coverage."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inercal.foundation.errors import InputError, RecordError
from inercal.foundation.instruments.noise import SYMBOLS, NoiseModel
from inercal.foundation.noise.deviation import allan_deviation, regular
from inercal.foundation.noise.dwell_means import overlapping_variance, running_sums
from inercal.foundation.noise.limits import LIMITS
from rows import for_each


def plain(x, m):
    """Twin of the compiled loops: half the mean square difference of adjacent means, and how many there are."""
    before, after = (
        np.lib.stride_tricks.sliding_window_view(x, m)[k : k + len(x) - 2 * m + 1] for k in (0, m)
    )
    enough = [np.isfinite(part).sum(axis=1) >= np.ceil(LIMITS.present_share * m) for part in (before, after)]
    there = enough[0] & enough[1]
    d = np.nanmean(after[there], axis=1) - np.nanmean(before[there], axis=1)
    return (np.mean(d**2) / 2 if len(d) else np.nan), len(d)


# The deviation.


@pytest.mark.kernels
@settings(deadline=None, max_examples=40)
@given(st.integers(3, 300), st.data(), st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.03, 0.3]))
def test_kernels_against_plain_numpy(n, data, seed, missing):
    """With and without gaps, at any averaging time, on any offset."""
    m = data.draw(st.integers(1, n // 2))
    rng = np.random.default_rng(seed)
    x = rng.standard_normal(n)
    x[rng.random(n) < missing] = np.nan
    found = allan_deviation(x + 1000.0, 0.5, [0.5 * m])
    expected, count = plain(x, m)
    assert found.terms[0, 0] == count
    np.testing.assert_allclose(found.deviation[0, 0] ** 2, expected, rtol=1e-7, atol=1e-18)


@pytest.mark.kernels
@settings(deadline=None, max_examples=20)
@given(st.integers(30, 200), st.integers(1, 15), st.integers(0, 2**32 - 1), st.sampled_from([0.01, 0.05]))
def test_gain_of_white_noise_and_of_quantisation_is_that_of_the_weights(n, m, seed, missing):
    """Squares of the weights of all samples in a difference of means, and of their steps, written out."""
    there = np.random.default_rng(seed).random(n) >= missing
    found = allan_deviation(np.where(there, 1.0 * np.arange(n), np.nan), 1.0, [m])
    white, steps = [], []
    for i in range(n - 2 * m + 1):
        halves = there[i : i + m], there[i + m : i + 2 * m]
        if min(half.sum() for half in halves) >= np.ceil(LIMITS.present_share * m):
            w = m * np.concatenate(
                [sign * half / half.sum() for sign, half in zip((-1, 1), halves, strict=True)]
            )
            white.append(w @ w / (2 * m))
            steps.append(np.sum(np.diff(w, prepend=0.0, append=0.0) ** 2) / 6)
    if white:
        of = [SYMBOLS.index(symbol) for symbol in "NQ"]
        np.testing.assert_allclose(found.gain[0, 0, of], [np.mean(white), np.mean(steps)], rtol=1e-12)


def test_all_channels_and_averaging_times_against_the_definition():
    x = np.cumsum(np.random.default_rng(1).standard_normal((500, 3)), axis=0)
    found = allan_deviation(x, 0.01)
    for tau, m, row in zip(found.tau, found.lengths, found.deviation, strict=True):
        assert tau == pytest.approx(0.01 * m)
        np.testing.assert_allclose(row**2, overlapping_variance(running_sums(x), int(m)), rtol=1e-10)
    one = allan_deviation(x[:, 1], 0.01)
    np.testing.assert_array_equal(one.deviation[:, 0], found.deviation[:, 1])


def test_averaging_times_by_default():
    """Eight a decade from one sample to a third of the record, each once."""
    lengths = allan_deviation(np.arange(30000.0) % 7, 1.0).lengths
    assert lengths[0] == 1
    assert lengths[-1] == 10000
    assert np.all(np.diff(lengths) > 0)
    np.testing.assert_allclose(lengths[lengths > 40][1:] / lengths[lengths > 40][:-1], 10**0.125, rtol=0.02)
    assert allan_deviation([1.0, 2.0, 0.0], 1.0).lengths.tolist() == [1]


def test_digits_survive_a_large_offset():
    """The mean goes first: 2000 of 1e-6 on 1e3 to the last digits that the samples hold."""
    x = 1e-6 * np.random.default_rng(2).standard_normal(2000)
    m = [1, 10, 100, 1000]
    np.testing.assert_allclose(
        allan_deviation(x + 1e3, 1.0, m).deviation, allan_deviation(x, 1.0, m).deviation, rtol=1e-6
    )


@pytest.mark.parametrize("share", [0.001, 0.02])
def test_lost_samples_change_little(share):
    """White noise and drift of a record that lost samples here and there, at every averaging time, and a long gap."""
    rng = np.random.default_rng(3)
    x = NoiseModel(N=1.0, K=0.01).simulate(20000, 1.0, rng)
    whole = allan_deviation(x, 1.0)
    x[rng.random(20000) < share] = np.nan
    x[7000:7300] = np.nan
    gappy = allan_deviation(x, 1.0, whole.tau)
    assert np.all(gappy.terms > 0)
    change = gappy.deviation / whole.deviation - 1.0
    # the samples that are gone, 1.5 % and those of `share`, of a statistic of that many degrees of freedom
    assert np.all(np.abs(change) < share / 2 + 4.5 * np.sqrt((share + 0.03) / 2 / whole.dof) + 0.02)
    assert np.all(gappy.dof <= whole.dof)


def test_a_constant_has_no_deviation_and_a_gone_channel_none_that_is_known():
    x = np.column_stack([np.full(100, 9.81), np.full(100, np.nan), np.arange(100.0)])
    found = allan_deviation(x, 1.0)
    assert not found.deviation[:, 0].any()
    assert not found.upper[:, 0].any()
    assert np.isnan(found.deviation[:, 1]).all()
    np.testing.assert_allclose(found.deviation[:, 2], found.tau / np.sqrt(2), rtol=1e-9)  # a ramp


# Kinds of noise and confidence limits.

KINDS = {
    "Q": (2, NoiseModel(Q=1.0)),
    "N": (0, NoiseModel(N=1.0)),
    "B": (-1, NoiseModel(B=1.0)),
    "K": (-2, NoiseModel(K=1.0)),
}


@pytest.mark.parametrize("kind", KINDS)
def test_the_kind_of_noise_is_told_and_the_limits_hold(kind):
    """68.3 % limits of 1500 recordings hold the truth as often; within 4.5 binomial standard deviations and the 3 %
    that chi-square with equivalent degrees of freedom is from the distribution of the variance."""
    alpha, model = KINDS[kind]
    x = model.simulate(600, 1.0, np.random.default_rng(4), 1500)
    found = allan_deviation(x, 1.0, [1, 2, 5, 16, 50, 150])
    told = np.mean(found.alpha == alpha, axis=1)
    # white noise lies nearest to another kind: 1/12, that is 1.3 standard deviations of the lag 1 autocorrelation of
    # 120 means by Bartlett's formula
    assert np.all(told[:3] > 0.85), told
    truth = np.sqrt(model.variance(found.tau))[:, None]
    held = np.mean((found.lower <= truth) & (truth <= found.upper), axis=1)
    slack = 4.5 * np.sqrt(0.683 * 0.317 / 1500) + 0.03
    assert np.all(np.abs(held - 0.683) < slack), held


def test_limits_widen_with_the_level_and_enclose_the_deviation():
    x = np.random.default_rng(5).standard_normal(400)
    narrow, wide = allan_deviation(x, 1.0), allan_deviation(x, 1.0, level=0.95)
    assert np.all((wide.lower < narrow.lower) & (narrow.lower < narrow.deviation))
    assert np.all((narrow.deviation < narrow.upper) & (narrow.upper < wide.upper))


# What cannot be.


@for_each(
    ("x", "interval", "tau", "says"),
    [
        ([1.0, 2.0], 1.0, None, "expected three samples"),
        (np.zeros((4, 2, 2)), 1.0, None, "expected three samples"),
        (np.zeros(9), 0.0, None, "expected more than 0"),
        (np.zeros(9), 1.0, [5.0], "one sample, to 4 s, half the record"),
        (np.zeros(9), 1.0, [0.3], "averaging times from 1 s"),
        (np.zeros(9), 1.0, [], "averaging times from 1 s"),
        (np.zeros(9), 1.0, [np.nan], "averaging times from 1 s"),
    ],
)
def test_what_cannot_be_analysed_is_said(x, interval, tau, says):
    with pytest.raises(InputError, match=says):
        allan_deviation(x, interval, tau)


# The grid.


@settings(deadline=None, max_examples=40)
@given(st.integers(20, 200), st.integers(0, 2**32 - 1), st.floats(1e-3, 1e3), st.floats(-1e5, 1e5))
def test_samples_go_where_their_stamps_say(n, seed, interval, start):
    """Jitter of a fifth of the interval, and gaps of any whole number of samples."""
    rng = np.random.default_rng(seed)
    there = np.flatnonzero(np.concatenate([[True, True, True], rng.random(n - 3) < 0.9]))
    t = start + interval * (there + rng.uniform(-0.1, 0.1, len(there)))
    x = rng.standard_normal((len(there), 2))
    found, grid = regular(t, x)
    assert found == pytest.approx(interval, rel=0.1)
    expected = np.full((there[-1] + 1, 2), np.nan)
    expected[there] = x
    np.testing.assert_array_equal(grid, expected)


def test_stamps_in_ticks_of_a_clock():
    """300 Hz stamped in milliseconds: steps of 3 and 4 ms are no gaps, and the interval is their mean."""
    t = np.floor(np.arange(3000) / 300.0 * 1000) / 1000
    interval, grid = regular(t, np.arange(3000.0))
    assert interval == pytest.approx(1 / 300, rel=1e-3)
    np.testing.assert_array_equal(grid, np.arange(3000.0))


@pytest.mark.parametrize(
    ("t", "says"),
    [
        ([0.0, 1.0, 1.0, 2.0], "found 1 s after 1 s, expected increasing"),
        ([0.0, 1.0, np.nan, 2.0], "expected increasing"),
        ([0.0, 1.0], "expected three or more"),
        ([0.0, 1.0, 2.0, 3600.0], "expected a record without long interruptions"),
    ],
)
def test_time_that_is_none(t, says):
    with pytest.raises(RecordError, match=says) as error:
        regular(t, np.zeros(len(t)), "run.csv")
    assert error.value.where == "run.csv"
