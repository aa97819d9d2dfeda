"""Cases of noise: Allan deviations of published data sets, degrees of freedom, and noise of known density."""

from __future__ import annotations

import numpy as np

from inercal.faces.validate.case import Case, record_of
from inercal.foundation.arrays import Array
from inercal.foundation.instruments.noise import NoiseModel
from inercal.foundation.noise.coefficients import noise_coefficients
from inercal.foundation.noise.covariance import degrees_of_freedom
from inercal.foundation.noise.deviation import allan_deviation
from inercal.foundation.units import parse_unit

_STABLE32 = (2.9223e-1, 2.0102e-1, 1.4479e-1, 1.0570e-1, 6.1915e-2, 4.8082e-2, 3.6237e-2, 2.7674e-2)
"""Overlapping deviations at 1, 2, 4, .. 128 samples."""

TAU = (0.01, 0.2, 1.0, 10.0, 100.0, 500.0)
ALLANTOOLS = np.array([
    (53.11216154222367, 55.28366668891407, 17.352969950226534, 8.420291462833005, 2.0748463944562054,
     0.3194956678121396),
    (56.81165185739366, 128.1875331885039, 60.656479319263276, 14.691978514290197, 2.66111878764186,
     0.4537886630546319),
    (34.17169766901764, 50.38408587559926, 8.706210606352899, 1.4944848730466624, 0.2505152923013912,
     0.04448235426420036),
    (0.14307288711849164, 0.014604474528502432, 0.0033162295996531544, 0.003313031327114284,
     0.004916001860501169, 0.0064184533246514726),
    (0.21979115672086524, 0.011763481128776352, 0.002130768502095728, 0.002241797729258805,
     0.003906793938657779, 0.007648501098920952),
    (0.15447873140045076, 0.015491746861201043, 0.0021488211484324503, 0.0002479537594927087,
     8.300677745884409e-05, 0.00015205098080045296),
])  # fmt: skip
"""At `TAU` [s]: gyros x, y, z [deg/h], accelerometers x, y, z [m/s^2]."""

_TRUE = NoiseModel(N=3e-4, B=0.0, K=2e-4)
_SEED = 20230517


def thousand() -> Array:
    """The 1000 numbers of NIST SP 1065: a congruential generator of modulus 2^31 - 1, over that modulus."""
    state, values = 1234567890, []
    for _ in range(1000):
        values.append(state / 2147483647)
        state = 16807 * state % 2147483647
    return np.array(values)


def _nine() -> Array:
    """Deviations of the nine frequency values of NBS."""
    return allan_deviation([892.0, 809, 823, 798, 671, 644, 883, 903, 677], 1.0, [1.0, 2.0]).deviation


def _recording() -> Array:
    """Deviations of the ring-laser recording, relative to those of AllanTools."""
    record = record_of("lasergyro")
    deg_per_h = parse_unit("deg/h").factor
    x = np.hstack([record.triad("gyro").values / deg_per_h, record.triad("acc").values])
    return np.asarray(allan_deviation(x, 0.01, TAU).deviation.T / ALLANTOOLS - 1.0)


def _coefficients() -> list[float]:
    """N and K found in simulated noise, less the truth, over their standard uncertainties."""
    x = _TRUE.simulate(100_000, 0.01, np.random.default_rng(_SEED), 4)
    curve = allan_deviation(x, 0.01)
    off = []
    for channel in range(4):
        fit = noise_coefficients(curve, channel)
        terms = dict(zip(fit.names, zip(fit.values, fit.u, strict=True), strict=True))
        off += [(terms[name][0] - getattr(_TRUE, name)) / terms[name][1] for name in "NK"]
    return off


CASES = (
    Case(
        "nist-nine-points",
        "Allan deviation of nine values, at one and two samples",
        "NIST SP 1065",
        [91.22945, 85.95287],
        5e-6,
        _nine,
    ),
    Case(
        "nist-1000-points",
        "Overlapping Allan deviation of 1000 values, at 1, 10 and 100 samples",
        "NIST SP 1065",
        [2.922319e-1, 9.159953e-2, 3.241343e-2],
        [5e-8, 5e-9, 5e-9],
        lambda: allan_deviation(thousand(), 1.0, [1.0, 10.0, 100.0]).deviation,
    ),
    Case(
        "stable32-octaves",
        "Overlapping Allan deviation of the same 1000 values, at 1, 2, 4, .. 128 samples",
        "Stable32",
        _STABLE32,
        [5e-6] * 4 + [5e-7] * 4,
        lambda: allan_deviation(thousand(), 1.0, 2.0 ** np.arange(8)).deviation,
    ),
    Case(
        "white-noise-dof",
        "Means of 1000 independent samples have 2 (n - 1)^2 / (3 n - 4) degrees of freedom at one sample",
        "closed form",
        [2.0 * 999.0**2 / 2996.0],
        1e-6,
        lambda: [degrees_of_freedom(1000, 1, 0)],
    ),
    Case(
        "ring-laser-allan",
        "Deviations of six channels of 184 718 rows at 0.01 s to 500 s: relative differences",
        "AllanTools",
        np.zeros(36),
        1e-10,
        _recording,
    ),
    Case(
        "noise-coefficients",
        "N and K of four simulated channels are within 4.5 standard uncertainties of the truth",
        "truth",
        np.zeros(8),
        4.5,
        _coefficients,
        "u",
    ),
)
