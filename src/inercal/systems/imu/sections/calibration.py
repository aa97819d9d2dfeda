"""Calibration of an IMU from sections: coefficients with their uncertainty, and what they rest on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.linalg import LinAlgError
from scipy.special import chdtrc, stdtrit

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.inference.variances import degrees, second_moment, weighed
from inercal.systems.imu.limits import LIMITS as IMU_LIMITS
from inercal.systems.imu.sections.agreement import of_placing, of_sensors, outlying
from inercal.systems.imu.sections.arrow import ArrowSolution, Linear
from inercal.systems.imu.sections.bends import bend
from inercal.systems.imu.sections.limits import LIMITS
from inercal.systems.imu.sections.outputs import misfit
from inercal.systems.imu.sections.priors import Priors, Size
from inercal.systems.imu.sections.problem import Extra, Iterate, Problem, problem_of, with_classes
from inercal.systems.imu.sections.scatters import half_widths, mode, nodes
from inercal.systems.imu.sections.section import Section
from inercal.systems.imu.sections.solve import solved
from inercal.systems.imu.sections.start import first_guess
from inercal.systems.imu.sections.unknowns import COEFFICIENTS, COMMON, K1, LOCAL, SWIVEL, TILT, S

SOFTENED: Final = (1e-3, 3e-5, 1e-6)
"""Noise of means, as parts of the largest output, by which a fit goes from the first guess to noise far below what
tilts do to the outputs: the valley of its sum of squares is too narrow for a straight way."""

_FINEST: Final = 1e-9
"""Noise of means, as a part of the largest output, that counts at least: rounding rules below."""

_SOFT: Final = 100.0
"""Growth of a variance up to which it makes no other valley."""


@short_repr
@dataclass(frozen=True, eq=False)
class SectionCalibration:
    """Coefficients of an IMU from sections, ``x`` (p,) by their ``names``, in SI and units of the outputs.

    ``U`` (p,) are the half widths that hold 95 %, ``dof`` (p,) the degrees of freedom by which ``u`` (p,) is U over
    Student's factor; ``covariance`` (p, p) belongs to u.
    """

    names: tuple[str, ...]
    x: Array
    u: Array
    U: Array
    dof: Array
    covariance: Array
    budget: dict[str, Array]
    """Shares (p,) of u^2 by their source."""
    by_prior: tuple[str, ...]
    """Terms of which the data say less than what was known before."""
    leaning: tuple[str, ...]
    """Terms that a prior shifts by more than a fifth of their u, or holds to more than a tenth."""
    scatter: dict[str, float]
    """Standard deviations that nobody states [SI], as found."""
    scatter_dof: dict[str, float]
    """Their degrees of freedom."""
    beyond: dict[str, float]
    """Distance of each above what was known of it, in standard deviations of its logarithm."""
    noise: dict[str, float]
    """Scatter of the means of each sensor [SI], stated or found."""
    chi2: float
    freedom: float
    probability: float
    """Sum of squares, its degrees of freedom, and the probability of a larger one."""
    agreement: dict[str, float]
    """Probability of such residuals of a sensor under its stated noise."""
    excess: frozenset[str]
    """Sensors whose means scatter beyond their stated noise, for which u allows."""
    freed: bool
    """True where the prior of the scale factors was dropped, since the sections deny it."""
    residuals: Array
    """Outputs (n, 3 kinds, 3 axes) less those of the model."""
    outlying: Array
    """Probabilities (n,) that a sound section lies as far off all others."""
    placed: Array
    """Angles (n, 2) by which verticals and axes lie off what is said of them [rad], 0 where nothing is."""
    placed_sigmas: Array
    """The same over what was known of them."""
    pulled_rates: dict[str, float]
    """Errors of rates that sections share as found, in the standard deviations that they have where all is sound."""
    converged: bool
    problem: Problem
    point: Iterate

    def value(self, name: str) -> tuple[float, float, float]:
        """Value, u and U of a coefficient."""
        k = self.names.index(name)
        return float(self.x[k]), float(self.u[k]), float(self.U[k])

    def relative_alignment(self) -> tuple[tuple[str, ...], Array, Array]:
        """Names of T - M, which says how the axes of the two triads lie to each other, values and covariance."""
        pairs = [name[2:] for name in self.names if name.startswith("T_") and f"M_{name[2:]}" in self.names]
        A = np.zeros((len(pairs), len(self.names)))
        for k, pair in enumerate(pairs):
            A[k, self.names.index(f"T_{pair}")], A[k, self.names.index(f"M_{pair}")] = 1.0, -1.0
        return tuple(f"T - M {pair}" for pair in pairs), A @ self.x, A @ self.covariance @ A.T


@dataclass(frozen=True, eq=False)
class _Fit:
    """A fit: the problem with its classes, the point, the linear problem there, and the likeliest variances."""

    problem: Problem
    point: Iterate
    linear: Linear
    z: Array
    spread: Array
    converged: bool


def calibrate_sections(
    sections: Sequence[Section], priors: Priors, extras: tuple[Extra, ...] = ()
) -> SectionCalibration:
    """Calibrate from sections, of which at least one has an output of a sensor.

    A sensor whose residuals contradict its stated noise is given a scatter of its own. Where sections contradict what
    is known, and a fit with the priors of ordinary instruments does not, or one without the prior of the scale factors,
    it is taken.

    Raises
    ------
    LinAlgError
        Too little is known for any solution.
    """
    found = _calibrated(sections, priors, extras)
    if not (found.converged and contradicted(found)):
        return found
    ordinary = replace(
        priors,
        k2=IMU_LIMITS.ordinary_k2 if priors.k2 is None else priors.k2,
        g_sensitivity=LIMITS.ordinary_g_sensitivity if priors.g_sensitivity is None else priors.g_sensitivity,
    )
    free = replace(ordinary, acc_scale=_freed(priors.acc_scale), gyro_scale=_freed(priors.gyro_scale))
    for other in (ordinary, free):
        try:
            anew = _calibrated(sections, other, extras)
        except LinAlgError:
            continue
        if anew.converged and not contradicted(anew):
            return replace(anew, freed=other is free)
    return found


def _freed(scale: Size | None) -> Size | None:
    """A prior of scale factors that says nothing but the unit."""
    return None if scale is None else scale._replace(spread=np.inf)


def contradicted(found: SectionCalibration) -> bool:
    """True where the sections contradict what is said of them: by their sum of squares, or by a scatter that no
    instrument has."""
    return (
        found.probability < LIMITS.contradiction
        or max(found.beyond.values(), default=0.0) > LIMITS.beyond_scatter
    )


def _calibrated(sections: Sequence[Section], priors: Priors, extras: tuple[Extra, ...]) -> SectionCalibration:
    """Calibrate with these priors, and with a scatter of its own for each sensor that contradicts its stated noise."""
    problem = problem_of(sections, priors, extras)
    found = _result(_fit(softened(problem, _FINEST) or problem))
    new = {sensor for sensor, p in found.agreement.items() if p < LIMITS.contradiction} - priors.excess
    if new:
        return _calibrated(sections, replace(priors, excess=priors.excess | new), extras)
    return found


def _fit(problem: Problem) -> _Fit:
    """Solve, with the likeliest variances and the lengths that tilts take from verticals and axes.

    Where noise is far below what coefficients and tilts do together, the valley of the sum of squares is too bent for
    the search; what they take from lengths then counts as noise, and once more as curvature: u is on the safe side.
    """
    fitted = _fit_by(problem, whole=False)
    return fitted if fitted.converged else _fit_by(problem, whole=True)


def _fit_by(problem: Problem, *, whole: bool) -> _Fit:
    """Solve; ``whole``: what coefficients leave open of tilts counts as noise as well."""
    z, point = np.array([np.log(size.median) for size in problem.sizes.values()]), first_guess(problem)
    spread, noise = np.eye(len(z)), _noise(problem, point, z)
    problem = with_classes(problem, noise)
    for part in SOFTENED:
        softer = softened(problem, part)
        if softer is not None:
            point, _, _ = solved(softer, point, z)
    for _ in range(3):
        point, linear, converged = solved(problem, point, z)
        z, spread = mode(linear, z)
        least_known = z + 2.0 * np.linalg.norm(
            spread, axis=1
        )  # a scatter that may be small makes no fine instrument
        problem = with_classes(problem, _noise(problem, point, least_known))
        point = _shortened(problem, point, linear, linear.at(z), z, whole=whole)
    point, linear, converged = solved(problem, point, z)
    return _Fit(problem, point, linear, z, spread, converged)


def softened(problem: Problem, part: float) -> Problem | None:
    """The problem with a noise of means of at least this ``part`` of the largest outputs; None where it is no less."""
    r = problem.readings
    largest = np.array(
        [np.max(np.abs(r.y[:, kinds][r.seen[:, kinds]]), initial=0.0) for kinds in ([0, 1], [2])]
    )
    least = (part * largest[[0, 0, 1], None]) ** 2
    softer = np.where(r.stated, np.maximum(r.variance, least), r.variance)
    if np.all(softer <= _SOFT * r.variance):
        return None
    return replace(problem, readings=replace(r, variance=softer))


def _noise(problem: Problem, point: Iterate, z: Array) -> dict[str, float]:
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


def _shortened(
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


def _result(fit: _Fit) -> SectionCalibration:
    """Mean and covariance over what is left open of the variances, with 95 % limits of the mixture."""
    problem, linear, x = fit.problem, fit.linear, fit.point.x
    count = int(np.sum(linear.shared < len(COEFFICIENTS)))
    at, names = linear.shared[:count], tuple(COEFFICIENTS[p] for p in linear.shared[:count])
    logs, volume = nodes(fit.z, fit.spread)
    found = [linear.at(z) for z in logs]
    prior = -0.5 * np.sum(((logs - linear.sizes[:, 0]) / linear.sizes[:, 1]) ** 2, axis=1)
    weights = weighed(np.array([each.value for each in found]) + prior + volume)
    z = fit.z
    best = linear.at(z)
    curved = bend(problem, fit.point, linear, z, best)
    shifts = np.array([(each.shared + curved.mean)[:count] for each in found])
    covariances = np.array([(each.covariance + curved.covariance)[:count, :count] for each in found])
    mean = weights @ shifts
    covariance = second_moment(weights, covariances, shifts - mean)
    J, value = _in_outputs(names, x, x[at] + mean)
    variances = np.einsum("ij,gjk,ik->gi", J, covariances, J)
    covariance = J @ covariance @ J.T
    U = half_widths(weights, (shifts - mean) @ J.T, np.sqrt(variances))
    logs_of = np.log(variances)
    dof = degrees(np.maximum(weights @ (logs_of - weights @ logs_of) ** 2, 1e-12))
    dof = np.maximum(dof, LIMITS.fewest_dof)  # u would no longer be like the standard deviation with fewer
    u = U / stdtrit(dof, 0.975)
    scale = u / np.sqrt(np.diag(covariance))

    budget = _budget(problem, linear, best, z, J)
    left = linear.left(z, best)
    sd = linear.sd(z)[:count]
    size = np.sqrt(np.diag(covariance)) / np.abs(np.diag(J))
    by = sum((share for source, share in budget.items() if source.startswith("prior")), np.zeros(count))
    ruled = (size**2 > 0.5 * sd**2) | (by > 0.5)
    pulled = best.covariance[:count, :count] @ np.where(
        np.isfinite(sd), (problem.mean[at] - x[at] - mean) / sd**2, 0.0
    )
    heads = np.array([name.rpartition("_")[0] in ("K1", "S", "M", "T") for name in names])
    leaning = ~ruled & ((np.abs(pulled) > 0.2 * size) | (heads & (size**2 > 0.1 * sd**2)))
    open_ends = int(np.sum(~np.isfinite(linear.sd(z))))
    freedom = float(sum(np.count_nonzero(np.einsum("ckk->ck", C)) for _, C in left) - open_ends)
    placed, sigmas = of_placing(problem, fit.point, linear, z, best)
    means = left[0]
    return SectionCalibration(
        names=names,
        x=value,
        u=u,
        U=U,
        dof=dof,
        covariance=covariance * np.outer(scale, scale),
        budget=budget,
        by_prior=tuple(np.array(names)[ruled].tolist()),
        leaning=tuple(np.array(names)[leaning].tolist()),
        scatter={name: float(np.exp(weights @ logs[:, k])) for k, name in enumerate(problem.sizes)},
        scatter_dof={
            name: float(degrees(4.0 * weights @ (logs[:, k] - weights @ logs[:, k]) ** 2))
            for k, name in enumerate(problem.sizes)
        },
        beyond={
            name: float((z[k] - np.log(s.median)) / s.spread)
            for k, (name, s) in enumerate(problem.sizes.items())
        },
        noise=_noise(problem, fit.point, z),
        chi2=best.chi2,
        freedom=freedom,
        probability=float(chdtrc(freedom, best.chi2)) if freedom > 0.0 else 1.0,
        agreement=of_sensors(problem, *means),
        excess=problem.priors.excess,
        freed=False,
        residuals=misfit(problem, fit.point),
        outlying=outlying(linear, z, best) if fit.converged else np.ones(len(x[problem.shared :]) // LOCAL),
        placed=placed,
        placed_sigmas=sigmas,
        pulled_rates=_pulled_rates(problem, fit.point, linear, best),
        converged=fit.converged,
        problem=problem,
        point=fit.point,
    )


def _pulled_rates(problem: Problem, point: Iterate, linear: Linear, best: ArrowSolution) -> dict[str, float]:
    """Errors of the rates of groups, over the part of their standard deviation that the sections take away."""
    out, at = {}, linear.shared.tolist()
    for k, name in enumerate(problem.readings.rate_groups):
        p = COMMON + k
        if p in at:
            j = at.index(p)
            told = problem.sd[p] ** 2 - best.covariance[j, j]
            if told > LIMITS.told_rate * problem.sd[p] ** 2:
                out[name] = float((point.x[p] + best.shared[j]) / np.sqrt(told))
    return out


def _in_outputs(names: tuple[str, ...], x: Array, values: Array) -> tuple[Array, Array]:
    """Derivatives (p, p) of the coefficients by their ``values`` (p,) in the fit, and the coefficients: G is carried as
    a rate, of which outputs see S times as much. S that is not fitted is that of the unknowns ``x``."""
    J, out = np.eye(len(names)), values.copy()
    for k, name in enumerate(names):
        if name.startswith("G_"):
            scale = f"S_{name[2]}"
            if scale in names:
                J[k, k], J[k, names.index(scale)] = values[names.index(scale)], values[k]
            else:
                J[k, k] = x[COEFFICIENTS.index(scale)]
            out[k] = J[k, k] * values[k]
    return J, out


def _budget(problem: Problem, linear: Linear, best: ArrowSolution, z: Array, J: Array) -> dict[str, Array]:
    """Shares (p,) of the variances of the coefficients by source."""
    of_rows, of_priors = linear.shares(z, best, J)
    out: dict[str, Array] = {}
    for sources, of_block in zip(linear.sources, of_rows, strict=True):
        for source, share in zip(sources, of_block.sum(axis=0), strict=True):
            out[source] = out.get(source, 0.0) + share
    for p, share in zip([*linear.shared, *linear.local], of_priors, strict=True):
        if share.any():
            source = problem.source(int(p))
            out[source] = out.get(source, 0.0) + share
    whole = np.sum(list(out.values()), axis=0)
    return {source: share / whole for source, share in out.items() if np.any(share > 0.0)}
