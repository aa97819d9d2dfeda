"""Cases of what all systems stand on: units, rotations, gravity, least squares, coverage factors, and noise."""

from __future__ import annotations

import numpy as np

from inercal.faces.validate.case import Case, record_of
from inercal.foundation.arrays import Array
from inercal.foundation.geometry import earth, rotations
from inercal.foundation.inference.least_squares import least_squares, solve
from inercal.foundation.instruments.noise import NoiseModel
from inercal.foundation.noise.coefficients import noise_coefficients
from inercal.foundation.noise.covariance import degrees_of_freedom
from inercal.foundation.noise.deviation import allan_deviation
from inercal.foundation.results.result import coverage_factor
from inercal.foundation.units import parse_quantity, parse_unit

_PI = 3.14159265358979324
_DEG_PER_H = 648000.0 / _PI
"""One rad/s."""

NORRIS = """
0.1 0.2  338.8 337.4  118.1 118.2  888.0 884.6  9.2 10.1  228.1 226.5  668.5 666.3  998.5 996.3  449.1 448.6
778.9 777.0  559.2 558.2  0.3 0.4  0.1 0.6  778.1 775.5  668.8 666.9  339.3 338.0  448.9 447.5  10.8 11.6
557.7 556.0  228.3 228.1  998.0 995.8  888.8 887.6  119.6 120.2  0.3 0.3  0.6 0.3  557.6 556.8  339.3 339.1
888.0 887.2  998.5 999.0  778.9 779.0  10.2 11.1  117.6 118.3  228.9 229.2  668.4 669.1  449.2 448.9  0.2 0.5
"""
NORRIS_CERTIFIED = np.array(
    [-0.262323073774029, 1.00211681802045, 0.232818234301152, 0.429796848199937e-3, 0.884796396144373]
)
LONGLEY = """
60323 83.0 234289 2356 1590 107608 1947   61122 88.5 259426 2325 1456 108632 1948
60171 88.2 258054 3682 1616 109773 1949   61187 89.5 284599 3351 1650 110929 1950
63221 96.2 328975 2099 3099 112075 1951   63639 98.1 346999 1932 3594 113270 1952
64989 99.0 365385 1870 3547 115094 1953   63761 100.0 363112 3578 3350 116219 1954
66019 101.2 397469 2904 3048 117388 1955  67857 104.6 419180 2822 2857 118734 1956
68169 108.4 442769 2936 2798 120445 1957  66513 110.8 444546 4681 2637 121950 1958
68655 112.6 482704 3813 2552 123366 1959  69564 114.2 502601 3931 2514 125368 1960
69331 115.7 518173 4806 2572 127852 1961  70551 116.9 554894 4007 2827 130081 1962
"""
LONGLEY_CERTIFIED = np.array(
    [-3482258.63459582, 15.0618722713733, -0.358191792925910e-1, -2.02022980381683, -1.03322686717359,
     -0.511041056535807e-1, 1829.15146461355, 890420.383607373, 84.9149257747669, 0.334910077722432e-1,
     0.488399681651699, 0.214274163161675, 0.226073200069370, 455.478499142212, 304.854073561965]
)  # fmt: skip
MISRA1A = np.array(
    [(10.07, 77.6), (14.73, 114.9), (17.94, 141.1), (23.93, 190.8), (29.61, 239.9), (35.18, 289.0),
     (40.02, 332.8), (44.82, 378.4), (50.76, 434.8), (55.05, 477.3), (61.01, 536.8), (66.40, 593.1),
     (75.47, 689.1), (81.78, 760.0)]
)  # fmt: skip
MISRA1A_CERTIFIED = np.array([2.3894212918e02, 5.5015643181e-04])

_DIGITS = 1e-9
"""Relative limit for certified values of 15 digits: what rounding of doubles costs with their condition numbers."""


def _units() -> Array:
    """Factors to SI, and a value with its uncertainty, over what they are, less 1."""
    texts = ("deg", "arcsec", "deg/h", "deg/sqrt(h)", "g", "ug", "ppm")
    read = parse_quantity("9.81744(2) m/s^2", "acceleration", "gravity")
    values = [*(parse_unit(text).factor for text in texts), read.value, read.u]
    return np.asarray(np.array(values) / _UNITS - 1.0)


_UNITS: Array = np.array(
    [_PI / 180, _PI / 648000, _PI / 648000, _PI / 10800, 9.80665, 9.80665e-6, 1e-6, 9.81744, 0.00002]
)


def _turns() -> Array:
    """The matrix of a quarter turn about z after one about x, and the rotation vector of both together."""
    quarters = [rotations.exp(0.5 * _PI * np.eye(3)[axis]) for axis in (2, 0)]
    both = rotations.multiply(*quarters)
    return np.concatenate([rotations.to_matrix(both).ravel(), rotations.log(both)])


_THIRD = 2.0 * _PI / 3.0 / 3.0**0.5


def _gravity() -> Array:
    """Normal gravity at the equator, at 45 deg and at a pole."""
    return earth.gravity(np.array([0.0, 0.25, 0.5]) * _PI)


def _earth_rate() -> list[float]:
    """North and up components [deg/h] at 30 deg south."""
    return [float(part) * _DEG_PER_H for part in earth.earth_rate(-_PI / 6.0)]


