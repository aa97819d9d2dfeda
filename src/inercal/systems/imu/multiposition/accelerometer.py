"""The accelerometer triad from static poses: only the size of gravity is known, not its direction.

``y = S (l + K2 l^2) + b`` with ``l = M f``, M upper-triangular with unit diagonal, and |f| = g in every pose: nine
parameters K0, K1, M_xy, M_xz, M_yz from at least ten poses (Tedaldi, Pretto, Menegatti, ICRA 2014, eqs. (7) to (10),
there written as the correction T K (raw - b)), and three K2 where they are asked for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.inference.least_squares import NonlinearFit, solve
from inercal.foundation.instruments.terms import ACCELEROMETER_TRIAD
from inercal.foundation.instruments.triad import TriadModel, apart

PARAMETERS = len(ACCELEROMETER_TRIAD)
SQUARES = tuple(f"K2_{axis}" for axis in "xyz")
"""The second-order coefficients of the triad."""

_UPPER = ((0, 1), (0, 2), (1, 2))


@dataclass(frozen=True)
class AccelerometerFit:
    """The triad ``model``, its ``k2`` (3,) [1/(m/s^2)], the specific force ``f`` (n, 3) [m/s^2] in each pose, and the
    ``fit`` behind it.

    Residuals are |f| - g [m/s^2].
    """

    model: TriadModel
    k2: Array
    f: Array
    fit: NonlinearFit

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return (ACCELEROMETER_TRIAD + SQUARES)[: len(self.fit.x)]

    @property
    def squares(self) -> bool:
        """True where K2 was fitted."""
        return len(self.fit.x) > PARAMETERS

    @property
    def directions(self) -> Array:
        """Unit vectors (n, 3) of the specific force in the poses."""
        return np.asarray(self.f / np.linalg.norm(self.f, axis=1, keepdims=True))

    def correct(self, y: Array) -> Array:
        """Specific force (n, 3) [m/s^2] for outputs ``y`` (n, 3)."""
        return specific_force(self.model, self.k2, y)

    def output_gradient(self) -> Array:
        """(n, 3): derivative of each residual with respect to the mean output of its pose."""
        return np.asarray(np.einsum("ni,nij->nj", self.directions, inverses(self.model, self.k2, self.f)))

    def force_sensitivity(self) -> Array:
        """(n, 3, p): derivative of the specific force in each pose with respect to the parameters."""
        by_parameter = _output_sensitivity(self.model, self.k2, self.f)[:, :, : len(self.fit.x)]
        return np.asarray(-inverses(self.model, self.k2, self.f) @ by_parameter)

    def force_by_squares(self) -> Array:
        """(n, 3, 3): derivative of the specific force in each pose with respect to K2_x, K2_y, K2_z."""
        by_square = _output_sensitivity(self.model, self.k2, self.f)[:, :, PARAMETERS:]
        return np.asarray(-inverses(self.model, self.k2, self.f) @ by_square)


def specific_force(model: TriadModel, k2: Array, y: Array) -> Array:
    """Specific force (n, 3) [m/s^2] for outputs ``y`` (n, 3): the inverse of K1 (l + K2 l^2) + K0, l along the axis."""
    if not np.any(k2):
        return model.correct(y)
    x = (y - model.bias) / model.scale
    # the root that is x where K2 vanishes; beyond the turning point of the parabola there is none
    along = 2.0 * x / (1.0 + np.sqrt(np.maximum(1.0 + 4.0 * k2 * x, 0.0)))
    return apart(np.asarray(np.linalg.inv(model.misalignment), dtype=np.float64), along)


def inverses(model: TriadModel, k2: Array, f: Array) -> Array:
    """(n, 3, 3): derivative of the specific force with respect to the outputs, at ``f`` (n, 3)."""
    slope = model.scale * (1.0 + 2.0 * k2 * (f @ model.misalignment.T))
    return np.asarray(np.linalg.inv(model.misalignment) / slope[:, None, :])


def model_from(theta: Array) -> TriadModel:
    """The triad of parameters (9 or more,) in the order of `ACCELEROMETER_TRIAD`."""
    misalignment = np.eye(3)
    for value, (i, j) in zip(theta[6:PARAMETERS], _UPPER, strict=True):
        misalignment[i, j] = value
    return TriadModel(theta[3:6], misalignment, theta[:3])


def _squares_from(theta: Array) -> Array:
    """K2 (3,) of parameters (9 or 12,)."""
    return theta[PARAMETERS:] if len(theta) > PARAMETERS else np.zeros(3)


def _output_sensitivity(model: TriadModel, k2: Array, f: Array) -> Array:
    """(n, 3, 12): derivative of the outputs with respect to the parameters, K2 among them, at fixed f."""
    along = f @ model.misalignment.T
    out = np.zeros((len(f), 3, PARAMETERS + 3))
    for i in range(3):
        out[:, i, i] = 1.0
        out[:, i, 3 + i] = along[:, i] + k2[i] * along[:, i] ** 2
        out[:, i, PARAMETERS + i] = model.scale[i] * along[:, i] ** 2
    for k, (i, j) in enumerate(_UPPER):
        out[:, i, 6 + k] = model.scale[i] * (1.0 + 2.0 * k2[i] * along[:, i]) * f[:, j]
    return out


def fit_accelerometer(
    means: Array, gravity: float, start: Array | None = None, squares: bool = False
) -> AccelerometerFit:
    """Fit the nine parameters, or twelve.

    Parameters
    ----------
    means : (n, 3), n >= 9
        Mean output in each static pose, in output units; positive scale factors are assumed.
    gravity : float
        Local gravity [m/s^2].
    start : (9,), optional
        First guess; from the range of the means if absent.
    squares : bool
        K2 of the three axes, too.

    Notes
    -----
    With w the derivative of |f| by the outputs, that of the residual |f| - g is -w times that of the outputs by the
    parameters.
    """
    low, high = means.min(axis=0), means.max(axis=0)
    span = np.maximum(0.5 * (high - low), 1e-9 * np.max(np.abs(means)) + 1e-300)
    if start is None:
        size = np.max(span)
        start = np.concatenate([0.5 * (low + high), np.maximum(span, 0.3 * size) / gravity, np.zeros(3)])
    typical = np.concatenate([np.full(3, np.max(span)), np.full(3, np.max(span) / gravity), np.ones(3)])
    names = ACCELEROMETER_TRIAD
    if squares:
        start, typical = np.append(start, np.zeros(3)), np.append(typical, np.full(3, 1.0 / gravity))
        names += SQUARES

    def residuals(theta: Array) -> Array:
        f = specific_force(model_from(theta), _squares_from(theta), means)
        return np.asarray(np.linalg.norm(f, axis=1) - gravity)

    def jacobian(theta: Array) -> Array:
        model, k2 = model_from(theta), _squares_from(theta)
        f = specific_force(model, k2, means)
        w = np.einsum("ni,nij->nj", f / np.linalg.norm(f, axis=1, keepdims=True), inverses(model, k2, f))
        return np.asarray(-np.einsum("ni,nip->np", w, _output_sensitivity(model, k2, f)[:, :, : len(theta)]))

    fit = solve(residuals, jacobian, start, names, typical)
    model, k2 = model_from(fit.x), _squares_from(fit.x)
    return AccelerometerFit(model, k2, specific_force(model, k2, means), fit)
