"""What each function of `rotations` computes, in cases whose answer is known beforehand.

The group laws and the comparison with SciPy are in ``tests/laws/test_rotation_group.py``.
"""

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from inercal.foundation.geometry import rotations
from inercal.foundation.geometry.rotations import SMALL_ANGLE

EPS = np.finfo(float).eps
X, Y, Z = np.eye(3)
IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])


def test_a_quarter_turn_about_z_takes_x_to_y():
    q = rotations.exp(0.5 * np.pi * Z)
    assert_allclose(rotations.rotate(q, X), Y, atol=EPS)
    assert_allclose(rotations.to_matrix(q) @ X, Y, atol=EPS)


def test_hamilton_product_has_ij_equal_to_k():
    _, i, j, k = np.eye(4)
    assert_array_equal(rotations.multiply(i, j), k)
    assert_array_equal(rotations.multiply(j, i), -k)


def test_products_chain_frames_from_right_to_left():
    """q_ac = q_ab q_bc: first about the outer axis y, then about the turned inner axis z."""
    q = rotations.multiply(rotations.exp(0.3 * Y), rotations.exp(0.7 * Z))
    C = rotations.elementary("y", 0.3) @ rotations.elementary("z", 0.7)
    assert_allclose(rotations.to_matrix(q), C, atol=2 * EPS)


def test_elementary_rotations_are_those_of_the_turntable_convention():
    t = 0.4
    c, s = np.cos(t), np.sin(t)
    assert_array_equal(rotations.elementary("x", t), [[1, 0, 0], [0, c, -s], [0, s, c]])
    assert_array_equal(rotations.elementary("y", t), [[c, 0, s], [0, 1, 0], [-s, 0, c]])
    assert_array_equal(rotations.elementary("z", t), [[c, -s, 0], [s, c, 0], [0, 0, 1]])
    assert rotations.elementary("x", np.zeros((2, 5))).shape == (2, 5, 3, 3)


def test_an_unknown_axis_is_refused():
    with pytest.raises(ValueError, match="'xy'"):
        rotations.elementary("xy", 0.1)  # type: ignore[arg-type]


@pytest.mark.parametrize(("axis", "direction"), [("x", X), ("y", Y), ("z", Z)])
def test_exp_about_an_axis_is_the_elementary_rotation(axis, direction):
    angle = np.linspace(-4.0, 4.0, 41)
    C = rotations.to_matrix(rotations.exp(angle[:, None] * direction))
    assert_allclose(C, rotations.elementary(axis, angle), atol=4 * EPS)


def test_exp_is_relatively_accurate_at_every_small_angle():
    """The vector part is sin(angle/2), to a few units in the last place, on both sides of the branch."""
    angle = np.concatenate([np.geomspace(1e-150, 1.0, 301), SMALL_ANGLE * (1.0 + EPS * np.arange(-4, 5))])
    exact = np.sin(0.5 * angle.astype(np.longdouble)).astype(float)
    assert_allclose(rotations.exp(angle[:, None] * X)[:, 1], exact, rtol=4 * EPS)
    assert_array_equal(rotations.exp(np.zeros(3)), IDENTITY)


def test_log_is_relatively_accurate_at_every_small_angle():
    angle = np.concatenate([np.geomspace(1e-150, 1.0, 301), SMALL_ANGLE * np.linspace(1.9, 2.1, 21)])
    q = np.stack([np.cos(0.5 * angle), np.sin(0.5 * angle), 0.0 * angle, 0.0 * angle], axis=-1)
    assert_allclose(rotations.log(q)[:, 0], angle, rtol=8 * EPS)
    assert_array_equal(rotations.log(IDENTITY), np.zeros(3))


def test_log_takes_the_short_way_round():
    """Three quarters of a turn one way is a quarter of a turn the other way."""
    assert_allclose(rotations.log(rotations.exp(1.5 * np.pi * Y)), -0.5 * np.pi * Y, atol=4 * EPS)


def test_log_of_a_half_turn_has_length_pi():
    half_turns = np.array([[0.0, 1, 0, 0], [-0.0, 0, 1, 0], [0.0, 0, 0, -1], [-0.0, 0.6, 0, 0.8]])
    assert_allclose(rotations.log(half_turns), np.pi * half_turns[:, 1:], rtol=2 * EPS)


def test_log_ignores_the_length_of_the_quaternion():
    q = rotations.exp([[0.1, -0.2, 0.3], [1e-9, 0.0, 2e-9]])
    assert_allclose(rotations.log(7.0 * q), rotations.log(q), rtol=8 * EPS)


def test_normalize_keeps_the_sign_and_refuses_zero():
    assert_allclose(rotations.normalize([-2, 0, 0, 0]), -IDENTITY)
    with pytest.raises(ValueError, match="zero quaternion"):
        rotations.normalize(np.zeros((3, 4)))


@pytest.mark.parametrize(
    "bad", [np.diag([1.0, 1.0, -1.0]), np.diag([1.0, 1.0, 1.0 + 1e-5]), np.eye(3) * np.nan]
)
def test_from_matrix_refuses_what_is_no_rotation(bad):
    with pytest.raises(ValueError, match="not a rotation"):
        rotations.from_matrix(np.stack([np.eye(3), bad]))


def test_from_matrix_is_exact_at_half_turns():
    half_turns = np.array([[0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1], [0, 0.6, 0.8, 0], [0, 0, 0.6, -0.8]])
    q = rotations.from_matrix(rotations.to_matrix(half_turns))
    assert_allclose(rotations.attitude_difference(q, half_turns), 0.0, atol=4 * EPS)


