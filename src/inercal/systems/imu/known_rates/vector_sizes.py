"""A triad from vectors of known size in unknown directions: the rate of a table in orientations.

``y = S M x + b`` with M upper-triangular with unit diagonal and |x| known in each row: nine parameters. Rows of size
zero count with all three axes, for they show the bias itself. Errors of rows may be correlated, as by a rate that a
whole file has in common.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.inference.identifiability import Identifiability
from inercal.foundation.inference.least_squares import NonlinearFit, solve, whiten
from inercal.foundation.instruments.triad import TriadModel
from inercal.systems.imu.limits import LIMITS

PARAMETERS = 9
"""Biases, scale factors and the three misalignments of a triad that defines the frame."""

_UPPER = ((0, 1), (0, 2), (1, 2))


@dataclass(frozen=True)
class SizeFit:
    """A triad fitted to n rows of known size.

    ``model``; ``x`` (n, 3) [SI] the vectors of the rows; ``row`` (N,) the row of each residual, one a row and three
    where the size is zero; ``residuals`` (N,) and ``jacobian`` (N, 9) of |x| less its known size, or of x [SI];
    ``fit`` the whitened fit behind it and ``covariance`` (N, N) by which it was whitened.
    """

    model: TriadModel
    x: Array
    row: NDArray[np.int64]
    residuals: Array
    jacobian: Array
    fit: NonlinearFit
    covariance: Array

    @property
    def directions(self) -> Array:
        """Unit vectors (n, 3) of the rows; 0 where the vector is."""
        return np.asarray(self.x / np.maximum(np.linalg.norm(self.x, axis=1, keepdims=True), 1e-300))

    def gain(self) -> Array:
        """(9, N): shift of the parameters by an error of each known size [SI]."""
        return np.asarray(self.fit.unit_covariance @ self.jacobian.T @ np.linalg.inv(self.covariance))

    def left(self) -> Array:
        """(N, N) ``P = V^-1 - V^-1 J (J^T V^-1 J)^-1 J^T V^-1``, what the fit leaves of the rows' errors."""
        inverse = np.linalg.inv(self.covariance)
        by = inverse @ self.jacobian
        return np.asarray(inverse - by @ self.fit.unit_covariance @ by.T)


def model_from(theta: Array) -> TriadModel:
    """The triad of parameters (9,): bias, scale, the upper misalignments."""
    misalignment = np.eye(3)
    for value, (i, j) in zip(theta[6:], _UPPER, strict=True):
        misalignment[i, j] = value
    return TriadModel(theta[3:6], misalignment, theta[:3])


def fit_sizes(
    outputs: Array,
    sizes: Array,
    names: Sequence[str],
    covariance: Array | None = None,
    start: Array | None = None,
) -> SizeFit:
    """Fit the nine parameters.

    Parameters
    ----------
    outputs : (n, 3)
        Mean outputs; positive scale factors are assumed.
    sizes : (n,)
        Known sizes |x| [SI], 0 or more; some have to be above 0.
    names : nine names
        Of the parameters: biases, scale factors, M_xy, M_xz, M_yz.
    covariance : (N, N), optional
        That of the errors of the residuals [SI^2], up to a factor; unit variance if absent.
    start : (9,), optional
        First guess; from the range of the outputs if absent.

    Returns
    -------
    SizeFit
        Check ``fit.converged`` and the rank of its identifiability.
    """
    row, axis = residual_rows(sizes)
    at_rest = axis >= 0
    V = np.eye(len(row)) if covariance is None else covariance
    if start is None:
        start = _start(outputs, sizes)
    largest = float(np.max(sizes))
    full = float(np.max(start[3:6])) * largest
    typical = np.concatenate([np.full(3, full), np.full(3, full / largest), np.ones(3)])
    known = sizes[row]

    def residuals(theta: Array) -> Array:
        x = model_from(theta).correct(outputs)[row]
        return np.where(at_rest, x[range(len(row)), axis], np.linalg.norm(x, axis=1) - known)

    def jacobian(theta: Array) -> Array:
        model = model_from(theta)
        x = model.correct(outputs)[row]
        along = x / np.maximum(np.linalg.norm(x, axis=1, keepdims=True), 1e-300)
        along[at_rest] = np.eye(3)[axis[at_rest]]
        w = along @ np.linalg.inv(model.gain)
        return np.asarray(-np.einsum("ni,nip->np", w, _sensitivity(model, x)))

    fit = solve(
        lambda theta: whiten(residuals(theta), V),
        lambda theta: whiten(jacobian(theta), V),
        start,
        names,
        typical,
    )
    model = model_from(fit.x)
    return SizeFit(model, model.correct(outputs), row, residuals(fit.x), jacobian(fit.x), fit, V)


