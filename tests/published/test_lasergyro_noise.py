"""The ring-laser IMU of PSINS, 30.8 minutes at rest: overlapping Allan deviations of all axes.

PSINS (Yan Gongmin, BSD 2-clause), data/lasergyro.imu: increments at 100 Hz of 0.1 arcsec and 125 ug s, with the g of
PSINS, 9.780327 m/s^2. Values by AllanTools 2024.6 (oadev) of the rates in deg/h and the accelerations in m/s^2.
"""

import gzip
from importlib.resources import files

import numpy as np
import pytest

from inercal.faces.validate.foundation import ALLANTOOLS, TAU
from inercal.foundation.noise.coefficients import noise_coefficients
from inercal.foundation.noise.deviation import allan_deviation

ROWS, INTERVAL = 184718, 0.01


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
    for channel, values in enumerate(ALLANTOOLS):
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
