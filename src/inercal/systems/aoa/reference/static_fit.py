"""Calibration of the sensors against reference angles that are known at rests alone, as of an inclinometer or a sector.

The means of the readings at K rests are fitted, of each accelerometer its scale, bias and axis:

    A_i = S_i (f_x cos lambda_i - f_z sin lambda_i + b_i),   f_x = g sin theta, f_z = c g cos theta

The error of a reading of the reference is one and the same for all rows of a rest and for all sensors: it enters the
covariance of the readings of a rest as sigma^2 s s^T, s their slopes by the angle, beside their own means' scatter.
sigma is that of the largest restricted likelihood (`inercal.foundation.inference.variances`), and where chi-square is
still above its degrees of freedom the covariance grows with it. What rests do not show stays at ten times the
study's prior, as in `inercal.systems.aoa.reference.sensor_fit`; the zero of the reference is taken as true.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import RecordError
from inercal.foundation.inference.identifiability import learned
from inercal.foundation.inference.variances import Solved, solved
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.recording import Recording, mean_u
from inercal.systems.aoa.reference.sensor_fit import Verified, fit_terms
from inercal.systems.aoa.settings import AoaSettings

Stretch = tuple[int, int]

_SIGMAS = (0.0, *np.geomspace(1e-7, 0.1, 32).tolist())
"""Standard deviations [rad] of a reading of the reference that are tried; the last is of no use."""

_ITERATIONS = 3

_FLOOR = 1e-6
"""Standard uncertainty [m/s^2] of a mean, a tenth of a millionth of gravity, below which none is believed."""


def at_rests_alone(recording: Recording) -> list[Stretch]:
    """Stretches of rows, first and one after the last, over each of which one reference angle is given; empty where the
    reference moves or is there all the time."""
    if recording.reference is None:
        return []
    given = np.flatnonzero(np.isfinite(recording.reference))
    if not len(given) or len(given) == len(recording.t):
        return []
    parts = np.split(given, np.flatnonzero(np.diff(given) > 1) + 1)
    if len(parts) < 2 or any(np.ptp(recording.reference[part]) > LIMITS.reference_creep for part in parts):
        return []
    return [(int(part[0]), int(part[-1]) + 1) for part in parts]


def static_fit(recording: Recording, settings: AoaSettings, points: Sequence[Stretch]) -> Verified:
    """Fit the accelerometers to the reference angles of a recording that has them at rests alone.

    A rest is the one of the ``points`` in which a reference angle lies, else the rows that have it. Raises
    `RecordError` where there are fewer than four rests with readings, or no sensor follows them.
    """
    assert recording.reference is not None
    theta, means, u, rates = _rests(recording, points)
    n, count = len(settings.layout.names), len(theta)
    if count < LIMITS.fewest_rests:
        raise RecordError(
            "theta_ref", f"found {count} rests with a reference angle, expected {LIMITS.fewest_rests} or more"
        )
    names, units, usual, start = fit_terms(settings)
    wide = LIMITS.widened_prior * usual
    # of all rests together, for those of one are known by eight cosines
    pooled = np.sqrt(np.nanmean(np.square(u), axis=0))
    x = start.copy()

    for _ in range(_ITERATIONS):
        linear = _linear(settings, theta, means, x)
        tried = [_solve(sigma, x - start, linear, pooled, wide) for sigma in _SIGMAS]
        best = int(np.argmax([likelihood for _, likelihood in tried]))
        sigma, found = _SIGMAS[best], tried[best][0]
        x = start + wide * found.x
    if sigma >= _SIGMAS[-1]:
        raise RecordError("theta_ref", "found angles that no sensor follows, expected those of the model")
    inverse = found.inverse
    used = len(wide) - float(np.sum(inverse**2))
    dof = max(np.count_nonzero(np.isfinite(means)) - used, 1.0)
    P = inverse @ inverse.T * np.outer(wide, wide) * max(float(found.chi2) / dof, 1.0)
    at = names.index("b_g")
    good = rates[np.isfinite(rates)]
    if len(good) > 1:
        x[at], P[at, at] = float(good.mean()), float(good.var(ddof=1)) / len(good)
    more = learned(P, wide, names)
    unseen = tuple(more.at_prior(1.0 / LIMITS.widened_prior))
    rows = int(np.isfinite(recording.reference).sum())
    return Verified(names, units, x, P, more, unseen, np.full(n + 1, np.nan), sigma, rows, True)


def _rests(recording: Recording, points: Sequence[Stretch]) -> tuple[Array, Array, Array, Array]:
    """Reference angles (K,), means of the accelerometers (K, N), their u, and means of the gyro (K,)."""
    assert recording.reference is not None
    inside: dict[Stretch, list[float]] = {}
    for start, stop in at_rests_alone(recording):
        around = next((each for each in points if each[0] <= start and stop <= each[1]), (start, stop))
        if around[1] - around[0] >= LIMITS.starting_rows:
            inside.setdefault(around, []).append(float(recording.reference[start:stop].mean()))
    theta, means, u, rates = [], [], [], []
    for (start, stop), angles in inside.items():
        rows = recording.acc[start:stop]
        theta.append(float(np.mean(angles)))
        columns = [column[np.isfinite(column)] for column in rows.T]
        enough = [len(column) >= LIMITS.starting_rows for column in columns]
        means.append([float(c.mean()) if good else math.nan for c, good in zip(columns, enough, strict=True)])
        u.append(
            [max(mean_u(c), _FLOOR) if good else math.nan for c, good in zip(columns, enough, strict=True)]
        )
        gyro = recording.gyro[start:stop]
        rates.append(float(np.nanmean(gyro)) if np.isfinite(gyro).any() else math.nan)
    n = recording.acc.shape[1]
    shape = (len(theta), n)
    return np.array(theta), np.reshape(means, shape), np.reshape(u, shape), np.array(rates)


def _solve(
    sigma: float, x: Array, linear: tuple[Array, Array, Array], u: Array, wide: Array
) -> tuple[Solved, float]:
    """One step of weighted least squares about ``x``, with readings of the reference off by ``sigma`` [rad]; the
    logarithm of its restricted likelihood."""
    jacobian, residual, slopes = linear
    rows, determinant = [np.eye(len(wide), len(wide) + 1)], 0.0
    for J, r, s in zip(jacobian, residual + jacobian @ x, slopes, strict=True):
        seen = np.isfinite(r) & np.isfinite(u)
        weighted = np.column_stack([J[seen] * wide, r[seen]]) / u[seen, None]
        along = s[seen] / u[seen]
        length = max(float(np.linalg.norm(along)), 1e-300)
        common = math.hypot(1.0, sigma * length)
        # rows by C^(-1/2), C = diag(u^2) + sigma^2 s s^T: products of C^-1 would cancel where sigma is far above u
        weighted -= (1.0 - 1.0 / common) * np.outer(along / length, along @ weighted / length)
        rows.append(weighted)
        determinant += 2.0 * float(np.log(u[seen]).sum() + np.log(common))
    found = solved(np.concatenate(rows))
    return found, float(found.likelihood(determinant))


def _linear(settings: AoaSettings, theta: Array, means: Array, x: Array) -> tuple[Array, Array, Array]:
    """Derivatives (K, N, p) of the readings at coefficients ``x`` (p,), residuals (K, N) and slopes by the angle."""
    layout, g, c = settings.layout, settings.site.gravity, settings.attitude.level
    n = len(layout.names)
    S, b, turned = x[:n], x[n : 2 * n], x[2 * n : 3 * n]
    ca, sa = np.cos(layout.angle + turned), np.sin(layout.angle + turned)
    fx, fz = g * np.sin(theta), c * g * np.cos(theta)
    force = np.outer(fx, ca) - np.outer(fz, sa)
    jacobian = np.zeros((len(theta), n, len(x)))
    each = np.arange(n)
    jacobian[:, each, each] = force + b
    jacobian[:, each, n + each] = S
    jacobian[:, each, 2 * n + each] = -S * (np.outer(fx, sa) + np.outer(fz, ca))
    slopes = np.outer(g * np.cos(theta), ca) + np.outer(c * g * np.sin(theta), sa)
    return jacobian, means - S * (force + b), slopes
