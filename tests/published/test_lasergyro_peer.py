"""The ring-laser IMU of PSINS, fitted by another program: allan-variance of N. Mayorov, and what its fit does to noise.

It fits five terms, none negative, to a hundred Allan variances up to a tenth of the record, each weighted by its own
inverse: the sum of squared relative errors. Reference values: that program on data/lasergyro.imu (PSINS, Yan Gongmin,
BSD 2-clause), in deg/h or m/s^2 and seconds.
"""

from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import nnls

from inercal.foundation.instruments.noise import SYMBOLS, NoiseModel, allan_terms
from inercal.foundation.noise.coefficients import noise_coefficients
from inercal.foundation.noise.deviation import allan_deviation
from inercal.foundation.records.read import read

EXAMPLES = Path(str(files("inercal"))) / "examples"
DEG_H = np.radians(1.0 / 3600.0)
PUBLISHED = {
    "gyro_x": {"N": 6.07583851137615, "B": 2.1696972734229165},
    "gyro_y": {"N": 7.451161682427279, "B": 3.2156877727330917},
    "gyro_z": {"N": 2.8226950948517455, "Q": 0.15733765347615367},
    "acc_x": {"B": 0.00396448453206581, "K": 0.0006682278195542807, "Q": 0.001247548466567128},
    "acc_y": {"B": 0.001796158442867935, "K": 0.0007115780063327202, "Q": 0.0011605184898234723},
    "acc_z": {"N": 0.0004172900101605364, "K": 1.167903046211215e-05, "Q": 0.0011055886749141825},
}


def relative_fit(x, interval):
    """N, B, K, R, Q (channels, 5) by that program's rule, and fitted over measured deviation (times, channels)."""
    lengths = np.unique(np.round(np.logspace(0, np.log2(len(x) // 10), 100, base=2)))
    variance = allan_deviation(x, interval, lengths * interval).deviation ** 2
    terms = allan_terms(lengths * interval)
    squares = np.array([nnls(terms / v[:, None], np.ones(len(v)))[0] for v in variance.T])
    return np.sqrt(squares), lengths * interval, np.sqrt(terms @ squares.T / variance)


def test_its_rule_gives_its_values_and_misses_the_curve():
    """On the gyros, whose curve is a hump and not a sum of five slopes, it is low by factors of 4 to 8."""
    record = read(EXAMPLES / "lasergyro.txt.gz", EXAMPLES / "lasergyro-map.toml")
    x = np.hstack([record.triad("gyro").values / DEG_H, record.triad("acc").values])
    found, tau, ratio = relative_fit(x, 0.01)
    for channel, values in zip(found, PUBLISHED.values(), strict=True):
        expected = [values.get(symbol, 0.0) for symbol in SYMBOLS]
        np.testing.assert_allclose(channel, expected, rtol=1e-4)
    lowest = 1.0 / ratio[:, :3].min(axis=0)
    assert lowest == pytest.approx([4.0, 8.3, 8.0], abs=0.1)
    assert np.all(tau[ratio[:, :3].argmin(axis=0)] < 0.3)


@pytest.mark.campaign
def test_on_noise_of_the_five_kinds():
    """A hundred recordings with known N, B and K: the rule finds R and Q where there are none."""
    truth = NoiseModel(N=1e-4, B=2e-4, K=2e-4)
    true = np.array([truth.N, truth.B, truth.K])
    x = truth.simulate(20000, 0.01, np.random.default_rng(1), 100)
    theirs, _, _ = relative_fit(x, 0.01)
    curve = allan_deviation(x, 0.01)
    ours = np.zeros((100, 5))
    for channel in range(100):
        fit = noise_coefficients(curve, channel)
        for name, value in zip(fit.names, fit.values, strict=True):
            ours[channel, SYMBOLS.index(name)] = value

    def rms(found):
        return np.sqrt(np.mean((found[:, :3] / true - 1.0) ** 2, axis=0))

    def phantoms(found):
        return np.mean(found[:, 3:] > 0.0, axis=0)

    assert rms(theirs) == pytest.approx([0.058, 0.183, 0.200], abs=0.005)
    assert rms(ours) == pytest.approx([0.0075, 0.083, 0.170], abs=0.005)
    assert np.mean(theirs[:, 2]) / truth.K == pytest.approx(0.886, abs=0.01)
    assert np.mean(ours[:, 2]) / truth.K == pytest.approx(1.0, abs=3 * 0.17 / 10)
    assert np.all(phantoms(theirs) > 0.4)
    assert np.all(phantoms(ours) < 0.05)
