"""The closed form of the Ferraris calibration, and its derivatives.

Forward model ``y = S M f + b`` and ``y = S T omega + D_F + G f``, all matrices full. With +g and -g along each axis
in turn the differences of the positions give S M and G, their means the biases, and the integral of the gyro over a
known turn, less bias and G f, the column of S T of that axis.

F. Ferraris, U. Grimaldi, M. Parvis, Procedure for effortless in-field calibration of three-axial rate gyro and
accelerometers, Sensors and Materials 7 (1995) 311-330. Their accelerometer bias is that of the two positions of the
axis itself: a tilt of a position acts on the other two axes in first order, on its own in second order only. The gyro
bias is the mean of all samples of the six positions, as in the program imucal.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.instruments.terms import ACCELEROMETERS_IN_A_FRAME, GYRO_G_SENSITIVITY, GYRO_TRIAD
from inercal.foundation.instruments.triad import TriadModel

Values = NDArray[Any]

NAMES = (*ACCELEROMETERS_IN_A_FRAME, *GYRO_TRIAD, *GYRO_G_SENSITIVITY)
"""The 33 coefficients in the order of results."""

_MISALIGNMENTS = [("xyz".index(i), "xyz".index(j)) for i, j in ("xy", "xz", "yz", "yx", "zx", "zy")]
_CROSS = [(i, j) for i in range(3) for j in range(3) if i != j]


@dataclass(frozen=True, eq=False)
class Inputs:
    """All that the coefficients are computed from; leading batch axes broadcast.

    ``force`` and ``rate`` (6, 3) mean outputs of accelerometers and gyro in the positions +x, -x, +y, -y, +z, -z (the
    sign of the specific force along the axis); ``turned_force`` and ``turned_rate`` (3, 3) their means over the turns
    about x, y, z, of ``durations`` (3,) [s] by ``angles`` (3,) [rad]; ``gravity`` () [m/s^2] and ``vertical_rate`` ()
    [rad/s], the upward part of earth rate.
    """

    force: Values
    rate: Values
    turned_force: Values
    turned_rate: Values
    durations: Values
    angles: Values
    gravity: Values
    vertical_rate: Values


@dataclass(frozen=True, eq=False)
class Matrices:
    """The matrices of the method: gains (3, 3) [output per SI unit], biases (3,) [output] and the g-sensitivity as it
    shows (3, 3) [gyro output/(m/s^2)], in which the vertical part of earth rate is contained."""

    force_gain: Values
    force_bias: Values
    rate_gain: Values
    rate_bias: Values
    apparent_g: Values

    @property
    def accelerometer(self) -> TriadModel:
        """The accelerometer triad."""
        return _triad(self.force_gain, self.force_bias)

    @property
    def gyro(self) -> TriadModel:
        """The gyro triad."""
        return _triad(self.rate_gain, self.rate_bias)


def _triad(gain: Array, bias: Array) -> TriadModel:
    """A triad of its gain."""
    scale = np.diag(gain)
    return TriadModel(scale, gain / scale[:, None], bias)


def matrices(x: Inputs, weights: Array) -> Matrices:
    """Ferraris' equations; ``weights`` (6,) are the shares of the positions in the gyro's bias, their sum 1.

    The turns are freed of the apparent g-sensitivity: in the positions the vertical part of earth rate is along the
    specific force, as it is in the turns, so that it is taken off with it and the angle is that against the Earth.
    """
    twice_g = 2.0 * x.gravity[..., None, None]
    force_gain = _transposed(x.force[..., 0::2, :] - x.force[..., 1::2, :]) / twice_g
    means = 0.5 * (x.force[..., 0::2, :] + x.force[..., 1::2, :])
    force_bias = np.diagonal(means, axis1=-2, axis2=-1)
    apparent_g = _transposed(x.rate[..., 0::2, :] - x.rate[..., 1::2, :]) / twice_g
    rate_bias = np.einsum("k,...ki->...i", weights, x.rate)
    f = (x.turned_force - force_bias[..., None, :]) @ _transposed(np.linalg.inv(force_gain))
    rate = x.turned_rate - rate_bias[..., None, :] - f @ _transposed(apparent_g)
    rate_gain = _transposed(rate * (x.durations / x.angles)[..., None])
    return Matrices(force_gain, force_bias, rate_gain, rate_bias, apparent_g)


def _transposed(matrix: Values) -> Values:
    """Last two axes exchanged."""
    return np.swapaxes(matrix, -1, -2)


def coefficients(x: Inputs, weights: Array) -> Values:
    """The coefficients (..., 33) in the order of `NAMES`; earth rate is taken off the g-sensitivity."""
    m = matrices(x, weights)
    k1 = np.diagonal(m.force_gain, axis1=-2, axis2=-1)
    s = np.diagonal(m.rate_gain, axis1=-2, axis2=-1)
    g = m.apparent_g - m.rate_gain * (x.vertical_rate / x.gravity)[..., None, None]
    misaligned = np.stack([m.force_gain[..., i, j] / k1[..., i] for i, j in _MISALIGNMENTS], axis=-1)
    crossed = np.stack([m.rate_gain[..., i, j] / s[..., i] for i, j in _CROSS], axis=-1)
    nine = g.reshape(*g.shape[:-2], 9)
    return np.concatenate([m.force_bias, k1, misaligned, m.rate_bias, s, crossed, nine], axis=-1)


def derivatives(x: Inputs, weights: Array) -> dict[str, Array]:
    """Derivatives (33, *shape) of the coefficients with respect to each field of the inputs, by name.

    By complex steps: the equations are rational, and so these are exact to rounding (Squire and Trapp, SIAM Review 40
    (1998) 110).
    """
    sizes = {each.name: np.shape(getattr(x, each.name)) for each in fields(x)}
    flat = np.concatenate([np.ravel(getattr(x, name)) for name in sizes])
    step = 1e-30
    moved = flat + 1j * step * np.eye(len(flat))
    ends = np.cumsum([int(np.prod(shape)) for shape in sizes.values()])
    parts = dict(zip(sizes, np.split(moved, ends[:-1], axis=1), strict=True))
    shaped = {name: part.reshape(len(flat), *sizes[name]) for name, part in parts.items()}
    J = coefficients(Inputs(**shaped), weights).imag.T / step
    return {
        name: part.reshape(len(NAMES), *sizes[name])
        for name, part in zip(sizes, np.split(J, ends[:-1], axis=1), strict=True)
    }
