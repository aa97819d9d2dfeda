"""Faults that the residuals of a test show, and those that they could not show: F-tests at a stated risk.

A fault with columns Z changes the readings by Z theta. Where it is fitted beside the terms, with the noise estimated
anew, and C is the covariance of theta, ``theta^T C^-1 theta / m`` follows F(m, nu) in a sound test: exactly where there
is noise alone, and as nearly as Welch and Satterthwaite's nu says where the stated errors of the table cause a part.
The same risk, divided by the number of faults, holds for each. Candidates come from
`inercal.foundation.inference.hypotheses`, ranked by their score, which costs no fit.

A fault that is not significant may be there all the same. A test whose fault has the chance p supports it by
``1 / (-e p ln p)`` at most (Sellke, Bayarri and Berger, The American Statistician 55 (2001) 62), so that with the odds
before the test, the same for all faults, each has a probability; one of them is taken to be there, or none.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.inference.hypotheses import Fits, Hypothesis, search
from inercal.systems.turntable.limits import LIMITS
from inercal.systems.turntable.positions.faults import Fault, faults, reading
from inercal.systems.turntable.readings import Readings
from inercal.systems.turntable.regression import Regression
from inercal.systems.turntable.weights import whitened

_TINY = 1e-300
"""Least chance that has a logarithm."""


@dataclass(frozen=True, eq=False)
class Seen:
    """A fault in the residuals.

    Attributes
    ----------
    base : (m, r)
        Its parameters that show, of unit covariance.
    columns : (n c + q, r)
        What is left of them beside the terms.
    hidden : (m, m - r)
        Orthonormal combinations of its parameters that do not show.
    reach : float
        Size of a fault, in standard uncertainties, that is named in half of the tests.
    """

    fault: Fault
    base: Array
    columns: Array
    hidden: Array
    reach: float


@dataclass(frozen=True, eq=False)
class TestedFault:
    """A fault that was fitted beside the terms: its ``values`` (m,), their probability by ``chance`` in a sound test,
    and the ``probability`` that it is there."""

    seen: Seen
    values: Array
    chance: float
    probability: float = 1.0

    @property
    def fault(self) -> Fault:
        """The fault."""
        return self.seen.fault


@dataclass(frozen=True)
class Examination:
    """The faults in the residuals: ``significant`` ones, ``doubtful`` ones that may be there, and all that were
    ``asked`` for."""

    significant: tuple[TestedFault, ...]
    doubtful: tuple[TestedFault, ...]
    asked: tuple[Seen, ...]


class _White:
    """The judge of residuals that are white already."""

    def residuals(self, case: Array) -> Array:
        """The residuals themselves."""
        return case

    def misfit(self, case: Array) -> float:
        """Sum of their squares."""
        return float(case @ case)


def examine(means: Readings, fit: Regression, noise: Sequence[float | None]) -> Examination:
    """Ask a fit of the readings for every fault; ``noise`` (c,) as stated."""
    first_fit = fit
    table = tuple(faults(means, fit))
    risk = LIMITS.residual_risk / max(len(table), 1)
    first, residuals = _seen(fit, table, risk)
    asked, significant = first, list[TestedFault]()
    while True:
        tested = _likely(fit, noise, asked, residuals)
        likeliest = [*tested[:1], *_stray(means, fit, noise, risk)]
        found = min(likeliest, key=lambda each: each.chance, default=None)
        if found is None or found.chance > risk or len(significant) == LIMITS.most_faults:
            break
        significant.append(found)
        fit = _refitted(fit, noise, found.seen)
        names = {each.fault.name for each in significant}
        asked, residuals = _seen(fit, (each for each in faults(means, fit) if each.name not in names), risk)
    if not first_fit.effects.free.size + first_fit.effects.random.size:
        significant += _within_dwells(means, first, {each.fault.code for each in significant})
    doubtful = [each for each in tested if each.chance < LIMITS.doubtful]
    return Examination(tuple(significant), tuple(_with_probability(doubtful, len(first))), tuple(first))


def _with_probability(doubtful: Sequence[TestedFault], asked: int) -> Iterator[TestedFault]:
    """Doubtful faults, of so many ``asked`` for, with the probability that they are there."""
    odds = LIMITS.fault_odds / max(asked, 1)
    chances = [max(each.chance, 1e-300) for each in doubtful]  # 0.0 of a number too small to be told
    support = [odds / (-math.e * chance * math.log(chance)) for chance in chances]
    for each, own in zip(doubtful, support, strict=True):
        yield replace(each, probability=own / (1.0 + sum(support)))


def _within_dwells(means: Readings, asked: Sequence[Seen], codes: set[str]) -> Iterator[TestedFault]:
    """Drifts that the samples within the dwells show, the likeliest of each code but of ``codes``.

    The slopes scatter from dwell to dwell as they do, whatever the noise: an F-test of one and n - 1 degrees of
    freedom.
    """
    from scipy.special import fdtrc

    slopes = means.slopes * (means.times[-1] - means.times[0])
    tested = []
    for seen in asked:
        fault = seen.fault
        if fault.within is None or fault.code in codes:
            continue
        k = int(np.argmax(np.abs(fault.within).max(axis=0)))
        rate, slope = fault.within[:, k], slopes[:, k]
        if np.isfinite(slope).all() and len(slope) > 2:
            value = float(rate @ slope / (rate @ rate))
            left = float(np.square(slope - rate * value).sum()) / (len(slope) - 1)
            chance = float(fdtrc(1, len(slope) - 1, value**2 * (rate @ rate) / left)) if left else 1.0
            what = f"{fault.what.rstrip(',')}, as it drifts within the dwells,"
            seen = replace(seen, fault=replace(fault, what=what))
            tested.append(TestedFault(seen, np.array([value]), chance))
    named: set[str] = set()
    for each in sorted(tested, key=lambda each: each.chance):
        if each.chance < LIMITS.dwell_risk / len(tested) and each.fault.code not in named:
            named.add(each.fault.code)
            yield each


def _stray(means: Readings, fit: Regression, noise: Sequence[float | None], risk: float) -> list[TestedFault]:
    """The reading that lies furthest off all others, with its chance among so many; none where each is needed."""
    weight = fit.weights(fit.noise)
    n, c, _ = fit.rows.shape
    white = whitened(fit.rows, fit.residuals, weight)
    Q = np.linalg.qr(white.rows)[0]
    left = (white.right - (Q @ (Q.T @ np.append(white.right, np.zeros(len(Q) - n * c))))[: n * c]).reshape(
        n, c
    )
    own = np.eye(c) - np.einsum("nap,nbp->nab", *[Q[: n * c].reshape(n, c, -1)] * 2)
    free = np.linalg.eigvalsh(own)[:, 0] > LIMITS.least_seen
    if len(means.times) < 3 or not free.any() or fit.noise_dof.max() < LIMITS.fewest_degrees:
        return []
    score = np.full(n, -np.inf)
    score[free] = np.einsum("na,na->n", left[free], np.linalg.solve(own[free], left[free][..., None])[..., 0])
    seen, _ = _seen(fit, [reading(means, int(np.argmax(score)))], risk)
    tested = f_test(fit, noise, seen[0])
    return [replace(tested, chance=min(1.0, n * tested.chance))]


def _likely(
    fit: Regression, noise: Sequence[float | None], asked: Sequence[Seen], residuals: Array
) -> list[TestedFault]:
    """Faults whose score is beyond what is usual by chance, with their F-tests, the least by chance first."""
    by_name, tested = {each.fault.name: each for each in asked}, list[TestedFault]()

    def try_all(case: Array, fits: Iterator[Fits[Array]]) -> None:
        tested.extend(f_test(fit, noise, by_name[each[-1].hypothesis.name]) for each in fits)

    table = [_hypothesis(each) for each in asked]
    search(residuals, lambda _: table, _White(), LIMITS.screen * len(table), 1, choose=try_all)
    tested.sort(key=lambda each: each.chance)
    # a heading that is wrong is a field to the ground too: of faults that explain about as much the simplest
    as_good = [
        each
        for each in tested
        if np.log(each.chance + _TINY) < LIMITS.simpler_fault * np.log(tested[0].chance + _TINY)
    ]
    simplest = min(as_good, key=lambda each: len(each.values), default=None)
    return tested if simplest is None else [simplest, *(each for each in tested if each is not simplest)]


def _seen(fit: Regression, asked: Iterable[Fault], risk: float) -> tuple[list[Seen], Array]:
    """The faults beside the terms, and the whitened residuals, both orthogonal to all that is fitted; ``risk`` of a
    test."""
    weight = fit.weights(fit.noise)
    n, c, _ = fit.rows.shape
    white = whitened(fit.rows, fit.residuals, weight)
    Q = np.linalg.qr(white.rows)[0]
    pad = white.rows.shape[0] - n * c

    def beside(columns: Array) -> Array:
        whole = np.concatenate([columns, np.zeros((pad, columns.shape[1]))])
        return np.asarray(whole - Q @ (Q.T @ whole))

    made = []
    for fault in asked:
        whole = (white.inverse @ fault.columns).reshape(n * c, -1)
        size = np.linalg.norm(whole, axis=0)
        size[size == 0.0] = 1.0
        left = beside(whole / size)
        _, s, vt = np.linalg.svd(left, full_matrices=False)
        known = s > LIMITS.least_seen
        base = vt[known].T / s[known] / size[:, None]
        columns = beside(whole @ base)
        gain = np.einsum("nam,nab->mnb", columns[: n * c].reshape(n, c, -1), white.inverse)
        parts = np.square(fit.noise) * np.square(gain).sum(axis=(0, 1)) / max(len(gain), 1)
        hidden = np.linalg.qr(vt[~known].T / size[:, None])[0]
        made.append(Seen(fault, base, columns, hidden, _reach(len(gain), parts, fit.noise_dof, risk)))
    return made, beside(white.right[:, None])[:, 0]


def _reach(m: int, parts: Array, noise_dof: Array, risk: float) -> float:
    """Size of a fault of ``m`` parameters that show, in standard uncertainties, at which its F-test has this risk."""
    from scipy.special import chdtri, fdtri

    if not m:
        return math.inf
    nu = _dof(parts, noise_dof)
    return math.sqrt(chdtri(m, risk) if nu > LIMITS.known_variance else m * fdtri(m, nu, 1.0 - risk))


def _dof(parts: Array, noise_dof: Array) -> float:
    """Degrees of freedom of a variance, by Welch and Satterthwaite: of each channel's noise, ``parts`` (c,) of the
    variance, those of ``noise_dof`` (c,)."""
    return 1.0 / max(float(np.sum(np.square(parts) / noise_dof)), 1.0 / LIMITS.known_variance)


def _hypothesis(seen: Seen) -> Hypothesis[Array]:
    """A fault as the search takes it, in units of its parameters' uncertainties."""
    names = tuple(str(k) for k in range(seen.base.shape[1]))
    return Hypothesis(
        seen.fault.name,
        seen.fault.code,
        seen.fault.what,
        lambda residuals, values: residuals - seen.columns @ values,
        names,
        left_out=0 if names else 10**9,  # one that cannot be seen is never found
    )


