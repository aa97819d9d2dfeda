"""The batch estimator: the most probable attitudes and coefficients, by Gauss-Newton on a banded system.

Unknowns are the attitude at every row and the coefficients (linear form). Each term of the sum of squares is whitened:

    the first attitude against the first encoder reading (or a start), and the coefficients against their prior,
    each step: log(propagated^-1 next), of covariance ARW^2 dt I,
    each row: accelerometers, and log(q^-1 q_encoders) of covariance sigma^2 (J J^T + 0.05^2 I).

Attitudes are tied to their neighbours alone: their part of the normal matrix has a band of five beside its diagonal.
The Schur complement without them is left for the coefficients, and its inverse is their covariance, the Cramer-Rao
bound along the path found (Triggs et al. 2000, "Bundle adjustment - a modern synthesis", section 6).
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from inercal.foundation._jit import allocating
from inercal.foundation.arrays import Array
from inercal.foundation.geometry.rotations import (
    boxminus,
    boxplus,
    conjugate,
    exp,
    inverse_left_jacobian,
    multiply,
    normalize,
    to_matrix,
)
from inercal.systems.selfcal.filters.filter_result import FilterResult
from inercal.systems.selfcal.filters.gaps import broken
from inercal.systems.selfcal.filters.problem import AttitudeStart, FilterProblem, encoders_at
from inercal.systems.selfcal.filters.residuals import (
    RowMeasurements,
    Sensed,
    batch_result,
    first_reading,
    followed,
    normalised,
    readings,
    sensed,
    turns,
)
from inercal.systems.selfcal.platform.model import base_of
from inercal.systems.selfcal.platform.recording import Recording
from inercal.systems.selfcal.platform.states import TAU

_BAND = 5
"""Entries below the diagonal that the attitudes' normal matrix has."""

_STEP = 1e-6
"""Size of the last step, over the standard uncertainties of the coefficients, at which the iteration ends."""

_ITERATIONS = 30


def estimate_map(
    recording: Recording, problem: FilterProblem, start: AttitudeStart | None = None, history: bool = True
) -> FilterResult:
    """Maximum a posteriori over all attitudes and coefficients; measurements missing or stopped by the gate left out.

    ``start`` is that of the first attitude, its encoder reading if absent; the iteration begins at the encoders all the
    same, so that a start may be off by any angle, and only where these never read at the commanded path from the start.
    With ``history`` attitudes are given all measurements.

    ``nis`` of a row: squared normalised residuals of its measurements and of the steps since the row measured before,
    and an equal share of those of the prior. Their sum over all rows is the minimum, chi-square with as many degrees of
    freedom as there are scalar measurements (unknowns and terms of prior and steps are as many). ``innovations`` are
    residuals over the standard deviations of their noise. Not ``converged`` where the iteration did not end.
    """
    import scipy.linalg  # noqa: F401  as the kernels, loaded before time is taken

    first = first_reading(recording, problem) if start is None else start
    of_encoders = start is None
    followed(first.attitude, np.empty((0, 3)))
    inverse_diagonal(np.ones((2, 2), order="F"), np.empty(2))
    began = time.perf_counter()
    measured, loose = readings(recording, problem), broken(recording, problem, start)
    q, c = _first_guess(recording, problem, measured, start), problem.mean
    p = len(c)
    message = f"the iteration did not end in {_ITERATIONS} steps, so far is the recording from the model"
    covariance, u = np.full((p, p), np.nan), np.full((len(q), 3), np.nan)
    for _ in range(_ITERATIONS):
        try:
            with np.errstate(over="ignore", invalid="ignore"):  # lost numbers are refused below
                terms = _terms_at(q, c, recording, problem, measured, first, loose, of_encoders)
                step = _step(terms, history)
        except (np.linalg.LinAlgError, ValueError):
            message = "the iteration diverged: the normal equations are not positive definite"
            break
        covariance, u = step.covariance, step.attitude_u
        q, c = normalize(boxplus(q, step.attitudes)), c + problem.prior * step.coefficients
        if np.max(np.abs(step.coefficients) / np.sqrt(np.diag(covariance))) < _STEP:
            message = ""
            break
    covariance = covariance * np.outer(problem.prior, problem.prior)
    innovations = normalised(terms.sensed.residual, measured) if history else None
    nis = _per_row(terms, measured)
    result = batch_result(recording, problem, measured, (q, u), (c, covariance), nis, innovations, message)
    return replace(result, seconds=time.perf_counter() - began, restarts=tuple(k + 1 for k in loose))


