"""A cubic in temperature, fitted to a signal that wanders.

``y = c0 + c1 d + c2 d^2 + c3 d^3``, d = T - T0. The coefficients are those of ordinary least squares over all samples.
What they leave over is no white noise: heating and cooling differ, and the instrument lags behind its thermometer.
So the covariance is that of least squares under residuals whose correlation falls off exponentially with time; its
length is found from the means of equal parts of the sweep, as far as these tell.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.inference.least_squares import least_squares
from inercal.foundation.inference.variances import degrees, solved, weighed

PARTS = 64
"""Equal parts of a sweep whose means are taken."""

_CORRELATIONS = np.concatenate([np.arange(0.0, 0.95, 0.05), np.arange(0.95, 0.996, 0.01)])


@dataclass(frozen=True)
class Cubic:
    """A fitted polynomial of one channel.

    ``coefficients`` (p,) ascending, [output/K^i], about the temperature ``reference`` [degC], and behind them those of
    further columns [output]; ``terms`` of them belong to the polynomial. With ``covariance`` (p, p) and ``dof`` (p,);
    ``residuals`` (n,), and the ``correlation`` of the means of neighbouring parts of the sweep.
    """

    reference: float
    coefficients: Array
    covariance: Array
    dof: Array
    residuals: Array
    correlation: float = 0.0
    terms: int = 4

    def value(self, temperature: Array) -> Array:
        """Output at temperatures [degC]."""
        return np.asarray(
            powers(np.asarray(temperature) - self.reference, self.terms) @ self.coefficients[: self.terms]
        )

    def u(self, temperature: Array) -> Array:
        """Standard uncertainty of `value`."""
        A = powers(np.asarray(temperature) - self.reference, self.terms)
        own = self.covariance[: self.terms, : self.terms]
        return np.asarray(np.sqrt(np.einsum("...i,ij,...j->...", A, own, A)))


def powers(d: Array, count: int) -> Array:
    """1, d, d^2, ... (*d.shape, count)."""
    return np.asarray(np.asarray(d)[..., None] ** np.arange(count))


def fit_sweep(temperature: Array, values: Array, reference: float, more: Array, terms: int = 4) -> Cubic:
    """Fit one channel of a sweep.

    Parameters
    ----------
    temperature, values : (n,), n >= 2 PARTS
        In the order of time, equally spaced.
    reference : float
        T0 [degC].
    more : (n, q)
        Further columns of the model, beside the powers of temperature; q may be 0.
    terms : int
        Coefficients of the polynomial: 4 for a cubic.
    """
    d = temperature - reference
    size = float(np.max(np.abs(d)))  # keeps the powers of comparable size
    A = np.column_stack([powers(d / size, terms), more])
    solution, *_ = np.linalg.lstsq(A, values, rcond=None)
    parts = np.array_split(np.arange(len(d)), PARTS)
    mean_A = np.array([A[part].mean(axis=0) for part in parts])
    means = np.array([values[part].mean() for part in parts])
    rho, unit, dof = _wander(mean_A, means)
    scale = np.concatenate([size ** -np.arange(float(terms)), np.ones(more.shape[1])])
    return Cubic(
        reference,
        solution * scale,
        unit * np.outer(scale, scale),
        dof,
        values - A @ solution,
        rho,
        terms,
    )


def fit_points(
    temperature: Array,
    values: Array,
    variances: Array,
    common: float,
    reference: float,
    more: Array,
    terms: int,
) -> Cubic:
    """Fit values (n,) with variances (n,) at single temperatures (n,) [degC].

    Scatter beyond the variances widens the covariance (Birge's ratio), with n - p degrees of freedom; scatter below
    does not narrow it. All values share an error of variance ``common``, which goes to the constant and is known: the
    degrees of freedom of the constant are those of both together (Welch-Satterthwaite).
    """
    d = temperature - reference
    size = float(np.max(np.abs(d)))
    A = np.column_stack([powers(d / size, terms), more])
    fit = least_squares(A, values, [f"column {k}" for k in range(A.shape[1])], variances)
    scale = np.concatenate([size ** -np.arange(float(terms)), np.ones(more.shape[1])])
    birge = max(1.0, fit.s2) if fit.dof > 0 else 1.0
    covariance = birge * fit.unit_covariance * np.outer(scale, scale)
    dof = np.full(len(scale), float(fit.dof) if birge > 1.0 else np.inf)
    dof[0] *= (1.0 + common / covariance[0, 0]) ** 2
    covariance[0, 0] += common
    return Cubic(
        reference,
        fit.beta * scale,
        covariance,
        dof,
        fit.residuals,
        terms=terms,
    )


def _wander(A: Array, means: Array) -> tuple[float, Array, Array]:
    """Correlation of neighbouring part means about a model A (PARTS, p); covariance and dof of its coefficients.

    The correlation is not well known from one sweep. So the logarithms of the variances are averaged over it, weighed
    by its restricted likelihood, and their spread takes degrees of freedom away (2/dof is the variance of the logarithm
    of an estimated variance).
    """
    n, p = A.shape
    gain = np.linalg.pinv(A)
    steps = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    # independent innovations: the first mean, then each less rho times the one before
    rho = _CORRELATIONS[:, None, None]
    root = np.sqrt(1.0 - _CORRELATIONS**2)
    whiten = np.eye(n) - rho * np.eye(n, k=-1)
    whiten[:, 0, 0] = root
    fit = solved(whiten @ np.column_stack([A, means]))
    s2 = np.maximum(fit.chi2 / (n - p), 1e-300)
    likelihood = -0.5 * ((n - p) * np.log(s2) + fit.volume - 2.0 * np.log(root))
    covariances = (s2 / root**2)[:, None, None] * (gain @ rho**steps @ gain.T)
    weights = weighed(likelihood)
    logs = np.log(np.einsum("kii->ki", covariances))
    typical = weights @ logs
    spread = weights @ (logs - typical) ** 2 + 2.0 / (n - p)
    mean = np.einsum("k,kij->ij", weights, covariances)
    scale = np.exp(0.5 * (typical - np.log(np.diag(mean))))
    best = float(_CORRELATIONS[np.argmax(likelihood)])
    return best, mean * np.outer(scale, scale), degrees(spread)
