"""The gyro triad from turns between static poses, against the verticals the accelerometers give.

Two kinds of data, fitted together: in every turn the vertical of one pose, carried through the gyro's
output, must meet the vertical of the next (Tedaldi, Pretto, Menegatti, ICRA 2014, eqs. (13) to (16)); in
every pose the mean output is the bias, plus what earth rate and, if asked for, drift with specific force and time
make.
All scatter is estimated from the data: that of the pose means about their own regression, that of the turns
as a variance that grows with the duration of the turn, on top of what the accelerometers' scatter makes of
the verticals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.inference.identifiability import Identifiability, identify
from inercal.foundation.inference.least_squares import NonlinearFit, least_squares, solve
from inercal.foundation.instruments.terms import GYRO_TRIAD
from inercal.foundation.instruments.triad import TriadModel
from inercal.systems.imu.multiposition.deletion import LinearisedFit
from inercal.systems.imu.multiposition.drivers import Drivers
from inercal.systems.imu.multiposition.earth_rate import (
    EarthRate,
    UnknownRates,
    unknown_rates,
    vertical_output,
)
from inercal.systems.imu.turns import Turns, carried, carried_with_derivatives, thin

COARSE = 8
"""Samples in one step of the coarse rounds."""

_OFF_DIAGONAL = tuple((i, j) for i in range(3) for j in range(3) if i != j)


@dataclass(frozen=True)
class StaticRegression:
    """Mean gyro outputs in the poses, regressed on a constant and the drivers, if any.

    ``coefficients`` (c, 3), ``unit_covariance`` (c, c), ``scatter`` (3,) standard deviation of a pose mean
    about the regression [output], ``dof``, ``residuals`` (n, 3).
    """

    coefficients: Array
    unit_covariance: Array
    scatter: Array
    dof: int
    residuals: Array


def regress_static(means: Array, regressors: Array) -> StaticRegression:
    """Regress pose means (n, 3) on a constant and further ``regressors`` (n, c - 1), axis by axis."""
    A = np.column_stack([np.ones(len(means)), regressors])
    names = [f"column {k}" for k in range(A.shape[1])]
    fits = [least_squares(A, y, names) for y in means.T]
    dof = fits[0].dof
    scatter = np.sqrt([fit.chi2 / max(dof, 1) for fit in fits])
    return StaticRegression(
        np.column_stack([fit.beta for fit in fits]),
        fits[0].unit_covariance,
        scatter,
        dof,
        np.column_stack([fit.residuals for fit in fits]),
    )


@dataclass(frozen=True)
class GyroFit:
    """The triad ``model``, ``drift`` (3, q) [output/driver], and how they came about.

    ``x`` (p,) are the parameters ``names``; ``geometry`` is their identifiability by turns and poses, whatever
    the noise. ``walk`` is the angle random walk [rad/sqrt(s)] that explains the scatter of the turns. ``gain``
    (p, 3 m + 3 n) takes errors of the carried verticals (turn by turn, [rad]) and of the pose means (pose by
    pose, [output]) to errors of the parameters, ``rate_gain`` (p, q) the unknown parts of earth rate, each in
    units of its standard deviation. ``miss`` (m, 3) is the carried minus the measured vertical [rad], and
    ``by_earth`` (n, 3) the output in the poses that is put down to earth rate [output].
    ``vertical_error`` (3 m, 3 n) takes errors of the specific force in the poses to errors of ``miss``;
    ``durations`` (m,) [s] of the turns and ``first`` (m,) the pose before each; ``linear`` their misses across the
    vertical, made linear.
    """

    names: tuple[str, ...]
    model: TriadModel
    drift: Array
    x: Array
    converged: bool
    message: str
    geometry: Identifiability
    gain: Array
    rate_gain: Array
    miss: Array
    by_earth: Array
    walk: float
    dof: float
    static: StaticRegression
    vertical_error: Array
    durations: Array
    first: NDArray[np.int64]
    linear: LinearisedFit


def fit_gyro(
    turns: Turns,
    means: Array,
    f: Array,
    force_error: Array,
    scatter: float,
    start: TriadModel,
    drivers: Drivers,
    earth: EarthRate,
) -> GyroFit:
    """Fit bias, scale, misalignment and, if asked for, drift with specific force and time.

    Parameters
    ----------
    turns : Turns
        At least seven turns.
    means : (n, 3)
        Mean gyro output in each pose.
    f : (n, 3)
        Specific force in each pose [m/s^2], from the calibrated accelerometers.
    force_error : (3 n, 3 n)
        Takes independent errors of the pose means of the accelerometers [m/s^2] to errors of ``f``, those
        through the accelerometers' own parameters included.
    scatter : float
        Standard deviation of those independent errors [m/s^2].
    start : TriadModel
        First guess (see `first_guess`).
    drivers : Drivers
        Drivers of the bias, in the poses; the same as in ``turns``.
    earth : EarthRate
        Earth rate at the site.
    """
    names = GYRO_TRIAD + drivers.names
    p = len(names)
    size = np.linalg.norm(f, axis=1, keepdims=True)
    verticals = f / size
    by_earth = vertical_output(verticals, start, earth)
    static = regress_static(means - by_earth, drivers.at_rest)
    design = _static_design(drivers.at_rest, p)
    finest = 1e-12 * np.max(start.scale)

    theta = np.concatenate(
        [static.coefficients[0], start.scale, [start.misalignment[i, j] for i, j in _OFF_DIAGONAL]]
    )
    theta = np.concatenate([theta, static.coefficients[1:].T.ravel()])
    # a bias that turns the instrument by one radian in a turn, and a drift that does so at the largest driver
    turning = np.max(start.scale) / float(np.median(turns.durations))
    typical = np.concatenate([np.full(3, turning), start.scale, np.ones(6)])
    typical = np.concatenate([typical, np.tile(turning / np.max(np.abs(drivers.at_rest), axis=0), 3)])

    durations = np.repeat(turns.durations, 3)
    walk2 = 0.01**2 / float(np.median(turns.durations))
    x = theta
    # Coarse rounds come near cheaply; the last one starts at the minimum with the variance settled.
    coarse = thin(turns, COARSE)
    for part in (coarse, coarse, turns, turns):
        theta = x[:p]
        spread = np.tile(np.maximum(static.scatter, finest), len(f))
        vertical_error = _vertical_errors(part, verticals, size, theta) @ force_error
        by_verticals = scatter**2 * vertical_error @ vertical_error.T
        weigh = np.linalg.inv(np.linalg.cholesky(by_verticals + walk2 * np.diag(durations)))
        unknown = unknown_rates(part, verticals, *unpack(theta), earth)
        x = np.concatenate([theta, np.zeros(len(unknown.sizes))])

        problem = _Problem(part, verticals, means, design, weigh, spread, unknown)
        sizes = np.concatenate([typical, unknown.sizes])
        fit = solve(problem.residuals, problem.jacobian, x, (*names, *unknown.names), sizes)
        x = fit.x
        model, drift = unpack(x[:p])
        left = problem.miss(x)
        by_earth = unknown.output(model, x[p:])
        static = regress_static(means - by_earth, drivers.at_rest)
        dof = max(1.0, 2.0 * len(turns) - _absorbed(fit, len(weigh)))
        walk2 = _excess(left, by_verticals, durations, dof)

    gain = fit.gain()[:p]
    m, n = len(weigh), len(spread)
    by_miss, by_output, by_rate = gain[:, :m] @ weigh, -gain[:, m : m + n] / spread, gain[:, m + n :]
    return GyroFit(
        names,
        model,
        drift,
        x[:p],
        fit.converged,
        fit.message,
        _geometry(turns, verticals, model, drift, design, typical, names),
        np.hstack([by_miss, by_output]),
        # a prior observation of each unknown rate, in units of its size, has an error of one
        -by_rate,
        left.reshape(-1, 3),
        by_earth,
        float(np.sqrt(walk2)),
        dof,
        static,
        vertical_error,
        turns.durations,
        turns.first,
        _across(turns, verticals, left, by_verticals, fit, weigh),
    )


@dataclass(frozen=True)
class _Problem:
    """Whitened residuals of parameters and unknown rates: misses of the turns, pose means, prior rates."""

    turns: Turns
    verticals: Array
    means: Array
    design: Array
    weigh: Array
    spread: Array
    unknown: UnknownRates

    def _split(self, x: Array) -> tuple[TriadModel, Array, Array]:
        """Triad, drift and rates."""
        p = self.design.shape[1]
        return *unpack(x[:p]), x[p:]

    def miss(self, x: Array) -> Array:
        """(3 m,) carried minus measured verticals [rad]."""
        model, drift, rates = self._split(x)
        miss = carried(self.turns, self.verticals, model, drift) - self.verticals[self.turns.last]
        return np.asarray(miss.ravel() + self.unknown.in_turns @ rates)

    def residuals(self, x: Array) -> Array:
        """(3 m + 3 n + q,)."""
        model, _, rates = self._split(x)
        rest = (
            self.design @ x[: self.design.shape[1]] + (self.unknown.output(model, rates) - self.means).ravel()
        )
        return np.concatenate([self.weigh @ self.miss(x), rest / self.spread, rates / self.unknown.sizes])

    def jacobian(self, x: Array) -> Array:
        """(3 m + 3 n + q, p + q)."""
        model, drift, rates = self._split(x)
        p, q = self.design.shape[1], len(rates)
        turn = carried_with_derivatives(self.turns, self.verticals, model, drift)[1].reshape(-1, p)
        rest = self.design + self.unknown.output_sensitivity(model, rates, p)
        by_rate = np.einsum("ij,njk->nik", model.gain, self.unknown.at_rest).reshape(len(self.spread), q)
        return np.block(
            [
                [self.weigh @ turn, self.weigh @ self.unknown.in_turns],
                [rest / self.spread[:, None], by_rate / self.spread[:, None]],
                [np.zeros((q, p)), np.diag(1.0 / self.unknown.sizes)],
            ]
        )


def _across(
    turns: Turns, verticals: Array, miss: Array, by_verticals: Array, fit: NonlinearFit, weigh: Array
) -> LinearisedFit:
    """The misses (m, 2) in the two directions across the vertical at the end of each turn, beside all other data."""
    m, rows = len(turns), len(miss)
    across = np.linalg.svd(verticals[turns.last][:, None, :])[2][:, 1:]
    whole = np.zeros((m, 2, m, 3))
    whole[range(m), :, range(m)] = across
    project = whole.reshape(2 * m, rows)
    return LinearisedFit.beside(
        (project @ miss).reshape(m, 2),
        (project @ np.linalg.solve(weigh, fit.jacobian[:rows])).reshape(m, 2, -1),
        project @ by_verticals @ project.T,
        turns.durations,
        fit.jacobian[rows:],
        fit.residuals[rows:],
    )


def _geometry(
    turns: Turns,
    verticals: Array,
    model: TriadModel,
    drift: Array,
    design: Array,
    typical: Array,
    names: tuple[str, ...],
) -> Identifiability:
    """Identifiability by turns and poses, whatever the noise: misses in radians, rates at rest in radians a turn."""
    by_parameter = carried_with_derivatives(turns, verticals, model, drift)[1]
    per_turn = float(np.median(turns.durations)) / np.tile(model.scale, len(verticals))
    J = np.concatenate([by_parameter.reshape(-1, len(names)), design * per_turn[:, None]])
    return identify(J, names, typical)


def unpack(theta: Array) -> tuple[TriadModel, Array]:
    """Triad and drift (3, q) of parameters (12 + 3 q,): those of the term table, then the rows of the drift."""
    misalignment = np.eye(3)
    for value, (i, j) in zip(theta[6:12], _OFF_DIAGONAL, strict=True):
        misalignment[i, j] = value
    return TriadModel(theta[3:6], misalignment, theta[:3]), theta[12:].reshape(3, (len(theta) - 12) // 3)


def _static_design(drivers: Array, parameters: int) -> Array:
    """(3 n, p): pose means as a linear function of the parameters."""
    n, q = drivers.shape
    design = np.zeros((n, 3, parameters))
    design[:, range(3), range(3)] = 1.0
    for j in range(3):
        design[:, j, 12 + q * j : 12 + q * (j + 1)] = drivers
    return design.reshape(-1, parameters)


def _vertical_errors(turns: Turns, verticals: Array, size: Array, theta: Array) -> Array:
    """(3 m, 3 n): miss of each turn by errors of the specific force in the poses."""
    by_vertical = carried_with_derivatives(turns, verticals, *unpack(theta))[2]
    across = (np.eye(3) - verticals[:, :, None] * verticals[:, None, :]) / size[:, :, None]
    out = np.zeros((len(turns), 3, len(verticals), 3))
    rows = np.arange(len(turns))
    out[rows, :, turns.first] = by_vertical @ across[turns.first]
    out[rows, :, turns.last] -= across[turns.last]
    return out.reshape(3 * len(turns), -1)


def _absorbed(fit: NonlinearFit, rows: int) -> float:
    """Number of parameters that the first ``rows`` residuals determine: the trace of their hat matrix."""
    J = fit.jacobian[:rows]
    return float(np.sum((J @ fit.unit_covariance) * J))


def _excess(miss: Array, by_verticals: Array, durations: Array, dof: float) -> float:
    """Variance per second that brings the weighted sum of squares of ``miss`` down to ``dof``.

    Mandel and Paule's rule (Anal. Chem. 42 (1970) 1194) with a variance proportional to the duration; not
    negative, and never quite zero, so that the covariance of the turns stays positive definite.
    """
    root = np.sqrt(durations)
    floor = 1e-6 * float(miss @ miss) / float(np.sum(durations)) + 1e-24
    # in the eigenvectors of the known part, per second, the covariance is diagonal for every variance
    values, vectors = np.linalg.eigh(by_verticals / np.outer(root, root))
    parts = (vectors.T @ (miss / root)) ** 2

    def surplus(variance: float) -> float:
        return float(np.sum(parts / (np.maximum(values, 0.0) + variance))) - dof

    if surplus(floor) <= 0:
        return floor
    from scipy.optimize import brentq

    return float(brentq(surplus, floor, 1.001 * float(np.sum(parts)) / dof, rtol=1e-9))