def _first_guess(
    recording: Recording, problem: FilterProblem, measured: RowMeasurements, start: AttitudeStart | None
) -> Array:
    """Attitudes (n, 4) to begin with: the encoders', carried by the commands where silent."""
    seen = np.append(start is None, np.all(np.isfinite(recording.th[1:]), axis=1))
    first = first_reading(recording, problem).attitude if start is None else start.attitude
    attitudes = np.vstack([first, measured.attitude])
    path = followed(first, recording.rate * recording.dt[:, None])
    # the reading before each row, or the first one before there is any
    last = np.maximum.accumulate(np.where(seen, np.arange(len(seen)), int(np.argmax(seen))))
    since = recording.t - recording.t[last]
    turned = multiply(exp(-since[:, None] * problem.world.earth), attitudes[last])
    carried = multiply(turned, multiply(conjugate(path[last]), path))
    return normalize(carried)


class _Terms(NamedTuple):
    """Whitened residuals and derivatives of the model, per change of coefficients over their prior: of the ``first``
    attitude (3,), of what is ``sensed``, of the steps (``process`` (n - 1, 3), by the attitude before and after and by
    the coefficients), of the ``prior`` (p,)."""

    first: Array
    by_first: Array
    first_by_coefficients: Array
    sensed: Sensed
    process: Array
    by_last: Array
    by_next: Array
    by_coefficients: Array
    prior: Array


def _terms_at(
    q: Array,
    c: Array,
    recording: Recording,
    problem: FilterProblem,
    measured: RowMeasurements,
    start: AttitudeStart,
    loose: Sequence[int] = (),
    of_encoders: bool = False,
) -> _Terms:
    """All terms at attitudes (n, 4) and coefficients (p,); ``loose`` steps weigh next to nothing; ``of_encoders``: the
    start is that of the first reading, whose errors are those of the states."""
    prior, dt, states = problem.prior, recording.dt, problem.states
    of_rows, by_start = sensed(q[1:], c, measured, problem), np.zeros((3, len(c)))
    earth = np.array(base_of(states.full(c), states.layout.based, problem.world)[0])
    turn, slope = turns(q[:-1], recording.steps, c, problem)
    if of_encoders:
        start, by_start = _at_encoders(recording, problem, c, start)
    ahead = exp(turn)
    propagated = multiply(multiply(exp(-dt[:, None] * earth), q[:-1]), ahead)
    residual = boxminus(q[1:], propagated)
    weight = 1.0 / (problem.noise.angle_random_walk * np.sqrt(recording.walking))
    weight[list(loose)] = 1.0 / np.pi
    left = inverse_left_jacobian(residual) * weight[:, None, None]
    miss = boxminus(start.attitude, q[0])
    return _Terms(
        miss / start.sigma,
        inverse_left_jacobian(miss) / start.sigma,
        -inverse_left_jacobian(miss).T @ by_start * prior / start.sigma,
        of_rows._replace(by_coefficients=of_rows.by_coefficients * prior),
        residual * weight[:, None],
        left @ np.swapaxes(to_matrix(ahead), 1, 2),
        -np.swapaxes(left, 1, 2),
        left @ (slope * prior),
        (problem.mean - c) / prior,
    )


def _at_encoders(
    recording: Recording, problem: FilterProblem, c: Array, start: AttitudeStart
) -> tuple[AttitudeStart, Array]:
    """The start at the first reading of the encoders as the states have it, and its change (3, p) by these; with the
    turn within the prior of a delay added to its sigma."""
    q, slope = encoders_at(problem, recording.th[0], c, recording.rate[0])
    late = problem.states.layout.place[TAU] - 3
    sigma = start.sigma
    if late >= 0:
        sigma = math.hypot(sigma, float(np.linalg.norm(slope[:, late])) * problem.prior[late])
        slope[:, late] = 0.0
    return AttitudeStart(q, sigma), slope


class _GaussNewtonStep(NamedTuple):
    """A step of Gauss-Newton: of ``attitudes`` (n, 3) [rad] and ``coefficients`` (p,), over their prior; with the
    ``covariance`` (p, p) of these and standard deviations ``attitude_u`` (n, 3) [rad], or (0, 3)."""

    attitudes: Array
    coefficients: Array
    covariance: Array
    attitude_u: Array


