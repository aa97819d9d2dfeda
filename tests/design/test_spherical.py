"""The orthonormal basis of the constant, linear and quadratic functions on the sphere."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from positions import from_monomials, monomials

from inercal.foundation.designs.criteria import NAMES, basis


def directions(seed, n):
    a = np.random.default_rng(seed).standard_normal((n, 3))
    return a / np.linalg.norm(a, axis=1, keepdims=True)


def test_orthonormal_over_the_sphere():
    """A product rule exact for degree 4 (Gauss-Legendre in z, even spacing in azimuth) gives the unit matrix."""
    z, weight = np.polynomial.legendre.leggauss(3)
    azimuth = 2.0 * np.pi * np.arange(5) / 5.0
    z, azimuth = (grid.ravel() for grid in np.meshgrid(z, azimuth, indexing="ij"))
    weight = np.repeat(weight, 5) / 10.0
    r = np.sqrt(1.0 - z * z)
    X = basis(np.stack([r * np.cos(azimuth), r * np.sin(azimuth), z], axis=-1))
    assert X.shape == (15, len(NAMES))
    np.testing.assert_allclose(X.T @ (weight[:, None] * X), np.eye(9), atol=1e-14)


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 2**32 - 1))
def test_the_squares_sum_to_nine_in_every_direction(seed):
    """Addition theorem: 1 + 3 + 5."""
    np.testing.assert_allclose(np.sum(np.square(basis(directions(seed, 8))), axis=-1), 9.0, rtol=1e-14)


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 2**32 - 1))
def test_change_of_basis_leaves_the_drift_as_it_is(seed):
    a = directions(seed, 6)
    beta = np.random.default_rng(seed).uniform(-100.0, 100.0, 9)
    np.testing.assert_allclose(basis(a) @ (from_monomials() @ beta), monomials(a) @ beta, atol=1e-11)


def test_rms_drift_is_the_length_of_the_coefficients():
    """Against the known moments of a direction: <ax²> = 1/3, <ax⁴> = 1/5, <ax²ay²> = 1/15."""
    F, X, Y, Z, XX, YY, XY, XZ, YZ = beta = np.array([50.0, 60.0, 40.0, 8.0, 2.0, 1.5, 1.0, 3.0, 2.5])
    mean_square = F * F + (X * X + Y * Y + Z * Z + 2.0 * F * (XX + YY)) / 3.0
    mean_square += (XX * XX + YY * YY) / 5.0 + (XY * XY + XZ * XZ + YZ * YZ + 2.0 * XX * YY) / 15.0
    np.testing.assert_allclose(np.linalg.norm(from_monomials() @ beta), np.sqrt(mean_square), rtol=1e-14)
