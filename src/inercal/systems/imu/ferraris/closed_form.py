"""The numbers that the program imucal makes of six sides and three turns, by the closed form of Ferraris.

F. Ferraris, U. Grimaldi, M. Parvis, Procedure for effortless in-field calibration of three-axial rate gyro and
accelerometers, Sensors and Materials 7 (1995) 311-330. With +g and -g along each axis in turn the differences of the
sides give K1 M and G, the means of the two sides of an axis K0 of that axis, and the mean of all samples at rest D_F;
the integral of the gyro over a turn, less D_F and G f, gives the column of S T of its axis.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from inercal.foundation.arrays import Array
from inercal.systems.imu.ferraris.names import POSITIONS, TURNS
from inercal.systems.imu.sections.cutting.cut import Stretch, lengths_of


def imucal_coefficients(
    stretches: Mapping[str, tuple[Stretch, ...]], turn: float, gravity: float
) -> dict[str, float]:
    """The 33 coefficients by symbol, in outputs and SI, of the nine sections by name.

    ``turn`` [rad] is the angle of each turn, ``gravity`` [m/s^2]; both triads are there in all stretches.
    """
    acc = {name: _values(parts, "acc") for name, parts in stretches.items()}
    gyro = {name: _values(parts, "gyro") for name, parts in stretches.items()}
    force, rate = (np.array([of[name].mean(axis=0) for name in POSITIONS]) for of in (acc, gyro))
    force_gain = (force[0::2] - force[1::2]).T / (2.0 * gravity)
    force_bias = np.diagonal(0.5 * (force[0::2] + force[1::2]))
    g_gain = (rate[0::2] - rate[1::2]).T / (2.0 * gravity)
    rate_bias = np.concatenate([gyro[name] for name in POSITIONS]).mean(axis=0)
    columns = []
    for name in TURNS:
        samples = stretches[name][0].gyro
        assert samples is not None
        cells = lengths_of(samples.t)
        f = np.linalg.solve(force_gain, acc[name].mean(axis=0) - force_bias)
        columns.append(cells @ (gyro[name] - rate_bias - g_gain @ f) / turn)
    rate_gain = np.array(columns).T
    numbers: dict[str, float] = {}
    for bias, scale, cross, b, gain in (
        ("K0", "K1", "M", force_bias, force_gain),
        ("D_F", "S", "T", rate_bias, rate_gain),
    ):
        for i, row in enumerate("xyz"):
            numbers |= {f"{bias}_{row}": float(b[i]), f"{scale}_{row}": float(gain[i, i])}
            numbers |= {
                f"{cross}_{row}{c}": float(gain[i, j] / gain[i, i]) for j, c in enumerate("xyz") if i != j
            }
    return numbers | {
        f"G_{r}{c}": float(g_gain[i, j]) for i, r in enumerate("xyz") for j, c in enumerate("xyz")
    }


def _values(parts: tuple[Stretch, ...], sensor: str) -> Array:
    """Outputs (n, 3) of a section."""
    return np.concatenate([getattr(part, sensor).values for part in parts])
