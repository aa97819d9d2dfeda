"""Calibration of an IMU from sections: coefficients with their uncertainty, and what they rest on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import LinAlgError
from scipy.special import chdtrc, stdtrit

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.inference.limits import LIMITS as INFERENCE
from inercal.foundation.inference.variances import degrees, second_moment, weighed
from inercal.systems.imu.limits import LIMITS as IMU_LIMITS
from inercal.systems.imu.sections.agreement import of_placing, of_sensors, outlying
from inercal.systems.imu.sections.arrow import ArrowSolution, Linear
from inercal.systems.imu.sections.bends import bend
from inercal.systems.imu.sections.fit import FittedSections, fitted, noise_of, rounded
from inercal.systems.imu.sections.limits import LIMITS
from inercal.systems.imu.sections.outputs import misfit
from inercal.systems.imu.sections.priors import Priors, Size
from inercal.systems.imu.sections.problem import Extra, Iterate, Problem, problem_of
from inercal.systems.imu.sections.readings import Flags
from inercal.systems.imu.sections.scatters import half_widths, nodes
from inercal.systems.imu.sections.section import Section
from inercal.systems.imu.sections.unknowns import COEFFICIENTS, COMMON, MOUNTING


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
    common: Array
    """Part (p, p) of the covariance that is one error in repeat runs: by the site, the time base, and what was known
    before of coefficients."""
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
    placed: Array
    """Angles (n, 2) by which verticals and axes lie off what is said of them [rad], 0 where nothing is."""
    placed_sigmas: Array
    """The same over what was known of them."""
    pulled_rates: dict[str, float]
    """Errors of rates that sections share as found, in the standard deviations that they have where all is sound."""
    converged: bool
    problem: Problem
    point: Iterate
    linear: Linear
    z: Array
    """The linear problem at the point, and the likeliest logarithms (c,) of the scatters."""
    widened: float = 1.0
    """Factor on u for residuals that are larger than what is known explains."""

    @cached_property
    def outlying(self) -> Array:
        """Probabilities (n,) that a sound section lies as far off all others."""
        if not self.converged:
            return np.ones(len(self.problem.readings.sections))
        return outlying(self.linear, self.z, self.linear.at(self.z))

    @property
    def misfit(self) -> float:
        """Residuals over what is known of them (rms)."""
        return float(np.sqrt(self.chi2 / self.freedom)) if self.freedom > 0.0 else 1.0

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
    return _widened(found)


def _widened(found: SectionCalibration) -> SectionCalibration:
    """The calibration with u as much larger as its residuals are, where these are not so large that nothing can be
    used."""
    if gross(found):
        return found
    times = found.misfit
    return replace(
        found, u=times * found.u, U=times * found.U, covariance=times**2 * found.covariance, widened=times
    )


def _freed(scale: Size | None) -> Size | None:
    """A prior of scale factors that says nothing but the unit."""
    return None if scale is None else scale._replace(spread=np.inf)


def gross(found: SectionCalibration) -> bool:
    """True where sections contradict what is said of them so much that nothing can be used."""
    return contradicted(found) and (
        found.misfit > INFERENCE.gross or max(found.beyond.values(), default=0.0) > LIMITS.beyond_scatter
    )


def contradicted(found: SectionCalibration) -> bool:
    """True where the sections contradict what is said of them: by their sum of squares, or by a scatter that no
    instrument has."""
    return (
        found.probability < LIMITS.contradiction
        or max(found.beyond.values(), default=0.0) > LIMITS.beyond_scatter
    )


def _calibrated(
    sections: Sequence[Section], priors: Priors, extras: tuple[Extra, ...], start: Iterate | None = None
) -> SectionCalibration:
    """Calibrate with these priors, and with a scatter of its own for each sensor that contradicts its stated noise."""
    fit = fitted(rounded(problem_of(sections, priors, extras)), start)
    rest, covariance = fit.linear.left(fit.z, fit.linear.at(fit.z))[0]
    agreement = of_sensors(fit.problem, rest, covariance)
    new = {sensor for sensor, p in agreement.items() if p < LIMITS.contradiction} - priors.excess
    if new:
        near = fit.point if fit.converged else None
        return _calibrated(sections, replace(priors, excess=priors.excess | new), extras, near)
    return _result(fit, agreement)


def _result(fit: FittedSections, agreement: dict[str, float]) -> SectionCalibration:
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
    J, value = in_outputs(names, x, x[at] + mean)
    variances = np.einsum("ij,gjk,ik->gi", J, covariances, J)
    covariance = J @ covariance @ J.T
    U = half_widths(weights, (shifts - mean) @ J.T, np.sqrt(variances))
    logs_of = np.log(variances)
    dof = degrees(np.maximum(weights @ (logs_of - weights @ logs_of) ** 2, 1e-12))
    dof = np.maximum(dof, LIMITS.fewest_dof)  # u would no longer be like the standard deviation with fewer
    u = U / stdtrit(dof, 0.975)
    scale = u / np.sqrt(np.diag(covariance))

    budget = shares_of(problem, linear, best, z, J)
    left = linear.left(z, best)
    sd = linear.sd(z)[:count]
    size = np.sqrt(np.diag(covariance)) / np.abs(np.diag(J))
    ruled = ruled_by_prior(size, sd, budget)
    pulled = best.covariance[:count, :count] @ np.where(
        np.isfinite(sd), (problem.mean[at] - x[at] - mean) / sd**2, 0.0
    )
    heads = np.array([name.rpartition("_")[0] in ("K1", "S", "M", "T") for name in names])
    leaning = ~ruled & ((np.abs(pulled) > 0.2 * size) | (heads & (size**2 > 0.1 * sd**2)))
    open_ends = int(np.sum(~np.isfinite(linear.sd(z))))
    freedom = float(sum(np.count_nonzero(np.einsum("ckk->ck", C)) for _, C in left) - open_ends)
    placed, sigmas = of_placing(problem, fit.point, linear, z, best)
    return SectionCalibration(
        names=names,
        x=value,
        u=u,
        U=U,
        dof=dof,
        covariance=covariance * np.outer(scale, scale),
        budget=budget,
        common=_common(linear, best, z, J),
        by_prior=tuple(np.array(names)[ruled].tolist()),
        leaning=tuple(np.array(names)[leaning].tolist()),
        scatter={name: float(np.exp(weights @ logs[:, k])) for k, name in enumerate(problem.sizes)},
        scatter_dof={
            name: float(degrees(float(4.0 * weights @ (logs[:, k] - weights @ logs[:, k]) ** 2) + 1e-12))
            for k, name in enumerate(problem.sizes)
        },
        beyond={
            name: float((z[k] - np.log(s.median)) / s.spread)
            for k, (name, s) in enumerate(problem.sizes.items())
        },
        noise=noise_of(problem, fit.point, z),
        chi2=best.chi2,
        freedom=freedom,
        probability=float(chdtrc(freedom, best.chi2)) if freedom > 0.0 else 1.0,
        agreement=agreement,
        excess=problem.priors.excess,
        freed=False,
        residuals=misfit(problem, fit.point),
        placed=placed,
        placed_sigmas=sigmas,
        pulled_rates=_pulled_rates(problem, fit.point, linear, best),
        converged=fit.converged,
        problem=problem,
        point=fit.point,
        linear=linear,
        z=z,
    )


def _common(linear: Linear, best: ArrowSolution, z: Array, J: Array) -> Array:
    """Covariance (p, p) of the coefficients by errors that repeat runs of an instrument at a site share."""
    again = linear.shared < MOUNTING.start  # an instrument is mounted anew
    effects = (best.covariance[:, : len(J)] @ J.T / linear.sd(z)[: len(again), None])[again]
    return np.asarray(effects.T @ effects)


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


def ruled_by_prior(u: Array, sd: Array, shares: Mapping[str, Array]) -> Flags:
    """Coefficients (p,) of whose ``u`` the sections say less than what was known before: their own ``sd``, or priors of
    coefficients by their ``shares`` of u^2."""
    by = sum((share for source, share in shares.items() if source.startswith("prior")), np.zeros(len(u)))
    return np.asarray((u**2 > 0.5 * sd**2) | (by > 0.5))


def in_outputs(names: tuple[str, ...], x: Array, values: Array) -> tuple[Array, Array]:
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


def shares_of(problem: Problem, linear: Linear, best: ArrowSolution, z: Array, J: Array) -> dict[str, Array]:
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
