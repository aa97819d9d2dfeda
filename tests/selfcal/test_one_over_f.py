"""1/f noise of accelerometers: u with biases that walk, against the least that any estimator can have."""

import numpy as np
import pytest
from independent.selfcal import UG, flicker
from selfcal_one_over_f import compared, covariance_in_time

pytestmark = pytest.mark.slow


def test_the_covariance_is_that_of_the_noise_of_the_simulator():
    """Variance of differences over 1, 10 and 100 steps of 2000 records, within five standard errors."""
    n, level, draws = 256, 1.0, 2000
    rng = np.random.default_rng(20261126)
    noise = flicker(rng, level, 0.2, n, draws)
    covariance = covariance_in_time(level, 0.2, n)
    for lag in (1, 10, 100):
        expected = 2.0 * (covariance[0, 0] - covariance[0, lag])
        found = np.mean((noise[lag] - noise[0]) ** 2)
        assert abs(found / expected - 1.0) < 5.0 * np.sqrt(2.0 / draws)


def test_a_walk_costs_hardly_more_than_the_least_there_is():
    """No estimator that knows the spectrum has less than three times u of an ideal rig; a walk has at most 1.15 times
    that, and less for the biases, which it takes for known in the long run."""
    names, u = compared(UG, waves=40)
    best = np.median(u["best"] / u["paper"])
    assert 2.9 < best < 3.2
    ratio = dict(zip(names, u["walking"] / u["best"], strict=True))
    assert all(0.98 < more < 1.15 for name, more in ratio.items() if not name.startswith("ka0"))
    assert all(0.7 < ratio[f"ka0_{axis}"] < 1.0 for axis in "xyz")


def test_without_1_f_noise_the_states_of_a_careful_rig_cost_at_most_2_and_5():
    """u over that of an ideal rig: at most 2 in the median, 5 for the worst coefficient."""
    _, u = compared(1e-3 * UG, waves=4)
    for states in ("rig", "best", "walking"):
        ratio = u[states] / u["paper"]
        assert np.median(ratio) < 2.0
        assert ratio.max() < 5.0
