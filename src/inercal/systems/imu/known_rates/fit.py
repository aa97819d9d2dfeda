"""The gyro triad from orientations at known rates, with the scatter of each file estimated and its rate's u allowed
for."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.inference.identifiability import identify
from inercal.foundation.inference.least_squares import NonlinearFit, whiten
from inercal.systems.imu.known_rates.vector_sizes import SizeFit, fit_sizes, residual_rows
from inercal.systems.imu.limits import LIMITS

NAMES = ("D_F_x", "D_F_y", "D_F_z", "S_x", "S_y", "S_z", "T_xy", "T_xz", "T_yz")
"""The parameters."""

_ROUNDS = 4
_STEPS = 25
_ROUNDING = 1e-8


@dataclass(frozen=True)
class RateFit:
    """The ``fit`` with the scatter of its rows.

    ``geometry`` is the fit with all rows of equal weight, for the words about what they leave open; ``group`` (N,) of
    each residual and, for each of the g groups, the standard deviation ``scatter`` (g,) [rad/s] times ``share`` (N,),
    and its degrees of freedom ``dof`` (g,); ``of_rate`` (N, k) shows which residuals an error of each rate shifts.
    """

    fit: SizeFit
    geometry: NonlinearFit
    group: NDArray[np.int64]
    share: Array
    scatter: Array
    dof: Array
    of_rate: Array

    def by_scatter(self, k: int) -> Array:
        """(N, N) covariance of the residuals by the scatter of group k."""
        return np.diag(np.where(self.group == k, (self.scatter[k] * self.share) ** 2, 0.0))


def fit_rates(outputs: Array, file: NDArray[np.int64], rates: Array, rates_u: Array) -> RateFit:
    """Fit the nine parameters.

    Parameters
    ----------
    outputs : (n, 3)
        Mean outputs in the orientations.
    file : (n,)
        Place of each in ``rates``.
    rates, rates_u : (k,)
        Known rates [rad/s] and their standard uncertainties, each one error for its whole file.

    Notes
    -----
    The variances of the groups are those of restricted maximum likelihood, by the multiplicative steps
    ``v <- v (r^T P D P r) / tr(P D)``, whose fixed point solves its equations (Searle, Casella, McCulloch, Variance
    Components, Wiley 1992, section 6.6); a file of few rows shares its scatter, relative to the rate, with the others.
    """
    sizes = np.abs(rates)[file]
    row, axis = residual_rows(sizes)
    group, share = _groups(file[row], axis >= 0, np.abs(rates))
    of_rate = (file[row][:, None] == np.arange(len(rates))) & (axis < 0)[:, None]
    stated = (of_rate * rates_u) @ (of_rate * rates_u).T
    fit = fit_sizes(outputs, sizes, NAMES)
    count = int(group.max()) + 1
    pooled = fit.fit.chi2 / max(fit.fit.dof, 1)
    least = (_ROUNDING * float(np.max(sizes))) ** 2
    variance = np.array([max(pooled / np.mean(share[group == g] ** 2), least) for g in range(count)])
    dof = np.ones(count)
    for _ in range(_ROUNDS):
        for _ in range(_STEPS):
            V = np.diag(variance[group] * share**2) + stated
            fit = _reweighed(fit, V)
            P = fit.left()
            weighted = (P @ fit.residuals) ** 2
            for g in range(count):
                own = np.where(group == g, share**2, 0.0)
                trace = float(np.diag(P) @ own)
                dof[g] = max(variance[g] * trace, 1e-9)
                variance[g] = max(variance[g] * float(weighted @ own) / max(trace, 1e-300), least)
        V = np.diag(variance[group] * share**2) + stated
        fit = fit_sizes(outputs, sizes, NAMES, V, fit.fit.x)
    geometry = replace(
        fit.fit, identifiability=identify(fit.jacobian, NAMES, 1.0 / fit.fit.identifiability.scale)
    )
    return RateFit(fit, geometry, group, share, np.sqrt(variance), dof, of_rate.astype(float))


def _reweighed(fit: SizeFit, V: Array) -> SizeFit:
    """The fit made linear at its parameters, with other weights."""
    J, r = whiten(fit.jacobian, V), whiten(fit.residuals, V)
    identified = identify(J, NAMES, 1.0 / fit.fit.identifiability.scale)
    linear = replace(fit.fit, jacobian=J, residuals=r, identifiability=identified)
    return replace(fit, fit=linear, covariance=V)


def _groups(
    file: NDArray[np.int64], at_rest: NDArray[np.bool_], rates: Array
) -> tuple[NDArray[np.int64], Array]:
    """Group (N,) of each residual and its share of the group's scatter.

    Files at rest are one group, each file in which the table turned is one of its own if all have
    `LIMITS.rows_of_a_rate`; else these are one group whose scatter goes as the rate. Hardly any rows at rest join the
    slowest turn.
    """
    turned = np.unique(file[~at_rest])
    largest = float(np.max(rates))
    own = all(np.count_nonzero(file == k) >= LIMITS.rows_of_a_rate for k in turned)
    group = np.searchsorted(turned, file) if own else np.zeros(len(file), dtype=np.int64)
    share = np.ones(len(file)) if own else rates[file] / largest
    if np.any(at_rest):
        slowest = turned[np.argmin(rates[turned])]
        if np.count_nonzero(at_rest) >= 3 * LIMITS.rows_at_rest:
            group = np.where(at_rest, int(group.max()) + 1, group)
            share = np.where(at_rest, 1.0, share)
        else:
            group = np.where(at_rest, np.searchsorted(turned, slowest) if own else 0, group)
            share = np.where(at_rest, 1.0 if own else rates[slowest] / largest, share)
    return group, share


def contradiction(rate_fit: RateFit, rates: Array, rates_u: Array) -> tuple[float, Array, Array]:
    """Agreement of several rates with each other, the first that is not 0 taken as it stands.

    Returns
    -------
    probability : float
        Probability of such differences by chance, their uncertainties allowed for; 1 for a single rate.
    difference : (m,)
        Relative amounts by which the other rates seem larger than stated.
    u : (m,)
        Their standard uncertainties.
    """
    from scipy.special import fdtrc

    turned = np.flatnonzero(np.abs(rates) > 0.0)
    if len(turned) < 2:
        return 1.0, np.zeros(0), np.zeros(0)
    fit = rate_fit.fit
    scatter = np.diag((rate_fit.scatter[rate_fit.group] * rate_fit.share) ** 2)
    weigh = np.linalg.inv(scatter)
    A = np.column_stack([fit.jacobian, -rate_fit.of_rate[:, turned[1:]]])
    N = np.linalg.pinv(A.T @ weigh @ A, rcond=1e-14, hermitian=True)
    m = len(turned) - 1
    d = -(N @ A.T @ weigh @ fit.residuals)[-m:]
    size = np.abs(rates[turned])
    part = size[1:] / size[0] * rates_u[turned[0]]
    V = N[-m:, -m:] + np.diag(rates_u[turned[1:]] ** 2) + np.outer(part, part)
    dof = float(np.sum(rate_fit.dof))
    ratio = float(d @ np.linalg.solve(V, d)) / m
    return float(fdtrc(m, dof, ratio)), d / size[1:], np.sqrt(np.diag(V)) / size[1:]
