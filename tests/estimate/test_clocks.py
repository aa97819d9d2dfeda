"""Two triads on two clocks are told by their motion; on one clock nothing is said."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from inercal.foundation.inference.clocks import lag_drift


def turned(rng, duration=120.0, rate=50.0, fast=1.0):
    """Specific force and rate of a unit that somebody turns and holds; the gyro's clock runs ``fast`` times as fast."""

    def rates(t):
        k = np.clip((t // 4.0).astype(int), 0, len(turns) - 1)
        s = np.clip((t - 4.0 * k - 2.0) / 2.0, 0.0, 1.0)
        return turns[k] * (30.0 * s**2 * (1.0 - s) ** 2 / 2.0)[:, None]

    turns = rng.normal(0.0, 1.0, (int(1.1 * duration / 4.0), 3))
    t, fine = np.arange(0.0, duration, 1.0 / rate), 0.005
    grid = np.arange(0.0, duration, fine)
    attitude, f = Rotation.identity(), np.empty((len(grid), 3))
    for k, w in enumerate(rates(grid + 0.5 * fine)):
        f[k] = attitude.inv().apply([0.0, 0.0, 9.81])
        attitude = attitude * Rotation.from_rotvec(w * fine)
    force = np.stack([np.interp(t, grid, x) for x in f.T], axis=1) + rng.normal(0.0, 0.02, (len(t), 3))
    return t, force, rates(t / fast) + rng.normal(0.0, 0.01, (len(t), 3))


@pytest.mark.parametrize("fast", [0.995, 1.01])
def test_a_clock_that_runs_fast_is_measured(fast):
    t, force, rate = turned(np.random.default_rng(3), fast=fast)
    found = lag_drift(t, force, rate)
    assert found is not None
    assert found.drift == pytest.approx((1.0 - fast) * found.duration, rel=0.05)


@pytest.mark.parametrize("seed", range(4))
def test_one_clock_has_no_drift(seed):
    assert lag_drift(*turned(np.random.default_rng(seed))) is None


def test_a_constant_lag_is_no_drift():
    t, force, rate = turned(np.random.default_rng(5))
    assert lag_drift(t[5:], force[5:], rate[:-5]) is None


def test_what_never_turns_says_nothing():
    rng = np.random.default_rng(6)
    t = np.arange(0.0, 60.0, 0.02)
    force = np.array([0.0, 0.0, 9.81]) + rng.normal(0.0, 0.02, (len(t), 3))
    assert lag_drift(t, force, rng.normal(0.0, 0.01, (len(t), 3))) is None
