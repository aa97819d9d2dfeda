"""The evidence of a fit on errors outside it: against nested fits, refits and what is drawn."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from inercal.foundation.inference.evidence import evidence
from inercal.foundation.inference.hypotheses import least_squares, normal_equations


def fitted(rng, n=30, p=4, noise_dof=0.0):
    """A weighted fit of correlated readings: readings, covariance, columns, gain, evidence."""
    columns = rng.standard_normal((n, p))
    root = np.eye(n) + 0.3 * np.tril(rng.standard_normal((n, n)), -1) / np.sqrt(n)
    V = root @ root.T
    W = np.linalg.inv(V)
    gain = np.linalg.solve(columns.T @ W @ columns, columns.T @ W)
    y = columns @ rng.standard_normal(p) + root @ rng.standard_normal(n)
    return y, V, columns, gain, evidence(y - columns @ gain @ y, V, columns, gain, noise_dof)


def squares(y, V, columns):
    """Weighted sum of squares that a fit leaves, with its values."""
    L = np.linalg.cholesky(V)
    A, b = np.linalg.solve(L, columns), np.linalg.solve(L, y)
    c = np.linalg.lstsq(A, b, rcond=None)[0]
    return float(np.sum((b - A @ c) ** 2)), c


@pytest.mark.parametrize("m", [1, 3])
def test_chances_are_those_of_nested_fits(m):
    """With stated noise the chi-square of the fall, without it the F test of two fits, to the last digits."""
    rng = np.random.default_rng(20261127)
    y, V, columns, gain, found = fitted(rng)
    more = rng.standard_normal((len(y), m))
    before, _ = squares(y, V, columns)
    after, _ = squares(y, V, np.hstack([columns, more]))
    asked = found.ask(more)
    free = len(y) - columns.shape[1] - m
    assert_allclose(found.squares, before, rtol=1e-11)
    assert_allclose(found.explained(asked), before - after, rtol=1e-10)
    expected = stats.f.sf((before - after) / m / (after / free), m, free)
    assert_allclose(found.chance(asked), expected, rtol=1e-9)
    stated = evidence(y - columns @ gain @ y, V, columns, gain, np.inf)
    assert_allclose(stated.chance(stated.ask(more)), stats.chi2.sf(before - after, m), rtol=1e-9)
    assert_allclose(stated.chance(asked, by_residuals=True), expected, rtol=1e-9)


def test_it_is_the_score_test_of_the_search():
    rng = np.random.default_rng(5)
    y, _, _, _, found = fitted(rng)
    more = rng.standard_normal((len(y), 2))
    beside = -found.beside(more)  # the search asks what happens where an error is taken out
    equations = normal_equations([beside], found.z)
    gained = least_squares(equations, np.zeros(2), np.full(2, np.inf)).gained
    assert_allclose(found.explained(found.ask(more)), gained, rtol=1e-10)


def test_shifts_are_those_of_a_refit():
    """The values less their shift are those of the fit with the error beside them."""
    rng = np.random.default_rng(6)
    y, V, columns, gain, found = fitted(rng)
    more = rng.standard_normal((len(y), 2))
    _, refitted = squares(y, V, np.hstack([columns, more]))
    assert_allclose(gain @ y - found.shift(found.ask(more)), refitted[: columns.shape[1]], rtol=1e-10)
    left, _ = squares(y, V, np.hstack([columns, more]))
    assert_allclose(found.without(found.ask(more)).squares, left, rtol=1e-10)


@pytest.mark.parametrize("noise_dof", [0.0, np.inf])
def test_chances_of_sound_fits_are_uniform(noise_dof):
    """Kolmogorov's test of 600 draws at 0.1 %."""
    rng = np.random.default_rng(7)
    chances = []
    for _ in range(600):
        y, *_, found = fitted(rng, 14, 3, noise_dof)
        chances.append(found.chance(found.ask(rng.standard_normal((len(y), 2)))))
    assert stats.kstest(chances, "uniform").pvalue > 1e-3


def test_a_column_of_the_fit_does_not_show():
    rng = np.random.default_rng(8)
    *_, columns, _, found = fitted(rng)
    assert found.ask(columns[:, :2]).count == 0
