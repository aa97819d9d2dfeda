"""K2 of accelerometers in the hand: fitted where it is asked for, and else named where it would matter."""

from dataclasses import replace

import numpy as np
import pytest
from independent import imu
from independent_recordings import SETTINGS, calibrated
from scipy.stats import chi2

from inercal.findings import Status
from inercal.imu.multiposition.accelerometer import fit_accelerometer, specific_force

G = 9.81
FITTED = replace(SETTINGS, k2=True)
NAVIGATION = {"acc_noise": 2e-5, "gyro_noise": 1e-6}


def outputs(rng, n, k2):
    """Means of a unit in ``n`` poses, K1 (l + K2 l^2) + K0 written out here."""
    made = imu.unit(rng)
    f = imu.random_ups(rng, n) * G
    along = f @ (made.A / np.diag(made.A)[:, None]).T
    return made, f, np.diag(made.A) * (along + k2 * along**2) + made.a0


def test_without_noise_the_truth_comes_back_and_derivatives_are_those_of_differences():
    rng = np.random.default_rng(0)
    k2 = np.array([2e-4, -1e-4, 5e-5])
    made, f, y = outputs(rng, 20, k2)
    acc = fit_accelerometer(y, G, squares=True)
    truth = made.truth() | {f"K2_{axis}": k for axis, k in zip("xyz", k2, strict=True)}
    np.testing.assert_allclose(acc.fit.x, [truth[name] for name in acc.names], atol=1e-9)
    np.testing.assert_allclose(acc.f, f, atol=1e-8)
    step = 1e-5
    for i in range(3):
        moved = acc.correct(y + step * np.eye(3)[i])
        np.testing.assert_allclose(
            (np.linalg.norm(moved, axis=1) - G) / step, acc.output_gradient()[:, i], atol=1e-6
        )
        square = specific_force(acc.model, acc.k2 + step * np.eye(3)[i], y)
        np.testing.assert_allclose(
            (square - acc.f) / step, acc.force_by_squares()[..., i], rtol=3e-2, atol=0.2
        )


def chi_square_of(runs, first=0):
    """Sum of squares of the three errors of K2 over u, whitened by their own covariance."""
    total = 0.0
    for seed in range(first, first + runs):
        k2 = np.random.default_rng(seed).normal(0.0, 1e-5, 3)
        calibration, _ = calibrated(seed, settings=FITTED, poses=36, k2=k2, rate=25.0, start=10.0)
        estimate = calibration.estimate
        assert estimate.status is Status.OK
        k = [estimate.names.index(f"K2_{axis}") for axis in "xyz"]
        error = estimate.values[k] - k2
        total += error @ np.linalg.solve(estimate.covariance[np.ix_(k, k)], error)
    return total


def test_uncertainties_of_k2_are_true():
    """8 runs: the sum of squares is chi-square of 24, within its 99.9 % range."""
    low, high = chi2.ppf([5e-4, 1.0 - 5e-4], 24)
    assert low < chi_square_of(8) < high


@pytest.mark.campaign
def test_uncertainties_of_k2_are_true_in_100_runs():
    low, high = chi2.ppf([5e-4, 1.0 - 5e-4], 300)
    assert low < chi_square_of(100, 1000) < high


def test_nineteen_square_poses_of_a_good_unit_say_what_k2_would_do():
    """K2 of 30 ug/g^2 shifts K0 by more than 10 u: suspect, named, and sound once it is fitted."""
    k2 = 3e-6
    left, error = calibrated(1, ups=imu.square_ups, poses=19, k2=k2, **NAVIGATION)
    assert left.estimate.status is Status.SUSPECT
    (finding,) = (f for f in left.estimate.findings if f.code == "unmodelled_k2")
    assert {"K0_x", "K0_y", "K0_z"} <= set(finding.harm)
    assert "imu.k2 = true" in finding.message
    assert np.max(np.abs(error[:3])) > 2.0
    fitted, error = calibrated(1, settings=FITTED, ups=imu.square_ups, poses=19, k2=k2, **NAVIGATION)
    assert fitted.estimate.status is Status.OK
    assert np.max(np.abs(error)) < 5.0
    assert fitted.estimate.parameters["K2_x"].unit == "1/(m/s^2)"


def test_ten_poses_cannot_tell_k2_and_a_good_unit_is_suspect_without():
    left, _ = calibrated(2, poses=12, **NAVIGATION)
    assert left.estimate.status is Status.SUSPECT
    (finding,) = (f for f in left.estimate.findings if f.code == "unmodelled_k2")
    assert "add poses on the edges" in finding.message
