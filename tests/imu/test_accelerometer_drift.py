"""Biases of accelerometers that drift while the poses are taken; records by a simulator that shares no code."""

import re

import imu_faults
import numpy as np
import pytest
from catalogue import imu as catalogue
from independent import imu

from inercal.findings import Status
from inercal.imu.multiposition.accelerometer import fit_accelerometer
from inercal.imu.multiposition.calibration import calibrate_multiposition
from inercal.imu.settings import ImuSettings
from inercal.records.record import record_of
from inercal.units import parse_unit

SETTINGS = ImuSettings(imu_faults.SITE)


def drifting(draw, size):
    """A calibration of a unit whose biases change by (size, -size, size) [m/s^2] from begin to end."""
    rng = np.random.default_rng([imu_faults.SEED, draw])
    made = imu.unit(rng)
    t, acc, gyro = imu.record(rng, made, imu.random_ups(rng, 24))
    t, acc, gyro = catalogue.ramp(size, 0)(t, acc, gyro, rng)
    columns = [
        (f"{sensor}_{axis}", parse_unit(unit), values[:, i])
        for sensor, unit, values in (("acc", "m/s^2", acc), ("gyro", "rad/s", gyro))
        for i, axis in enumerate("xyz")
    ]
    return calibrate_multiposition(record_of(columns, t), SETTINGS)


def said(done):
    return [each for each in done.estimate.findings if each.code == "bias_drift"]


@pytest.mark.slow
@pytest.mark.parametrize("size", [0.005, 0.05])
def test_it_is_named_with_its_size_and_ends_the_verdict(size):
    """Of three units all; each axis within 4.5 u of what it is, between the middles of the first and last pose."""
    for draw in range(3):
        done = drifting(draw, size)
        (found,) = said(done)
        assert found.harm
        assert done.estimate.status is Status.SUSPECT
        times = done.poses.times
        true = size * np.ptp(times) / done.recording.accelerometer.t[-1] * np.array([1.0, -1.0, 1.0])
        pairs = re.findall(r"(-?[\d.e-]+) ± ([\d.e-]+)", found.message)
        for (value, u), each in zip(np.array(pairs, dtype=float), true, strict=True):
            assert abs(value - each) < 4.5 * u + 1e-9


def test_without_the_drift_that_is_named_the_poses_fit_as_well_as_noise_allows():
    """Its values taken out of the mean outputs, a new fit has the squares that it was said to gain less."""
    done = drifting(0, 0.05)
    (found,) = said(done)
    values = np.array(re.findall(r"(-?[\d.e-]+) ±", found.message), dtype=float)
    poses = done.poses
    through = (poses.times - poses.times.mean()) / np.ptp(poses.times)
    before = poses.accelerometer.fit
    after = fit_accelerometer(poses.means - np.outer(through, values), imu.G).fit
    assert after.chi2 < 0.02 * before.chi2
    assert after.chi2 / after.dof < 4.0 * np.mean(poses.noise_variance)


def test_a_sound_unit_has_none():
    done = drifting(1, 0.0)
    assert said(done) == []
    assert done.estimate.status is Status.OK
