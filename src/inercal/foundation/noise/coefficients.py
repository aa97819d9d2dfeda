"""Noise coefficients N, B, K, R, Q from an Allan deviation, with uncertainties that hold.

Allan variances at neighbouring averaging times come from the same samples, and those at long times from few
independent means. So the fit is generalised least squares with the covariance that they have under the fitted
noise itself (`inercal.foundation.noise.covariance`), repeated until both agree: an estimating equation without bias.
Squared coefficients are fitted, none below zero.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import InputError
from inercal.foundation.findings import Finding
from inercal.foundation.instruments.noise import SYMBOLS, allan_terms
from inercal.foundation.noise.covariance import sums
from inercal.foundation.noise.curve import AllanCurve, TermsFit
from inercal.foundation.noise.deviation import AllanDeviation
from inercal.foundation.noise.limits import LIMITS

_N, _Q = SYMBOLS.index("N"), SYMBOLS.index("Q")


@dataclass(frozen=True, eq=False)
class NoiseCoefficients:
    """Coefficients of one channel that its Allan deviation shows, in the order N, B, K, R, Q.

    ``values`` (p,), ``covariance`` (p, p) and ``dof`` (p,) belong to ``names``, units those of the samples and
    seconds; value ± Student t at that dof times u is the coverage interval. ``bounds`` gives each coefficient that
    was looked for and not seen its upper limit (one-sided, 95 %). ``fit_range`` (shortest, longest averaging time
    used) [s]; ``chi2`` and ``chi2_dof`` the squared residuals in units of their covariance; ``findings`` are
    about the fit.
    """

    names: tuple[str, ...]
    values: Array
    covariance: Array
    dof: Array
    bounds: Mapping[str, float]
    fit_range: tuple[float, float]
    chi2: float
    chi2_dof: int
    findings: tuple[Finding, ...] = ()

    @property
    def u(self) -> Array:
        """Standard uncertainties (p,)."""
        return np.sqrt(np.diag(self.covariance))

    def variance(self, tau: Array, gain: Array | float = 1.0) -> Array:
        """Fitted Allan variance (*tau.shape) at averaging times ``tau`` [s].

        That of a recording with gaps by the ``gain`` (*tau.shape, 5) of its terms; by default without.
        """
        columns = [SYMBOLS.index(name) for name in self.names]
        return np.asarray((allan_terms(tau) * gain)[..., columns] @ self.values**2)


def noise_coefficients(
    deviation: AllanDeviation,
    channel: int = 0,
    *,
    terms: tuple[str, ...] = SYMBOLS,
) -> NoiseCoefficients:
    """Fit the noise of one channel and report the terms that it shows.

    All averaging times are fitted; where the noise of short means is not of the kinds looked for (filters and dither
    shape it), those from the shortest from which it is.

    Parameters
    ----------
    deviation : AllanDeviation
        At averaging times spread over decades.
    channel : int
        Column of it.
    terms : tuple of str, optional
        Terms looked for, of N, B, K, R, Q.

    Raises
    ------
    InputError
        Unknown terms, or none.

    Notes
    -----
    Terms are left out one at a time, the least significant first, while the least is below `Limits.term_sigmas`
    standard deviations under the noise of the others. What the reported squares would move by, were a term that was
    left out fitted after all, is counted as one standard uncertainty. The degrees of freedom of a ramp are those of the
    noise in which it is seen (Welch and Satterthwaite); those of other terms are half of the chi-square degrees of
    freedom that a term's own scatter leaves it, for with a standard deviation s of nu degrees of freedom and u =
    s/sqrt(2 nu) the interval s ± t(nu/2) u holds the truth at 95 % within 1 % from nu = 4 on, and more often below.
    Where a misfit remains, the covariance is multiplied by chi2 per degree of freedom.
    """
    unknown = [term for term in terms if term not in SYMBOLS]
    if unknown or not terms:
        expected = ", ".join(SYMBOLS)
        raise InputError("terms", f"found {', '.join(unknown) or 'none'}, expected some of {expected}")
    columns = [i for i, symbol in enumerate(SYMBOLS) if symbol in terms]
    rows = _rows(deviation, channel)
    if len(rows) < LIMITS.fewest_times:
        few = (
            f"there are fewer than {LIMITS.fewest_times} averaging times with a deviation above zero: "
            "no noise was fitted"
        )
        return _nothing(deviation, terms, Finding("few_degrees_of_freedom", few))
    lengths = deviation.lengths[rows]
    scale = float(np.max(deviation.deviation[rows, channel]))
    gain = deviation.gain[rows, channel]
    whole = AllanCurve(
        (deviation.deviation[rows, channel] / scale) ** 2,
        allan_terms(lengths) * gain,
        deviation.terms[rows, channel] / (deviation.samples + 1.0 - 2.0 * lengths),
        sums(deviation.samples, tuple(lengths.tolist())).with_gaps(
            deviation.samples, gain[:, _N], gain[:, _Q]
        ),
    )
    tried = _tried(whole, columns)
    if not tried:
        line = "the output is a ramp without noise of the kinds looked for: none was fitted"
        return _nothing(deviation, terms, Finding("noise_misfit", line))
    curve, squares, chi2, chi2_dof = tried[-1]
    fits = not _improbable(chi2, chi2_dof)
    if not fits:  # then the one that comes nearest
        curve, squares, chi2, chi2_dof = min(tried, key=lambda one: one[2] / max(one[3], 1))
    fit = curve.fitted(curve.eliminated(squares, LIMITS.term_sigmas))
    first = len(rows) - len(curve.variances)
    span = (float(deviation.tau[rows[first]]), float(deviation.tau[rows[-1]]))
    inflation = 1.0 if fits else chi2 / chi2_dof
    unit = scale * _in_seconds(deviation.interval)
    values, covariance, dof, bounds = _uncertain(curve, fit, columns, unit, inflation, chi2_dof)
    names = tuple(SYMBOLS[i] for i in fit.seen)
    findings = tuple(_findings(span, first > 0, inflation))
    return NoiseCoefficients(names, values, covariance, dof, bounds, span, chi2, chi2_dof, findings)


def _rows(deviation: AllanDeviation, channel: int) -> list[int]:
    """Averaging times to fit: known, and well apart."""
    rows: list[int] = []
    for row, (tau, value) in enumerate(zip(deviation.tau, deviation.deviation[:, channel], strict=True)):
        apart = not rows or tau >= (LIMITS.spacing_ratio - 1e-9) * deviation.tau[rows[-1]]
        if value > 0.0 and apart:
            rows.append(row)
    return rows


def _tried(whole: AllanCurve, columns: list[int]) -> list[tuple[AllanCurve, Array, float, int]]:
    """Curves, from the whole to ever later starts, with squares and misfit; the last may fit."""
    tried = []
    curve, squares = whole, whole.squares(columns)
    while squares is not None:
        chi2, dof = curve.misfit(squares)
        tried.append((curve, squares, chi2, dof))
        if not _improbable(chi2, dof) or len(curve.variances) <= LIMITS.fewest_kept:
            break
        curve = curve.without_first()
        squares = curve.squares(columns)
    return tried


def _improbable(chi2: float, dof: int) -> bool:
    """True if the residuals are larger than chance lets them be."""
    from scipy.special import chdtrc

    return dof > 0 and bool(chdtrc(dof, chi2) < LIMITS.misfit_chance)


def _nothing(deviation: AllanDeviation, terms: tuple[str, ...], why: Finding) -> NoiseCoefficients:
    """A fit without any coefficient."""
    none = np.zeros(0)
    span = (deviation.interval, deviation.interval * (deviation.samples // 2))
    return NoiseCoefficients(
        (), none, np.zeros((0, 0)), none, dict.fromkeys(terms, np.inf), span, 0.0, 0, (why,)
    )


def _in_seconds(interval: float) -> Array:
    """N, B, K, R and Q in seconds, from those per sample."""
    return np.array([np.sqrt(interval), 1.0, 1.0 / np.sqrt(interval), 1.0 / interval, interval])


def _uncertain(
    curve: AllanCurve, fit: TermsFit, columns: list[int], unit: Array, inflation: float, chi2_dof: int
) -> tuple[Array, Array, Array, dict[str, float]]:
    """Coefficients of a fit in their units, with all that makes them uncertain, and limits of the others."""
    others = [i for i in columns if i not in fit.seen]
    moves = np.array([curve.moves(fit, i) for i in others]).reshape(len(others), len(fit.seen))
    covariance = inflation * (fit.covariance + moves.T @ moves)
    dof = np.array([curve.dof(fit, k) for k in range(len(fit.seen))])
    if inflation > 1.0:
        dof = np.minimum(dof, chi2_dof)
    seen = list(fit.seen)
    values = np.sqrt(fit.squares[seen])
    slope = unit[seen] / (2.0 * values)
    bounds = {
        SYMBOLS[i]: float(unit[i] * np.sqrt(inflation**0.5 * curve.upper_limit(fit, i))) for i in others
    }
    return unit[seen] * values, covariance * np.outer(slope, slope), dof, bounds


def _findings(span: tuple[float, float], cut: bool, inflation: float) -> list[Finding]:
    """Findings about a fit."""
    findings = []
    if cut:
        findings.append(
            Finding(
                "noise_misfit",
                f"means shorter than {span[0]:.3g} s were left out of the fit: their noise is not N, B, K, R, Q "
                "(filters and dither shape it)",
            )
        )
    if inflation > 1.0:
        findings.append(
            Finding(
                "noise_misfit",
                "the Allan deviation is not that of N, B, K, R, Q: its residuals are "
                f"{np.sqrt(inflation):.2g} times what chance explains, and the uncertainties are enlarged by that",
            )
        )
    return findings
