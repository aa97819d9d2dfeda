"""Covariance of Allan variances: against traces of covariance matrices, all lags, and simulated scatter."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inercal.instruments.noise import NoiseModel
from inercal.noise import covariance
from inercal.noise.allan import equivalent_dof, overlapping_variance
from inercal.noise.covariance import ALPHA, degrees_of_freedom, lag_one, pair_sums, sums


def generalised(kind, n):
    """Generalised covariance (n, n) of n samples: minus half the variance of differences for flicker and walks."""
    lag = np.abs(np.subtract.outer(np.arange(n), np.arange(n))).astype(float)
    if kind == "N":
        return np.eye(n)
    if kind == "Q":
        return 2.0 * np.eye(n) - (lag == 1)
    # minus the second difference of the generalised autocovariance of the running sum
    log = np.log(np.where(lag > 1, lag - 1, 1.0)), np.log(np.where(lag > 0, lag, 1.0)), np.log(lag + 1)
    if kind == "B":
        return -((lag - 1) ** 2 * log[0] - 2 * lag**2 * log[1] + (lag + 1) ** 2 * log[2]) / (2 * np.pi)
    return -(np.abs(lag - 1) ** 3 - 2 * lag**3 + (lag + 1) ** 3) / 12


def quadratic(n, m):
    """The matrix W of v = x' W x, v the overlapping Allan variance."""
    D = np.array(
        [[(m <= j - i < 2 * m) * 1.0 - (0 <= j - i < m) for j in range(n)] for i in range(n - 2 * m + 1)]
    )
    return D.T @ D / (2 * m**2 * len(D))


@settings(deadline=None, max_examples=25)
@given(st.integers(4, 26), st.data())
def test_covariance_of_quadratic_forms(n, data):
    """cov(x'Vx, x'Wx) = 2 tr(V C W C) + 4 r'V C W r, x normal with covariance C about a ramp r."""
    m, other = (data.draw(st.integers(1, n // 2)) for _ in range(2))
    squares = np.array([data.draw(st.sampled_from([0.0, 0.3, 2.0])) for _ in range(4)])
    ramp = data.draw(st.sampled_from([0.0, 0.4]))
    C = sum(s * generalised(kind, n) for s, kind in zip(squares, "NBKQ", strict=True))
    V, W = quadratic(n, m), quadratic(n, other)
    r = ramp * np.arange(n)
    expected = np.trace(V @ C @ W @ C) * 2 + 4 * r @ V @ C @ W @ r if squares.any() else 0.0
    lengths = (m, other) if m != other else (m,)
    found = sums(n, lengths).covariance(squares, ramp**2)[0, -1]
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-12)
    mean = np.trace(V @ C) + r @ V @ r if squares.any() else r @ V @ r
    model = NoiseModel(*np.sqrt([squares[0], squares[1], squares[2], ramp**2, squares[3]]))
    assert model.variance(m) == pytest.approx(mean, rel=1e-9, abs=1e-12)


def test_lags_between_those_summed_matter_little(monkeypatch):
    """All lags, against lags that lie ever further apart away from the kinks: correlations within 2e-3."""
    n, lengths = 3000, (1, 3, 10, 40, 150, 600, 1500)

    def correlations(squares):
        C = sums(n, lengths).covariance(np.array(squares))
        return C / np.sqrt(np.outer(np.diag(C), np.diag(C)))

    mixes = [*np.eye(4).tolist(), [1.0, 0.02, 1e-5, 4.0]]
    coarse = [correlations(mix) for mix in mixes]
    monkeypatch.setattr(covariance, "_SPACING", 1e-9)
    covariance._offsets.cache_clear()
    pair_sums.cache_clear()
    try:
        np.testing.assert_allclose(coarse, [correlations(mix) for mix in mixes], atol=2e-3)
    finally:
        covariance._offsets.cache_clear()
        pair_sums.cache_clear()


@pytest.mark.parametrize("squares", [*np.eye(4).tolist(), [1.0, 1e-4, 1e-12, 4.0]])
def test_covariances_of_long_records_are_positive_definite(squares):
    """Over seven decades of lags no digits cancel: 2 million samples, a ratio of 1.8 between averaging times."""
    lengths = tuple(int(m) for m in np.unique(np.geomspace(1, 600_000, 24).astype(int)))
    C = sums(2_000_000, lengths).covariance(np.array(squares))
    d = np.sqrt(np.diag(C))
    assert np.linalg.eigvalsh(C / np.outer(d, d))[0] > 1e-3


@pytest.mark.parametrize(("kind", "model"), [("B", NoiseModel(B=1.0)), ("K", NoiseModel(K=1.0))])
def test_scatter_of_simulated_noise(kind, model):
    """Covariance matrix of 4000 Allan variances each at five averaging times."""
    n, lengths = 400, (1, 4, 16, 60, 130)
    x = model.simulate(n, 1.0, np.random.default_rng(7), 4000)
    counted = np.cov([overlapping_variance(x, m) for m in lengths])
    expected = sums(n, lengths).covariance(np.array([kind == k for k in "NBKQ"], dtype=float))
    # standard errors: sqrt(1/4000) of a correlation, sqrt(kurtosis/4000) of a variance, chi-square of 2 and more dof
    size = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose(counted / size, expected / size, atol=4.5 * np.sqrt(8 / 4000))


def test_white_noise_has_the_published_degrees_of_freedom():
    """NIST SP 1065, table 5, white frequency noise; an empirical formula good to a few per cent."""
    for m in (1, 2, 5, 20, 100, 250):
        assert degrees_of_freedom(1000, m, 0) == pytest.approx(equivalent_dof(1000, m), rel=0.06)


@pytest.mark.parametrize("alpha", ALPHA)
def test_one_difference_has_one_degree_of_freedom(alpha):
    assert degrees_of_freedom(200, 100, alpha) == pytest.approx(1.0)


def test_lag_one_of_each_kind():
    """-2/3 quantisation, -1/2 white, 1/4 random walk, and of flicker (9 ln 3 - 16 ln 2) / (8 ln 2), at all lengths."""
    flicker = (9 * np.log(3) - 16 * np.log(2)) / (8 * np.log(2))
    for m in (1, 7, 1000):
        np.testing.assert_allclose(lag_one(m), [-1 / 2, flicker, 1 / 4, -2 / 3], rtol=1e-9)
