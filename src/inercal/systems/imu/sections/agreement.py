"""Agreement of sections with each other: residuals of each sensor, sections that lie off all others, placing."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.special import chdtrc, fdtrc

from inercal.foundation.arrays import Array
from inercal.systems.imu.sections.arrow import ArrowSolution, Linear
from inercal.systems.imu.sections.problem import Iterate, Problem
from inercal.systems.imu.sections.unknowns import SWIVEL, TILT

_TOLD: Final = 1e-6
"""Share of the variance of a residual below which the section itself settles it."""


def of_sensors(problem: Problem, rest: Array, covariance: Array) -> dict[str, float]:
    """Probability of the residuals of each sensor under its stated noise, if all of it is stated and something is left.

    ``rest`` (n, 9) are the residuals of means, ``covariance`` (n, 9, 9) is theirs.
    """
    out = {}
    stated = (problem.readings.seen & problem.readings.stated).reshape(len(rest), 9)
    variance = np.where(stated, problem.readings.variance.reshape(len(rest), 9), 1.0)
    kept = np.where(stated, np.einsum("ckk->ck", covariance) / variance, 0.0)
    for sensor, rows in (("acc", slice(0, 6)), ("gyro", slice(6, 9))):
        freedom = float(kept[:, rows].sum())
        if freedom > 0.5 and not any(name.split()[0] == sensor for name in problem.on):
            chi2 = float(np.sum(np.where(stated, rest**2 / variance, 0.0)[:, rows]))
            out[sensor] = float(chdtrc(freedom, chi2))
    return out


def of_sections(rest: Array, covariance: Array, chi2: float, freedom: float, stated: bool) -> Array:
    """Probabilities (n,) that a sound section lies as far off what all others say, by its residuals ``rest`` (n, k) and
    their ``covariance`` (n, k, k): as if it were left out. Where noise is not ``stated`` the others tell it."""
    out = np.ones(len(rest))
    for k, (r, C) in enumerate(zip(rest, covariance, strict=True)):
        used = np.diag(C) > 0.0
        if not used.any():
            continue
        size = 1.0 / np.sqrt(np.diag(C)[used])
        values, vectors = np.linalg.eigh(C[np.ix_(used, used)] * np.outer(size, size))
        told = values > _TOLD
        q = int(told.sum())
        off = float(np.sum((vectors.T @ (r[used] * size))[told] ** 2 / values[told]))
        if stated:
            out[k] = chdtrc(q, off)
        elif freedom - q >= 1.0:
            out[k] = fdtrc(q, freedom - q, (off / q) / max((chi2 - off) / (freedom - q), 1e-12))
    return out


def of_placing(
    problem: Problem, point: Iterate, linear: Linear, z: Array, best: ArrowSolution
) -> tuple[Array, Array]:
    """Angles (n, 2) by which verticals and axes lie off what is said of them [rad], and the same over what was known;
    0 where nothing is."""
    x, sd = point.x.copy(), np.zeros(len(problem.sd))
    x[linear.local] += best.local
    sd[linear.local] = linear.sd(z)[len(linear.shared) :]
    local, known = problem.local(x)[problem.readings.leader], problem.local(sd)[problem.readings.leader]
    said = (known > 0.0) & np.isfinite(known)
    angles, sigmas = np.zeros((2, len(local), 2))
    for k, place in enumerate((TILT, SWIVEL)):
        angles[:, k] = np.linalg.norm(np.where(said, local, 0.0)[:, place], axis=1)
        sigmas[:, k] = np.linalg.norm(
            np.where(said, local / np.where(said, known, 1.0), 0.0)[:, place], axis=1
        )
    return angles, sigmas
