"""Roots of a covariance: whatever the factor and the scales, their columns add up to it."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inercal.foundation.inference.sigma_point import (
    CHOLESKY,
    EIGEN,
    FACTORS,
    NEGATIVE,
    SVD,
    cholesky,
    forward,
    root,
)

pytestmark = pytest.mark.kernels


def drawn(seed, n, rank, decades):
    """A covariance of a rank, with standard deviations over some decades."""
    rng = np.random.default_rng(seed)
    a = rng.standard_normal((n, rank)) * 10.0 ** rng.uniform(-decades, 0.0, n)[:, None]
    return a @ a.T


def rooted(P, kind):
    out, work = np.full_like(P, np.nan), np.full_like(P, np.nan)
    return out, *root(P, kind, out, work)


def misfit(P, A):
    """Largest difference, as a correlation."""
    d = np.sqrt(np.diag(P))
    d[d == 0.0] = 1.0
    return np.max(np.abs(A @ A.T - P) / np.outer(d, d))


cases = st.tuples(st.integers(0, 10_000), st.integers(1, 26), st.floats(0.2, 1.0), st.floats(0.0, 9.0))


@pytest.mark.parametrize("kind", FACTORS.values(), ids=FACTORS)
@given(cases)
@settings(max_examples=40, deadline=None)
def test_columns_add_up_to_any_covariance(kind, case):
    """P = A A^T to rounding, of full rank or not, with variances up to 18 decades apart."""
    seed, n, share, decades = case
    P = drawn(seed, n, max(1, round(share * n)), decades)
    A, fell, lowest = rooted(P, kind)
    assert misfit(P, A) < 1e-13 * n
    # a sum of squares is no failure
    assert math.isnan(lowest) if kind == CHOLESKY and not fell else lowest > 0.01 * NEGATIVE


@given(st.integers(0, 10_000), st.integers(1, 26))
@settings(max_examples=30, deadline=None)
def test_cholesky_is_that_of_numpy_and_solves(seed, n):
    P = drawn(seed, n, n, 0.0) + np.eye(n)
    L = np.full_like(P, np.nan)
    assert cholesky(P, L)
    np.testing.assert_allclose(L, np.linalg.cholesky(P), atol=1e-12 * n)
    b = np.random.default_rng(seed).standard_normal(n)
    x = b.copy()
    forward(L, x)
    np.testing.assert_allclose(L @ x, b, atol=1e-11 * n)


def test_cholesky_says_where_there_is_no_factor():
    out = np.empty((2, 2))
    for A in ([[1.0, 2.0], [2.0, 1.0]], [[1.0, 1.0], [1.0, 1.0]], [[math.nan, 0.0], [0.0, 1.0]]):
        assert not cholesky(np.array(A), out)


@pytest.mark.parametrize("kind", FACTORS.values(), ids=FACTORS)
def test_a_state_without_variance(kind):
    """Its row of the root is zero, and the rest as without it; Cholesky gives way to the eigen factor."""
    P = np.zeros((5, 5))
    P[1:, 1:] = drawn(3, 4, 4, 6.0)
    A, fell, lowest = rooted(P, kind)
    assert misfit(P, A) < 1e-13
    assert np.all(A[0] == 0.0)
    assert fell == (kind == CHOLESKY)
    assert abs(lowest) < 1e-12


@pytest.mark.parametrize("kind", FACTORS.values(), ids=FACTORS)
@given(st.integers(0, 10_000), st.integers(2, 26), st.floats(-8.0, -1.0), st.floats(0.0, 9.0))
@settings(max_examples=30, deadline=None)
def test_a_negative_eigenvalue_is_told_by_every_factor(kind, seed, n, power, decades):
    """|P| is never taken for P: the correlation matrix's lowest eigenvalue comes back, and its vector is left out."""
    rng = np.random.default_rng(seed)
    U, _ = np.linalg.qr(rng.standard_normal((n, n)))
    d = 10.0 ** rng.uniform(-decades, 0.0, n)
    eigenvalues = np.concatenate([[-(10.0**power)], rng.uniform(0.5, 2.0, n - 1)])
    P = d[:, None] * (U * eigenvalues @ U.T) * d
    P = 0.5 * (P + P.T)
    size = np.sqrt(np.abs(np.diag(P)))
    truth, vectors = np.linalg.eigh(P / np.outer(size, size))
    A, fell, lowest = rooted(P, kind)
    assert fell == (kind == CHOLESKY)
    assert lowest == pytest.approx(truth[0], abs=1e-13 * n)
    assert lowest < NEGATIVE
    if np.all(np.diag(P) > 0.0):  # else two eigenvalues may be of one size, and their vectors any
        assert np.max(np.abs((vectors[:, 0] / size) @ A)) < 1e-6


@pytest.mark.parametrize("kind", [EIGEN, SVD])
def test_a_negative_eigenvalue_as_large_as_a_positive_one(kind):
    """Eigenvalues 1 and -1, singular values 1 and 1: any vectors, but more than the trace in sum."""
    P = np.array([[0.0, 1.0], [1.0, 0.0]])
    _, _, lowest = rooted(P, kind)
    assert lowest == pytest.approx(-1.0)


@pytest.mark.parametrize("kind", FACTORS.values(), ids=FACTORS)
def test_a_negative_variance(kind):
    _, _, lowest = rooted(np.diag([1.0, -1e-20]), kind)
    assert lowest == pytest.approx(-1.0)


@pytest.mark.parametrize("kind", FACTORS.values(), ids=FACTORS)
def test_what_is_not_finite_stays_so(kind):
    """A filter that diverged gives no numbers, and no exception in the midst of a campaign."""
    A, _, lowest = rooted(np.array([[1.0, math.nan], [math.nan, 1.0]]), kind)
    assert np.isnan(A).all()
    assert math.isnan(lowest)