def test_from_matrix_keeps_tiny_rotations():
    rotvec = np.array([3e-12, -2e-13, 5e-14])
    C = np.eye(3) + rotations.skew(rotvec)
    assert_allclose(rotations.log(rotations.from_matrix(C)), rotvec, rtol=8 * EPS)


def test_skew_is_the_cross_product():
    v, u = np.random.default_rng(1).normal(size=(2, 5, 3))
    assert_allclose((rotations.skew(v) @ u[..., None])[..., 0], np.cross(v, u), atol=4 * EPS)


def test_skew_is_the_derivative_of_a_rotation():
    """d/dt C(t v) at t = 0 is skew(v)."""
    v, h = np.array([0.3, -0.5, 0.2]), 1e-6
    forward, backward = (rotations.to_matrix(rotations.exp(t * v)) for t in (h, -h))
    assert_allclose((forward - backward) / (2 * h), rotations.skew(v), atol=1e-9)


def test_angle_between_is_accurate_where_the_arc_cosine_is_not():
    angle = np.array([0.0, 1e-12, 1e-8, 1e-3, 1.0, 3.0])
    v = 5.0 * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=-1)
    assert_allclose(rotations.angle_between(2.0 * X, v), angle, rtol=4 * EPS)
    assert_allclose(rotations.angle_between(-X, v), np.pi - angle, rtol=4 * EPS)


def test_attitude_difference_is_the_shortest_angle_and_ignores_the_sign():
    q = rotations.exp([0.3, 0.2, -0.1])
    angle = np.array([0.0, 1e-10, 1e-3, 3.0, np.pi])
    turned = rotations.boxplus(q, angle[:, None] * np.array([0.6, 0.0, 0.8]))
    assert_allclose(rotations.attitude_difference(q, turned), angle, atol=4 * EPS)
    assert_allclose(rotations.attitude_difference(-q, turned), angle, atol=4 * EPS)


def test_mean_of_two_attitudes_lies_half_way():
    q = rotations.exp([0.1, 0.5, -0.3])
    delta = np.array([0.2, -0.4, 0.7])
    mean = rotations.mean(np.stack([q, -rotations.boxplus(q, delta)]))
    assert_allclose(rotations.boxminus(mean, q), 0.5 * delta, atol=8 * EPS)


def test_mean_counts_weights_like_repetitions():
    q = rotations.exp(np.random.default_rng(2).normal(size=(3, 3)))
    repeated = rotations.mean(np.repeat(q, [1, 2, 4], axis=0))
    assert_allclose(rotations.mean(q, weights=[0.5, 1.0, 2.0]), repeated, atol=8 * EPS)


def test_mean_takes_any_batch_axis():
    q = rotations.exp(np.random.default_rng(3).normal(scale=0.3, size=(5, 2, 3)))
    assert_allclose(rotations.mean(q, axis=0), rotations.mean(q.swapaxes(0, 1)), atol=4 * EPS)
    assert_allclose(rotations.mean(q)[4], rotations.mean(q[4]), atol=4 * EPS)
    with pytest.raises(ValueError, match="out of bounds"):
        rotations.mean(q, axis=2)


def test_many_steps_at_a_constant_rate_are_one_long_step():
    q0, omega = rotations.exp([0.1, -0.2, 0.3]), np.array([0.5, -1.0, 2.0])
    q = q0
    for _ in range(100):
        q = rotations.step(q, omega, 0.01)
    assert rotations.attitude_difference(q, rotations.step(q0, omega, 1.0)) < 50 * EPS


def test_step_turns_a_fixed_vector_backwards_in_the_body():
    """A body turning about its z sees a fixed direction turn the other way: dv_b/dt = -omega x v_b."""
    q = rotations.step(IDENTITY, 0.2 * Z, 1.0)
    assert_allclose(rotations.rotate(rotations.conjugate(q), X), [np.cos(0.2), -np.sin(0.2), 0.0], atol=EPS)


def test_batch_axes_broadcast():
    q, v = rotations.exp(np.ones((4, 1, 3))), np.ones((5, 3))
    assert rotations.rotate(q, v).shape == (4, 5, 3)
    assert rotations.multiply(q, IDENTITY).shape == (4, 1, 4)
    assert rotations.step(q, v, np.ones((2, 1, 5))).shape == (2, 4, 5, 4)
    assert rotations.angle_between(v, X).shape == (5,)
    assert rotations.from_matrix(np.zeros((0, 3, 3))).shape == (0, 4)


def test_loading_the_module_loads_neither_numba_nor_scipy():
    """Start-up time: a command that only shows help does not pay for compilers."""
    program = (
        "import sys, inercal.foundation.geometry.rotations, inercal.foundation.geometry.earth;"
        "print(sorted({'numba', 'scipy'} & set(sys.modules)))"
    )
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"


@given(st.floats(-1e6, 1e6))
def test_the_principal_angle_is_the_same_angle_in_one_turn(angle):
    """Within (-pi, pi], and off by a whole number of turns."""
    found = float(rotations.principal(angle))
    assert -np.pi < found <= np.pi
    turns = (angle - found) / (2.0 * np.pi)
    assert turns == pytest.approx(round(turns), abs=1e-9)


def test_the_principal_angle_of_an_unknown_one_is_unknown():
    found = rotations.principal([np.nan, 3.0 * np.pi, -np.pi, np.nextafter(-np.pi, -4.0)])
    assert np.isnan(found[0])
    np.testing.assert_allclose(found[1:3], np.pi, rtol=1e-15)
    assert found[3] > 0.0
