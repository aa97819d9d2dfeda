"""The accelerometer triad from static poses: only the size of gravity is known, not its direction.

``y = S M f + b``, M upper-triangular with unit diagonal, and |f| = g in every pose: nine parameters K0, K1,
M_xy, M_xz, M_yz from at least ten poses (Tedaldi, Pretto, Menegatti, ICRA 2014, eqs. (7) to (10), there
written as the correction T K (raw - b)).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inercal.arrays import Array
from inercal.estimate.nonlinear import NonlinearFit, solve
from inercal.instruments.terms import ACCELEROMETER_TRIAD
from inercal.instruments.triad import TriadModel

PARAMETERS = len(ACCELEROMETER_TRIAD)
_UPPER = ((0, 1), (0, 2), (1, 2))


@dataclass(frozen=True)
class AccelerometerFit:
    """The triad ``model``, the specific force ``f`` (n, 3) [m/s^2] in each pose, and the ``fit`` behind it.

    Residuals are |f| - g [m/s^2].
    """

    model: TriadModel
    f: Array
    fit: NonlinearFit

    @property
    def directions(self) -> Array:
        """Unit vectors (n, 3) of the specific force in the poses."""
        return np.asarray(self.f / np.linalg.norm(self.f, axis=1, keepdims=True))

    def output_gradient(self) -> Array:
        """(n, 3): derivative of each residual with respect to the mean output of its pose."""
        return np.asarray(self.directions @ np.linalg.inv(self.model.gain))

    def force_sensitivity(self) -> Array:
        """(n, 3, 9): derivative of the specific force in each pose with respect to the parameters."""
        inverse = np.linalg.inv(self.model.gain)
        return np.asarray(-np.einsum("ij,njp->nip", inverse, _output_sensitivity(self.model, self.f)))


def model_from(theta: Array) -> TriadModel:
    """The triad of parameters (9,) in the order of `ACCELEROMETER_TRIAD`."""
    misalignment = np.eye(3)
    for value, (i, j) in zip(theta[6:], _UPPER, strict=True):
        misalignment[i, j] = value
    return TriadModel(theta[3:6], misalignment, theta[:3])


def _output_sensitivity(model: TriadModel, f: Array) -> Array:
    """(n, 3, 9): derivative of S M f + b with respect to the parameters, at fixed f."""
    out = np.zeros((len(f), 3, PARAMETERS))
    for i in range(3):
        out[:, i, i] = 1.0
        out[:, i, 3 + i] = f @ model.misalignment[i]
    for k, (i, j) in enumerate(_UPPER):
        out[:, i, 6 + k] = model.scale[i] * f[:, j]
    return out


def fit_accelerometer(means: Array, gravity: float, start: Array | None = None) -> AccelerometerFit:
    """Fit the nine parameters.

    Parameters
    ----------
    means : (n, 3), n >= 9
        Mean output in each static pose, in output units; positive scale factors are assumed.
    gravity : float
        Local gravity [m/s^2].
    start : (9,), optional
        First guess; from the range of the means if absent.

    Notes
    -----
    With w = gain^-T f/|f|, the derivative of the residual |f| - g is -w times that of S M f + b.
    """
    low, high = means.min(axis=0), means.max(axis=0)
    span = np.maximum(0.5 * (high - low), 1e-9 * np.max(np.abs(means)) + 1e-300)
    if start is None:
        size = np.max(span)
        start = np.concatenate([0.5 * (low + high), np.maximum(span, 0.3 * size) / gravity, np.zeros(3)])
    typical = np.concatenate([np.full(3, np.max(span)), np.full(3, np.max(span) / gravity), np.ones(3)])

    def residuals(theta: Array) -> Array:
        return np.asarray(np.linalg.norm(model_from(theta).correct(means), axis=1) - gravity)

    def jacobian(theta: Array) -> Array:
        model = model_from(theta)
        f = model.correct(means)
        w = (f / np.linalg.norm(f, axis=1, keepdims=True)) @ np.linalg.inv(model.gain)
        return np.asarray(-np.einsum("ni,nip->np", w, _output_sensitivity(model, f)))

    fit = solve(residuals, jacobian, start, ACCELEROMETER_TRIAD, typical)
    model = model_from(fit.x)
    return AccelerometerFit(model, model.correct(means), fit)
