"""Restricted likelihood: that of the dense matrices, its highest point, and averages over it."""

import numpy as np
import pytest

from inercal.foundation.inference.variances import Score, degrees, highest, second_moment, solved, weighed


def dense(A, y, V):
    """Restricted log-likelihood, unknowns and their covariance, of dense matrices."""
    W = np.linalg.inv(V)
    P = np.linalg.inv(A.T @ W @ A)
    x = P @ A.T @ W @ y
    chi2 = (y - A @ x) @ W @ (y - A @ x)
    return -0.5 * (np.linalg.slogdet(V)[1] + np.linalg.slogdet(A.T @ W @ A)[1] + chi2), x, P


def test_the_likelihood_is_that_of_dense_matrices():
    """Of a stack of problems at once, and of a Cholesky factor of the normal equations as of the rows."""
    rng = np.random.default_rng(1)
    A, y = rng.normal(size=(8, 3)), rng.normal(size=8)
    roots = np.tril(rng.normal(size=(5, 8, 8))) + 3.0 * np.eye(8)
    fit = solved(np.linalg.inv(roots) @ np.column_stack([A, y]))
    size = 2.0 * np.log(np.abs(np.einsum("gii->gi", roots))).sum(axis=1)
    for k, root in enumerate(roots):
        likelihood, x, P = dense(A, y, root @ root.T)
        assert fit.likelihood(size)[k] == pytest.approx(likelihood, rel=1e-10)
        assert np.allclose(fit.x[k], x, rtol=1e-9)
        assert np.allclose(fit.inverse[k] @ fit.inverse[k].T, P, rtol=1e-9)


def blocks(seed, sizes, wrong=1.0):
    """Readings in groups with a variance each; their likelihood, its information ``wrong`` by a factor."""
    rng = np.random.default_rng(seed)
    group = np.repeat(np.arange(len(sizes)), 30)
    A, y = rng.normal(size=(len(group), 2)), rng.normal(size=len(group)) * np.array(sizes)[group]
    parts = [np.diag((group == k).astype(float)) for k in range(len(sizes))]

    def score(variances):
        V = np.diag(variances[group])
        W = np.linalg.inv(V)
        P = W - W @ A @ np.linalg.solve(A.T @ W @ A, A.T @ W)
        slope = [0.5 * (y @ P @ E @ P @ y - np.trace(P @ E)) for E in parts]
        information = [[0.5 * np.trace(P @ E @ P @ F) for F in parts] for E in parts]
        return Score(dense(A, y, V)[0], np.array(slope), wrong * np.array(information))

    return score


@pytest.mark.parametrize("wrong", [1.0, 0.04, 4.0])
def test_the_likeliest_variances_are_found(wrong):
    """No slope is left, also where the information is far from what it should be: too small, or too large."""
    found = highest(blocks(2, [0.1, 3.0], wrong), np.array([10.0, 10.0]), np.full(2, 1e-12))
    assert np.abs(found.score.slope * found.variances).max() < 0.01
    assert np.sqrt(found.variances) == pytest.approx([0.1, 3.0], rel=0.3)
    assert found.gain > 0.0


def test_a_variance_that_is_none_ends_at_the_least():
    found = highest(blocks(3, [0.0, 1.0]), np.array([1.0, 1.0]), np.full(2, 1e-8))
    assert found.variances[0] == pytest.approx(1e-8)
    assert found.variances[1] == pytest.approx(1.0, rel=0.6)


def test_without_a_variance_the_likelihood_is_told_all_the_same():
    found = highest(lambda _: Score(-3.0, np.zeros(0), np.zeros((0, 0))), np.zeros(0), np.zeros(0))
    assert found.score.value == -3.0


def test_averages_are_those_of_a_mixture():
    """Mean and spread of two sizes; the values of each are counted about the stated ones."""
    weights = weighed(np.log([1.0, 3.0]) - 800.0)
    assert weights == pytest.approx([0.25, 0.75])
    moment = second_moment(weights, np.array([[[4.0]], [[8.0]]]), np.array([[2.0], [0.0]]))
    assert moment == pytest.approx(np.array([[0.25 * (4.0 + 4.0) + 0.75 * 8.0]]))
    assert degrees(0.1) == 20.0
    assert degrees(5.0) == 1.0
