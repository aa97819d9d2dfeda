"""Effects outside the model: how far a recording speaks for terms that a study leaves out, and for another latitude.

Each candidate adds columns to the last linear problem of a fit. Elimination of the nodes leaves normal equations of the
coefficients alone, of which every candidate is a block: how far chi-square falls when it is freed, and how far the
other coefficients go with it, takes a few small matrices and no further fit.

Drifts by specific force of a unit whose study does not fit them: how large they may be, and what they do to u.

Nine small drifts shift some coefficient by several u before chi-square tells of them. Of a common size s, each of
standard deviation s, the last linear problem of a fit gives their likelihood, and given s their mean and covariance.
The size is not chosen but averaged over, with the Cauchy distribution beyond 0 about the usual size as what is known
before: where a recording shows that the drifts are smaller, they hardly count.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.inference.effects import second_moment
from inercal.foundation.records.places import counted_names
from inercal.foundation.results.budget import TypeB
from inercal.foundation.units import STANDARD_GRAVITY
from inercal.systems.strapdown.fit.arrow import forward
from inercal.systems.strapdown.fit.batch import Fit
from inercal.systems.strapdown.limits import LIMITS
from inercal.systems.strapdown.model.coefficients import GROUPS, LATITUDE, OPTIONS
from inercal.systems.strapdown.settings import StrapdownSettings

_TERM = "g_sensitivity"


class Considered(NamedTuple):
    """Drifts that are not fitted: their ``usual`` size and that ``left`` by the recording [(rad/s)/(m/s^2)], what they
    add to the covariance of results, and the finding that tells of them, None where that is little."""

    usual: float
    left: float
    source: TypeB
    finding: Finding | None


def _usual_size(settings: StrapdownSettings) -> float:
    """Usual size of drifts by specific force [(rad/s)/(m/s^2)]: that of the study's prior, where it states one, else a
    part of the gyros' biases for each g."""
    if _TERM in settings.given.get("prior", {}):
        return float(settings.prior.g_sensitivity)
    return float(LIMITS.usual_drift * settings.prior.gyro_bias / STANDARD_GRAVITY)


def considered(
    tested: list[TestedEffect], settings: StrapdownSettings, slope: Array, found: tuple[str, ...], u: Array
) -> Considered | None:
    """Drifts by specific force among the effects outside the model; None where the study fits them.

    ``slope`` (q, p) is of the results ``found`` by the coefficients of the fit, ``u`` (q,) theirs without the drifts.
    """
    each = next((each for each in tested if each.candidate.name == _TERM), None)
    if each is None:
        return None
    size, usual = float(each.candidate.prior[0]), _usual_size(settings)
    moment = second_moment(each.score, each.information - np.eye(len(each.score)), usual / size)
    left = math.sqrt(np.trace(moment) / len(moment))
    eigenvalues, axes = np.linalg.eigh(moment)
    parts = slope @ each.moved @ axes * np.sqrt(np.maximum(eigenvalues, 0.0))
    source = TypeB("drifts by specific force", left * size, "rad/s/(m/s^2)", parts / (left * size))
    raised = np.linalg.norm(parts, axis=1) > LIMITS.considered_part * u
    names = [name for name, by in zip(found, raised.tolist(), strict=True) if by]
    return Considered(
        usual, left * size, source, _told(settings, left * size, usual, names) if names else None
    )


def _told(settings: StrapdownSettings, left: float, usual: float, names: list[str]) -> Finding:
    """The finding that tells what drifts that are not fitted do to u."""
    per_g = 3600.0 * math.degrees(STANDARD_GRAVITY)
    whence = (
        "as prior.g_sensitivity states"
        if _TERM in settings.given.get("prior", {})
        else f"usual, {LIMITS.usual_drift:.2g} of prior.gyro_bias for each g"
    )
    return Finding(
        "considered",
        f"Drifts of the gyros by specific force, {per_g * left:.2g} deg/h/g, are not fitted and count in u of "
        f"{counted_names(names, 2)}.",
        action=f'State prior.g_sensitivity if they are smaller, or add "{_TERM}" to terms.',
        items=(
            {
                "drift by specific force": whence,
                "left by this recording": per_g * left,
                "before": per_g * usual,
                "unit": "deg/h/g",
            },
        ),
    )


_WORDS = {
    "k2": "second-order coefficients of the accelerometers",
    "size": "places of the accelerometers",
    "delay": "a delay between the triads",
    "asymmetry": "scale factors of the gyros that differ for positive and negative rates",
    "g_sensitivity": "drifts of the gyros by specific force",
}


class Candidate(NamedTuple):
    """An effect outside the model: code of its finding, words, advice, its ``columns`` (k, 6, q) of derivatives and the
    ``prior`` (q,) standard deviations of its parameters."""

    name: str
    code: str
    words: str
    advice: str
    columns: Array
    prior: Array


