"""Tests of innovations: sound ones pass as often as the risk says, and each way to be unsound is seen."""

import numpy as np
import pytest

from inercal.foundation.inference.consistency import nis, slow_power, surprising, whiteness

DIMS = 6


def innovations(rng, rows=2000):
    return rng.standard_normal((rows, DIMS))


def test_the_mean_of_sound_nis_lies_within_its_standard_error():
    rng = np.random.default_rng(1)
    excess = []
    for _ in range(400):
        x = innovations(rng, 200)
        excess.append(nis(np.square(x).sum(axis=1), np.full(200, DIMS)).excess)
    # standard normal: mean within 4/sqrt(400), variance within 4 sqrt(2/400) of 1
    assert abs(np.mean(excess)) < 0.2
    assert abs(np.var(excess) - 1.0) < 0.3


def test_the_limit_is_that_of_the_interface_where_all_rows_are_full():
    judged = nis(np.full(2700, 6.5), np.full(2700, 6))
    assert judged.limit() == pytest.approx(6.0 + 5.0 * np.sqrt(12.0 / 2700.0))
    assert judged.mean > judged.limit()


def test_rows_without_measurements_do_not_count():
    values, dims = np.array([3.0, np.nan, 7.0]), np.array([3, 0, 6])
    judged = nis(values, dims)
    assert (judged.mean, judged.expected, judged.rows) == (5.0, 4.5, 2)
    with pytest.raises(ValueError, match="no row with measurements"):
        nis(values[1:2], dims[1:2])


def test_a_filter_that_diverged_exceeds_every_limit():
    assert nis(np.array([np.nan, 6.0]), np.array([6, 6])).excess == np.inf
    np.testing.assert_array_equal(surprising(np.array([6.0, np.nan, np.inf]), np.full(3, 6)), [1, 2])


def test_a_row_is_surprising_as_often_as_the_risk_says():
    rng = np.random.default_rng(2)
    risk, runs = 0.05, 2000
    found = sum(len(surprising(rng.chisquare(DIMS, 100), np.full(100, DIMS), risk)) > 0 for _ in range(runs))
    # binomial, 4 standard deviations; 1 - (1 - risk/100)^100 is below the risk by 2.5 %
    assert abs(found / runs - 0.0488) < 4.0 * np.sqrt(0.0488 * 0.9512 / runs)


def test_white_innovations_are_called_white_whatever_the_variance_of_their_rows():
    rng = np.random.default_rng(3)
    chances = []
    for _ in range(150):
        x = innovations(rng, 1000) * (1.0 + 4.0 * (np.arange(1000) > 700))[:, None]
        x[rng.random(1000) < 0.1] = np.nan
        chances.append(whiteness(x, blocks=()))
    # Bonferroni: not above the risk, by more than 4 standard deviations
    assert np.mean(np.array(chances) < 0.05) < 0.05 + 4.0 * np.sqrt(0.05 * 0.95 / 150)


def test_white_innovations_of_even_variance_pass_the_sums_over_blocks():
    rng = np.random.default_rng(4)
    chances = np.array([whiteness(innovations(rng)) for _ in range(150)])
    assert np.mean(chances < 0.05) < 0.05 + 4.0 * np.sqrt(0.05 * 0.95 / 150)


@pytest.mark.parametrize("part", [slice(0, 200), slice(700, 1400)])
def test_white_innovations_that_are_missing_for_long_are_white(part):
    """A channel that was measured in a part of the recording alone: blocks without it say nothing."""
    rng = np.random.default_rng(7)
    chances = []
    for _ in range(60):
        x, known = innovations(rng), np.zeros(2000, dtype=bool)
        known[part] = True
        x[~known, :3] = np.nan
        chances.append(whiteness(x))
    assert np.mean(np.array(chances) < 0.05) < 0.05 + 4.0 * np.sqrt(0.05 * 0.95 / 60)


def test_correlation_over_one_row_and_over_many_are_both_seen():
    rng = np.random.default_rng(5)
    white = innovations(rng)
    near = white.copy()
    near[1:, 2] += 0.2 * white[:-1, 2]
    slow = white.copy()
    slow[:, 4] += 0.3 * np.sin(np.arange(len(white)) / 60.0)
    steady = white.copy()
    steady[1:, 0] -= 0.9 * white[:-1, 0]
    for coloured in (near, slow, steady):
        assert whiteness(coloured) < 1e-3
        assert whiteness(np.vstack([coloured, np.full((8 * len(coloured), DIMS), np.nan)])) < 1e-3


def test_columns_that_were_never_measured_are_left_out():
    x = innovations(np.random.default_rng(6))
    x[:, 3:] = np.nan
    assert whiteness(x) > 1e-3
    assert whiteness(np.full((50, 2), np.nan)) == 1.0


def test_slow_power_is_a_probability_where_innovations_are_white():
    """Of 400 sets of 3 columns, those below a probability: binomial within four standard deviations of it."""
    rng = np.random.default_rng(20261124)
    chances = np.array([slow_power(rng.standard_normal((1000, 3)), 25.0) for _ in range(400)])
    for chance in (0.05, 0.5):
        assert abs(np.mean(chances < chance) - chance) < 4.0 * np.sqrt(chance * (1.0 - chance) / 400)


def test_slow_power_shows_a_process_far_beneath_the_noise():
    """Variance of 2 % correlated over 25 rows, in 3 columns of 4000: no lag tells of so little."""
    rng, keep = np.random.default_rng(20261125), np.exp(-1.0 / 25.0)
    slow = np.zeros((4000, 3))
    for k in range(1, len(slow)):
        slow[k] = keep * slow[k - 1] + 0.15 * np.sqrt(1.0 - keep**2) * rng.standard_normal(3)
    assert slow_power(slow + rng.standard_normal(slow.shape), 25.0) < 1e-6


def test_slow_power_needs_measurements():
    assert slow_power(np.full((50, 3), np.nan), 5.0) == 1.0
    assert slow_power(np.zeros((0, 3)), 5.0) == 1.0
