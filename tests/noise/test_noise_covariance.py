"""Covariance of Allan variances: against traces of covariance matrices, all lags, and simulated scatter."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inercal.foundation.instruments.noise import NoiseModel, allan_terms
from inercal.foundation.noise import covariance
from inercal.foundation.noise.covariance import ALPHA, degrees_of_freedom, lag_one, pair_sums, sums
from inercal.foundation.noise.curve import AllanCurve
from inercal.foundation.noise.deviation import allan_deviation
from inercal.foundation.noise.dwell_means import equivalent_dof, overlapping_variance, running_sums
from inercal.foundation.noise.limits import LIMITS


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


def weights(there, m):
    """m times what each sample counts in each difference of adjacent means that is there (M, n)."""
    starts = np.arange(len(there) - 2 * m + 1)[:, None]
    at = np.arange(len(there))
    rows, enough = 0.0, True
    for sign, begin in ((-1.0, starts), (1.0, starts + m)):
        inside = (at >= begin) & (at < begin + m) & there
        count = inside.sum(axis=1, keepdims=True)
        rows = rows + sign * inside * m / np.maximum(count, 1)
        enough = enough & (count[:, 0] >= np.ceil(LIMITS.present_share * m))
    return rows[enough]


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
    counted = np.cov([overlapping_variance(running_sums(x), m) for m in lengths])
    expected = sums(n, lengths).covariance(np.array([kind == k for k in "NBKQ"], dtype=float))
    # standard errors: sqrt(1/4000) of a correlation, sqrt(kurtosis/4000) of a variance, chi-square of 2 and more dof
    size = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose(counted / size, expected / size, atol=4.5 * np.sqrt(8 / 4000))


@settings(deadline=None, max_examples=60)
@given(st.integers(3, 60), st.data(), st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.03, 0.1]))
def test_what_gaps_add_to_white_noise_and_to_quantisation(n, data, seed, missing):
    """E D^2 = sum w^2 of white samples, and that of the weights' differences where samples are those of white noise;
    without gaps 2 m and 6, and so nothing is added to the last digit."""
    m = data.draw(st.integers(1, n // 2))
    rng = np.random.default_rng(seed)
    x = rng.standard_normal(n)
    x[rng.random(n) < missing] = np.nan
    found = allan_deviation(x, 1.0, [m])
    of_samples = weights(np.isfinite(x), m)
    expected = np.ones(5)
    if len(of_samples):
        of_phase = np.diff(of_samples, axis=1, prepend=0.0, append=0.0)
        expected[0] = np.mean(np.sum(of_samples**2, axis=1)) / (2 * m)
        expected[4] = np.mean(np.sum(of_phase**2, axis=1)) / 6
    np.testing.assert_allclose(found.gain[0, 0], expected, rtol=1e-12)
    if np.isfinite(x).all():
        np.testing.assert_array_equal(found.gain[0, 0], np.ones(5))


@pytest.mark.parametrize("share", [0.005, 0.02])
def test_covariance_under_gaps_is_that_of_the_weights_left(share):
    """Quantisation and white noise with lost samples: 2 tr(V C W C) for the very weights, on average over 20 patterns.

    Within 6 % of the standard deviations and 0.12 of the correlations: that a mean of 10 or 24 is there only if it
    lost no more than one or two is not in the sums. Those without gaps would have 0.6 and less of the deviation at 60.
    """
    n, lengths = 400, (1, 10, 24, 60)
    model = NoiseModel(N=0.03, Q=1.0)
    C = model.N**2 * generalised("N", n) + model.Q**2 * generalised("Q", n)
    squares = np.array([model.N, 0.0, 0.0, 0.0, model.Q]) ** 2
    rng = np.random.default_rng(8)
    exact, found = [], []
    for _ in range(20):
        there = rng.random(n) >= share
        VC = []
        for m in lengths:
            D = weights(there, m)
            VC.append(D.T @ D / (2 * m**2 * len(D)) @ C)
        exact.append([[2 * np.sum(a * b.T) for b in VC] for a in VC])
        curve = allan_deviation(np.where(there, 0.0, np.nan), 1.0, lengths)
        gain = curve.gain[:, 0]
        left = curve.terms[:, 0] / (n + 1.0 - 2.0 * np.array(lengths))
        np.testing.assert_allclose(
            (allan_terms(lengths) * gain) @ squares, [np.trace(each) for each in VC], rtol=1e-9
        )
        fitted = AllanCurve(
            np.ones(4), allan_terms(lengths), left, sums(n, lengths).with_gaps(n, gain[:, 0], gain[:, 4])
        )
        found.append(fitted.covariance(squares))
    exact, found = np.mean(exact, axis=0), np.mean(found, axis=0)
    sd = np.sqrt(np.diag(exact))
    np.testing.assert_allclose(np.sqrt(np.diag(found)), sd, rtol=0.06)
    np.testing.assert_allclose(found / np.outer(sd, sd), exact / np.outer(sd, sd), atol=0.12)


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
