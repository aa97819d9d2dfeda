"""Estimator 5, to start with: attitude at the first row and coefficients, by Levenberg-Marquardt.

The path follows from them alone (gyro noise left out). The first guess turns all specific forces back to the first row
by the commanded rates and solves Wahba's problem, in closed form and whatever the start: a fit started 100 degrees off
can end in a wrong minimum of the heading, which comes from earth rate alone.

The covariance includes gyro noise: with G the gain of the fit, R the noise of the measurements, H their derivative by
attitude and W = ARW^2 min(t_i, t_j) the covariance of the accumulated wander,

    cov = G R G^T + G H W H^T G^T  (and the prior's share).

References: Wahba 1965, SIAM Review 7(3), problem 65-1; Markley 1988, "Attitude determination using vector
observations and the singular value decomposition", J. Astronautical Sciences 36(3).
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from inercal.arrays import Array
from inercal.estimate.least_squares import NonlinearFit, solve
from inercal.geometry.rotations import (
    boxminus,
    boxplus,
    conjugate,
    exp,
    from_matrix,
    inverse_left_jacobian,
    multiply,
    right_jacobian,
    rotate,
    to_matrix,
)
from inercal.selfcal.filters.filter_result import FilterResult
from inercal.selfcal.filters.gaps import broken
from inercal.selfcal.filters.problem import FilterProblem, Start
from inercal.selfcal.filters.residuals import (
    Measurements,
    Sensed,
    batch_result,
    first_reading,
    followed,
    normalised,
    on_base,
    readings,
    sensed,
    turns,
)
from inercal.selfcal.platform.coefficients import DS, ETA, KA0, KA1
from inercal.selfcal.platform.recording import Recording


def estimate_lm(
    recording: Recording, problem: FilterProblem, start: Start | None = None, history: bool = True
) -> FilterResult:
    """Least squares over the first attitude and the coefficients, without gyro noise in the dynamics.

    Accelerometers alone are enough; arguments as of `inercal.selfcal.filters.batch.estimate_map`. Uncertainties include
    the wander that gyro noise causes, though estimates are not weighted for it: they are wider than the bound. ``nis``
    of a row: squared residuals over the covariance of noise and of the wander up to it, and an equal share of those of
    the prior; its mean is somewhat below 6, as the fit takes part of the wander up. ``innovations`` likewise.
    """
    import scipy.optimize  # noqa: F401  as the kernel, loaded before time is taken

    first = first_reading(recording, problem) if start is None else start
    followed(first.attitude, np.empty((0, 3)))
    began = time.perf_counter()
    measured, arw = readings(recording, problem), problem.noise.angle_random_walk
    fit, at = _fit(recording, problem, measured, first)
    message = "" if fit.converged else fit.message
    if loose := broken(recording, problem, start):
        message = (
            f"the platform did not turn on as before from t = {recording.t[loose[0]]:.10g} s on, where no rate was "
            "recorded, and a fit of one path cannot go on behind that: use map or a filter"
        )
    wander = arw**2 * np.cumsum(recording.walking)
    unknowns, u = _uncertainty(fit, at, recording, arw)
    covariance = unknowns[3:, 3:] * np.outer(problem.prior, problem.prior)
    by_attitude, residual = at.sensed.by_attitude, at.sensed.residual
    spread = np.eye(6) + wander[:, None, None] * by_attitude @ np.swapaxes(by_attitude, 1, 2)
    try:
        weighted = np.linalg.solve(spread, residual[:, :, None])[:, :, 0]
    except np.linalg.LinAlgError:
        weighted = np.full_like(residual, np.nan)
        message = "the random walk of the gyros drowns all measurements: check its unit"
    nis = np.einsum("ki,ki->k", residual, weighted)
    of_prior = fit.residuals[: 3 + len(problem.prior)]
    nis += of_prior @ of_prior / max(int(np.count_nonzero(measured.dims)), 1)
    nis, innovations = np.where(measured.dims > 0, nis, np.nan), None
    if history:
        over = residual.copy()
        over[:, :3] /= np.sqrt(np.diagonal(spread, axis1=1, axis2=2)[:, :3])
        innovations = normalised(over, measured, wander[:, None])
    result = batch_result(
        "lm", recording, problem, measured, (at.q, u), (at.c, covariance), nis, innovations, message
    )
    return replace(result, seconds=time.perf_counter() - began)


def rough_path(recording: Recording, problem: FilterProblem, start: Start) -> tuple[Array, Array]:
    """Attitudes (n, 4) and coefficients (p,) of the fit of `estimate_lm`."""
    _, at = _fit(recording, problem, readings(recording, problem), start)
    return at.q, at.c


def wahba(recording: Recording, problem: FilterProblem, measured: Measurements, start: Start) -> Array:
    """First attitude (4,) from measurements as they are, in closed form.

    Turned back to the first row by the commanded rates, specific forces a_k are C^T u_k, with u_k the vertical as earth
    rate turns it, and encoders read C_k = C. The most probable C maximises the trace of

        C^T (sum w u_k a_k^T + sum w C_k / 2 + C_start / (2 sigma^2)).

    Errors of the coefficients act alike in all rows: all rows together weigh w = 1 / (their variance).
    """
    world, prior, noise = problem.world, problem.prior, problem.noise
    g = float(np.linalg.norm(world.up))
    path = followed(np.array([1.0, 0.0, 0.0, 0.0]), recording.rate * recording.dt[:, None])
    since = recording.t[1:, None] - recording.t[0]
    turned = exp(since * world.earth)
    vertical, forces = rotate(turned, world.up) / g, rotate(path[1:], measured.acc) / g
    first = to_matrix(multiply(multiply(turned, measured.attitude), conjugate(path[1:])))
    three, encoders = measured.used[:, :3].all(axis=1), measured.used[:, 3]
    of_gyros = np.mean(prior[DS] ** 2)
    of_forces = np.mean(prior[KA1] ** 2 + prior[ETA] ** 2 + (prior[KA0] / g) ** 2) + of_gyros
    B = to_matrix(start.attitude) / (2.0 * start.sigma**2)
    B += (
        vertical[three].T
        @ forces[three]
        / ((of_forces + (noise.accelerometer / g) ** 2) * max(three.sum(), 1))
    )
    B += first[encoders].sum(axis=0) / (2.0 * (of_gyros + noise.encoder**2) * max(encoders.sum(), 1))
    U, _, Vt = np.linalg.svd(B)
    return from_matrix(U @ np.diag([1.0, 1.0, np.linalg.det(U) * np.linalg.det(Vt)]) @ Vt)


class _Along(NamedTuple):
    """A path without gyro noise: attitudes ``q`` (n, 4), coefficients ``c`` (p,), residuals ``sensed`` at all rows but
    the first; ``inertial`` (n, 4) attitudes against the frame that b is at the first row; ``slope`` (n, 3, 3 + p)
    rotations, about the axes of p, per unit of the unknowns."""

    q: Array
    c: Array
    sensed: Sensed
    inertial: Array
    slope: Array


def _along(
    x: Array, guess: Array, recording: Recording, problem: FilterProblem, measured: Measurements
) -> _Along:
    """The path of unknowns x (3 + p,): rotation vector [rad] from ``guess``, coefficients over their prior."""
    c, since = problem.prior * x[3:], recording.t - recording.t[0]
    turn, steps = turns(recording.rate, recording.dt, c)
    inertial = followed(boxplus(guess, x[:3]), turn)
    base = on_base(c, problem.world)
    of_earth = -since[:, None] * base.earth
    q, C = multiply(exp(of_earth), inertial), to_matrix(inertial)
    # in the inertial frame what each step does stays as it is
    slope = np.zeros((len(since), 3, len(x)))
    slope[:, :, :3] = C[0] @ right_jacobian(x[:3])
    slope[1:, :, 3:] = np.cumsum(C[1:] @ steps, axis=0)
    slope = np.swapaxes(C, 1, 2) @ slope
    if base.earth_slope is not None:
        by_earth = -since[:, None, None] * right_jacobian(-of_earth) @ base.earth_slope
        slope[:, :, -3:] += np.swapaxes(to_matrix(q), 1, 2) @ by_earth
    slope[:, :, 3:] *= problem.prior
    of_rows = sensed(q[1:], c, measured, problem)
    of_rows = of_rows._replace(by_coefficients=of_rows.by_coefficients * problem.prior)
    return _Along(q, c, of_rows, inertial, slope)


def _fit(
    recording: Recording, problem: FilterProblem, measured: Measurements, start: Start
) -> tuple[NonlinearFit, _Along]:
    """Fit the unknowns of `_along`, from those of `wahba`, to the start, the prior and the measurements."""
    guess, size = wahba(recording, problem, measured, start), 3 + len(problem.prior)
    last: dict[bytes, _Along] = {}

    def along(x: Array) -> _Along:
        """The path of x, kept for when the derivatives are asked for after the residuals."""
        if x.tobytes() not in last:
            last.clear()
            last[x.tobytes()] = _along(x, guess, recording, problem, measured)
        return last[x.tobytes()]

    def residuals(x: Array) -> Array:
        """Of the start, of the prior, of all rows."""
        at = along(x)
        of_start = boxminus(start.attitude, at.q[0]) / start.sigma
        return np.concatenate([of_start, -x[3:], at.sensed.residual.ravel()])

    def jacobian(x: Array) -> Array:
        """Their derivatives."""
        at = along(x)
        of_rows = at.sensed.by_attitude @ at.slope[1:]
        of_rows[:, :, 3:] += at.sensed.by_coefficients
        of_prior, miss = np.eye(size), boxminus(start.attitude, at.q[0])
        of_prior[:3, :3] = inverse_left_jacobian(miss) @ right_jacobian(x[:3]) / start.sigma
        return -np.concatenate([of_prior, of_rows.reshape(-1, size)])

    named = ("turn_x", "turn_y", "turn_z", *problem.names)
    scale = np.append(np.full(3, start.sigma), np.ones(size - 3))
    fit = solve(residuals, jacobian, np.zeros(size), named, scale)
    return fit, along(fit.x)


def _uncertainty(fit: NonlinearFit, at: _Along, recording: Recording, arw: float) -> tuple[Array, Array]:
    """Covariance (3 + p, 3 + p) of the unknowns of `_fit`, standard deviations (n, 3) [rad] of attitudes.

    Each step of the wander, isotropic in the inertial frame, moves all rows after it, and the estimates by these.
    """
    root = arw * np.sqrt(recording.walking)
    C, m, p = to_matrix(at.inertial), len(root), len(at.c)
    gain = fit.gain()[:, 3 + p :].reshape(3 + p, m, 6)
    by_row = np.einsum("pki,kij,klj->kpl", gain, at.sensed.by_attitude, C[1:], optimize=True)
    moved = np.cumsum(by_row[::-1], axis=0)[::-1] * root[:, None, None]  # of the estimates, per step
    unknowns = fit.unit_covariance + np.einsum("kpl,kql->pq", moved, moved, optimize=True)
    # attitude error S (x - x_true) - wander: its covariance, about the axes of p
    S = at.slope
    crossed = np.zeros((m + 1, 3 + p, 3))
    crossed[1:] = np.cumsum(moved * root[:, None, None], axis=0)
    shared = np.einsum("kip,kpl,kli->ki", S, crossed, C, optimize=True)
    wander = np.append(0.0, np.cumsum(root**2))
    variance = np.einsum("kip,pq,kiq->ki", S, unknowns, S, optimize=True) - 2.0 * shared + wander[:, None]
    with np.errstate(invalid="ignore"):  # unknown where a huge wander leaves but rounding
        return unknowns, np.sqrt(variance)
