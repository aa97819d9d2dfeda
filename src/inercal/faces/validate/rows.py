"""Cases of IMU calibration from pose means, known rates and known turns, and of K2: outputs written out by hand."""

from __future__ import annotations

import numpy as np

from inercal.faces.validate.case import Case
from inercal.foundation.arrays import Array
from inercal.foundation.geometry.earth import Site
from inercal.foundation.records.record import Record, record_of
from inercal.foundation.results.result import Estimate
from inercal.foundation.units import parse_unit
from inercal.systems.imu.settings import ImuSettings, KnownRatesSettings, KnownTurnsSettings, MeansSettings
from inercal.systems.imu.task import calibrate_files

_G = 9.81
_RATES = np.pi / 30.0 * np.array([0.0, 33.333, 45.0])
_ANGLES = np.radians([361.338, 367.160, 363.670])

_ALONG = np.array(
    [(i, j, k) for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1) if i or j or k], float
)
_ALONG /= np.linalg.norm(_ALONG, axis=1, keepdims=True)
"""Sides, edges and corners of a cube (26, 3)."""

_BIAS = np.array([120.0, -80.0, 40.0])
_SCALE = np.array([410.0, 395.0, 402.0])
_UPPER = np.array([0.011, -0.007, 0.013])
_K2 = np.array([2e-4, -1e-4, 5e-5])


def _outputs(x: Array, k2: Array | float = 0.0) -> Array:
    """Outputs S (l + K2 l^2) + b at inputs ``x`` (n, 3), l = M x along the input axes."""
    along = x.copy()
    along[:, 0] += _UPPER[0] * x[:, 1] + _UPPER[1] * x[:, 2]
    along[:, 1] += _UPPER[2] * x[:, 2]
    return np.asarray(_SCALE * (along + k2 * along**2) + _BIAS)


def _record(sensor: str, values: Array, t: Array | None = None) -> Record:
    """A record of a triad (n, 3); rows are counted where there is no time."""
    t = np.arange(len(values), dtype=float) if t is None else t
    count = parse_unit("count")
    columns = zip("xyz", values.T, strict=True)
    return record_of([(f"{sensor}_{axis}", count, column) for axis, column in columns], t)


def _less(estimate: Estimate) -> Array:
    """Coefficients less the truth, over the size of their kind."""
    size = np.concatenate([np.full(6, 400.0), np.ones(3)])
    return np.asarray((estimate.values[:9] - np.concatenate([_BIAS, _SCALE, _UPPER])) / size)


def _means() -> Array:
    """Errors of nine coefficients from 26 rows."""
    record = _record("acc", _outputs(_G * _ALONG))
    return _less(calibrate_files([record], ImuSettings(Site(_G), method=MeansSettings())).estimate)


def _squares() -> Array:
    """Errors of twelve coefficients from 26 poses with K2."""
    record = _record("acc", _outputs(_G * _ALONG, _K2))
    settings = ImuSettings(Site(_G), method=MeansSettings(), k2=True)
    estimate = calibrate_files([record], settings).estimate
    names = (*(f"{head}_{axis}" for head in ("K0", "K1") for axis in "xyz"), "M_xy", "M_xz", "M_yz")
    found = np.array([estimate[name].value for name in (*names, "K2_x", "K2_y", "K2_z")])
    size = np.concatenate([np.full(6, 400.0), np.ones(3), np.full(3, 1.0 / _G)])
    return np.asarray((found - np.concatenate([_BIAS, _SCALE, _UPPER, _K2])) / size)


def _rates() -> Array:
    """Errors of nine coefficients from 13 orientations at each of three rates."""
    records = [_record("gyro", _outputs(rate * _ALONG[::2])) for rate in _RATES]
    options = KnownRatesSettings(tuple(_RATES.tolist()), (0.0, 0.0, 0.0))
    return _less(calibrate_files(records, ImuSettings(Site(_G), method=options)).estimate)


def _turns() -> Array:
    """Errors of the nine terms of S and T from a turn about each axis, integrated by hand."""
    t = np.arange(0.0, 16.0, 0.01)
    turning = (t > 5.0) & (t < 11.0)
    rate = np.where(turning, 1.0 - np.cos(2.0 * np.pi * (t - 5.0) / 6.0), 0.0) / 6.0
    gain = np.array([[940.0, 9.0, -5.0], [3.0, 950.0, 8.0], [-7.0, 2.0, 930.0]])
    tremble = 1e-6 * np.sin(np.outer(np.arange(len(t)), [1.0, 2.0, 3.0]))
    records = [
        _record("gyro", angle * np.outer(rate, gain[:, j]) + 3.0 + tremble, t)
        for j, angle in enumerate(_ANGLES)
    ]
    options = KnownTurnsSettings(tuple(_ANGLES.tolist()), (0.0, 0.0, 0.0), 0.0)
    estimate = calibrate_files(records, ImuSettings(Site(_G), method=options)).estimate
    made = np.array(
        [
            [
                estimate[f"S_{i}"].value if i == j else estimate[f"S_{i}"].value * estimate[f"T_{i}{j}"].value
                for j in "xyz"
            ]
            for i in "xyz"
        ]
    )
    return np.asarray((made - gain) / 940.0).ravel()


CASES = (
    Case(
        "pose-means",
        "Accelerometers from 26 rows of mean outputs: nine coefficients less those put in, over the size of their kind",
        "closed form",
        np.zeros(9),
        1e-9,
        _means,
    ),
    Case(
        "second-order",
        "Accelerometers with K2 in 26 poses: twelve coefficients less those put in, over the size of their kind",
        "closed form",
        np.zeros(12),
        1e-8,
        _squares,
    ),
    Case(
        "known-rates",
        "A gyro in 13 orientations at rest and two rates: nine coefficients less those put in, over their size",
        "closed form",
        np.zeros(9),
        1e-8,
        _rates,
    ),
    Case(
        "known-turns",
        "A gyro turned by known angles about each axis: the nine terms of S T less those put in, over their size",
        "closed form",
        np.zeros(9),
        1e-7,
        _turns,
    ),
)