class TestedEffect(NamedTuple):
    """A candidate, by how much chi-square falls when it is freed, and the ``limit`` beyond which that is more than
    chance; by how much each of its parameters, one prior standard deviation large, has ``moved`` (p, q) the
    coefficients of the fit; in the same units the ``score`` (q,) of the parameters and their ``information`` (q, q),
    that of the prior with it."""

    candidate: Candidate
    drop: float
    limit: float
    moved: Array
    score: Array
    information: Array

    @property
    def significant(self) -> bool:
        """True where it is no chance."""
        return self.drop > self.limit

    @property
    def shift(self) -> Array:
        """Shift (p,) of the coefficients when the candidate is freed."""
        return np.asarray(self.moved @ np.linalg.solve(self.information, self.score))

    @property
    def reach(self) -> Array:
        """Shifts (p, q) that record and prior leave open, each column by one standard deviation of the parameters."""
        return np.asarray(self.moved @ np.linalg.inv(np.linalg.cholesky(self.information)).T)


def _candidates(fit: Fit, settings: StrapdownSettings) -> Iterator[Candidate]:
    """Effects that a fit may have left out."""
    G, prior = fit.sensitivities, settings.deviations()
    for term in (each for each in OPTIONS if each not in settings.terms):
        places = list(GROUPS[term])
        yield Candidate(
            term, "unmodelled", _WORDS[term], f'add "{term}" to terms', G[:, :, places], prior[places]
        )
    if LATITUDE not in fit.free:
        yield Candidate(
            "latitude",
            "site_suspect",
            "another earth rate than that of the latitude",
            "check site.latitude, or state it with its uncertainty",
            G[:, :, [LATITUDE]],
            np.ones(1),
        )


class Posed(NamedTuple):
    """Normal equations ``H`` (n, n), ``g`` (n,) of the p coefficients of a fit and, behind them, of the parameters of
    ``candidates``, the nodes eliminated, all in units of their prior; the ``places`` of the parameters of each
    candidate, and the ``prior`` (p,) standard deviations of the fit."""

    candidates: list[Candidate]
    places: list[NDArray[np.int64]]
    H: Array
    g: Array
    prior: Array

    def tested(self, number: int) -> TestedEffect | None:
        """The score test of a candidate; None where the information was lost in rounding."""
        from scipy.special import chdtri

        p, q = len(self.prior), self.places[number]
        free = np.arange(p)
        by = np.asarray(np.linalg.solve(self.H[np.ix_(free, free)], self.H[np.ix_(free, q)]), dtype=float)
        score = self.g[q] - by.T @ self.g[free]
        information = self.H[np.ix_(q, q)] - self.H[np.ix_(q, free)] @ by
        if not np.all(np.linalg.eigvalsh(information) > 0.0):
            return None
        drop = float(score @ np.linalg.solve(information, score))
        limit = float(chdtri(len(q), LIMITS.naming_risk / len(self.candidates)))
        moved = -self.prior[:, None] * by[:p]
        return TestedEffect(self.candidates[number], drop, limit, moved, score, information)


def posed(fit: Fit, settings: StrapdownSettings) -> Posed:
    """The normal equations of a fit and of all that it may have left out."""
    tried = list(_candidates(fit, settings))
    p = len(fit.free)
    none = np.empty((len(fit.chain.G), 6, 0))
    columns = np.concatenate([none, *(each.columns for each in tried)], axis=2)
    prior = np.concatenate([np.empty(0), *(each.prior for each in tried)])
    H, g = eliminated(fit, columns, prior**-2)
    size = np.concatenate([fit.prior, prior])
    ends = np.cumsum([len(each.prior) for each in tried])
    places = [
        p + np.arange(end - len(each.prior), end) for each, end in zip(tried, ends.tolist(), strict=True)
    ]
    return Posed(tried, places, H * np.outer(size, size), g * size, fit.prior)


def eliminated(fit: Fit, columns: Array, information: Array) -> tuple[Array, Array]:
    """Normal equations (p + q, p + q), (p + q,) of the coefficients of a fit and of more ``columns`` (k, 6, q) of its
    intervals, whose sizes are 0 with so much ``information`` (q,), the nodes eliminated."""
    m, p, q = fit.chain.F.shape[1], len(fit.free), columns.shape[2]
    chain = fit.chain._replace(
        G=np.ascontiguousarray(
            np.concatenate([fit.chain.G, np.pad(columns, ((0, 0), (0, m - 6), (0, 0)))], axis=2)
        ),
        prior=np.concatenate([fit.chain.prior, information]),
        c=np.concatenate([fit.chain.c, np.zeros(q)]),
    )
    n, count = 2 * m + 3 + p + q, len(chain.rest)
    H, g = np.empty((n, n)), np.empty(n)
    forward(chain, H, g, np.empty((count, m + 3, n)), np.empty((count, m + 3)))
    upper = np.triu(H[2 * m + 3 :, 2 * m + 3 :])
    return upper + np.triu(upper, 1).T, g[2 * m + 3 :]


def tests(problem: Posed) -> list[TestedEffect]:
    """Score tests of all that a fit may have left out, the largest fall of chi-square first; without those whose
    information was lost in rounding."""
    done = (problem.tested(number) for number in range(len(problem.candidates)))
    return sorted((each for each in done if each), key=lambda each: -each.drop)
