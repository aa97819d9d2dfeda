"""Parts of sigma-point filters against their closed forms and the textbook."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inercal.foundation.inference.sigma_point import (
    CHOLESKY,
    EIGEN,
    FACTORS,
    covariance,
    cross,
    draw,
    empty_moments,
    empty_points,
    mean,
    moments,
    root,
    update,
    weights,
)

pytestmark = pytest.mark.kernels

seeds = st.integers(0, 10_000)


def random_covariance(rng, n):
    a = rng.standard_normal((n, n)) * 10.0 ** rng.uniform(-4.0, 0.0, n)[:, None]
    return a @ a.T


def updated(P, Pxz, Pzz, r):
    """Our update on copies: dx, P, nis, number."""
    P, Pxz, Pzz, r = P.copy(), Pxz.copy(), Pzz.copy(), r.copy()
    dx = np.full(len(P), np.nan)
    nis, count = update(r, Pxz, Pzz, np.full_like(Pzz, np.nan), P, dx)
    return dx, P, nis, count


def measured(seed, n, m):
    """A covariance, a linear measurement of it and innovations."""
    rng = np.random.default_rng(seed)
    P, H = random_covariance(rng, n), rng.standard_normal((m, n))
    Pzz = H @ P @ H.T + random_covariance(rng, m) + 1e-3 * np.eye(m)
    return P, P @ H.T, Pzz, rng.standard_normal(m)


def test_weights_of_the_paper():
    """alpha 1, beta 0, kappa 0 and 30 states: no weight at the centre, 1/60 elsewhere, spread sqrt(30)."""
    assert weights(30, 1.0, 0.0, 0.0) == pytest.approx((0.0, 0.0, 1.0 / 60.0, math.sqrt(30.0)))


@given(st.integers(1, 40), st.floats(0.1, 2.0), st.floats(0.0, 2.0), st.floats(0.0, 3.0))
def test_weights_in_general(size, alpha, beta, kappa):
    """Those of the mean add up to 1; the spread gives back a unit variance; lambda as van der Merwe writes it."""
    of_mean, of_covariance, other, spread = weights(size, alpha, beta, kappa)
    assert of_mean + 2 * size * other == pytest.approx(1.0, abs=1e-9)
    assert 2.0 * other * spread**2 == pytest.approx(1.0)
    scale = alpha**2 * (size + kappa) - size
    assert of_mean == pytest.approx(scale / (size + scale), abs=1e-9)
    assert of_covariance - of_mean == pytest.approx(1.0 - alpha**2 + beta, abs=1e-9)


@given(seeds, st.integers(1, 8), st.floats(0.5, 1.5), st.floats(0.0, 2.0))
@settings(max_examples=30, deadline=None)
def test_moments_of_points_are_exact(seed, n, alpha, beta):
    """Mean and covariance come back from the points; a linear function's covariances are those of theory."""
    rng = np.random.default_rng(seed)
    P, x = random_covariance(rng, n), rng.standard_normal(n)
    A, work = np.empty((n, n)), np.empty((n, n))
    root(P, EIGEN, A, work)
    of_mean, of_covariance, other, spread = weights(n, alpha, beta, 1.0)
    points = x + np.vstack([np.zeros(n), spread * A.T, -spread * A.T])
    out, P2 = np.full(n, np.nan), np.full((n, n), np.nan)
    mean(points, of_mean, other, out)
    np.testing.assert_allclose(out, x, atol=1e-10)
    covariance(points - out, of_covariance, other, P2)
    np.testing.assert_allclose(P2, P, atol=1e-10)
    assert np.array_equal(P2, P2.T)
    H = rng.standard_normal((3, n))
    Pxz = np.full((n, 3), np.nan)
    cross(points - out, (points - out) @ H.T, of_covariance, other, Pxz)
    np.testing.assert_allclose(Pxz, P @ H.T, atol=1e-9)


def test_mean_of_a_square():
    """E x^2 = P for x of mean 0: points are exact to second order, E x^4 = (n + kappa) P^2 shows their kurtosis."""
    of_mean, _, other, spread = weights(1, 1.0, 0.0, 2.0)
    x = np.array([[0.0], [spread * 0.3], [-spread * 0.3]])
    out = np.empty(1)
    mean(x**2, of_mean, other, out)
    assert out[0] == pytest.approx(0.09)
    mean(x**4, of_mean, other, out)
    assert out[0] == pytest.approx(3.0 * 0.09**2)


def drawn(P, factor, health):
    """Columns of the points, and the weight of each of them."""
    n = len(P)
    _, _, other, spread = weights(n, 1.0, 0.0, 0.0)
    points = empty_points(n)._replace(health=health)
    draw(P, factor, spread, points)
    return points.columns, other


