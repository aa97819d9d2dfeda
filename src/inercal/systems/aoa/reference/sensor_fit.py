"""Calibration of the sensors of a model against a reference angle: scale, bias, axis, position, delays.

    A_i = S_i (f_x cos lambda_i - f_z sin lambda_i + b_i)      lambda_i = stated + dlambda_i
    f_x = g sin theta - r_i w^2 - c z_i al                     r_i = stated + dr_i, z_i = stated + zo_i
    f_z = c (g cos theta + r_i al) - c^2 z_i w^2               c the cosine of the stated roll
    G = c (1 + k_g) w + b_g

all of the reference motion ``tau`` earlier, the gyro's another ``tau_g`` earlier. Gauss-Newton on readings and model
smoothed alike (`inercal.systems.aoa.reference.readings`), each sensor weighted by its own residuals, with a prior ten
times as wide as the study's (tau: as wide, for in a sweep at one rate it cannot be told from the axes), so that what
the record does not show stays where it was. The covariance is that of the scores as they are found, all sensors of a
row and rows nearby together (Newey and West 1987, Econometrica 55, 703-708): noise of the reference acts on all at
once, more where the angle changes more, and its derivatives are far from white. The zero of the reference, and its
clock, are taken as true: their errors are in all dlambda and in tau.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.errors import RecordError
from inercal.foundation.inference.identifiability import Learned, learned
from inercal.foundation.results.result import Parameter
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.recording import Recording
from inercal.systems.aoa.reference.readings import OVERLAP, ReferenceMotion, reference
from inercal.systems.aoa.settings import AoaSettings

KINDS = ("S", "b", "dlambda", "dr", "zo")
_USUAL = 1e-3
"""Usual error of a scale, and of an axis [rad]."""

_NEAR = 6
"""Distance in rows from which on residuals are not correlated; the smoothing reaches over four."""

_ITERATIONS = 8
_SMALL = 1e-3
"""Step over standard uncertainty at which the iteration ends."""


@dataclass(frozen=True, eq=False)
class Verified:
    """Sensors as fitted to a turntable: ``values`` (p,) and their ``covariance`` (p, p).

    ``names``: ``S_1``.. scale, ``b_1``.. bias [m/s^2], ``dlambda_1``.. error of the axis angle [rad], ``dr_1``..,
    ``zo_1``.. errors of positions [m], ``tau`` delay of all sensors against the reference [s], ``b_g`` [rad/s],
    ``k_g``, and ``tau_g`` delay of the gyro against the accelerometers [s].

    ``learned`` is the information of the record beyond the prior, ``unseen`` the names of coefficients no better known
    than by the study's prior. ``noise`` (N + 1,) [m/s^2, rad/s] of one sample of accelerometers and gyro, from the
    residuals below some 5 Hz, NaN where there is no sensor; ``reference_noise`` [rad] of one sample of the reference;
    ``rows`` of the recording that were used.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    covariance: Array
    learned: Learned
    unseen: tuple[str, ...]
    noise: Array
    reference_noise: float
    rows: int
    converged: bool

    @property
    def u(self) -> Array:
        """Standard uncertainties (p,)."""
        return np.sqrt(np.diag(self.covariance))

    def __getitem__(self, name: str) -> Parameter:
        """The coefficient of that name."""
        k = self.names.index(name)
        return Parameter(name, float(self.values[k]), float(self.u[k]), math.inf, self.units[k])


def fit(recording: Recording, settings: AoaSettings) -> Verified:
    """Fit the sensors to the recording's reference angle; roll and yaw are those that the study states.

    Raises `RecordError` where there is no reference angle, too little of it, or none that a sensor follows.
    """
    truth = reference(recording)
    names, units, usual, start = fit_terms(settings)
    wide = np.where([name == "tau" for name in names], usual, LIMITS.widened_prior * usual)
    x, weights = start.copy(), np.full(len(settings.layout.names) + 1, np.nan)
    converged = False
    for _ in range(_ITERATIONS):
        residuals, jacobian = _linearised(recording, settings, truth, x)
        seen = _sound(residuals)
        residuals, jacobian = np.where(seen, residuals, 0.0), np.where(seen[..., None], jacobian, 0.0)
        count = seen.sum(axis=0)
        power = np.square(residuals).sum(axis=0) / np.maximum(count, 1)
        weights = np.where(power > 0.0, OVERLAP[0] / np.where(power > 0.0, power, 1.0), 0.0)
        information = np.einsum("kip,i,kiq->pq", jacobian, weights, jacobian, optimize=True)
        scores = np.einsum("kip,i,ki->kp", jacobian, weights, residuals, optimize=True)
        # in units of the prior, in which the matrices are well scaled, and by factors, so that no variance is negative
        scale = np.outer(wide, wide)
        try:
            inner = np.linalg.inv(np.linalg.cholesky(information * scale + np.eye(len(x))))
            outer = np.linalg.cholesky(_spread(scores) * scale + np.eye(len(x)))
        except np.linalg.LinAlgError as error:
            text = "found angles that no sensor follows, expected those of the model"
            raise RecordError("theta_ref", text) from error
        pull = np.einsum("kip,i,ki->p", jacobian, weights, residuals, optimize=True)
        bread = inner.T @ inner
        step = wide * (bread @ (wide * pull - (x - start) / wide))
        x = x + step
        root = wide[:, None] * (bread @ outer)
        covariance = root @ root.T
        converged = bool((np.abs(step) <= _SMALL * np.sqrt(np.diag(covariance))).all())
        if converged:
            break
    more = learned(covariance, wide, names)
    noise = np.sqrt(power / OVERLAP[0] * truth.span) * np.where(count > 0, 1.0, np.nan)
    unseen = tuple(more.at_prior(1.0 / LIMITS.widened_prior))
    return Verified(names, units, x, covariance, more, unseen, noise, truth.noise, len(truth.rows), converged)


