"""What data add to a prior: the laws of principal axes, and their words."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from inercal.foundation.inference.identifiability import identify, learned

NAMES = ("a", "b", "c", "d")


def posterior(J, prior):
    """Covariance after whitened observations with Jacobian J, and a prior."""
    return np.linalg.inv(J.T @ J + np.diag(prior**-2.0))


@given(st.integers(0, 10_000))
def test_singular_values_are_those_of_the_data_alone_in_units_of_the_prior(seed):
    rng = np.random.default_rng(seed)
    J, prior = rng.standard_normal((9, 4)), np.exp(rng.uniform(-3.0, 3.0, 4))
    known = learned(posterior(J, prior), prior, NAMES)
    alone = identify(J, NAMES, sizes=prior)
    assert known.singular_values[::-1] == pytest.approx(alone.singular_values, rel=1e-6)
    assert known.condition == pytest.approx(known.left.max() / known.left.min())


@given(st.integers(0, 10_000))
def test_parts_left_do_not_depend_on_units(seed):
    rng = np.random.default_rng(seed)
    J, prior, units = rng.standard_normal((9, 4)), np.exp(rng.uniform(-3.0, 3.0, 4)), np.logspace(-9, 6, 4)
    one = learned(posterior(J, prior), prior, NAMES)
    other = learned(posterior(J / units, prior * units), prior * units, NAMES)
    assert other.left == pytest.approx(one.left, rel=1e-8)
    assert other.ratio == pytest.approx(one.ratio, rel=1e-8)


def test_without_data_everything_is_left():
    prior = np.array([1.0, 1e-6, 5.0, 1e3])
    known = learned(np.diag(prior**2), prior, NAMES)
    assert known.left == pytest.approx(np.ones(4))
    assert known.singular_values == pytest.approx(np.zeros(4), abs=1e-7)
    assert tuple(known.at_prior()) == NAMES
    assert known.condition == pytest.approx(1.0)


def test_a_sum_alone_is_seen():
    """Of a + b is known all, of a - b nothing: what is left of each is 1/sqrt(2)."""
    prior = np.array([1.0, 1.0, 1.0, 1.0])
    J = 1e3 * np.array([[1.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    known = learned(posterior(J, prior), prior, NAMES)
    assert known.ratio[:2] == pytest.approx(np.sqrt([0.5, 0.5]), rel=1e-5)
    assert tuple(known.at_prior()) == ("a", "b")
    assert tuple(known.at_prior(0.9)) == ()
    assert known.weakest() in [("a - 1.00 b",), ("b - 1.00 a",)]
    assert known.left[0] == pytest.approx(1.0)
    assert known.left[1:].max() < 2e-3


def test_what_is_known_beyond_rounding_has_a_finite_condition():
    """Of eigenvalues below eps of the largest nothing is known but that they are: the square of the condition, their
    ratio, ends at 1/eps."""
    found = learned(np.diag([1e-300, 1.0]), np.ones(2), ("a", "b"))
    assert found.condition**2 == pytest.approx(1.0 / np.finfo(float).eps, rel=1e-12)
    tame = learned(np.diag([1e-12, 1.0]), np.ones(2), ("a", "b"))
    assert tame.condition == pytest.approx(1e6, rel=1e-12)