@pytest.mark.parametrize("kind", FACTORS.values(), ids=FACTORS)
@given(seeds, st.integers(1, 12), st.integers(1, 6))
@settings(max_examples=20, deadline=None)
def test_drawn_points_carry_the_covariance_through(kind, seed, n, m):
    """Of readings h + H x + x^2: mean h + P_ii, covariance with the state P H^T, that of the readings of all points."""
    rng = np.random.default_rng(seed)
    P, H = random_covariance(rng, n), rng.standard_normal((m, n))
    h, curved = rng.standard_normal(m), rng.integers(0, n, m)
    columns, other = drawn(P, kind, np.array([math.nan, 0.0]))
    np.testing.assert_allclose(2.0 * other * columns.T @ columns, P, atol=1e-11 * n)
    points = np.vstack([np.zeros(n), columns, -columns])
    read = h + points @ H.T + points[:, curved] ** 2
    expected, got = read[1:] - read[1:].mean(axis=0), empty_moments(n, m)
    moments(read.copy(), columns, other, got)
    np.testing.assert_allclose(got.mean, h + np.diag(P)[curved], atol=1e-10 * n)
    np.testing.assert_allclose(got.cross, P @ H.T, atol=1e-10 * n)
    np.testing.assert_allclose(got.covariance, expected.T @ expected / (2.0 * n), atol=1e-10 * n)


def test_drawing_remembers_the_worst():
    """The lowest eigenvalue of all steps, NaN while there is none, and the steps at which Cholesky failed."""
    health = np.array([math.nan, 0.0])
    drawn(np.eye(2), CHOLESKY, health)
    assert math.isnan(health[0])
    for correlation in (0.5, 1.5, 0.9, 1.2):
        drawn(np.array([[1.0, correlation], [correlation, 1.0]]), CHOLESKY, health)
    assert health == pytest.approx([-0.5, 2.0])
    drawn(np.array([[1.0, 1.75], [1.75, 1.0]]), EIGEN, health)
    assert health == pytest.approx([-0.75, 2.0])


@given(seeds, st.integers(1, 26), st.integers(1, 7))
@settings(max_examples=50, deadline=None)
def test_update_is_the_textbook_one(seed, n, m):
    P, Pxz, Pzz, r = measured(seed, n, m)
    dx, P2, nis, count = updated(P, Pxz, Pzz, r)
    K = np.linalg.solve(Pzz, Pxz.T).T
    scale = np.sqrt(np.diag(P))
    np.testing.assert_allclose(dx / scale, K @ r / scale, atol=1e-9)
    np.testing.assert_allclose(
        P2 / np.outer(scale, scale), (P - K @ Pzz @ K.T) / np.outer(scale, scale), atol=1e-9
    )
    assert np.array_equal(P2, P2.T)
    assert nis == pytest.approx(r @ np.linalg.solve(Pzz, r), rel=1e-8)
    assert count == m


@given(seeds, st.integers(2, 7), st.data())
@settings(max_examples=50, deadline=None)
def test_a_missing_measurement_is_one_left_out(seed, m, data):
    """NaN gives the digits of a smaller set, whatever its covariances say."""
    missing = np.array(
        data.draw(st.lists(st.booleans(), min_size=m, max_size=m).filter(lambda x: not all(x)))
    )
    P, Pxz, Pzz, r = measured(seed, 9, m)
    kept = ~missing
    r[missing] = np.nan
    Pzz[missing] = Pzz[:, missing] = np.nan
    Pxz[:, missing] = np.nan
    whole = updated(P, Pxz, Pzz, r)
    part = updated(P, Pxz[:, kept], Pzz[np.ix_(kept, kept)], r[kept])
    assert whole[3] == part[3] == kept.sum()
    assert whole[2] == part[2]
    assert np.array_equal(whole[0], part[0])
    assert np.array_equal(whole[1], part[1])


def test_nothing_measured_changes_nothing():
    P, Pxz, Pzz, _ = measured(1, 6, 3)
    dx, P2, nis, count = updated(P, Pxz, Pzz, np.full(3, np.nan))
    assert np.array_equal(P2, P)
    assert not dx.any()
    assert math.isnan(nis)
    assert count == 0


def test_innovations_without_a_covariance_leave_nothing_to_trust():
    P, Pxz, Pzz, r = measured(1, 6, 3)
    Pzz[1, 1] = -1.0
    dx, P2, _, _ = updated(P, Pxz, Pzz, r)
    assert np.isnan(dx).all()
    assert np.isnan(P2).all()
