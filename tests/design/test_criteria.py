"""Covariance of a plan with constant errors against its definition; the criteria against theirs."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from positions import drift, with_rates

from inercal.foundation.designs.criteria import Candidates, D, a_criterion, covariance, i_criterion
from inercal.foundation.rigs.plans import grid, named


def random_plan(rng, m, c, p, q):
    root = rng.standard_normal((m, c, c))
    variance = root @ np.swapaxes(root, 1, 2) + 0.2 * np.eye(c)
    common = rng.standard_normal((m, c, q)) if q else None
    return Candidates(tuple(f"b{k}" for k in range(p)), rng.standard_normal((m, c, p)), variance, common)


def whole_covariance(plan):
    """blockdiag(variance) + C C^T, written out."""
    m, c, _ = plan.rows.shape
    Sigma = np.zeros((m * c, m * c))
    for j in range(m):
        Sigma[j * c : (j + 1) * c, j * c : (j + 1) * c] = plan.variance[j]
    C = np.zeros((m * c, 0)) if plan.common is None else plan.common.reshape(m * c, -1)
    return Sigma + C @ C.T


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 2**32 - 1), st.integers(1, 3), st.integers(0, 4))
def test_constant_errors_as_unknowns_equal_generalised_least_squares(seed, c, q):
    """(X^T Sigma^-1 X)^-1 by the full covariance of all readings."""
    plan = random_plan(np.random.default_rng(seed), 9, c, 4, q)
    X = plan.rows.reshape(-1, 4)
    direct = np.linalg.inv(X.T @ np.linalg.solve(whole_covariance(plan), X))
    np.testing.assert_allclose(covariance(plan), direct, rtol=1e-7, atol=1e-9 * np.max(direct))


@settings(deadline=None, max_examples=10)
@given(st.integers(0, 2**32 - 1))
def test_order_of_positions_does_not_matter(seed):
    rng = np.random.default_rng(seed)
    plan = random_plan(rng, 8, 2, 3, 2)
    np.testing.assert_allclose(
        covariance(plan.take(rng.permutation(8))), covariance(plan), rtol=1e-8, atol=1e-12
    )


def test_independent_readings_may_give_their_variances_alone():
    rng = np.random.default_rng(4)
    rows, variance = rng.standard_normal((6, 2, 3)), rng.uniform(0.5, 2.0, (6, 2))
    full = Candidates(("a", "b", "c"), rows, variance[..., None] * np.eye(2))
    short = Candidates(("a", "b", "c"), rows, variance)
    np.testing.assert_allclose(covariance(short), covariance(full), rtol=1e-12)


def test_an_error_like_a_coefficient_does_not_average_out():
    """Mean of N readings with a common offset of standard deviation s: variance 1/N + s²."""
    for N in (1, 10, 1000):
        plan = Candidates(("mean",), np.ones((N, 1, 1)), np.ones((N, 1)), np.full((N, 1, 1), 0.3))
        np.testing.assert_allclose(covariance(plan), [[1.0 / N + 0.09]], rtol=1e-10)


def test_values_of_the_criteria():
    rng = np.random.default_rng(5)
    root = rng.standard_normal((4, 4))
    cov, T = root @ root.T, rng.standard_normal((3, 4))
    region = rng.standard_normal((50, 2, 4))
    assert D.value(cov) == pytest.approx(np.log(np.linalg.det(cov)), rel=1e-10)
    assert a_criterion(T).value(cov) == pytest.approx(np.trace(T @ cov @ T.T), rel=1e-12)
    mean = np.mean([np.trace(x @ cov @ x.T) for x in region])
    assert i_criterion(region).value(cov) == pytest.approx(mean, rel=1e-12)


def test_prediction_over_the_sphere_is_the_trace_in_the_orthonormal_basis():
    """On a grid with the sine of the outer angle as weight, which is the surface of the sphere."""
    plan = drift(named("24-position"))
    places = grid((180, 8))
    X = drift(places).rows[:, 0] * np.sqrt(np.abs(np.sin(places.angles[:, :1])) * np.pi / 2.0)
    assert i_criterion(X).value(covariance(plan)) == pytest.approx(np.trace(covariance(plan)), rel=2e-4)


def test_coefficients_of_very_different_size():
    """Earth rate in rad/s beside gravity in g: the determinant does not underflow, the rank is found."""
    plan = with_rates(grid((6, 6)), np.radians(45.0))
    scaled = plan.rows / ([1.0] * 9 + [7.292115e-5] * 3)
    same = Candidates(plan.names, scaled, plan.variance)
    difference = D.value(covariance(plan)) - D.value(covariance(same))
    assert difference == pytest.approx(-6.0 * np.log(7.292115e-5), rel=1e-9)


def test_a_plan_that_cannot_tell_says_what():
    with pytest.raises(ValueError, match=r"the 16 positions do not identify .*XZ.*YZ"):
        covariance(with_rates(named("16-cube"), 0.7).take(np.arange(16)))


@pytest.mark.parametrize(
    ("rows", "variance", "common"),
    [
        (np.ones((3, 2)), np.ones((3, 1)), None),
        (np.ones((3, 1, 3)), np.ones((3, 1)), None),
        (np.ones((3, 1, 2)), np.ones((3, 2)), None),
        (np.ones((3, 1, 2)), np.ones((3, 1)), np.ones((2, 1, 1))),
    ],
)
def test_shapes_that_do_not_fit(rows, variance, common):
    with pytest.raises(ValueError, match="expected"):
        Candidates(("a", "b"), rows, variance, common)


@pytest.mark.parametrize("variance", [np.zeros((3, 1)), -np.ones((3, 1, 1))])
def test_variance_must_be_positive(variance):
    with pytest.raises(ValueError, match="not positive"):
        covariance(Candidates(("a",), np.ones((3, 1, 1)), variance))
