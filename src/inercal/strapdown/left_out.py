"""Effects outside the model that a recording shows: score tests of terms, of drifts, of the latitude.

Each candidate adds columns to the last linear problem of a fit. Elimination of the nodes leaves normal equations of the
coefficients alone, of which every candidate is a block: how far chi-square falls when it is freed, and how far the
other coefficients go with it, takes a few small matrices and no further fit.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from inercal.arrays import Array
from inercal.strapdown.arrow import forward
from inercal.strapdown.batch import Fit
from inercal.strapdown.coefficients import GROUPS, K0, LATITUDE, OPTIONS, D
from inercal.strapdown.limits import LIMITS
from inercal.strapdown.settings import StrapdownSettings

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


class Tested(NamedTuple):
    """A candidate, by how much chi-square falls when it is freed (``drop``) and of that what it alone explains
    (``own``), where the strongest of its code is free already, and the ``limit`` beyond which that is more than chance;
    by how much each of its parameters, one prior standard deviation large, has ``moved`` (p, q) the coefficients of the
    fit; in the same units the ``score`` (q,) of the parameters and their ``information`` (q, q), that of the prior with
    it."""

    candidate: Candidate
    drop: float
    own: float
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


DRIFT = "bias_drift"
"""Code of biases that drift in proportion to time."""


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
    middle = 0.5 * (fit.nodes.sample[1:] + fit.nodes.sample[:-1])
    part = (middle - middle.mean()) / np.ptp(fit.nodes.sample)
    noise = settings.noise
    for sensor, walk, at in (("gyro", noise.gyro_walk, D), ("accelerometer", noise.accelerometer_walk, K0)):
        if walk == 0.0:
            yield Candidate(
                f"{sensor}_ramp",
                DRIFT,
                f"biases of the {sensor}s that drift over the recording",
                f"let the unit warm up, or state noise.{sensor}_walk",
                part[:, None, None] * G[:, :, at],
                prior[at],
            )


def tests(fit: Fit, settings: StrapdownSettings) -> list[Tested]:
    """Score tests of all that a fit may have left out, the largest fall of chi-square first."""
    from scipy.special import chdtri

    tried = list(_candidates(fit, settings))
    m, p = fit.chain.F.shape[1], len(fit.free)
    more = np.concatenate([each.columns for each in tried], axis=2)
    columns = np.pad(more, ((0, 0), (0, m - 6), (0, 0)))
    prior = np.concatenate([each.prior for each in tried])
    chain = fit.chain._replace(
        G=np.ascontiguousarray(np.concatenate([fit.chain.G, columns], axis=2)),
        prior=np.concatenate([fit.chain.prior, prior**-2]),
        c=np.concatenate([fit.chain.c, np.zeros(len(prior))]),
    )
    n, count = 2 * m + 3 + p + len(prior), len(chain.rest)
    H, g = np.empty((n, n)), np.empty(n)
    forward(chain, H, g, np.empty((count, m + 3, n)), np.empty((count, m + 3)))
    size = np.concatenate([fit.prior, prior])
    upper = np.triu(H[2 * m + 3 :, 2 * m + 3 :])
    scaled, right = (upper + np.triu(upper, 1).T) * np.outer(size, size), g[2 * m + 3 :] * size
    ends = p + np.cumsum([len(each.prior) for each in tried])
    done: list[tuple[Tested, Array]] = []
    for each, end in zip(tried, ends.tolist(), strict=True):
        q = np.arange(end - len(each.prior), end)
        by, score, left = _freed(scaled, right, p, q)
        if not np.all(np.linalg.eigvalsh(left) > 0.0):  # lost in rounding
            continue
        drop = float(score @ np.linalg.solve(left, score))
        limit = float(chdtri(len(q), LIMITS.naming_risk / len(tried)))
        done.append((Tested(each, drop, drop, limit, -fit.prior[:, None] * by, score, left), q))
    done.sort(key=lambda each: -each[0].drop)
    strongest: dict[str, tuple[Tested, Array]] = {}
    found = []
    for one, q in done:
        first, places = strongest.setdefault(one.candidate.code, (one, q))
        if first is not one:
            _, score, left = _freed(scaled, right, p, np.concatenate([places, q]))
            one = one._replace(own=float(score @ np.linalg.solve(left, score)) - first.drop)
        found.append(one)
    return found


def _freed(H: Array, g: Array, p: int, q: Array) -> tuple[Array, Array, Array]:
    """Parameters ``q`` freed beside the first p, by normal equations H x = g: how these follow (p, q), and score (q,)
    and information (q, q) of the parameters when these have followed."""
    by = np.asarray(np.linalg.solve(H[:p, :p], H[:p, q]), dtype=float)
    return by, g[q] - by.T @ g[:p], H[np.ix_(q, q)] - H[q, :p] @ by