def _thermometer() -> Array:
    """y1, u(y1), s, b(30 degC), u(b(30 degC)): the correction of a thermometer as a line, and its prediction."""
    t = np.array([21.521, 22.012, 22.512, 23.003, 23.507, 23.999, 24.513, 25.002, 25.503, 26.010, 26.511])
    b = -1e-3 * np.array([171, 169, 166, 159, 164, 165, 156, 157, 159, 161, 160])
    fit = least_squares(np.column_stack([np.ones(len(t)), t - 20.0]), b, ("y1", "y2"))
    covariance = fit.s2 * fit.unit_covariance
    at_30 = np.array([1.0, 10.0])
    u_30 = np.sqrt(at_30 @ covariance @ at_30)
    return np.array([fit.beta[0], np.sqrt(covariance[0, 0]), np.sqrt(fit.s2), at_30 @ fit.beta, u_30])


def _regression(text: str, certified: Array) -> Array:
    """Coefficients, their standard deviations and that of the residuals: errors relative to the certified values."""
    p = len(certified) // 2
    rows = np.array(text.split(), dtype=float).reshape(-1, p)
    A = np.column_stack([np.ones(len(rows)), rows[:, 1:]])
    fit = least_squares(A, rows[:, 0], [f"B{i}" for i in range(p)])
    u = np.sqrt(fit.s2 * np.diag(fit.unit_covariance))
    return np.concatenate([fit.beta, u, [np.sqrt(fit.s2)]]) / certified - 1.0


def _wampler() -> Array:
    """The coefficients of a polynomial of degree five, less 1."""
    A = np.vander(np.arange(21.0), 6, increasing=True)
    return np.asarray(least_squares(A, A.sum(axis=1), tuple("abcdef")).beta - 1.0)


def _misra() -> Array:
    """Both coefficients from the first official start: errors relative to the certified values."""
    y, x = MISRA1A.T
    start = np.array([500.0, 1e-4])
    fit = solve(
        lambda b: b[0] * (1 - np.exp(-b[1] * x)) - y,
        lambda b: np.column_stack([1 - np.exp(-b[1] * x), b[0] * x * np.exp(-b[1] * x)]),
        start,
        ("b1", "b2"),
        start,
    )
    return np.asarray(fit.x / MISRA1A_CERTIFIED - 1.0)


CASES = (
    Case(
        "units",
        "Angles, rates, random walk, g, ppm and a value in short notation are taken to SI: relative errors",
        "SI brochure",
        np.zeros(len(_UNITS)),
        1e-15,
        _units,
    ),
    Case(
        "rotations-combined",
        "Quarter turns about z and x make a third of a turn about (1, 1, 1), in this order",
        "closed form",
        [0, 0, 1, 1, 0, 0, 0, 1, 0, _THIRD, _THIRD, _THIRD],
        4e-15,
        _turns,
    ),
    Case(
        "wgs84-gravity",
        "Normal gravity on the ellipsoid at the equator, at 45 deg and at a pole",
        "WGS 84",
        [9.7803253359, 9.80619777, 9.8321849378],
        [5e-11, 5e-9, 5e-11],
        _gravity,
        "m/s^2",
    ),
    Case(
        "wgs84-earth-rate",
        "Earth rate has the components north and up, up being negative in the south",
        "WGS 84",
        [7.292115e-5 * 0.75**0.5 * _DEG_PER_H, -7.292115e-5 * 0.5 * _DEG_PER_H],
        5e-12 * _DEG_PER_H,
        _earth_rate,
        "deg/h",
    ),
    Case(
        "gum-thermometer",
        "A calibration line, its scatter and its prediction, with their standard uncertainties",
        "GUM H.3",
        [-0.1712, 0.0029, 0.0035, -0.1494, 0.0041],
        5e-5,
        _thermometer,
        "degC",
    ),
    Case(
        "gum-coverage-factors",
        "k of a coverage of 95.45 % for 1, 2, 3, 5, 10, 20, 50 and infinitely many degrees of freedom",
        "GUM table G.2",
        [13.97, 4.53, 3.31, 2.65, 2.28, 2.13, 2.05, 2.000],
        [5e-3] * 7 + [5e-4],
        lambda: [coverage_factor(dof) for dof in (1, 2, 3, 5, 10, 20, 50, np.inf)],
    ),
    Case(
        "nist-norris",
        "Straight line: relative errors of coefficients, standard deviations and residual",
        "NIST StRD",
        np.zeros(5),
        _DIGITS,
        lambda: _regression(NORRIS, NORRIS_CERTIFIED),
    ),
    Case(
        "nist-longley",
        "Six nearly collinear regressors: relative errors of coefficients, standard deviations and residual",
        "NIST StRD",
        np.zeros(15),
        _DIGITS,
        lambda: _regression(LONGLEY, LONGLEY_CERTIFIED),
    ),
    Case(
        "nist-wampler1",
        "Polynomial of degree five through exact data: relative errors of coefficients",
        "NIST StRD",
        np.zeros(6),
        _DIGITS,
        _wampler,
    ),
    Case(
        "nist-misra1a",
        "Nonlinear least squares from the far start: relative errors of coefficients",
        "NIST StRD",
        np.zeros(2),
        1e-8,
        _misra,
    ),
)


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


NOISE_CASES = (
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
