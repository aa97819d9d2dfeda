"""Agreement of sections with each other: residuals of each sensor, sections that lie off all others, placing."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.linalg import LinAlgError
from scipy.special import chdtrc

from inercal.foundation.arrays import Array
from inercal.foundation.inference.variances import weighed
from inercal.systems.imu.sections.arrow import ArrowSolution, Linear
from inercal.systems.imu.sections.limits import LIMITS
from inercal.systems.imu.sections.problem import Iterate, Problem
from inercal.systems.imu.sections.scatters import mode, nodes
from inercal.systems.imu.sections.unknowns import SWIVEL, TILT

_TOLD: Final = 1e-6
"""Share of the variance of a residual below which the section itself settles it."""

_LEAST_WEIGHT: Final = 1e-3
"""Weight of a node below which it is left out of such a probability."""


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


def of_sections(rest: Array, covariance: Array) -> tuple[Array, Array]:
    """Squared distances (n,) of sections from what all others say, and how many directions (n,) each has.

    ``rest`` (n, k) are the residuals of means, ``covariance`` (n, k, k) theirs; it is as if each section were left out.
    """
    off, told = np.zeros(len(rest)), np.zeros(len(rest))
    for k, (r, C) in enumerate(zip(rest, covariance, strict=True)):
        used = np.diag(C) > 0.0
        if used.any():
            size = 1.0 / np.sqrt(np.diag(C)[used])
            values, vectors = np.linalg.eigh(C[np.ix_(used, used)] * np.outer(size, size))
            left = values > _TOLD
            off[k] = np.sum((vectors.T @ (r[used] * size))[left] ** 2 / values[left])
            told[k] = left.sum()
    return off, told


def outlying(linear: Linear, z: Array, solution: ArrowSolution) -> Array:
    """Probabilities (n,) that a sound section lies as far off what all others say.

    Where variances are not stated, the others tell them: those of the farthest section are found without it, and for
    the rest, which are hardly outliers then, the probability is 1.
    """
    rest, covariance = linear.left(z, solution)[0]
    off, told = of_sections(rest, covariance)
    p = np.where(told > 0, chdtrc(np.maximum(told, 1.0), off), 1.0)
    if not len(z):
        return np.asarray(p)
    worst, out = int(np.argmin(p)), np.ones(len(p))
    if p[worst] < LIMITS.suspect_section:
        without = linear.without(worst)
        try:
            logs, volume = nodes(*mode(without, z))
            weights = weighed(np.array([without.likelihood(there) for there in logs]) + volume)
            heavy = weights > _LEAST_WEIGHT
            found = [
                of_sections(rest[None, worst], covariance[None, worst])[0][0]
                for there in logs[heavy]
                for rest, covariance in [linear.left(there, linear.at(there))[0]]
            ]
        except LinAlgError:
            return out
        out[worst] = weights[heavy] @ chdtrc(told[worst], np.array(found))
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