def _step(terms: _Terms, attitude_u: bool) -> _GaussNewtonStep:
    """Solve the normal equations of all terms."""
    from scipy.linalg import cho_solve_banded, cholesky_banded

    of_rows = terms.sensed
    last, following = np.swapaxes(terms.by_last, 1, 2), np.swapaxes(terms.by_next, 1, 2)
    seen = np.swapaxes(of_rows.by_attitude, 1, 2)
    n, p = len(of_rows.residual) + 1, len(terms.prior)
    diagonal = np.zeros((n, 3, 3))
    diagonal[0] = terms.by_first.T @ terms.by_first
    diagonal[1:] += seen @ of_rows.by_attitude + following @ terms.by_next
    diagonal[:-1] += last @ terms.by_last
    below = following @ terms.by_last
    # gradients of the attitudes, and their ties to the coefficients beside them
    right = np.zeros((n, 3, 1 + p))
    of_first = np.column_stack([terms.first, terms.first_by_coefficients])
    right[0] = terms.by_first.T @ of_first
    of_process = np.concatenate([terms.process[:, :, None], terms.by_coefficients], axis=2)
    of_sensed = np.concatenate([of_rows.residual[:, :, None], of_rows.by_coefficients], axis=2)
    right[1:] += seen @ of_sensed + following @ of_process
    right[:-1] += last @ of_process
    band = np.zeros((_BAND + 1, 3 * n))
    for j in range(3):
        for i in range(3):
            if i >= j:
                band[i - j, j::3] = diagonal[:, i, j]
            band[3 + i - j, j:-3:3] = below[:, i, j]
    factor = cholesky_banded(band, lower=True)
    ties = right.reshape(3 * n, 1 + p)
    solved = cho_solve_banded((factor, True), ties)
    flat_process, flat_sensed = of_process.reshape(-1, 1 + p), of_sensed.reshape(-1, 1 + p)
    both = flat_process.T @ flat_process + flat_sensed.T @ flat_sensed - ties.T @ solved
    both[1:] += terms.first_by_coefficients.T @ of_first
    schur = both[1:, 1:] + np.eye(p)
    covariance = np.linalg.inv(schur)
    if not (np.diag(covariance) > 0.0).all():
        raise np.linalg.LinAlgError("the coefficients have no variance")
    coefficients = np.linalg.solve(schur, both[1:, 0] + terms.prior)
    by_coefficients = solved[:, 1:]
    attitudes = solved[:, 0] - by_coefficients @ coefficients
    variance = np.empty(0)
    if attitude_u:
        variance = np.empty(3 * n)
        inverse_diagonal(factor, variance)
        variance += np.einsum("ki,ij,kj->k", by_coefficients, covariance, by_coefficients, optimize=True)
    return _GaussNewtonStep(
        attitudes.reshape(n, 3), coefficients, covariance, np.sqrt(variance).reshape(-1, 3)
    )


def _per_row(terms: _Terms, measured: RowMeasurements) -> Array:
    """Squared residuals of each measured row, of the steps since the one before, and a share of those of the prior."""
    total = np.cumsum(np.sum(terms.sensed.residual**2, axis=1) + np.sum(terms.process**2, axis=1))
    nis, rows = np.full(len(total), np.nan), np.flatnonzero(measured.dims)
    of_prior = float(terms.first @ terms.first + terms.prior @ terms.prior)
    nis[rows] = np.diff(total[rows], prepend=0.0) + of_prior / max(len(rows), 1)
    return nis


@allocating
def inverse_diagonal(factor: Array, out: Array) -> None:
    """Diagonal ``out`` (m,) of the inverse of a banded matrix, without the rest (Takahashi et al. 1973).

    ``factor`` (b + 1, m) is its Cholesky factor L in LAPACK's lower form, ``factor[i, j] = L[j + i, j]``. With Z the
    inverse, ``Z L = L^-T`` gives column j of Z within the band from those after it.
    """
    b, m = factor.shape[0] - 1, factor.shape[1]
    Z = np.zeros((b + 1, m))
    for j in range(m - 1, -1, -1):
        near = min(b, m - 1 - j)
        for i in range(near, -1, -1):
            total = 1.0 / factor[0, j] if i == 0 else 0.0
            for k in range(1, near + 1):
                total -= factor[k, j] * Z[abs(k - i), j + min(k, i)]
            Z[i, j] = total / factor[0, j]
        out[j] = Z[0, j]
