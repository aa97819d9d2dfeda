"""The Allan fit of several stretches together."""

import numpy as np
import pytest

from inercal.foundation.noise.dwell_means import fit, fit_pooled


def test_the_means_of_the_stretches_say_nothing():
    rng = np.random.default_rng(1)
    parts = [rng.normal(size=(n, 3)) for n in (500, 400, 300)]
    moved = [part + 100.0 * k for k, part in enumerate(parts)]
    assert fit_pooled(moved, 0.01).coefficients == pytest.approx(
        fit_pooled(parts, 0.01).coefficients, rel=1e-6, abs=1e-12
    )


def test_six_stretches_know_the_noise_better_than_one():
    """White noise of unit density: N^2 = 1; the scatter of the fitted variance over 200 draws."""
    rng = np.random.default_rng(2)
    one, six = [], []
    for _ in range(200):
        parts = [10.0 * rng.normal(size=(250, 1)) for _ in range(6)]
        one.append(float(fit(parts[0], 0.01).variance(0.6)[0]))
        six.append(float(fit_pooled(parts, 0.01).variance(0.6)[0]))
    assert np.std(six) < 0.5 * np.std(one)
    assert np.mean(six) == pytest.approx(1.0 / 0.6, rel=0.2)


def test_short_stretches_take_part_where_they_can():
    rng = np.random.default_rng(3)
    parts = [rng.normal(size=(n, 3)) for n in (2, 30, 1000)]
    assert fit_pooled(parts, 0.01).samples == 1032
    assert np.all(np.isfinite(fit_pooled(parts, 0.01).coefficients))
