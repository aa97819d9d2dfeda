"""Estimator 7, for comparison: a linear Kalman filter of the misalignment angles, the model of the literature.

The misalignment angles phi (3) [rad] take the commanded attitude to that of the platform, ``q = q_c qexp(phi)``. q_c
follows from the first encoder reading by the commanded rates and earth rate alone, and all is linearised about it once,
with coefficients 0: nothing that is estimated is fed back.

    phi' = -w x phi + kg0 + dM w + eps,   da = [f]x phi + errors of the accelerometers

What this leaves out are products of two errors, a second of arc and more: of 100 arcsec each in a turn by 180 degrees.
It shows in nothing but a comparison. (Jackson 1973, AIAA paper 73-865; Grewal, Henderson and Miyasako 1991,
"Application of Kalman filtering to the calibration and alignment of inertial navigation systems".)
"""

from __future__ import annotations

import math
import time
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from inercal._jit import allocating
from inercal.arrays import Array
from inercal.estimate.kalman import empty_row, innovation_variance, scalar_update
from inercal.geometry.rotations import boxplus, exp, multiply, normalize
from inercal.selfcal.filters.batch import terms_at
from inercal.selfcal.filters.filter_result import FilterResult, History
from inercal.selfcal.filters.gaps import broken
from inercal.selfcal.filters.problem import FilterProblem, Start
from inercal.selfcal.filters.residuals import batch_result, first_reading, followed, normalised, readings
from inercal.selfcal.platform.recording import Recording


class _System(NamedTuple):
    """The linear system of m steps: ``phi+ = F phi + B x + u + noise`` of covariance ``Q``, and whitened measurements
    ``z = H (phi, x) + noise`` (m, 6), with nothing where nothing was measured; x (p,) coefficients over their prior."""

    F: Array
    B: Array
    u: Array
    Q: Array
    H: Array
    z: Array


class _Along(NamedTuple):
    """Estimates after each of m steps: state and standard deviations (m, 3 + p), NIS (m,), innovations (m, 6) over
    their standard deviations."""

    x: Array
    sd: Array
    nis: Array
    innovations: Array


def estimate_linear(
    recording: Recording, problem: FilterProblem, start: Start | None = None, history: bool = True
) -> FilterResult:
    """Linear filter about the commanded path; arguments as of `inercal.selfcal.filters.batch.estimate_map`."""
    first = first_reading(recording, problem) if start is None else start
    followed(first.attitude, np.empty((0, 3)))
    p = len(problem.prior)
    _filter(np.eye(3 + p), _System(*(np.zeros((0, *shape)) for shape in _shapes(p))), _room(0, p))
    began = time.perf_counter()
    measured = readings(recording, problem)
    since = recording.t[:, None] - recording.t[0]
    commanded = followed(first.attitude, recording.rate * recording.dt[:, None])
    reference = normalize(multiply(exp(-since * problem.world.earth), commanded))
    terms = terms_at(reference, np.zeros(p), recording, problem, measured, first)
    to_next = np.linalg.inv(terms.by_next)
    system = _System(
        -to_next @ terms.by_last,
        -to_next @ terms.by_coefficients,
        np.einsum("kij,kj->ki", to_next, terms.process),
        np.asarray(to_next @ np.swapaxes(to_next, 1, 2)),
        np.concatenate([terms.sensed.by_attitude, terms.sensed.by_coefficients], axis=2),
        terms.sensed.residual,
    )
    P, out = np.eye(3 + p), _room(len(recording.dt), p)
    P[:3, :3] *= first.sigma**2
    with np.errstate(over="ignore", invalid="ignore"):  # lost numbers are refused below
        x = _filter(P, system, out)
    q = normalize(boxplus(reference, np.vstack([np.zeros(3), out.x[:, :3]])))
    message = "" if np.isfinite(x).all() and np.isfinite(P).all() else "the filter diverged"
    if loose := broken(recording, problem, start):
        message = (
            f"the platform did not turn on as before from t = {recording.t[loose[0]]:.10g} s on, where no rate was "
            "recorded, and a filter about the commanded path cannot go on behind that: use map or another filter"
        )
    c, covariance = problem.prior * x[3:], P[3:, 3:] * np.outer(problem.prior, problem.prior)
    nis = np.where(measured.dims > 0, out.nis, np.nan)
    path = q, np.vstack([np.full(3, first.sigma), out.sd[:, :3]])
    innovations = normalised(np.zeros_like(out.innovations), measured) if history else None
    result = batch_result(
        "linear", recording, problem, measured, path, (c, covariance), nis, innovations, message
    )
    if history:
        begin = np.vstack([np.zeros(p), np.ones(p)])
        courses = (
            np.vstack([row, part[:, 3:]]) * problem.prior for row, part in zip(begin, out[:2], strict=True)
        )
        result = replace(
            result,
            history=History(*path, *courses),
            innovations=np.where(measured.used, out.innovations, np.nan),
        )
    return replace(result, seconds=time.perf_counter() - began)


def _shapes(p: int) -> tuple[tuple[int, ...], ...]:
    """Shapes of a step's arrays in a `_System`."""
    return (3, 3), (3, p), (3,), (3, 3), (6, 3 + p), (6,)


def _room(m: int, p: int) -> _Along:
    """Room for the estimates of m steps."""
    return _Along(np.empty((m, 3 + p)), np.empty((m, 3 + p)), np.empty(m), np.empty((m, 6)))


@allocating
def _filter(P: Array, system: _System, out: _Along) -> Array:
    """Take the filter through all steps, ``P`` (3 + p, 3 + p) in place; returns the state (3 + p,) at the end."""
    F, B, u, Q, H, z = system
    n = len(P)
    x, work, top, row = np.zeros(n), np.empty(n), np.empty((3, n)), empty_row(n)
    for j in range(n):
        row.places[j] = j
    for k in range(len(z)):
        for i in range(3):
            work[i] = u[k, i]
            for j in range(3):
                work[i] += F[k, i, j] * x[j]
            for j in range(3, n):
                work[i] += B[k, i, j - 3] * x[j]
        for i in range(3):
            x[i] = work[i]
            for m in range(n):
                total = 0.0
                for j in range(3):
                    total += F[k, i, j] * P[j, m]
                for j in range(3, n):
                    total += B[k, i, j - 3] * P[j, m]
                top[i, m] = total
        for i in range(3):
            for m in range(3):
                total = Q[k, i, m]
                for j in range(3):
                    total += top[i, j] * F[k, m, j]
                for j in range(3, n):
                    total += top[i, j] * B[k, m, j - 3]
                P[i, m] = total
            for m in range(3, n):
                P[i, m] = top[i, m]
                P[m, i] = top[i, m]
        for i in range(3):
            for m in range(i):
                P[i, m] = P[m, i]
        for i in range(6):
            innovation = z[k, i]
            for j in range(n):
                row.values[j] = H[k, i, j]
                innovation -= H[k, i, j] * x[j]
            out.innovations[k, i] = innovation / math.sqrt(innovation_variance(P, row, n, 1.0))
        total = 0.0
        for i in range(6):
            for j in range(n):
                row.values[j] = H[k, i, j]
            total += scalar_update(P, x, row, n, z[k, i], 1.0, work)
        out.nis[k] = total
        for j in range(n):
            out.x[k, j] = x[j]
            out.sd[k, j] = math.sqrt(P[j, j])
    return x
