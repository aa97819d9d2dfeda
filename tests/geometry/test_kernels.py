"""The compiled kernels agree to rounding with their NumPy twins."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.linalg import expm

from inercal.foundation.geometry import kernels, rotations

pytestmark = pytest.mark.kernels

EPS = np.finfo(float).eps
RNG = np.random.default_rng(20)

ROTVECS = np.concatenate(
    [
        np.zeros((1, 3)),
        RNG.normal(size=(20, 3)),
        RNG.normal(size=(20, 3)) * np.geomspace(1e-12, 1e-2, 20)[:, None],
        np.pi * np.eye(3),
        (np.pi - 1e-7) * np.eye(3),
    ]
)
QUATERNIONS = rotations.exp(ROTVECS)


def test_multiply_agrees():
    got = [kernels.multiply(p, q) for p, q in zip(QUATERNIONS, QUATERNIONS[::-1], strict=True)]
    assert_allclose(got, rotations.multiply(QUATERNIONS, QUATERNIONS[::-1]), atol=2 * EPS)


def test_normalize_agrees():
    q = RNG.normal(size=(20, 4))
    assert_allclose([kernels.normalize(row) for row in q], rotations.normalize(q), rtol=2 * EPS)


def test_exp_agrees_relatively_also_for_tiny_angles():
    assert_allclose([kernels.exp(row) for row in ROTVECS], QUATERNIONS, rtol=4 * EPS)


def test_rotate_agrees():
    v = RNG.normal(size=ROTVECS.shape)
    got = [kernels.rotate(q, row) for q, row in zip(QUATERNIONS, v, strict=True)]
    assert_allclose(got, rotations.rotate(QUATERNIONS, v), atol=8 * EPS)


def test_log_agrees_relatively_also_for_tiny_angles_and_either_sign():
    for q in (QUATERNIONS, -QUATERNIONS, 3.0 * QUATERNIONS):
        assert_allclose([kernels.log(row) for row in q], rotations.log(q), rtol=8 * EPS, atol=1e-200)


def right_jacobian(rotvec):
    """The twin: expm of an augmented skew matrix holds its integral, J = int_0^1 exp(-s [v]x) ds."""
    x, y, z = rotvec
    block = np.zeros((6, 6))
    block[:3, :3] = [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]
    block[:3, 3:] = np.eye(3)
    return expm(block)[:3, 3:]


@pytest.mark.parametrize("length", [0.0, 1e-9, 1e-3, 0.0999999, 0.1000001, 1.0, 3.0, 6.0])
def test_right_jacobian_is_the_mean_of_the_turn_back(length):
    for direction in rotations.normalize(RNG.normal(size=(5, 4)))[:, :3]:
        v = length * direction / np.linalg.norm(direction)
        assert_allclose(kernels.right_jacobian(v), right_jacobian(v), rtol=1e-13, atol=20 * EPS)


def test_right_jacobian_is_how_a_rotation_answers_to_its_vector():
    """exp(v + d) = exp(v) exp(J d) to first order."""
    for v in ROTVECS:
        d = 1e-6 * RNG.normal(size=3)
        ends = [kernels.exp(v + d), kernels.exp(v - d)]
        found = 0.5 * rotations.boxminus(*ends)
        middle = np.array(kernels.right_jacobian(v)) @ d
        assert_allclose(found, middle, atol=1e-15)


def test_step_agrees():
    got = [kernels.step(q, row, 0.3) for q, row in zip(QUATERNIONS, ROTVECS, strict=True)]
    assert_allclose(got, rotations.step(QUATERNIONS, ROTVECS, 0.3), atol=4 * EPS)


@pytest.mark.parametrize("kind", [tuple, np.array])
def test_tuples_and_rows_of_arrays_are_the_same_to_a_kernel(kind):
    q, v = QUATERNIONS[3], ROTVECS[4]
    assert kernels.rotate(kind(q), kind(v)) == kernels.rotate(q, v)


def test_integrate_is_step_after_step():
    n = 200
    omega, dt = RNG.normal(size=(n, 3)), RNG.uniform(0.005, 0.02, n)
    out = np.full((n + 1, 4), np.nan)
    kernels.integrate(QUATERNIONS[5], omega, dt, out)
    assert_array_equal(out[0], QUATERNIONS[5])
    assert_allclose(out[1:], rotations.step(out[:-1], omega, dt), atol=4 * EPS)


def test_integrate_of_a_constant_rate_is_the_closed_form():
    n, omega = 2000, np.array([0.3, -0.7, 1.1])
    dt = np.full(n, 0.01)
    out = np.empty((n + 1, 4))
    kernels.integrate(QUATERNIONS[5], np.tile(omega, (n, 1)), dt, out)
    exact = rotations.step(QUATERNIONS[5], omega, np.arange(n + 1) * 0.01)
    assert rotations.attitude_difference(out, exact).max() < 1e-13


def test_integrate_does_not_lose_the_unit_length():
    n = 100_000
    out = np.empty((n + 1, 4))
    kernels.integrate(QUATERNIONS[5], RNG.normal(size=(n, 3)), np.full(n, 0.01), out)
    assert_allclose(np.linalg.norm(out, axis=-1), 1.0, atol=4 * EPS)


def test_integrate_of_nothing_leaves_the_first_attitude():
    out = np.empty((1, 4))
    kernels.integrate(QUATERNIONS[5], np.empty((0, 3)), np.empty(0), out)
    assert_array_equal(out, QUATERNIONS[5:6])
