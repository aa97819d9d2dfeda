"""Judgement of a filter: do its innovations agree with it, and do the uncertainties that it states hold?

On one recording, innovations of a filter whose model and noise hold are white, of zero mean and of the covariance that
it states (Kailath, IEEE Trans. Automatic Control 13 (1968) 646). Three questions follow: is the normalised innovation
squared (NIS) of the expected size, is that of single rows, and are innovations uncorrelated from row to row?

On simulated runs, whose truth is known, two questions follow: do the stated intervals hold the truth as often as they
claim (`coverage`), and do the stated covariances match the spread of all errors together (`nees`)?

All limits follow from the number of rows or runs and an accepted risk of a false alarm (Bar-Shalom, Li and Kirubarajan,
Estimation with Applications to Tracking and Navigation, Wiley 2001, section 5.4.2).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.errors import InputError


@dataclass(frozen=True)
class Nis:
    """Mean NIS of the rows that have measurements.

    ``mean`` over ``rows`` and its ``expected`` value, the mean number of scalars; ``standard_error`` of the mean where
    the model holds, ``sqrt(2 expected / rows)``.
    """

    mean: float
    expected: float
    standard_error: float
    rows: int

    def limit(self, sigmas: float = 5.0) -> float:
        """Mean NIS above which measurements contradict the model by so many standard errors."""
        return self.expected + sigmas * self.standard_error

    @property
    def excess(self) -> float:
        """Offset of the mean in standard errors; inf where it is not a number."""
        if not math.isfinite(self.mean):
            return math.inf
        return (self.mean - self.expected) / self.standard_error


class RunningNis(NamedTuple):
    """NIS of the rows so far: its ``total``, the number of scalars, ``dims``, and of ``rows`` that have any."""

    total: float = 0.0
    dims: int = 0
    rows: int = 0

    def after(self, value: float, dims: int) -> RunningNis:
        """The same with one row more."""
        return RunningNis(self.total + value, self.dims + dims, self.rows + 1)

    @property
    def nis(self) -> Nis:
        """The mean so far, NaN without rows."""
        if not self.rows:
            return Nis(math.nan, math.nan, math.nan, 0)
        expected = self.dims / self.rows
        return Nis(self.total / self.rows, expected, math.sqrt(2.0 * expected / self.rows), self.rows)


def nis(values: ArrayLike, dims: ArrayLike) -> Nis:
    """Judge NIS ``values`` (n,), each of ``dims`` (n,) scalars; rows of 0 scalars are left out.

    Raises ValueError where no row has measurements.
    """
    count = np.asarray(dims, dtype=float)
    used = count > 0.0
    if not used.any():
        raise ValueError("found no row with measurements, expected one at least")
    expected, rows = float(count[used].mean()), int(used.sum())
    mean = float(np.asarray(values, dtype=float)[used].mean())
    return Nis(mean, expected, math.sqrt(2.0 * expected / rows), rows)


def surprising(values: ArrayLike, dims: ArrayLike, risk: float = 1e-3) -> NDArray[np.int64]:
    """Rows whose NIS, of ``dims`` (n,) scalars, is too large, or not a number.

    Where the model holds the probability that any is found is ``risk`` (chi-square, Bonferroni).
    """
    from scipy.special import chdtri

    x, count = np.asarray(values, dtype=float), np.asarray(dims, dtype=float)
    used = np.flatnonzero(count > 0.0)
    fine = x[used] <= chdtri(count[used], risk / max(len(used), 1))
    return np.asarray(used[~fine], dtype=np.int64)


def whiteness(innovations: ArrayLike, lags: int = 20, blocks: Sequence[int] = (10, 40, 160)) -> float:
    """Probability by chance of correlations from row to row as strong as those of innovations (n, m), NaN left out.

    Two tests of each column, and Bonferroni's inequality over all. Of each lag the sum of products x_k x_(k+lag) over
    the root of the sum of their squares is about standard normal, whatever the variances of the rows; their squares are
    summed over the ``lags``. Sums over blocks of some rows show correlation over longer times: their squares,
    each over the number of its measurements and the mean square, add up to about chi-square with as many degrees of
    freedom as there are blocks with measurements, and can be too large or too small.
    """
    from scipy.special import chdtr, chdtrc

    x = np.asarray(innovations, dtype=float)
    filled, total = np.nan_to_num(np.ascontiguousarray(x.T)), np.zeros(x.shape[1])
    squares = np.square(filled)
    for lag in range(1, lags + 1):
        sums, of_squares = (np.array([y[lag:] @ y[:-lag] for y in each]) for each in (filled, squares))
        total += _ratio(np.square(sums), of_squares)
    chances = [chdtrc(lags, total)]
    for size in blocks:
        parts = x[: len(x) // size * size].reshape(-1, size, x.shape[1])
        rows, parts = np.isfinite(parts).sum(axis=1), np.nan_to_num(parts)
        count = np.count_nonzero(rows, axis=0)
        mean_square = _ratio(np.square(parts).sum(axis=(0, 1)), rows.sum(axis=0))
        sums = _ratio(np.sum(np.square(parts.sum(axis=1)) / np.maximum(rows, 1), axis=0), mean_square)
        chance = 2.0 * np.minimum(chdtr(count, sums), chdtrc(count, sums))
        chances.append(np.where(count >= 5, chance, 1.0))
    present = np.isfinite(x).any(axis=0)
    if not present.any():
        return 1.0
    return float(min(1.0, np.min(np.array(chances)[:, present]) * present.sum() * len(chances)))


def slow_power(innovations: ArrayLike, rows: float) -> float:
    """Probability by chance of as much slow power as innovations (n, m) have together, NaN left out.

    The test is that of a process correlated over some ``rows`` beneath white noise, whose spectrum weighs the
    periodogram (locally most powerful: P. Whittle, Estimation and information in stationary time series, Arkiv foer
    Matematik 2 (1953) 423). Its ordinates are exponential where innovations are white; their weighted sum is taken for
    gamma distributed, with its mean and variance.
    """
    from scipy.special import gammaincc

    x = np.nan_to_num(np.asarray(innovations, dtype=float))
    n, squares = len(x), np.square(x).sum(axis=0)
    seen = squares > 0.0
    if n < 3 or not seen.any():
        return 1.0
    power = np.square(np.abs(np.fft.rfft(x[:, seen], axis=0)))[1 : (n + 1) // 2] / squares[seen]
    weight = 1.0 / (1.0 + np.square(2.0 * np.pi * rows * np.arange(1, len(power) + 1) / n))
    mean = float(weight.sum()) * power.shape[1]
    variance = float(np.square(weight).sum()) * power.shape[1]
    return float(gammaincc(mean**2 / variance, float(weight @ power.sum(axis=1)) * mean / variance))


def _ratio(a: Array, b: Array) -> Array:
    """a / b, 0 where b is."""
    return np.divide(a, b, out=np.zeros_like(a), where=b > 0.0)


Limits = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Coverage:
    """Share of intervals that held the truth, and the share that should have.

    ``level`` is the probability that the intervals claim, ``fraction`` (m,) the share of the ``runs`` in which the
    interval of each coefficient held the truth, within ``limits``; ``pooled`` the share over all, within
    ``pooled_limits``. ``design_effect`` is the ratio of the variance of ``pooled`` to that of independent coefficients,
    1 to m; ``rms`` (m,) the root mean square of error / standard uncertainty: near 1, more for few degrees of freedom.
    """

    level: float
    runs: int
    fraction: NDArray[np.float64]
    limits: Limits
    pooled: float
    pooled_limits: Limits
    design_effect: float
    rms: NDArray[np.float64]

    @property
    def passed(self) -> bool:
        """True if every coefficient, and all of them together, lie within their limits."""
        low, high = self.limits
        each = bool(np.all((low <= self.fraction) & (self.fraction <= high)))
        return each and self.pooled_limits[0] <= self.pooled <= self.pooled_limits[1]

    def table(self, names: Sequence[str] = ()) -> str:
        """Return the figures as lines of text; `names` label the coefficients."""
        labels = [*(names or map(str, range(len(self.fraction)))), "all together"]
        fractions = [*self.fraction, self.pooled]
        limits = [self.limits] * len(self.fraction) + [self.pooled_limits]
        rms = [*self.rms, np.sqrt(np.mean(self.rms**2))]
        wide = max(map(len, labels))
        lines = [
            f"{100 * self.level:.4g} % intervals in {self.runs} runs",
            f"{'':{wide}}  covered %  expected %       rms(error/u)",
        ]
        for label, got, (low, high), r in zip(labels, fractions, limits, rms, strict=True):
            mark = "" if low <= got <= high else "  outside"
            span = f"{100 * low:.2f} to {100 * high:.2f}"
            lines.append(f"{label:{wide}}  {100 * got:9.2f}  {span:<15}  {r:12.3f}{mark}")
        return "\n".join(lines)


@dataclass(frozen=True)
class Nees:
    """Normalised estimation error squared: do stated covariances match the errors?

    ``mean`` over the ``runs`` of ``e' P^-1 e``, too large where the covariances are too small; its ``expected`` value
    m, the number of coefficients; ``standard_error``, ``sqrt(2 m / runs)``; ``limits``, the chi-square band for the
    mean.
    """

    mean: float
    expected: int
    standard_error: float
    limits: Limits
    runs: int

    @property
    def passed(self) -> bool:
        """True if the mean lies within its limits."""
        return self.limits[0] <= self.mean <= self.limits[1]

    def table(self) -> str:
        """Return the figures as one line of text."""
        low, high = self.limits
        mark = "" if self.passed else "  outside"
        return (
            f"NEES of {self.runs} runs: {self.mean:.4g}, expected {self.expected} with standard error "
            f"{self.standard_error:.2g}, within {low:.4g} to {high:.4g}{mark}"
        )


def coverage(
    errors: ArrayLike, u: ArrayLike, dof: ArrayLike = np.inf, *, level: float = 0.95, risk: float = 0.01
) -> Coverage:
    """Count how often the intervals ``estimate +- t(level, dof) u`` held the truth.

    The limits leave a correct procedure a probability of at most about `risk` to fail. One half of it is
    spent on the coefficients one by one: exact binomial limits at ``risk / (2 m)`` each, which by
    Bonferroni's inequality hold whatever the correlation between coefficients. The other half is spent on
    the pooled share: exact binomial limits for an effective number of trials ``runs m / D``, where D is the
    design effect by which correlation within a run inflates the variance. It is estimated from the runs, as
    the ratio of the variance of run means to that of independent coefficients, both for the hits and for
    the levels at which each interval would just hold the truth; the larger counts, because hits alone tell
    little where misses are rare.

    Parameters
    ----------
    errors : (runs, m)
        Estimate minus truth, in any unit; the runs are independent of each other.
    u : (runs, m) or (m,)
        Stated standard uncertainties, in the same unit.
    dof : float, (runs,) or (runs, m), optional
        Degrees of freedom of `u`; infinite where `u` is known.
    level, risk : float, optional
        Probability that the intervals claim, and that of a false alarm.

    Raises
    ------
    InputError
        Shapes that do not fit, errors that are not finite, or u or dof that are not positive.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> coverage(rng.normal(0.0, 2.0, (500, 3)), u=2.0 * np.ones(3)).passed
    True

    References
    ----------
    L. Kish, Survey Sampling, Wiley 1965 (design effect). E. L. Korn and B. I. Graubard, "Confidence
    intervals for proportions with small expected number of positive counts estimated from survey data",
    Survey Methodology 24 (1998) 193-201 (exact limits at the effective number of trials).
    """
    from scipy import stats  # takes long to import

    e = _runs_of("errors", errors)
    runs, m = e.shape
    u = _fitting("u", u, e.shape)
    dof = np.asarray(dof, dtype=np.float64)
    dof = _fitting("dof", dof[:, np.newaxis] if dof.ndim == 1 else dof, e.shape)
    if not (0 < level < 1 and 0 < risk < 1):
        raise InputError("coverage", f"got level={level}, risk={risk}, expected numbers between 0 and 1")

    just_holds = np.asarray(2.0 * stats.t.cdf(np.abs(e / u), dof) - 1.0)
    hits = np.where(just_holds <= level, 1.0, 0.0)
    design_effect = max(_design_effect(hits), _design_effect(just_holds))

    def limits(trials: int, alpha: float) -> Limits:
        """Hold a binomial share with a probability of at least 1 - alpha."""
        low, high = (float(stats.binom.ppf(q, trials, level)) / trials for q in (alpha / 2, 1 - alpha / 2))
        return low, high

    return Coverage(
        level=level,
        runs=runs,
        fraction=hits.mean(axis=0),
        limits=limits(runs, risk / 2 / m),
        pooled=float(hits.mean()),
        pooled_limits=limits(int(runs * m / design_effect), risk / 2),
        design_effect=design_effect,
        rms=np.sqrt(np.mean((e / u) ** 2, axis=0)),
    )


def nees(errors: ArrayLike, covariances: ArrayLike, *, risk: float = 0.01) -> Nees:
    """Compare the errors of all coefficients together with their stated covariances.

    ``e' P^-1 e`` of normal errors with known covariance P is chi-square distributed with m degrees of
    freedom, and its sum over independent runs with ``runs m``.

    Parameters
    ----------
    errors : (runs, m)
        Estimate minus truth.
    covariances : (runs, m, m) or (m, m)
        Stated covariances, positive definite; coefficients may differ in scale by any factor.
    risk : float, optional
        Accepted probability of a false alarm.

    Raises
    ------
    InputError
        Shapes that do not fit, values that are not finite, or a covariance that is not positive definite.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> nees(rng.normal(0.0, 2.0, (500, 3)), 4.0 * np.eye(3)).passed
    True

    References
    ----------
    Y. Bar-Shalom, X. R. Li and T. Kirubarajan, Estimation with Applications to Tracking and Navigation,
    Wiley 2001, section 5.4.2.
    """
    from scipy import stats  # takes long to import

    e = _runs_of("errors", errors)
    runs, m = e.shape
    P = np.asarray(covariances, dtype=np.float64)
    if P.shape[-2:] != (m, m) or not np.all(np.isfinite(P)):
        raise InputError(
            "covariances", f"got shape {P.shape}, expected finite numbers of shape (..., {m}, {m})"
        )
    scale = np.sqrt(_fitting("variances", np.diagonal(P, axis1=-2, axis2=-1), e.shape))
    # Correlations instead of covariances, lest the scales of the coefficients spoil the small eigenvalues.
    w, V = np.linalg.eigh(P / (scale[:, :, np.newaxis] * scale[:, np.newaxis, :]))
    if np.any(w[:, 0] <= m * np.finfo(float).eps):
        worst = int(np.argmin(w[:, 0]))
        raise InputError(
            f"covariances[{worst}]",
            f"is not positive definite: the correlations have the eigenvalue {w[worst, 0]:.3g}",
        )
    along = np.einsum("rji,rj->ri", V, e / scale)
    low, high = stats.chi2.ppf([risk / 2, 1 - risk / 2], runs * m) / runs
    return Nees(
        mean=float(np.sum(along**2 / w) / runs),
        expected=m,
        standard_error=float(np.sqrt(2 * m / runs)),
        limits=(float(low), float(high)),
        runs=runs,
    )


def _design_effect(x: NDArray[np.float64]) -> float:
    """Variance of the run means of ``x`` (runs, m) over that of m independent columns, 1 to m."""
    m = x.shape[1]
    spread = float(x.var())
    return float(np.clip(m * x.mean(axis=1).var(ddof=1) / spread, 1, m)) if spread > 0 else float(m)


def _runs_of(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """Values as finite (runs, m) with at least two runs."""
    a = np.asarray(values, dtype=np.float64)
    if a.ndim != 2 or a.shape[0] < 2 or a.shape[1] < 1:
        raise InputError(name, f"got shape {a.shape}, expected (runs, coefficients) with 2 runs or more")
    if not np.all(np.isfinite(a)):
        raise InputError(
            name,
            f"got {a[~np.isfinite(a)][0]} in run {np.argwhere(~np.isfinite(a))[0, 0]}, expected a number",
        )
    return a


def _fitting(name: str, values: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Positive values, broadcast to a shape."""
    a = np.asarray(values, dtype=np.float64)
    try:
        full = np.broadcast_to(a, shape)
    except ValueError as error:
        raise InputError(name, f"got shape {a.shape}, expected {shape}") from error
    if not np.all(full > 0):
        raise InputError(name, f"got {full[~(full > 0)][0]}, expected numbers above zero")
    return full