def _refitted(fit: Regression, noise: Sequence[float | None], seen: Seen) -> Regression:
    """The fit with a fault beside its terms."""
    return fit.with_effects(fit.effects.beside(seen.fault.columns @ seen.base), noise)


def f_test(fit: Regression, noise: Sequence[float | None], seen: Seen) -> TestedFault:
    """The F-test of a fault beside a fit, with the ``noise`` (c,) as stated."""
    from scipy.special import chdtrc, fdtrc

    before, m = len(fit.effect), seen.base.shape[1]
    try:
        now = _refitted(fit, noise, seen)
    except np.linalg.LinAlgError:
        return TestedFault(seen, np.zeros(seen.base.shape[0]), 1.0)
    values, C = now.effect[before:], now.effect_covariance[before:, before:]
    statistic = float(values @ np.linalg.solve(C, values)) / m
    # share of each channel's noise in the covariance of the fault
    parts = [
        np.trace(np.linalg.solve(C, s**2 * g @ g.T)) / m
        for s, g in zip(now.noise, np.moveaxis(now.effect_gain[before:], -1, 0), strict=True)
    ]
    nu = _dof(np.array(parts), now.noise_dof)
    chance = float(fdtrc(m, nu, statistic)) if nu < LIMITS.known_variance else float(chdtrc(m, m * statistic))
    return TestedFault(seen, seen.base @ values, chance)
