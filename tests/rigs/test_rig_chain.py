"""Chains of transforms: products of rotations and shifts, their derivatives, and errors drawn by scope."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from inercal.foundation.geometry.rotations import elementary, exp, to_matrix
from inercal.foundation.rigs.chain import Chain, Error, Fixed, Joint, Scope, about
from inercal.foundation.rigs.patterns import density, normal, uniform
from inercal.foundation.rigs.tables import turntable

ARC_MINUTE = np.radians(1.0 / 60.0)
ANGLE = st.floats(-10.0, 10.0)
VECTOR = st.tuples(*[st.floats(-3.0, 3.0)] * 3).filter(lambda v: np.linalg.norm(v) > 1e-3)


def error(name, axis="x", scope=Scope.RIG, is_offset=False, size=0.1):
    return Error(name, axis, uniform(size), scope, is_offset=is_offset)


def any_chain(seed, length=12):
    """A chain of fixed rotations, joints and errors in any order."""
    rng = np.random.default_rng(seed)
    elements = []
    for i in range(length):
        kind, axis = rng.integers(4), "xyz"[rng.integers(3)]
        if kind == 0:
            elements.append(Fixed(Rotation.random(rng=rng).as_matrix(), rng.normal(size=3)))
        elif kind == 1:
            elements.append(Joint(f"j{i}", axis))
        else:
            elements.append(error(f"e{i}", axis, is_offset=kind == 2))
    chain = Chain(tuple(elements))
    angles, errors = rng.uniform(-np.pi, np.pi, len(chain.joints)), rng.normal(size=(5, len(chain.errors)))
    return chain, angles, errors


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_attitudes_are_rotations(seed):
    chain, angles, errors = any_chain(seed)
    C = chain.attitude(angles, errors)
    assert_allclose(C @ np.swapaxes(C, -1, -2), np.broadcast_to(np.eye(3), C.shape), atol=1e-13)
    assert_allclose(np.linalg.det(C), 1.0, atol=1e-13)


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_the_pose_turns_as_the_attitude_does(seed):
    chain, angles, errors = any_chain(seed)
    pose = chain.pose(angles, errors)
    assert_allclose(pose[..., :3, :3], chain.attitude(angles, errors), atol=1e-14)
    assert_array_equal(pose[..., 3, :], np.broadcast_to([0.0, 0.0, 0.0, 1.0], (5, 4)))


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_errors_are_exchanged_one_after_the_other(seed):
    chain, angles, errors = any_chain(seed)
    others = errors[::-1] + 0.3
    exchanged = chain.exchanged(angles, errors, others)
    assert exchanged.shape == (len(chain.errors), 5, 3, 3)
    for k, C_nb in enumerate(exchanged):
        mixed = errors.copy()
        mixed[:, k] = others[:, k]
        assert_allclose(C_nb, chain.attitude(angles, mixed), atol=1e-13)


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_slopes_are_the_derivatives_of_the_attitude(seed):
    """Central differences, error step^2 / 6 times the third derivative (of size one)."""
    chain, angles, _ = any_chain(seed)
    k, step = len(chain.errors), 1e-4
    steps = step * np.eye(k)
    found = (chain.attitude(angles, steps) - chain.attitude(angles, -steps)) / (2.0 * step)
    slopes = chain.slopes(angles)
    assert slopes.shape == (k, 3, 3)
    assert_allclose(slopes, found.reshape(k, 3, 3), atol=2.0 * step**2)
    assert not slopes[[each.is_offset for each in chain.errors]].any()


def test_angles_and_errors_broadcast():
    chain = turntable("two_axis_turntable", uniform(ARC_MINUTE))
    rng = np.random.default_rng(1)
    angles, errors = rng.uniform(0.0, 6.0, (4, 1, 2)), rng.normal(size=(7, 11))
    C = chain.attitude(angles, errors)
    assert C.shape == (4, 7, 3, 3)
    assert chain.pose(angles, errors).shape == (4, 7, 4, 4)
    assert chain.slopes(angles).shape == (4, 1, 11, 3, 3)
    assert_array_equal(C[2, 3], chain.attitude(angles[2, 0], errors[3]))


def test_offsets_move_the_load_along_the_turned_axes():
    """Up by 2 m, a quarter turn about the vertical, then 0.5 m along the turned x axis, which is y of the base."""
    chain = Chain(
        (
            Fixed(offset=np.array([0.0, 0.0, 2.0])),
            Joint("turn", "z"),
            error("arm", "x", is_offset=True),
            error("wobble", "x"),
        )
    )
    pose = chain.pose([0.5 * np.pi], [0.5, 0.3])
    assert_allclose(pose[:3, 3], [0.0, 0.5, 2.0], atol=1e-15)
    assert_allclose(pose[:3, :3], elementary("z", 0.5 * np.pi) @ elementary("x", 0.3), atol=1e-15)


def test_the_offset_of_a_transform_is_in_the_frame_before_it():
    turn = elementary("z", 0.5 * np.pi)
    chain = Chain((Fixed(turn, np.array([1.0, 0.0, 0.0])), Fixed(turn, np.array([1.0, 0.0, 0.0]))))
    assert_allclose(chain.pose(np.zeros(0))[:3, 3], [1.0, 1.0, 0.0], atol=1e-15)


@settings(deadline=None, max_examples=50)
@given(VECTOR, ANGLE, st.sampled_from("xyz"))
def test_an_element_about_any_axis(axis, angle, own):
    """It is the exponential of the rotation vector, whatever the element's own axis."""
    C = to_matrix(exp(angle * np.array(axis) / np.linalg.norm(axis)))
    assert_allclose(Chain(about(axis, Joint("turn", own))).attitude([angle]), C, atol=1e-13)
    assert_allclose(Chain(about(axis, error("turn", own))).attitude([], [angle]), C, atol=1e-13)


