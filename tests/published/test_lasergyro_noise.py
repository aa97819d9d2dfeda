"""The ring-laser IMU of PSINS, 30.8 minutes at rest: overlapping Allan deviations of all axes.

PSINS (Yan Gongmin, BSD 2-clause), data/lasergyro.imu: increments at 100 Hz of 0.1 arcsec and 125 ug s, with the g of
PSINS, 9.780327 m/s^2. Values by AllanTools 2024.6 (oadev) of the rates in deg/h and the accelerations in m/s^2.
"""

import gzip
from importlib.resources import files

import numpy as np
import pytest

from inercal.noise.coefficients import noise_coefficients
from inercal.noise.deviation import allan_deviation

ROWS, INTERVAL = 184718, 0.01
TAU = (0.01, 0.2, 1.0, 10.0, 100.0, 500.0)
PUBLISHED = {
    "gyro_x": (53.11216154222367, 55.28366668891407, 17.352969950226534, 8.420291462833005, 2.0748463944562054,
               0.3194956678121396),
    "gyro_y": (56.81165185739366, 128.1875331885039, 60.656479319263276, 14.691978514290197, 2.66111878764186,
               0.4537886630546319),
    "gyro_z": (34.17169766901764, 50.38408587559926, 8.706210606352899, 1.4944848730466624, 0.2505152923013912,
               0.04448235426420036),
    "acc_x": (0.14307288711849164, 0.014604474528502432, 0.0033162295996531544, 0.003313031327114284,
              0.004916001860501169, 0.0064184533246514726),
    "acc_y": (0.21979115672086524, 0.011763481128776352, 0.002130768502095728, 0.002241797729258805,
              0.003906793938657779, 0.007648501098920952),
    "acc_z": (0.15447873140045076, 0.015491746861201043, 0.0021488211484324503, 0.0002479537594927087,
              8.300677745884409e-05, 0.00015205098080045296),
}  # fmt: skip


@pytest.fixture(scope="module")
def rates():
    """Rates [deg/h] and accelerations [m/s^2] (rows, 6)."""
    with gzip.open(str(files("inercal") / "examples" / "lasergyro.txt.gz"), "rt") as file:
        increments = np.loadtxt(file.readlines()[-ROWS:])
    assert increments.shape == (ROWS, 6)
    return increments * np.repeat([0.1, 125e-6 * 9.780327], 3) / INTERVAL


def test_deviations(rates):
    found = allan_deviation(rates, INTERVAL, TAU)
    assert found.terms[0, 0] == ROWS - 1
    assert found.terms[-1, 0] == 84719
    for channel, values in enumerate(PUBLISHED.values()):
        np.testing.assert_allclose(found.deviation[:, channel], values, rtol=1e-10)


def test_limits_hold_the_deviation_and_widen_with_time(rates):
    found = allan_deviation(rates, INTERVAL)
    assert np.all((found.lower < found.deviation) & (found.deviation < found.upper))
    width = (found.upper - found.lower) / found.deviation
    assert np.all(width[0] < 0.01)
    assert np.all(width[-1] > 0.2)


def test_dither_is_no_noise_of_the_five_kinds(rates):
    """The gyros have a hump at 0.1 s to 0.3 s: it is left out of the fit, and that is said."""
    found = allan_deviation(rates[:, :3], INTERVAL)
    for channel in range(3):
        fit = noise_coefficients(found, channel)
        assert fit.fit_range[0] > 0.3
        assert "noise_misfit" in [each.code for each in fit.findings]
        measured = np.interp(30.0, found.tau, found.deviation[:, channel])
        assert np.sqrt(fit.variance(np.array(30.0))) == pytest.approx(measured, rel=0.3)
