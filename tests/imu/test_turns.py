"""Verticals carried through turns: exact rotation, exact derivatives, the frame of the data irrelevant."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from inercal.foundation.geometry.rotations import exp, to_matrix
from inercal.foundation.instruments.triad import TriadModel
from inercal.systems.imu.turns import (
    attitudes,
    carried,
    carried_with_derivatives,
    cut_turns,
    first_guess,
    increments,
    thin,
    whole_turns,
)

RNG = np.random.default_rng(11)


def unpack(theta):
    """Triad and drift (3, q) of parameters: bias, scale, six misalignments by rows, and the rows of the drift."""
    misalignment = np.eye(3)
    misalignment[~np.eye(3, dtype=bool)] = theta[6:12]
    return TriadModel(theta[3:6], misalignment, theta[:3]), theta[12:].reshape(3, -1)


def some_turns(count=4, samples=120, rate=100.0):
    """Turns about changing axes, gyro output of a crooked triad, and verticals."""
    theta = np.concatenate(
        [[10.0, -4.0, 7.0], [900.0, 1100.0, 1000.0], RNG.normal(0, 0.05, 6), RNG.normal(0, 2, 9)]
    )
    model, g = unpack(theta)
    n = count * samples + 1
    t = np.arange(n) / rate
    omega = np.cumsum(RNG.normal(0, 0.15, (n, 3)), axis=0)
    force = RNG.normal(0, 5.0, (n, 3))
    y = model.indicate(omega) + force @ g.T
    spans = [(k, k * samples, (k + 1) * samples) for k in range(count)]
    up = RNG.normal(size=(count + 1, 3))
    return theta, cut_turns(t, y, force, spans), up / np.linalg.norm(up, axis=1, keepdims=True), omega, t


def test_the_true_model_undoes_output_and_leaves_rotation_vectors():
    theta, turns, _, omega, t = some_turns()
    phi = increments(turns, *unpack(theta))
    mean = 0.5 * (omega[:-1] + omega[1:]) * np.diff(t)[:, None]
    np.testing.assert_allclose(phi.transpose(1, 0, 2).reshape(-1, 3), mean, atol=1e-12)


@pytest.mark.parametrize("count", [1, 2, 50, 63])
def test_attitudes_are_products_of_rotations_as_scipy_makes_them(count):
    phi = RNG.normal(0, 0.3, (count, 3, 3))
    R = attitudes(phi)
    for m in range(3):
        product = Rotation.identity()
        for i in range(count):
            product = product * Rotation.from_rotvec(phi[i, m])
        np.testing.assert_allclose(R[-1, m], product.as_matrix(), atol=1e-12)
        np.testing.assert_allclose(whole_turns(phi)[m], product.as_matrix(), atol=1e-12)
    np.testing.assert_allclose(R[1, 0], to_matrix(exp(phi[0, 0])), atol=1e-14)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-4, 1.0, np.pi, 3.5])
def test_one_interval_of_any_angle(angle):
    phi = np.array([[[angle * 0.6, 0.0, angle * 0.8]]])
    np.testing.assert_allclose(attitudes(phi)[1, 0], Rotation.from_rotvec(phi[0, 0]).as_matrix(), atol=1e-14)


def test_a_vertical_is_carried_against_the_rotation():
    """What is fixed in space turns in the instrument by the inverse of the instrument's turn."""
    t = np.arange(101) / 100.0
    rate = np.tile([0.0, 0.0, np.pi / 2], (101, 1))  # a quarter turn about z
    turns = cut_turns(t, rate, np.zeros_like(rate), [(0, 0, 100)])
    model = TriadModel(np.ones(3), np.eye(3), np.zeros(3))
    end = carried(turns, np.array([[1.0, 0, 0], [0, 0, 0]]), model, np.zeros((3, 3)))
    np.testing.assert_allclose(end[0], [0.0, -1.0, 0.0], atol=1e-12)


def test_derivatives_are_those_of_differences():
    theta, turns, up, _, _ = some_turns()
    end, by_parameter, by_vertical = carried_with_derivatives(turns, up, *unpack(theta))
    np.testing.assert_allclose(end, carried(turns, up, *unpack(theta)), atol=1e-14)
    steps = np.concatenate([np.full(3, 1e-2), np.full(3, 1e-2), np.full(6, 1e-5), np.full(9, 1e-3)])
    for k, h in enumerate(steps):
        a, b = theta.copy(), theta.copy()
        a[k] += h
        b[k] -= h
        difference = (carried(turns, up, *unpack(a)) - carried(turns, up, *unpack(b))) / (2 * h)
        size = np.max(np.abs(difference)) + 1e-12
        # the left Jacobian is kept to third order in the angle of a sample interval, here 0.03 rad
        assert np.max(np.abs(by_parameter[..., k] - difference)) < 1e-4 * size
    for j in range(3):
        moved = up + 1e-6 * np.eye(3)[j]
        difference = (carried(turns, moved, *unpack(theta)) - end) / 1e-6
        np.testing.assert_allclose(by_vertical[..., j], difference, atol=1e-8)


def test_thinning_keeps_time_and_angle():
    theta, turns, _, _, _ = some_turns(samples=121)
    coarse = thin(turns, 8)
    np.testing.assert_allclose(coarse.durations, turns.durations, rtol=1e-12)
    model, g = unpack(theta)
    a, b = increments(coarse, model, g).sum(axis=0), increments(turns, model, g).sum(axis=0)
    np.testing.assert_allclose(a, b, atol=1e-12)


def test_the_scale_is_found_without_a_hint_and_wrong_signs_are_seen():
    rng = np.random.default_rng(5)
    for scale in (1e-2, 1.0, 57.3, 4775.0):
        count, n = 8, 200
        t = np.arange(count * n + 1) / 100.0
        axes = rng.normal(size=(count, 3))
        omega = np.repeat(axes / np.linalg.norm(axes, axis=1, keepdims=True), n, axis=0)
        omega = np.vstack([omega, omega[-1:]])
        spans = [(k, k * n, (k + 1) * n) for k in range(count)]
        turns = cut_turns(t, scale * omega, np.zeros_like(omega), spans)
        truth = TriadModel(np.full(3, scale), np.eye(3), np.zeros(3))
        up = [np.array([0.0, 0.0, 1.0])]
        for k in range(count):
            here = np.array([*up, np.zeros(3)])
            up.append(carried(turns.choose(np.array([k])), here, truth, np.zeros((3, 3)))[0])
        found, miss = first_guess(turns, np.array(up), np.zeros(3))
        assert abs(found / scale - 1) < 0.05
        assert miss < 0.1
        _, wrong = first_guess(turns, np.array(up), np.zeros(3), np.diag([1.0, -1.0, 1.0]))
        assert wrong > 0.4