def fit_terms(settings: AoaSettings) -> tuple[tuple[str, ...], tuple[str, ...], Array, Array]:
    """Names, units, usual sizes and first values of the parameters."""
    noise, prior = settings.noise, settings.prior
    n = len(settings.layout.names)
    lever = math.hypot(prior.lever_common, prior.lever)
    of_kind = {
        "S": ("1", _USUAL, 1.0),
        "b": ("m/s^2", max(noise.accelerometer_bias, noise.accelerometer), 0.0),
        "dlambda": ("rad", _USUAL, 0.0),
        "dr": ("m", lever, 0.0),
        "zo": ("m", prior.height, 0.0),
    }
    rows = [(f"{kind}_{k}", *of_kind[kind]) for kind in KINDS for k in range(1, n + 1)]
    rows += [
        ("tau", "s", prior.gyro_delay, settings.timing.common_delay),
        ("b_g", "rad/s", max(noise.gyro_bias, noise.gyro), 0.0),
        ("k_g", "1", max(prior.gyro_scale, _USUAL), 0.0),
        ("tau_g", "s", prior.gyro_delay, settings.timing.gyro_delay or 0.0),
    ]
    names, units, usual, start = zip(*rows, strict=True)
    return names, units, np.array(usual), np.array(start)


def _linearised(
    recording: Recording, settings: AoaSettings, truth: ReferenceMotion, x: Array
) -> tuple[Array, Array]:
    """Smoothed residuals (k, N + 1) and derivatives (k, N + 1, p) of the model; NaN without readings."""
    layout, g = settings.layout, settings.site.gravity
    n = len(layout.names)
    S, b, dlambda, dr, zo = x[: 5 * n].reshape(5, n)
    tau, b_g, k_g, tau_g = x[5 * n :]
    c = settings.attitude.level
    theta, w, w2, al, jerk = truth.motion(tau)
    sine, cosine = np.sin(theta), np.cos(theta)
    ones = truth.smoothed(np.ones(len(theta)))
    residuals, jacobian = np.empty((len(ones), n + 1)), np.zeros((len(ones), n + 1, len(x)))
    for i in range(n):
        ca, sa = math.cos(layout.angle[i] + dlambda[i]), math.sin(layout.angle[i] + dlambda[i])
        r, z = layout.r[i] + dr[i], layout.z[i] + zo[i]
        fx = g * sine - r * w2 - c * z * al
        fz = c * (g * cosine + r * al) - c * c * z * w2
        fx_dot = g * cosine * w - 2.0 * r * w * al - c * z * jerk
        fz_dot = c * (r * jerk - g * sine * w) - 2.0 * c * c * z * w * al
        force = fx * ca - fz * sa
        columns = (
            force + b[i],
            None,
            -S[i] * (fx * sa + fz * ca),
            -S[i] * (w2 * ca + c * al * sa),
            -S[i] * (c * al * ca - c * c * w2 * sa),
        )
        for kind, column in enumerate(columns):
            jacobian[:, i, kind * n + i] = S[i] * ones if column is None else truth.smoothed(column)
        jacobian[:, i, 5 * n] = truth.smoothed(-S[i] * (fx_dot * ca - fz_dot * sa))
        residuals[:, i] = truth.smoothed(recording.acc[truth.rows, i] - S[i] * (force + b[i]))
    w, al = (truth.derivatives[order](truth.t - tau - tau_g) for order in (1, 2))
    scale = c * (1.0 + k_g)
    residuals[:, n] = truth.smoothed(recording.gyro[truth.rows] - scale * w - b_g)
    late = -scale * truth.smoothed(al)
    jacobian[:, n, 5 * n :] = np.stack([late, ones, c * truth.smoothed(w), late], axis=-1)
    return residuals, jacobian


def _spread(scores: Array) -> Array:
    """(p, p) covariance of the sum of scores (k, p), of which rows nearby are correlated by the smoothing.

    Weights that fall to 0 at `_NEAR` rows keep it positive; the share that they take from white noise is restored.
    """
    total, white = scores.T @ scores, OVERLAP[0]
    for lag in range(1, _NEAR):
        weight = 1.0 - lag / _NEAR
        between = weight * (scores[lag:].T @ scores[:-lag])
        total += between + between.T
        white += 2.0 * weight * OVERLAP[lag]
    return np.asarray(total / white)


def _sound(residuals: Array) -> NDArray[np.bool_]:
    """Mask of residuals (k, N + 1) that are numbers and no spikes."""
    sound = np.isfinite(residuals)
    for i, column in enumerate(residuals.T):
        if sound[:, i].any():
            middle = np.median(column[sound[:, i]])
            scatter = np.median(np.abs(column[sound[:, i]] - middle)) / 0.6745
            sound[:, i] &= ~(np.abs(column - middle) > LIMITS.spike_sigmas * scatter)
    return sound
