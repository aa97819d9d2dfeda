"""Allan variance against AllanTools."""

import allantools
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inercal.foundation.noise.dwell_means import overlapping_variance, running_sums


@settings(deadline=None)
@given(st.integers(10, 2000), st.floats(0.1, 1e4), st.integers(0, 2**32 - 1), st.data())
def test_overlapping_deviation(n, rate, seed, data):
    rng = np.random.default_rng(seed)
    x = rng.standard_normal(n) + np.cumsum(rng.standard_normal(n)) * 0.1 + 9.81
    m = data.draw(st.integers(1, (n - 1) // 2))
    _, deviation, _, count = allantools.oadev(x, rate=rate, data_type="freq", taus=[m / rate])
    if len(deviation):  # AllanTools leaves out averaging times with a single difference
        assert int(count[0]) == n - 2 * m + 1
        assert np.sqrt(overlapping_variance(running_sums(x), m)) == pytest.approx(
            deviation[0], rel=1e-10, abs=1e-12
        )


@pytest.mark.parametrize("m", [1, 4, 16, 64, 256])
def test_every_colour_of_noise(m):
    """AllanTools' own generators of white, flicker and random-walk frequency noise."""
    np.random.seed(1)  # noqa: NPY002 (AllanTools knows no other)
    for colour in (allantools.noise.white, allantools.noise.pink, allantools.noise.brown):
        x = np.asarray(colour(2048))
        x = x[np.isfinite(x)]
        expected = allantools.oadev(x, rate=1.0, data_type="freq", taus=[m])[1][0]
        assert np.sqrt(overlapping_variance(running_sums(x), m)) == pytest.approx(expected, rel=1e-10)
