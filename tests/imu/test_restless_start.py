"""A start in the hand, a start in a turn, outputs without noise: the noise is that of all poses."""

from dataclasses import replace

import numpy as np
import pytest
from independent import imu
from independent_recordings import SETTINGS, calibrated
from recordings import arrays, record_of
from scipy.stats import chi2

from inercal.foundation.findings import Status
from inercal.systems.imu.simulate import TriadNoise, draw_truth, hand_poses, simulate
from inercal.systems.imu.task import calibrate
from rows import for_each


@pytest.mark.parametrize("tremor", [(0.05, 0.02), pytest.param((0.01, 0.004), marks=pytest.mark.campaign)])
def test_five_units_held_in_the_hand_at_the_start(tremor):
    """Five starts in the hand for 20 s: u of the accelerometers as after a quiet start, errors those of chi-square.

    5 x 9 errors over u lie in the 99.9 % range of chi-square. Errors of one unit are correlated, so that the range is
    that of three independent ones in each unit; u within a factor of the quiet start that the 15 degrees of freedom of
    either scatter allow at 99.9 %.
    """
    low, high = np.sqrt(chi2.ppf([5e-4, 1.0 - 5e-4], 15) / 15)
    errors, ratios = [], []
    for seed in range(5):
        quiet, _ = calibrated(seed)
        restless, error = calibrated(seed, imu.Faults(20.0, *tremor))
        estimate = restless.estimate
        assert estimate.status is Status.OK
        errors.append(error[:9])
        ratios.append(np.mean(estimate.u[:9] / quiet.estimate.u[:9]))
        assert np.mean(estimate.u[9:] / quiet.estimate.u[9:]) < 1.5
    assert low < np.sqrt(np.mean(np.square(errors))) < high
    assert max(ratios) < high / low
    assert 0.6 < np.exp(np.mean(np.log(ratios))) < 1.6


def test_a_record_that_begins_in_a_turn_needs_no_quiet_start():
    rng = np.random.default_rng(16)
    record, _ = simulate(draw_truth(rng), hand_poses(rng, 22), 9.81, 0.8, rng, rate=50.0)
    t, acc, gyro = (part[1520:] for part in arrays(record))
    estimate = calibrate(record_of(t, acc, gyro), SETTINGS).estimate
    assert estimate.status is Status.OK


@for_each("step", [0.0, 0.05])
def test_outputs_without_noise_at_rest_are_calibrated(step):
    """Outputs that never change in a hold, exact or in steps of 5 mg: the scatter of the poses is in u.

    Rounding errors scatter by step/sqrt(12): u of the biases is that over some root of 24 poses at least.
    """
    rng = np.random.default_rng(5)
    truth = replace(draw_truth(rng), accelerometer_noise=TriadNoise(0.0), gyro_noise=TriadNoise(5e-6))
    record, truth = simulate(truth, hand_poses(rng, 24), 9.81, 0.8, rng, rate=50.0)
    t, acc, gyro = arrays(record)
    if step:
        acc = 415.0 * step * np.round(acc / 415.0 / step)
    estimate = calibrate(record_of(t, acc, gyro), replace(SETTINGS, k2=True)).estimate
    assert estimate.status is Status.OK
    true = truth.values()
    names = [name for name in estimate.names if name in true and name[0] in "KM"]
    error = np.array([estimate[name].value - true[name] for name in names])
    if step:
        assert np.max(np.abs(error / [estimate[name].u for name in names])) < 5.0
        assert estimate["K0_x"].u > 415.0 * step / np.sqrt(12) / np.sqrt(24)
    else:
        assert np.max(np.abs(error)) < 1e-3
