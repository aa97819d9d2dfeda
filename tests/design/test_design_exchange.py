"""The exchange against all subsets, against the continuous optimum, and against the figures of the drift model."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from positions import drift, efficiency, with_rates

from inercal.foundation.designs.criteria import Candidates, D, a_criterion, covariance, i_criterion, plain
from inercal.foundation.designs.exchange import exchange
from inercal.foundation.errors import InputError
from inercal.foundation.rigs.plans import grid


def criteria(p, rng):
    return (D, a_criterion(rng.standard_normal((p, p))), i_criterion(rng.standard_normal((20, p))))


@pytest.mark.kernels
@pytest.mark.parametrize(
    ("c", "p", "q", "n"), [(1, 3, 0, 3), (1, 3, 2, 4), (2, 3, 1, 3), (2, 4, 2, 2), (3, 4, 1, 2)]
)
def test_the_best_of_all_subsets(c, p, q, n):
    """Every subset of ten candidates, with and without repeats, with and without constant errors, saturated ones
    included."""
    rng = np.random.default_rng(100 * c + 10 * p + q)
    root = rng.standard_normal((10, c, c))
    variance = root @ np.swapaxes(root, 1, 2) + 0.5 * np.eye(c)
    common = rng.standard_normal((10, c, q)) if q else None
    candidates = Candidates(tuple("abcd"[:p]), rng.standard_normal((10, c, p)), variance, common)
    for criterion, repeats in itertools.product(criteria(p, rng), (False, True)):
        choices = itertools.combinations_with_replacement if repeats else itertools.combinations
        values = {}
        for chosen in choices(range(10), n):
            if len(set(chosen)) * c >= p:  # else singular
                values[chosen] = criterion.value(covariance(candidates.take(chosen)))
        best = min(values, key=values.__getitem__)
        found = exchange(candidates, n, criterion, rng, starts=20, repeats=repeats)
        assert found.value == pytest.approx(values[best], rel=1e-9), (criterion.name, repeats)
        assert tuple(found.chosen) == best
        assert found.values.min() == found.value
        assert len(found.values) == 20


@pytest.mark.parametrize("name", ["D", "I"])
def test_continuous_optimum(name):
    """Kiefer and Wolfowitz: a measure is D-optimal if x^T M^-1 x nowhere exceeds p, and I-optimal if
    x^T M^-1 B M^-1 x nowhere exceeds trace(B M^-1). Such a measure, from the multiplicative algorithm, is a bound
    that no design can pass; one of 60 positions comes close."""
    n, p = 60, 12
    raw = with_rates(grid((18, 18)), np.radians(45.0)).rows[:, 0]
    X = raw / np.linalg.norm(raw, axis=0) * np.sqrt(len(raw))
    criterion = D if name == "D" else i_criterion(X)
    measure = np.full(len(X), 1.0 / len(X))
    for _ in range(3000):
        P = np.linalg.inv(X.T @ (measure[:, None] * X))
        weights = np.linalg.inv(P) if criterion.weights is None else criterion.weights
        slope = np.sum((X @ P @ weights @ P) * X, axis=1) / np.sum(weights * P)
        if slope.max() < 1.002:
            break
        measure *= slope if name == "D" else np.sqrt(slope)
        measure /= measure.sum()
    assert slope.max() < 1.002
    found = exchange(
        plain(tuple(map(str, range(p))), X), n, criterion, np.random.default_rng(1), 4, repeats=True
    )
    if name == "D":
        relative = np.exp((D.value(P) - found.value - p * np.log(n)) / p)
    else:
        relative = criterion.value(P) / (n * found.value)
    assert 0.985 < relative < 1.002


@pytest.mark.parametrize("half_step", [False, True])
@pytest.mark.parametrize(("n", "least"), [(12, 0.995), (24, 0.999)])
def test_efficiency_of_d_optimal_designs(n, least, half_step):
    """Nine drift terms on a 10° grid; 1 is the bound for any number of positions."""
    candidates = drift(grid((36, 36), half_step))
    found = exchange(candidates, n, D, np.random.default_rng(n))
    plan = candidates.take(found.chosen)
    assert least <= efficiency(plan) <= 1.0
    assert len(np.unique(found.chosen)) == n
    assert found.value == pytest.approx(-9.0 * np.log(n * efficiency(plan)), rel=1e-9)


@pytest.mark.kernels
def test_scaling_of_the_coefficients_leaves_the_d_optimal_positions():
    """The determinant changes by a factor that is the same for all designs."""
    candidates = with_rates(grid((12, 12)), 0.7)
    size = np.geomspace(1e-3, 1e3, 12)
    other = Candidates(candidates.names, candidates.rows * size, candidates.variance)
    first, second = (
        exchange(each, 16, D, np.random.default_rng(7), starts=3) for each in (candidates, other)
    )
    assert second.value == pytest.approx(first.value - 2.0 * np.log(size).sum(), abs=1e-6)


@pytest.mark.kernels
@settings(deadline=None, max_examples=10)
@given(st.integers(0, 2**32 - 1))
def test_order_of_candidates_does_not_matter(seed):
    rng = np.random.default_rng(seed)
    rows, common = rng.standard_normal((9, 1, 2)), rng.standard_normal((9, 1, 1))
    candidates = Candidates(("a", "b"), rows, np.ones((9, 1)), common)
    order = rng.permutation(9)
    first = exchange(candidates, 3, D, np.random.default_rng(1), starts=30)
    second = exchange(candidates.take(order), 3, D, np.random.default_rng(2), starts=30)
    assert set(order[second.chosen]) == set(first.chosen)


@pytest.mark.kernels
def test_same_seed_same_design():
    candidates = drift(grid((12, 12)))
    first, second = (exchange(candidates, 12, D, np.random.default_rng(9), starts=3) for _ in range(2))
    np.testing.assert_array_equal(first.chosen, second.chosen)
    np.testing.assert_array_equal(first.values, second.values)
    assert np.all(np.diff(first.chosen) > 0)


@pytest.mark.kernels
def test_constant_errors_move_the_design():
    """With slope errors that stay constant, the design on the absolute covariance is better than the plain one."""
    x = np.linspace(-1.0, 1.0, 41)
    rows = np.stack([np.ones_like(x), x], axis=-1)[:, None]
    common = np.stack([x**3, np.exp(x)], axis=-1)[:, None]
    absolute = Candidates(("b0", "b1"), rows, np.full((41, 1), 0.01), common)
    criterion = i_criterion(rows)
    plain_design = exchange(plain(("b0", "b1"), rows), 6, criterion, np.random.default_rng(1))
    best = exchange(absolute, 6, criterion, np.random.default_rng(1))
    assert best.value < 0.97 * criterion.value(covariance(absolute.take(plain_design.chosen)))


@pytest.mark.kernels
@pytest.mark.parametrize(
    ("n", "repeats", "message"),
    [
        (8, False, "design of 8 positions: found 8 positions, expected 9 or more for 9 coefficients"),
        (20, False, "design of 20 positions: found 16 of 16 candidates that remain, expected 20 or more"),
        (20, True, "identify 6 of 9 coefficients, not "),
        (12, False, "identify 6 of 9 coefficients, not "),
    ],
)
def test_designs_that_cannot_be(n, repeats, message):
    """The quarter turns of both axes take gravity along six directions only."""
    with pytest.raises(InputError) as caught:
        exchange(drift(grid((4, 4), half_step=False)), n, D, np.random.default_rng(0), repeats=repeats)
    assert message in str(caught.value)


@pytest.mark.kernels
def test_observations_that_repeat_each_other():
    """Two equal readings of each position count as one: two positions do not tell three coefficients."""
    rows = np.repeat(np.random.default_rng(6).standard_normal((8, 1, 3)), 2, axis=1)
    with pytest.raises(
        InputError, match="found none that identifies all of 3 coefficients, expected more pos"
    ):
        exchange(plain(("a", "b", "c"), rows), 2, D, np.random.default_rng(0))
