"""One covariance: its gains are the derivatives of the whole estimate, and its type B inputs those of re-fits."""

from dataclasses import replace

import numpy as np
import pytest
from recordings import arrays, record_of

from inercal.foundation.geometry.earth import GravityInput, Site
from inercal.systems.imu.multiposition.calibration import calibrate_multiposition as calibrate
from inercal.systems.imu.multiposition.gyro import _excess
from inercal.systems.imu.settings import ImuSettings
from inercal.systems.imu.simulate import draw_truth, hand_poses, simulate

SETTINGS = ImuSettings(Site(9.81, (), 0.8), g_sensitivity=True)


@pytest.fixture(scope="module")
def record():
    rng = np.random.default_rng(31)
    return simulate(draw_truth(rng, 2e-4), hand_poses(rng, 18), 9.81, 0.8, rng, rate=50.0)[0]


def shift(base, other):
    return other.values - base.values


def test_gravity_moves_the_estimate_as_the_budget_says(record):
    """A re-fit at another gravity against the type B item that an uncertain gravity makes."""
    step = 1e-3
    base = calibrate(record, SETTINGS).estimate
    moved = calibrate(record, replace(SETTINGS, site=Site(9.81 + step, (), 0.8))).estimate
    unsure = Site(9.81, (GravityInput("gravity", step, "m/s^2", 1.0),), 0.8)
    stated = calibrate(record, replace(SETTINGS, site=unsure)).estimate
    added = stated.covariance - base.covariance
    real = shift(base, moved)
    size = np.sqrt(np.diag(base.covariance))
    assert np.max(np.abs(added - np.outer(real, real)) / np.outer(size, size)) < 1e-2
    rows = [i for i, name in enumerate(base.names) if name.startswith(("K1_", "G_"))]
    np.testing.assert_allclose(real[rows], -base.values[rows] * step / 9.81, rtol=2e-2, atol=1e-5)


def test_the_clock_moves_the_estimate_as_the_budget_says(record):
    step = 1e-3
    base = calibrate(record, SETTINGS).estimate
    t, acc, gyro = arrays(record)
    moved = calibrate(record_of(t * (1.0 + step), acc, gyro), SETTINGS).estimate
    stated = calibrate(record, replace(SETTINGS, time_base_u=step)).estimate
    rows = [i for i, name in enumerate(base.names) if name.startswith("S_")]
    np.testing.assert_allclose(shift(base, moved)[rows], base.values[rows] * step, rtol=5e-3)
    added = np.sqrt(np.diag(stated.covariance - base.covariance)[rows])
    np.testing.assert_allclose(added, np.abs(base.values[rows]) * step, rtol=1e-6)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_the_gain_of_a_pose_is_what_moving_it_does(record, axis):
    """Shift the accelerometers in one pose by a constant: all coefficients move as ``by_force`` says."""
    t, acc, gyro = arrays(record)
    base = calibrate(record, SETTINGS)
    poses, k = base.poses, 7
    dwell = poses.dwells[k]
    model = poses.accelerometer.model
    error = np.zeros(3)
    error[axis] = 3e-4  # [m/s^2]
    spoiled = acc.copy()
    spoiled[dwell.start : dwell.stop] += model.gain @ error
    moved = calibrate(record_of(t, spoiled, gyro), SETTINGS)
    assert moved.poses.dwells == poses.dwells
    from inercal.systems.imu.multiposition.joint import join

    joint = join(poses.accelerometer, base.gyro)
    predicted = joint.by_force[:, 3 * k : 3 * k + 3] @ error
    found = shift(base.estimate, moved.estimate)
    # the weights of the fit move a little too; what is left is second order
    assert np.max(np.abs(found - predicted) / base.estimate.u) < 0.02
    assert np.max(np.abs(predicted) / base.estimate.u) > 0.05


def test_the_excess_variance_brings_the_sum_of_squares_down_to_its_degrees_of_freedom():
    rng = np.random.default_rng(32)
    m = 60
    durations = rng.uniform(1.0, 6.0, m)
    root = rng.normal(0.0, 0.02, (m, m)) / np.sqrt(m)
    known = root @ root.T
    miss = rng.normal(0.0, np.sqrt(np.diag(known) + 1e-3 * durations))
    variance = _excess(miss, known, durations, 50.0)
    total = miss @ np.linalg.solve(known + variance * np.diag(durations), miss)
    assert total == pytest.approx(50.0, rel=1e-6)
    assert _excess(1e-6 * miss, known + 1e-6 * np.eye(m), durations, 50.0) < 1e-12


def test_pooling_uses_the_scatter_alone_where_it_is_clearly_larger():
    """Small noise at rest and poses that scatter: the finding says so and dof are those of the residuals."""
    rng = np.random.default_rng(33)
    record, _ = simulate(draw_truth(rng), hand_poses(rng, 20), 9.81, 0.8, rng, rate=50.0)
    quiet = calibrate(record, replace(SETTINGS, g_sensitivity=False, k2_u=0.0))
    assert not any(f.code == "excess_scatter" for f in quiet.estimate.findings)
    assert quiet.estimate["M_xy"].dof > 11
    t, acc, gyro = arrays(record)
    for dwell in quiet.poses.dwells:
        acc[dwell.start : dwell.stop] += rng.normal(0.0, 2.0, 3)
    loud = calibrate(record_of(t, acc, gyro), replace(SETTINGS, g_sensitivity=False, k2_u=0.0)).estimate
    assert any(f.code == "excess_scatter" for f in loud.findings)
    assert loud["M_xy"].dof == pytest.approx(11, rel=1e-6)
    assert loud["M_xy"].u > 2 * quiet.estimate["M_xy"].u
