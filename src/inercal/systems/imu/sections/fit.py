"""The fit of a problem of sections: point, likeliest scatters, lengths that tilts take."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from inercal.foundation.arrays import Array
from inercal.systems.imu.sections.arrow import ArrowSolution, Linear
from inercal.systems.imu.sections.problem import Iterate, Problem, with_classes
from inercal.systems.imu.sections.readings import SectionArrays
from inercal.systems.imu.sections.scatters import mode
from inercal.systems.imu.sections.solve import FAR, NEAR, solved
from inercal.systems.imu.sections.start import first_guess
from inercal.systems.imu.sections.unknowns import K1, SWIVEL, TILT, S

SOFTENED: Final = (1e-3, 3e-5, 1e-6)
"""Noise of means, as parts of the largest output, by which a fit goes from the first guess to noise far below what
tilts do to the outputs: the valley of its sum of squares is too narrow for a straight way."""

_SETTLED: Final = 0.02
_SHORTENED: Final = 1e-8
"""Changes of the logarithms of scatters, and of the parts that tilts take from lengths, that end their rounds."""
_FINEST: Final = 1e-9
"""Noise of means, as a part of the largest output, that counts at least: rounding rules below."""

_SOFT: Final = 100.0
"""Growth of a variance up to which it makes no other valley."""


@dataclass(frozen=True, eq=False)
class FittedSections:
    """A fit: the problem with its classes, the point, the linear problem there, and the likeliest variances."""

    problem: Problem
    point: Iterate
    linear: Linear
    z: Array
    spread: Array
    converged: bool


def fitted(problem: Problem, start: Iterate | None) -> FittedSections:
    """Solve, with the likeliest variances and the lengths that tilts take from verticals and axes; from ``start`` on
    where a point near the solution is known.

    Where noise is far below what coefficients and tilts do together, the valley of the sum of squares is too bent for
    the search; what they take from lengths then counts as noise, and once more as curvature: u is on the safe side.
    """
    fitted = _fit_by(problem, start, whole=False)
    return fitted if fitted.converged else _fit_by(problem, None, whole=True)


def _fit_by(problem: Problem, start: Iterate | None, *, whole: bool) -> FittedSections:
    """Solve; ``whole``: what coefficients leave open of tilts counts as noise as well."""
    z = np.array([np.log(size.median) for size in problem.sizes.values()])
    point = first_guess(problem) if start is None else start
    spread, noise = np.eye(len(z)), noise_of(problem, point, z)
    problem = with_classes(problem, noise)
    for part in SOFTENED if start is None else ():
        softer = softened(problem, part)
        if softer is not None:
            point, _, _ = solved(softer, point, z)
    damping = FAR if start is None else NEAR
    for _ in range(3):
        point, linear, converged = solved(problem, point, z, damping)
        damping = NEAR if converged else FAR
        before, (z, spread) = z, mode(linear, z)
        least_known = z + 2.0 * np.linalg.norm(
            spread, axis=1
        )  # a scatter that may be small makes no fine instrument
        problem = with_classes(problem, noise_of(problem, point, least_known))
        short = point.short
        point = shortened(problem, point, linear, linear.at(z), z, whole=whole)
        change = np.max(np.abs(point.short - short), initial=0.0)
        if converged and np.max(np.abs(z - before), initial=0.0) < _SETTLED and change < _SHORTENED:
            break
    point, linear, converged = solved(problem, point, z, damping)
    return FittedSections(problem, point, linear, z, spread, converged)


def rounded(problem: Problem) -> Problem:
    """The problem with the noise of rounding in all outputs, which those of an exact simulation have as well."""
    r = problem.readings
    return replace(
        problem, readings=replace(r, variance=np.maximum(r.variance, (_FINEST * _largest(r)) ** 2))
    )


def _largest(readings: SectionArrays) -> Array:
    """Largest outputs (3, 1) of the kinds of outputs."""
    y, seen = np.abs(readings.y), readings.seen
    sizes = [np.max(y[:, kinds][seen[:, kinds]], initial=0.0) for kinds in ([0, 1], [2])]
    return np.array(sizes)[[0, 0, 1], None]


def softened(problem: Problem, part: float) -> Problem | None:
    """The problem with a noise of means of at least this ``part`` of the largest outputs; None where it is no less."""
    r = problem.readings
    least = (part * _largest(r)) ** 2
    softer = np.where(r.stated, np.maximum(r.variance, least), r.variance)
    if np.all(softer <= _SOFT * r.variance):
        return None
    return replace(problem, readings=replace(r, variance=softer))


def noise_of(problem: Problem, point: Iterate, z: Array) -> dict[str, float]:
    """Scatter of the means of each sensor [SI], stated or found."""
    scatter = dict(zip(problem.sizes, np.exp(z), strict=True))
    r, out = problem.readings, {}
    for name, kinds in (("acc", slice(0, 2)), ("gyro", slice(2, 3))):
        variance = (r.variance / np.array([point.x[K1], point.x[K1], point.x[S]]) ** 2)[:, kinds]
        for label, on in problem.on.items():
            if label.split()[0] == name:
                variance = variance + on[:, kinds] * scatter[label] ** 2
        if r.seen[:, kinds].any():
            out[name] = float(np.sqrt(np.median(variance[r.seen[:, kinds]])))
    return out


def shortened(
    problem: Problem, point: Iterate, linear: Linear, solution: ArrowSolution, z: Array, *, whole: bool
) -> Iterate:
    """The point with the mean and the variance of the part by which tilts that a section leaves open, within a known
    placing, shorten what acts along a direction: (d1^2 + d2^2)/2. What coefficients leave open is for `bend`,
    unless the ``whole`` is taken."""
    variance, sd = np.zeros(len(problem.sd)), np.zeros(len(problem.sd))
    variance[linear.local] = solution.local_variance if whole else np.diag(solution.given)
    sd[linear.local] = linear.sd(z)[len(linear.shared) :]
    left = np.where(np.isfinite(problem.local(sd)), problem.local(variance), 0.0)[problem.readings.leader]
    parts = [left[:, TILT], left[:, SWIVEL]]
    short = np.stack([0.5 * part.sum(axis=1) for part in parts], axis=1)
    loss = np.stack([0.5 * np.sum(part**2, axis=1) for part in parts], axis=1)
    return replace(point, short=short, loss=loss)
