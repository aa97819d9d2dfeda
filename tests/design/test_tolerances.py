"""Cheapest tolerances, against closed forms and against trying everything."""

import itertools

import numpy as np
import pytest

from inercal.foundation.designs.tolerances import LOOSEST, TIGHTEST, Price, Ratios, cheapest, total


def same(fixed, by_error):
    """A model whose estimator does not depend on the tolerances."""
    ratios = Ratios(np.atleast_1d(np.asarray(fixed, float)), np.atleast_2d(np.asarray(by_error, float)))
    return lambda x: ratios


def test_one_tolerance_takes_all_that_noise_leaves():
    """F + S x^2 = 1."""
    (x,) = cheapest([Price(3.0, 1.5)], same(0.36, 4.0))
    assert x == pytest.approx(np.sqrt(0.64 / 4.0), rel=1e-8)


@pytest.mark.parametrize("exponents", [(1.0, 1.0), (2.0, 2.0), (0.5, 3.0)])
def test_two_tolerances_by_lagrange(exponents):
    """c p x^-(p + 2) = 2 m S with one multiplier m, here found by halving."""
    c, p, S, room = np.array([1.0, 5.0]), np.array(exponents), np.array([0.8, 0.1]), 0.7
    low, high = 1e-9, 1e9
    for _ in range(200):
        m = np.sqrt(low * high)
        x = (c * p / (2.0 * m * S)) ** (1.0 / (p + 2.0))
        low, high = (m, high) if S @ x**2 > room else (low, m)
    found = cheapest([Price(*each) for each in zip(c, p, strict=True)], same(1.0 - room, S))
    np.testing.assert_allclose(found, x, rtol=1e-5)


def test_equal_errors_share_alike_and_what_does_not_matter_is_left_loose():
    found = cheapest([Price()] * 5, same(0.0, [[1.0, 1.0, 1.0, 1.0, 0.0]]))
    np.testing.assert_allclose(found, [0.5, 0.5, 0.5, 0.5, LOOSEST], rtol=1e-6)


def test_several_goals_as_a_fine_grid_finds_them():
    """Two errors, three goals of which two bind: no point of a grid of 1 % is cheaper by more than its step."""
    S, F = np.array([[1.0, 0.1], [0.1, 1.0], [0.3, 0.3]]), np.array([0.2, 0.5, 0.0])
    prices = [Price(1.0, 1.0), Price(2.0, 2.0)]
    x = cheapest(prices, same(F, S))
    assert (F + S @ x**2).max() <= 1.0 + 1e-9
    axis = np.exp(np.arange(np.log(0.05), np.log(5.0), 0.01))
    one, two = np.meshgrid(axis, axis)
    reached = np.all(F[:, None, None] + np.einsum("gk,kij->gij", S, np.stack([one, two]) ** 2) <= 1.0, axis=0)
    least = np.min((one**-1.0 + 2.0 * two**-2.0)[reached])
    assert total(prices, x) <= least * (1.0 + 1e-9)
    assert total(prices, x) >= least * (1.0 - 0.04)


def test_tables_as_all_their_combinations():
    """60 drawn cases of two to five errors with four sizes each."""
    rng, reached = np.random.default_rng(20261122), 0
    for _ in range(60):
        k, g = rng.integers(2, 6), rng.integers(1, 4)
        S, F = rng.exponential(size=(g, k)) ** 2, rng.uniform(0.0, 0.6, g)
        prices = [
            Price(
                levels=tuple(
                    (float(x), float(c * x**-1.3)) for x in np.sort(np.exp(rng.uniform(-3.0, 1.0, 4)))
                )
            )
            for c in rng.exponential(size=k)
        ]
        costs = [
            sum(cost for _, cost in choice)
            for choice in itertools.product(*[price.levels for price in prices])
            if np.all(F + S @ np.square([x for x, _ in choice]) <= 1.0)
        ]
        found = cheapest(prices, same(F, S))
        if not costs:
            assert found is None
            continue
        reached += 1
        assert np.all(F + S @ found**2 <= 1.0 + 1e-12)
        assert total(prices, found) == pytest.approx(min(costs), rel=1e-6)
    assert 20 < reached < 60


def test_a_table_beside_a_power():
    """What the table leaves the other takes: tried for each of its sizes."""
    S, levels = np.array([0.9, 0.5]), ((0.1, 9.0), (0.4, 3.0), (0.7, 1.0), (1.0, 0.8))
    prices = [Price(levels=levels), Price(2.0, 1.0)]
    left = [(cost, np.sqrt((0.8 - S[0] * x**2) / S[1])) for x, cost in levels if S[0] * x**2 < 0.8]
    x = cheapest(prices, same(0.2, S))
    assert total(prices, x) == pytest.approx(min(cost + 2.0 / other for cost, other in left), rel=1e-6)


def test_goals_out_of_reach_have_no_tolerances():
    assert cheapest([Price()], same(1.01, 0.1)) is None
    assert cheapest([Price()], same(0.0, 1.01 / TIGHTEST**2)) is None
    assert cheapest([Price(levels=((0.5, 1.0), (1.0, 0.5)))], same(0.9, 1.0)) is None
