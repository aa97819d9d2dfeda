"""Attitudes are a group that acts on vectors: the axioms, on batches, near identity and near pi."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from inercal.foundation.geometry import rotations

TOLERANCE = 1e-14
IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])
SHAPES = [(), (1,), (3, 1, 2)]
few = settings(max_examples=40, deadline=None)


def sample(kind, shape, seed):
    """Unit quaternions: uniform, or turned about random axes by angles near 0 or near pi."""
    rng = np.random.default_rng(seed)
    q = rotations.normalize(rng.normal(size=(*shape, 4)))
    axis = rotations.normalize(rng.normal(size=(*shape, 3)))
    small = 1e-7 * rng.normal(size=(*shape, 1))
    sign = rng.choice([-1.0, 1.0], size=(*shape, 1))
    return {
        "uniform": q,
        "near identity": sign * rotations.exp(small * axis),
        "near pi": sign * rotations.exp((np.pi - small) * axis),
    }[kind]


@st.composite
def attitudes(draw, count):
    """``count`` batches of attitudes, of one shape and of mixed kinds."""
    shape = draw(st.sampled_from(SHAPES))
    kinds = st.sampled_from(["uniform", "near identity", "near pi"])
    return [sample(draw(kinds), shape, draw(st.integers(0, 2**32 - 1))) for _ in range(count)]


def vectors(q, seed=5):
    """One random vector for each attitude."""
    return np.random.default_rng(seed).normal(size=(*q.shape[:-1], 3))


def assert_same_attitude(p, q, atol=TOLERANCE):
    """Equal up to the sign of the quaternion: the double cover, in one place."""
    assert p.shape == q.shape
    flipped = np.where(np.sum(p * q, axis=-1, keepdims=True) < 0.0, -q, q)
    assert_allclose(p, flipped, rtol=0, atol=atol)


def scipy_rotation(q):
    return Rotation.from_quat(q, scalar_first=True)


@few
@given(attitudes(2))
def test_closure(pq):
    """The product of two unit quaternions is one, and its matrix is orthogonal with determinant +1."""
    r = rotations.multiply(*pq)
    C = rotations.to_matrix(r)
    assert_allclose(np.linalg.norm(r, axis=-1), 1.0, atol=TOLERANCE)
    assert_allclose(C @ C.swapaxes(-1, -2), np.broadcast_to(np.eye(3), C.shape), atol=TOLERANCE)
    assert_allclose(np.linalg.det(C), 1.0, atol=TOLERANCE)


@few
@given(attitudes(1))
def test_identity(q):
    assert_same_attitude(rotations.multiply(q[0], IDENTITY), q[0])
    assert_same_attitude(rotations.multiply(IDENTITY, q[0]), q[0])


@few
@given(attitudes(1))
def test_inverse(q):
    identity = np.broadcast_to(IDENTITY, q[0].shape)
    assert_same_attitude(rotations.multiply(q[0], rotations.conjugate(q[0])), identity)
    assert_same_attitude(rotations.multiply(rotations.conjugate(q[0]), q[0]), identity)


@few
@given(attitudes(3))
def test_associativity(pqr):
    p, q, r = pqr
    left = rotations.multiply(rotations.multiply(p, q), r)
    assert_same_attitude(left, rotations.multiply(p, rotations.multiply(q, r)))


@few
@given(attitudes(1))
def test_exp_undoes_log(q):
    rotvec = rotations.log(q[0])
    assert np.all(np.linalg.norm(rotvec, axis=-1) <= np.pi * (1.0 + 1e-15))
    assert_same_attitude(rotations.exp(rotvec), q[0])


@few
@given(attitudes(1), st.floats(0.0, 1.0))
def test_log_undoes_exp_below_pi(q, fraction):
    rotvec = fraction * (1.0 - 1e-12) * rotations.log(q[0])
    assert_allclose(rotations.log(rotations.exp(rotvec)), rotvec, atol=TOLERANCE)


@few
@given(attitudes(1))
def test_quaternion_undoes_matrix(q):
    back = rotations.from_matrix(rotations.to_matrix(q[0]))
    assert np.all(back[..., 0] >= 0.0)
    assert_same_attitude(back, q[0])


@few
@given(attitudes(2))
def test_the_matrix_of_a_product_is_the_product_of_the_matrices(pq):
    p, q = pq
    product = rotations.to_matrix(rotations.multiply(p, q))
    assert_allclose(product, rotations.to_matrix(p) @ rotations.to_matrix(q), atol=TOLERANCE)


@few
@given(attitudes(2))
def test_action_is_compatible_with_the_product(pq):
    """(p q) v = p (q v), lengths are kept, and quaternion and matrix act alike."""
    p, q = pq
    v = vectors(q)
    turned = rotations.rotate(q, v)
    composed = rotations.rotate(rotations.multiply(p, q), v)
    assert_allclose(composed, rotations.rotate(p, turned), atol=2 * TOLERANCE)
    assert_allclose(np.linalg.norm(turned, axis=-1), np.linalg.norm(v, axis=-1), rtol=TOLERANCE)
    assert_allclose(turned, np.einsum("...ij,...j->...i", rotations.to_matrix(q), v), atol=2 * TOLERANCE)


@few
@given(attitudes(2))
def test_q_and_minus_q_are_one_attitude(pq):
    p, q = pq
    v = vectors(q)
    assert_allclose(rotations.to_matrix(-q), rotations.to_matrix(q), rtol=0, atol=0)
    assert_allclose(rotations.rotate(-q, v), rotations.rotate(q, v), rtol=0, atol=0)
    assert_same_attitude(rotations.exp(rotations.log(-q)), q)
    difference = rotations.attitude_difference(p, q)
    assert_allclose(rotations.attitude_difference(-p, q), difference, rtol=0, atol=0)


@few
@given(attitudes(2))
def test_boxplus_undoes_boxminus(pq):
    p, q = pq
    delta = rotations.boxminus(p, q)
    assert_same_attitude(rotations.boxplus(q, delta), p)
    angle = rotations.attitude_difference(p, q)
    assert_allclose(np.linalg.norm(delta, axis=-1), angle, atol=TOLERANCE)


@few
@given(attitudes(3))
def test_attitude_difference_is_a_metric_that_no_rotation_changes(pqr):
    p, q, r = pqr
    d = rotations.attitude_difference
    assert_allclose(d(p, q), d(q, p), atol=TOLERANCE)
    assert np.all(d(p, r) <= d(p, q) + d(q, r) + TOLERANCE)
    assert_allclose(d(rotations.multiply(r, p), rotations.multiply(r, q)), d(p, q), atol=TOLERANCE)


@few
@given(attitudes(1), st.integers(0, 2**32 - 1))
def test_mean_turns_with_its_attitudes_and_ignores_their_signs(q, seed):
    rng = np.random.default_rng(seed)
    cloud = rotations.exp(0.3 * rng.normal(size=(7, 3)))
    turned = rotations.multiply(q[0][..., None, :], cloud)
    flipped = turned * rng.choice([-1.0, 1.0], size=(7, 1))
    assert_same_attitude(rotations.mean(flipped), rotations.multiply(q[0], rotations.mean(cloud)))


@few
@given(attitudes(2))
def test_scipy_agrees(pq):
    """An independent implementation gives the same product, action, matrix, logarithm and difference."""
    p, q = (a.reshape(-1, 4) for a in pq)
    P, Q, v = scipy_rotation(p), scipy_rotation(q), vectors(q)
    assert_same_attitude(rotations.multiply(p, q), (P * Q).as_quat(scalar_first=True))
    assert_allclose(rotations.rotate(q, v), Q.apply(v), atol=2 * TOLERANCE)
    assert_allclose(rotations.to_matrix(q), Q.as_matrix(), atol=TOLERANCE)
    assert_same_attitude(rotations.exp(Q.as_rotvec()), q)
    assert_same_attitude(rotations.from_matrix(Q.as_matrix()), q)
    assert_allclose(rotations.attitude_difference(p, q), (P.inv() * Q).magnitude(), atol=TOLERANCE)


@few
@given(st.integers(0, 2**32 - 1))
def test_scipy_agrees_on_the_weighted_mean(seed):
    rng = np.random.default_rng(seed)
    q, weights = rotations.exp(0.5 * rng.normal(size=(6, 3))), rng.uniform(0.1, 1.0, 6)
    expected = scipy_rotation(q).mean(weights).as_quat(scalar_first=True)
    assert_same_attitude(rotations.mean(q, weights), expected, atol=1e-13)
