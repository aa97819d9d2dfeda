"""Nonlinear least squares against NIST's certified values, closed forms and finite differences."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from inercal.faces.validate.foundation import MISRA1A, MISRA1A_CERTIFIED
from inercal.foundation.inference.least_squares import least_squares, solve
from rows import for_each

T = np.linspace(0.0, 2.0, 12)


def decay(x):
    """a exp(-b t)"""
    return x[0] * np.exp(-x[1] * T)


def decay_jacobian(x):
    return np.column_stack([np.exp(-x[1] * T), -x[0] * T * np.exp(-x[1] * T)])


def fit_decay(y, start=(1.0, 0.5), names=("a", "b")):
    return solve(lambda x: decay(x) - y, decay_jacobian, np.array(start), names, np.ones(2))


def differences(function, x, step=1e-6):
    """Central differences of a vector function, (n, p)."""
    steps = step * np.maximum(np.abs(x), 1e-3)
    return np.column_stack(
        [
            (function(x + h * e) - function(x - h * e)) / (2 * h)
            for h, e in zip(steps, np.eye(len(x)), strict=True)
        ]
    )


# Published numbers and closed forms.


@pytest.mark.parametrize("start", [(500.0, 0.0001), (250.0, 0.0005)])
def test_certified_values_of_misra1a(start):
    """NIST StRD, nonlinear regression: y = b1 (1 - exp(-b2 x)), both official starts, 11 certified digits."""
    y, x = MISRA1A.T
    fit = solve(
        lambda b: b[0] * (1 - np.exp(-b[1] * x)) - y,
        lambda b: np.column_stack([1 - np.exp(-b[1] * x), b[0] * x * np.exp(-b[1] * x)]),
        np.array(start),
        ["b1", "b2"],
        np.array(start),
    )
    assert fit.converged
    np.testing.assert_allclose(fit.x, MISRA1A_CERTIFIED, rtol=1e-8)
    assert fit.chi2 == pytest.approx(1.2455138894e-01, rel=1e-10)
    assert fit.dof == 12
    s = np.sqrt(fit.chi2 / fit.dof)
    assert s == pytest.approx(1.0187876330e-01, rel=1e-10)
    sd = s * np.sqrt(np.diag(fit.unit_covariance))
    np.testing.assert_allclose(sd, [2.7070075241e00, 7.2668688436e-06], rtol=1e-7)


def test_rosenbrock():
    """Least at (1, 1), where both residuals vanish."""
    fit = solve(
        lambda x: np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]]),
        lambda x: np.array([[-20 * x[0], 10.0], [-1.0, 0.0]]),
        np.array([-1.2, 1.0]),
        "ab",
        np.ones(2),
    )
    assert fit.converged
    np.testing.assert_allclose(fit.x, 1.0, rtol=1e-10)
    assert fit.chi2 < 1e-20


@settings(deadline=None)
@given(st.integers(1, 5), st.integers(0, 2**32 - 1))
def test_a_linear_problem(p, seed):
    """Same solution and covariance as linear least squares; the covariance is the inverse half Hessian of chi2."""
    rng = np.random.default_rng(seed)
    A, y, names = (
        rng.standard_normal((3 * p + 5, p)),
        rng.standard_normal(3 * p + 5),
        [f"b{i}" for i in range(p)],
    )
    fit = solve(lambda x: A @ x - y, lambda x: A, np.zeros(p), names, np.ones(p))
    linear = least_squares(A, y, names)
    assert fit.converged
    np.testing.assert_allclose(fit.x, linear.beta, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(fit.unit_covariance, linear.unit_covariance, rtol=1e-6, atol=1e-9)
    assert fit.chi2 == pytest.approx(linear.chi2, rel=1e-9)
    assert fit.dof == linear.dof

    def half_gradient(x):
        return differences(lambda x: np.array([np.sum((A @ x - y) ** 2)]), x, 1e-3)[0] / 2

    hessian = differences(half_gradient, fit.x, 1e-1)
    np.testing.assert_allclose(hessian @ fit.unit_covariance, np.eye(p), atol=1e-4)


def test_jacobian_is_that_at_the_minimum():
    y = decay([2.0, 0.7]) + 0.05 * np.cos(9 * T)
    fit = fit_decay(y)
    np.testing.assert_allclose(fit.jacobian, differences(lambda x: decay(x) - y, fit.x), rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(fit.residuals, decay(fit.x) - y, atol=1e-14)
    # a minimum: the residuals are orthogonal to every direction the parameters can move them in
    cosine = (
        fit.jacobian.T @ fit.residuals / np.linalg.norm(fit.jacobian, axis=0) / np.linalg.norm(fit.residuals)
    )
    np.testing.assert_allclose(cosine, 0.0, atol=1e-7)


def test_gain_is_the_derivative_of_the_solution():
    """Each residual moved a little each way, and the problem solved anew; exact where the residuals vanish."""
    y = decay([2.0, 0.7])
    gain = fit_decay(y).gain()
    step = 1e-4
    for k, e in enumerate(step * np.eye(len(T))):
        # residuals decay(x) - (y - e): the residual is raised by e
        moved = (fit_decay(y - e).x - fit_decay(y + e).x) / (2 * step)
        np.testing.assert_allclose(gain[:, k], moved, atol=1e-6)


def test_gain_carries_a_covariance_to_the_parameters():
    """G G^T is the covariance for residuals of unit variance."""
    fit = fit_decay(decay([2.0, 0.7]) + 0.01 * np.sin(5 * T))
    np.testing.assert_allclose(fit.gain() @ fit.gain().T, fit.unit_covariance, rtol=1e-10)


@settings(deadline=None)
@given(st.integers(-6, 6), st.integers(-6, 6))
def test_units_of_the_parameters(p, q):
    """Parameters in other units, with their typical size said in the same: the same fit."""
    unit = 10.0 ** np.array([p, q])
    y = decay([2.0, 0.7]) + 0.01 * np.sin(5 * T)
    plain = fit_decay(y)
    other = solve(
        lambda x: decay(x / unit) - y,
        lambda x: decay_jacobian(x / unit) / unit,
        np.array([1.0, 0.5]) * unit,
        "ab",
        unit,
    )
    assert other.converged
    np.testing.assert_allclose(other.x / unit, plain.x, rtol=1e-7)
    assert other.identifiability.condition == pytest.approx(plain.identifiability.condition, rel=1e-6)
    np.testing.assert_allclose(other.unit_covariance / np.outer(unit, unit), plain.unit_covariance, rtol=1e-6)


def test_stated_covariance_holds_in_monte_carlo():
    """1500 decays with noise of 1 %: NEES and chi2 in their chi-square bands (risk 1e-4 each)."""
    rng, truth, sigma, runs = np.random.default_rng(1), np.array([2.0, 0.7]), 0.02, 1500
    nees = chi2 = 0.0
    for _ in range(runs):
        y = decay(truth) + sigma * rng.standard_normal(len(T))
        fit = solve(
            lambda x, y=y: (decay(x) - y) / sigma,
            lambda x: decay_jacobian(x) / sigma,
            truth,
            "ab",
            np.ones(2),
        )
        error = fit.x - truth
        nees += error @ np.linalg.solve(fit.unit_covariance, error)
        chi2 += fit.chi2
    for total, dof in ((nees, 2 * runs), (chi2, (len(T) - 2) * runs)):
        low, high = stats.chi2.ppf([5e-5, 1 - 5e-5], dof)
        assert low < total < high


# What cannot be solved.


def test_two_parameters_that_act_as_one():
    """exp(a + b): only the sum is known, and the null vector says so."""
    fit = solve(
        lambda x: np.exp(x[0] + x[1]) * np.ones(3) - 2.0,
        lambda x: np.exp(x[0] + x[1]) * np.ones((3, 2)),
        np.zeros(2),
        ["a", "b"],
        np.ones(2),
    )
    assert fit.converged
    assert fit.x.sum() == pytest.approx(np.log(2.0))
    assert fit.identifiability.rank == 1
    assert fit.dof == 2
    np.testing.assert_allclose(np.abs(fit.identifiability.null_vectors[0]), np.sqrt(0.5))
    assert fit.identifiability.weakest() in ("a - 1.00 b", "b - 1.00 a")


def test_a_minimum_at_infinity_is_not_reached():
    """1/(1 + x^2 + y^2) has no least value anywhere."""
    fit = solve(
        lambda x: np.ones(3) / (1 + x @ x),
        lambda x: np.ones((3, 1)) * (-2 * x / (1 + x @ x) ** 2),
        np.ones(2),
        "ab",
        np.ones(2),
    )
    assert not fit.converged
    assert fit.message


class Spoiled:
    """A function whose values from the given call on are not numbers."""

    def __init__(self, function, call, value):
        self.function, self.left, self.value = function, call, value

    def __call__(self, x):
        self.left -= 1
        return self.function(x) if self.left >= 0 else np.full_like(self.function(x), self.value)


@for_each("value", [np.nan, np.inf, -np.inf])
@for_each("call", [0, 1, 2, 3, 4])
@for_each("which", ["residuals", "jacobian"])
def test_values_that_are_no_numbers_are_no_convergence(which, call, value):
    """At the start or on the way: no exception, no false minimum (MINPACK stops there and calls it one)."""
    y = decay([2.0, 0.7])
    functions = {"residuals": lambda x: decay(x) - y, "jacobian": decay_jacobian}
    functions[which] = Spoiled(functions[which], call, value)
    fit = solve(functions["residuals"], functions["jacobian"], np.array([1.0, 0.5]), "ab", np.ones(2))
    assert not fit.converged
    assert "not finite" in fit.message
    np.testing.assert_array_equal(fit.x, [1.0, 0.5])
    assert fit.jacobian.shape == (len(T), 2)
    assert fit.identifiability.rank == 0


def test_one_missing_observation_or_a_start_that_is_no_number():
    y = decay([2.0, 0.7])
    y[3] = np.nan
    assert not fit_decay(y).converged
    assert not fit_decay(decay([2.0, 0.7]), start=(np.nan, 0.5)).converged


def test_fewer_residuals_than_parameters_are_refused():
    with pytest.raises(ValueError, match="number of residuals"):
        solve(lambda x: x[:1], lambda x: np.eye(2)[:1], np.ones(2), "ab", np.ones(2))
