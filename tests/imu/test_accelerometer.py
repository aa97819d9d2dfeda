"""The accelerometer fit: exact on exact data, derivatives right, invariant where physics is."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inercal.foundation.geometry.rotations import conjugate, rotate
from inercal.systems.imu.identified import pose_words
from inercal.systems.imu.multiposition.accelerometer import fit_accelerometer, model_from
from inercal.systems.imu.multiposition.verdict import curing_pose
from inercal.systems.imu.simulate import hand_poses

G = 9.81


def directions(seed: int, count: int) -> np.ndarray:
    poses = hand_poses(np.random.default_rng(seed), count)
    return rotate(conjugate(poses), np.array([0.0, 0.0, 1.0]))


def theta(seed: int, scale: float = 415.0, offset: float = 33000.0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.concatenate(
        [
            offset + rng.normal(0, 0.5 * scale, 3),
            scale * (1 + rng.normal(0, 0.02, 3)),
            rng.normal(0, 0.03, 3),
        ]
    )


@settings(max_examples=30, deadline=None)
@given(
    st.integers(0, 10_000),
    st.integers(12, 40),
    st.floats(1e-3, 1e5),
    st.floats(-1e4, 1e4),
)
def test_noiseless_poses_give_the_truth_back_whatever_the_output_unit(seed, count, scale, offset):
    true = theta(seed, scale, offset * scale)
    means = model_from(true).indicate(G * directions(seed, count))
    found = fit_accelerometer(means, G)
    assert found.fit.converged
    size = np.concatenate([np.full(6, scale), np.ones(3)])
    # the offset may exceed the signal by 1e3, and costs its digits
    limit = 1e-9 + 1e-13 * np.max(np.abs(means)) / scale
    assert np.max(np.abs(found.fit.x - true) / size) < limit


def test_the_jacobian_is_the_derivative_of_the_residuals():
    true, up = theta(3), directions(3, 15)
    means = model_from(true).indicate(G * up) + np.random.default_rng(3).normal(0, 1.0, (15, 3))
    found = fit_accelerometer(means, G)

    def residual(x):
        return np.linalg.norm(model_from(x).correct(means), axis=1) - G

    steps = np.concatenate([np.full(3, 1e-1), np.full(3, 1e-3), np.full(3, 1e-6)])
    for k, h in enumerate(steps):
        up_, down = found.fit.x.copy(), found.fit.x.copy()
        up_[k] += h
        down[k] -= h
        difference = (residual(up_) - residual(down)) / (2 * h)
        np.testing.assert_allclose(found.fit.jacobian[:, k], difference, rtol=1e-5, atol=1e-9)


def test_the_gradient_by_the_output_is_the_derivative_of_the_residuals():
    true, up = theta(4), directions(4, 12)
    means = model_from(true).indicate(G * up)
    found = fit_accelerometer(means, G)
    for i in range(3):
        moved = means.copy()
        moved[:, i] += 1e-2
        change = (np.linalg.norm(found.model.correct(moved), axis=1) - G - found.fit.residuals) / 1e-2
        np.testing.assert_allclose(found.output_gradient()[:, i], change, rtol=1e-4, atol=2e-8)


def test_gravity_sets_the_scale_and_nothing_else():
    means = model_from(theta(5)).indicate(G * directions(5, 20))
    a, b = fit_accelerometer(means, G).fit.x, fit_accelerometer(means, 1.001 * G).fit.x
    np.testing.assert_allclose(b[3:6] * 1.001, a[3:6], rtol=1e-9)
    np.testing.assert_allclose(b[:3], a[:3], rtol=1e-10)
    np.testing.assert_allclose(b[6:], a[6:], atol=1e-9)


def test_the_order_of_the_poses_does_not_matter():
    rng = np.random.default_rng(6)
    means = model_from(theta(6)).indicate(G * directions(6, 20)) + rng.normal(0, 1.0, (20, 3))
    shuffled = means[rng.permutation(20)]
    np.testing.assert_allclose(
        fit_accelerometer(shuffled, G).fit.x, fit_accelerometer(means, G).fit.x, rtol=1e-7
    )


def test_the_covariance_is_that_of_a_monte_carlo():
    """Ratio of empirical to stated variance within its own chi-square limits (400 draws, 9 parameters)."""
    rng = np.random.default_rng(7)
    true, up = theta(7), directions(7, 20)
    clean, sigma = model_from(true).indicate(G * up), 0.4
    stated, errors = None, []
    for _ in range(400):
        found = fit_accelerometer(clean + rng.normal(0, sigma, clean.shape), G, true)
        errors.append(found.fit.x - true)
        if stated is None:
            gain = found.fit.gain()
            variance = np.sum(found.output_gradient() ** 2, axis=1) * sigma**2
            stated = np.diag((gain * variance) @ gain.T)
    ratio = np.var(errors, axis=0) / stated
    spread = np.sqrt(2 / 400)
    assert np.all(np.abs(ratio - 1) < 4 * spread)


def test_weak_poses_are_cured_by_the_pose_it_names():
    """Without any pose between x and y, M_xy is free; the named pose brings it back."""
    axes = np.vstack([np.eye(3), -np.eye(3)])
    tilted = np.array([[0, 1, 1], [0, -1, 1], [1, 0, 1], [-1, 0, 1], [0, 1, -1], [1, 0, -1]]) / np.sqrt(2)
    up = np.vstack([axes, tilted])
    means = model_from(theta(8)).indicate(G * up)
    weak = fit_accelerometer(means, G, theta(8))
    assert weak.fit.identifiability.condition > 1e6
    assert weak.fit.identifiability.leading_term() == "M_xy"
    cure = curing_pose(weak, G)
    assert pose_words(cure) in ("+x +y", "-x -y", "+x -y", "-x +y")
    more = np.vstack([up, cure])
    cured = fit_accelerometer(model_from(theta(8)).indicate(G * more), G, theta(8))
    assert cured.fit.identifiability.condition < 50


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4])
def test_the_condition_number_does_not_depend_on_units(scale):
    up = directions(9, 16)
    base = fit_accelerometer(model_from(theta(9, 1.0, 0.3)).indicate(G * up), G)
    other = fit_accelerometer(scale * model_from(theta(9, 1.0, 0.3)).indicate(G * up), G)
    assert other.fit.identifiability.condition == pytest.approx(base.fit.identifiability.condition, rel=1e-6)
