"""Moments of random angles against closed forms with many digits: nothing cancels, however small the angle."""

import mpmath as mp
import numpy as np
import pytest
from high_precision import KINDS, relative, wave

from inercal.foundation.rigs.patterns import Distribution, uniform
from inercal.foundation.sensitivities.exact import moments

ARCSEC = np.pi / 180.0 / 3600.0
SIZES = [ARCSEC, 120.0 * ARCSEC, 0.01, np.radians(50.0)]

#: s and e = 1 - c as polynomials in z = exp(id), coefficients of z^-1, 1, z
S = [mp.mpc(0, 0.5), mp.mpf(0), mp.mpc(0, -0.5)]
E = [mp.mpf(-0.5), mp.mpf(1), mp.mpf(-0.5)]


def times(p, q):
    """Product of two polynomials in z and 1/z, each centred in its list."""
    product = [mp.mpf(0)] * (len(p) + len(q) - 1)
    for i, a in enumerate(p):
        for j, b in enumerate(q):
            product[i + j] += a * b
    return product


def expectation(p, distribution):
    """Of a polynomial in exp(id)."""
    middle = len(p) // 2
    total = mp.mpf(0)
    for i, coefficient in enumerate(p):
        value = mp.mpc(wave(distribution, abs(i - middle)))
        total += coefficient * (value if i >= middle else mp.conj(value))
    return total.real


def split(distribution):
    """Means, variances of the parts and their triangular factor of s, e, se, e^2, by L D L^T of the covariance."""
    functions = [S, E, times(S, E), times(E, E)]
    mean = [expectation(f, distribution) for f in functions]
    lower, variance = mp.eye(4), [mp.mpf(0)] * 4
    for i in range(4):
        for j in range(i + 1):
            rest = expectation(times(functions[i], functions[j]), distribution) - mean[i] * mean[j]
            rest -= sum(lower[i, k] * lower[j, k] * variance[k] for k in range(j))
            if i == j:
                variance[i] = rest
            elif variance[j] > mp.mpf(10) ** -100:
                lower[i, j] = rest / variance[j]
    return mean, variance, lower


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("kind", KINDS)
def test_all_moments_agree_with_closed_forms(kind, size):
    distribution = KINDS[kind](size)
    with mp.workdps(200):
        mean, variance, lower = split(distribution)
        found = moments(distribution, degree=2)
        scale = [mp.mpf(size) ** n for n in (1, 2, 3, 4)]
        assert relative(found.mean, mean, 1e-30) < 2e-14
        # the parts of two points that are functions of others have no variance: compared with h^2n
        parts = max(
            abs(a - b) / max(b, 1e-12 * h * h)
            for a, b, h in zip(found.variance, variance, scale, strict=True)
        )
        assert parts < 1e-12
        for i in range(4):
            for j in range(i):
                if variance[j] > 1e-12 * scale[j] ** 2:
                    assert abs(found.lower[i, j] - lower[i, j]) < 1e-12 * (
                        abs(lower[i, j]) + scale[i] / scale[j]
                    )


@pytest.mark.parametrize("size", SIZES)
def test_the_two_moments_of_a_uniform_error_as_in_the_handbook(size):
    """c - 1, Var sin and Var cos of a uniform angle, to rounding of the quadrature."""
    with mp.workdps(80):
        h = mp.mpf(size)
        mean_cos = mp.sin(h) / h
        var_sin = (1 - mp.sin(2 * h) / (2 * h)) / 2
        var_cos = (1 + mp.sin(2 * h) / (2 * h)) / 2 - mean_cos**2
        found = moments(uniform(size))
        assert relative([-found.mean[1], *found.variance], [mean_cos - 1, var_sin, var_cos]) < 2e-14


def test_symmetric_errors_have_no_odd_moments_at_all():
    """Not small ones: zeros, whatever the quadrature rounds."""
    for make in (KINDS[kind] for kind in KINDS if kind != "ramp"):
        found = moments(make(0.3), degree=2)
        assert found.mean[0] == found.mean[2] == 0.0
        assert found.lower[1, 0] == found.lower[2, 1] == found.lower[3, 0] == found.lower[3, 2] == 0.0


def test_degree_one_is_the_beginning_of_degree_two():
    few, many = moments(KINDS["ramp"](0.4)), moments(KINDS["ramp"](0.4), degree=2)
    np.testing.assert_allclose(few.mean, many.mean[:2], rtol=1e-14)
    np.testing.assert_allclose(few.variance, many.variance[:2], rtol=1e-14)
    np.testing.assert_allclose(few.lower, many.lower[:2, :2], rtol=1e-14)


def test_an_error_without_spread_has_finite_moments():
    """All mass at one angle: a part that does not vary explains nothing."""
    found = moments(Distribution("density", 0.0, np.array([0.2]), np.array([1.0]), np.asarray), degree=2)
    np.testing.assert_array_equal(found.lower, np.eye(4))
    np.testing.assert_array_equal(found.variance, 0.0)
