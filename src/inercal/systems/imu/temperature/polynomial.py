"""A polynomial in temperature, fitted to a signal that wanders.

``y = c0 + c1 d + c2 d^2 + ..``, d = T - T0, to the fifth power at most. The coefficients are those of ordinary least
squares over all samples. What they leave over is no white noise: heating and cooling differ, and the instrument lags
behind its thermometer. So the covariance is that of least squares under residuals whose correlation falls off
exponentially with time; its length is found from the means of equal parts of the sweep, as far as these tell. They also
tell the order, and whether the output jumps or bends at a temperature, which no polynomial follows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.inference.least_squares import least_squares
from inercal.foundation.inference.variances import degrees, solved, weighed

PARTS = 64
"""Equal parts of a sweep whose means are taken."""

HIGHEST_ORDER = 5
"""Highest power of temperature that is fitted."""

_PLACES = 25  # temperatures at which a jump is looked for
_CORRELATIONS = np.concatenate([np.arange(0.0, 0.95, 0.05), np.arange(0.95, 0.996, 0.01)])


@dataclass(frozen=True)
class TemperaturePolynomial:
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


def fit_sweep(
    temperature: Array, values: Array, reference: float, more: Array, terms: int = 4
) -> TemperaturePolynomial:
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
    rho, unit, dof = _wander(_part_means(A), _part_means(values[:, None])[:, 0])
    scale = np.concatenate([size ** -np.arange(float(terms)), np.ones(more.shape[1])])
    return TemperaturePolynomial(
        reference,
        solution * scale,
        unit * np.outer(scale, scale),
        dof,
        values - A @ solution,
        rho,
        terms,
    )


def order_of(temperature: Array, values: Array) -> int:
    """The power of temperature, 1 to 5, to which the data of a sweep (n,) ask for a polynomial.

    The order of the least Schwarz criterion (BIC) of the means of its parts, their correlation fitted.
    """
    d = (temperature - temperature.mean()) / np.ptp(temperature)
    means = _part_means(np.column_stack([powers(d, HIGHEST_ORDER + 1), values]))
    criteria = [
        terms * np.log(PARTS) - 2.0 * _likelihood(means[:, :terms], means[:, -1])
        for terms in range(2, HIGHEST_ORDER + 2)
    ]
    return 1 + int(np.argmin(criteria))


def with_next_power(fit: TemperaturePolynomial, temperature: Array, values: Array) -> TemperaturePolynomial:
    """A fit to a sweep (n,) with the next power counted in: u of a fit that has it too, and by how much that moves."""
    more = fit_sweep(temperature, values, fit.reference, np.empty((len(values), 0)), fit.terms + 1)
    return counted_in(fit, more)


def counted_in(fit: TemperaturePolynomial, more: TemperaturePolynomial) -> TemperaturePolynomial:
    """A fit with what one with ``more`` terms says of its coefficients: their u there, and by how much they move."""
    own = slice(fit.terms)
    moves = more.coefficients[own] - fit.coefficients[own]
    covariance = more.covariance[own, own] + np.outer(moves, moves)
    return replace(fit, covariance=covariance, dof=np.minimum(fit.dof[own], more.dof[own]))


class Kink(NamedTuple):
    """A temperature [degC] at which an output jumps, or else bends: ``shape`` (n,) of samples, 0 below it; and the
    ``gain`` of the log likelihood."""

    temperature: float
    jumps: bool
    shape: Array
    gain: float


def kink(temperature: Array, values: Array) -> Kink:
    """The likeliest jump or bend of the output of a sweep (n,), beside a polynomial of the highest order."""
    d = (temperature - temperature.mean()) / np.ptp(temperature)
    means = _part_means(np.column_stack([powers(d, HIGHEST_ORDER + 1), values]))
    whiten, root = _whitening(PARTS)
    Q, R = np.linalg.qr(whiten @ means)
    left, chi2, n = Q[:, :, -1] * R[:, -1:, -1], R[:, -1, -1] ** 2, PARTS  # what the polynomial leaves
    base = float(np.max(-0.5 * n * np.log(np.maximum(chi2, 1e-300)) + np.log(root)))

    def likeliest(places: Array) -> Kink:
        beyond = temperature[:, None] - places
        shapes = np.concatenate([beyond > 0.0, np.maximum(beyond, 0.0)], axis=1)
        columns = whiten @ _part_means(shapes)
        columns -= Q[:, :, :-1] @ (Q[:, :, :-1].mT @ columns)
        size = np.maximum(np.sum(columns**2, axis=1), 1e-300)
        less = (left[:, None] @ columns)[:, 0] ** 2 / size
        fall = np.log(np.maximum(chi2[:, None] - less, 1e-300))
        gains = np.max(-0.5 * n * fall + np.log(root)[:, None], axis=0) - base
        best = int(np.argmax(gains))
        at = float(places[best % len(places)])
        return Kink(at, best < len(places), shapes[:, best], float(gains[best]))

    places = np.quantile(temperature, np.linspace(0.08, 0.92, _PLACES))
    near = int(np.argmin(np.abs(places - likeliest(places).temperature)))
    return likeliest(np.linspace(places[max(near - 1, 0)], places[min(near + 1, _PLACES - 1)], _PLACES))


def fit_points(
    temperature: Array,
    values: Array,
    variances: Array,
    common: float,
    reference: float,
    more: Array,
    terms: int,
) -> TemperaturePolynomial:
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
    return TemperaturePolynomial(
        reference,
        fit.beta * scale,
        covariance,
        dof,
        fit.residuals,
        terms=terms,
    )


def _part_means(columns: Array) -> Array:
    """Means (PARTS, p) of columns (n, p) over the equal parts of a sweep."""
    return np.array([part.mean(axis=0) for part in np.array_split(columns, PARTS)])


def _likelihood(A: Array, means: Array) -> float:
    """Log likelihood of part means about a model A (PARTS, p), its variance and correlation the likeliest ones."""
    n = len(means)
    whiten, root = _whitening(n)
    s2 = np.maximum(solved(whiten @ np.column_stack([A, means])).chi2 / n, 1e-300)
    return float(np.max(-0.5 * n * np.log(s2) + np.log(root)))


def _whitening(n: int) -> tuple[Array, Array]:
    """Matrices (k, n, n) that make n neighbours of each correlation independent, but for a common factor, and the
    sd (k,) of an innovation in that of a value: the first mean, then each less rho times the one before."""
    root = np.sqrt(1.0 - _CORRELATIONS**2)
    whiten = np.eye(n) - _CORRELATIONS[:, None, None] * np.eye(n, k=-1)
    whiten[:, 0, 0] = root
    return whiten, root


def _wander(A: Array, means: Array) -> tuple[float, Array, Array]:
    """Correlation of neighbouring part means about a model A (PARTS, p); covariance and dof of its coefficients.

    The correlation is not well known from one sweep. So the logarithms of the variances are averaged over it, weighed
    by its restricted likelihood, and their spread takes degrees of freedom away (2/dof is the variance of the logarithm
    of an estimated variance).
    """
    n, p = A.shape
    gain = np.linalg.pinv(A)
    steps = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    rho = _CORRELATIONS[:, None, None]
    whiten, root = _whitening(n)
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