def test_a_shift_along_any_axis():
    axis = np.array([1.0, -2.0, 2.0])
    pose = Chain(about(axis, error("shift", "y", is_offset=True))).pose([], [0.6])
    assert_allclose(pose[:3, 3], [0.2, -0.4, 0.4], atol=1e-15)
    assert_allclose(pose[:3, :3], np.eye(3), atol=1e-15)


def test_an_axis_without_length_is_refused():
    with pytest.raises(ValueError, match="expected one with a length"):
        about([0.0, 0.0, 0.0], Joint("turn", "x"))


def test_scopes_say_how_long_an_error_lasts():
    scopes = (Scope.SAMPLE, Scope.POSITION, Scope.RUN, Scope.RIG)
    assert [scope.constant for scope in scopes] == [False, False, True, True]
    chain = Chain(tuple(error(scope.value, scope=scope) for scope in scopes))
    drawn = chain.draw(np.random.default_rng(2), positions=6, runs=50)
    assert drawn.shape == (50, 6, 4)
    constant = np.ptp(drawn, axis=1) == 0.0
    assert_array_equal(constant, np.broadcast_to([False, False, True, True], (50, 4)))
    assert len(np.unique(drawn[:, :, :2])) == 50 * 6 * 2
    assert len(np.unique(drawn[:, :, 2:])) == 50 * 2
    assert chain.draw(np.random.default_rng(2), positions=6).shape == (6, 4)


def test_draws_follow_each_distribution():
    """Mean and variance of 1e5 draws, to five standard deviations of theirs."""
    n = 100_000
    laws = (uniform(0.2), normal(0.3), density(lambda x: x, 0.0, 1.0))
    chain = Chain(tuple(Error(f"e{i}", "x", law, Scope.POSITION) for i, law in enumerate(laws)))
    drawn = chain.draw(np.random.default_rng(3), n)
    std = np.array([0.2 / np.sqrt(3.0), 0.3, np.sqrt(1.0 / 18.0)])
    assert_allclose(chain.std, std, rtol=1e-12)
    assert_array_equal(np.abs(drawn.mean(axis=0) - [0.0, 0.0, 2.0 / 3.0]) < 5.0 * std / np.sqrt(n), True)
    assert_allclose(drawn.std(axis=0), std, rtol=5.0 / np.sqrt(2.0 * n))


def test_errors_are_changed_by_name():
    chain = turntable("two_axis_turntable", uniform(ARC_MINUTE))
    wider = chain.with_errors(error("deps_x", size=0.5), error("dtheta_z", "z", size=0.25))
    assert wider.factors == chain.factors
    changed = wider.std != chain.std
    assert {name for name, each in zip(chain.factors, changed, strict=True) if each} == {"deps_x", "dtheta_z"}
    assert all(each.scope is Scope.POSITION for each in chain.with_scope(Scope.POSITION).errors)
    with pytest.raises(KeyError, match="dfoo"):
        chain.with_errors(error("dfoo"))


def test_a_name_occurs_once():
    """An error at two places would not be independent of itself."""
    with pytest.raises(ValueError, match="found a twice"):
        Chain((error("a"), Joint("b", "z"), error("a", "y")))
    with pytest.raises(ValueError, match="found b twice"):
        Chain((error("b"), Joint("b", "z")))


@pytest.mark.parametrize(
    ("angles", "errors", "message"),
    [
        ([1.0], [0.0], r"angles of shape \(1,\), expected 2"),
        (1.0, [0.0], r"angles of shape \(\), expected 2"),
        ([1.0, 2.0], [[0.0, 0.0]], r"errors of shape \(1, 2\), expected 1"),
    ],
)
def test_arrays_of_another_length_are_refused(angles, errors, message):
    chain = Chain((Joint("j1", "y"), error("e"), Joint("j2", "z")))
    with pytest.raises(ValueError, match=message):
        chain.attitude(angles, errors)


def test_a_chain_without_errors_has_no_slopes():
    chain = Chain((Joint("j", "y"),))
    assert chain.slopes(np.zeros((3, 1))).shape == (3, 0, 3, 3)
    assert chain.factors == ()