def residual_rows(sizes: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Row and axis (N,) of each residual: the axis is -1 where the size of a row (n,) is above zero."""
    rows, axes = [], []
    for k, size in enumerate(sizes):
        own = [-1] if size > 0.0 else [0, 1, 2]
        rows += [k] * len(own)
        axes += own
    return np.array(rows), np.array(axes)


def without_rows(fit: SizeFit, dof: Array) -> Array:
    """Probability (N,) that each residual is so far off a fit without it by chance: externally studentised.

    ``dof`` (N,) are the degrees of freedom of the scatter of each residual, which it is part of.
    """
    from scipy.special import stdtr

    P = fit.left()
    diagonal = np.maximum(np.diag(P), 1e-300)
    squared = (P @ fit.residuals) ** 2 / diagonal
    rest = np.maximum(dof - squared, 1e-6) / np.maximum(dof - 1.0, 1.0)
    # a row that alone fixes some combination has no residual, and is not judged
    judged = (diagonal * np.diag(fit.covariance) > 1e-6) & (dof > LIMITS.outlier_dof)
    return np.where(judged, 2.0 * stdtr(np.maximum(dof - 1.0, 1.0), -np.sqrt(squared / rest)), 1.0)


def curing(fit: SizeFit, identified: Identifiability) -> Array:
    """The direction (3,) along axes, edges and corners of a cube that tells most of the weakest combination."""
    weak = identified.directions[-1] / identified.scale
    grid = np.array([d for d in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(d)])
    grid /= np.linalg.norm(grid, axis=1, keepdims=True)
    x = float(np.max(np.linalg.norm(fit.x, axis=1))) * grid
    gain = np.einsum("ni,nip,p->n", grid @ np.linalg.inv(fit.model.gain), _sensitivity(fit.model, x), weak)
    return np.asarray(grid[np.argmax(np.abs(gain))])


def _start(outputs: Array, sizes: Array) -> Array:
    """First guess (9,) by the range of the outputs; the bias by the rows of size zero, where there are any."""
    largest = float(np.max(sizes))
    turned = outputs[sizes == largest]
    low, high = turned.min(axis=0), turned.max(axis=0)
    span = np.maximum(0.5 * (high - low), 1e-9 * np.max(np.abs(outputs)) + 1e-300)
    bias = outputs[sizes == 0.0].mean(axis=0) if np.any(sizes == 0.0) else 0.5 * (low + high)
    return np.concatenate([bias, np.maximum(span, 0.3 * np.max(span)) / largest, np.zeros(3)])


def _sensitivity(model: TriadModel, x: Array) -> Array:
    """(n, 3, 9): derivative of S M x + b with respect to the parameters, at fixed ``x`` (n, 3)."""
    out = np.zeros((len(x), 3, PARAMETERS))
    for i in range(3):
        out[:, i, i] = 1.0
        out[:, i, 3 + i] = x @ model.misalignment[i]
    for k, (i, j) in enumerate(_UPPER):
        out[:, i, 6 + k] = model.scale[i] * x[:, j]
    return out
