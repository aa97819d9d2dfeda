"""Noise that a recording shows: turns that do not close as well as white noise says, and walks of biases.

Variances by restricted likelihood (`inercal.foundation.inference.variances`): of the linear problem at the last pass of
a fit, with all unknowns integrated out,

    -2 ln L = sum ln |Q_k| + ln |H| + chi-square        Q_k = Q_k of the sensors + sum s_j Q_kj

Its slope by s_j is sum tr(M_k Q_kj) - r_k^T W Q_kj W r_k with the residuals r and M_k = W - W A Z A^T W, where A Z A^T
is the covariance of what the solution says of the interval; its curvature is taken from the intervals alone (Fisher's
scoring), which only costs steps.

What the recording leaves open of the size of a noise counts in u.

A walk of biases that hardly shows may be found as next to nothing, and u that believes it is too small. Given the size
of a noise, the last linear problem of a fit has the likelihood of that size, with the coefficients c and their
covariance P. Beforehand all sizes (standard deviations) are alike. The second moment about the values of the fit,

    E[P + (c - c_fit) (c - c_fit)^T]

is what is known of them; what it has beyond the covariance of the fit counts in u. Noises are taken one by one, the
others as they were found.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple, cast

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.inference.variances import Highest, Score, highest, second_moment, weighed
from inercal.systems.strapdown.fit.arrow import NodeChain, backward, forward
from inercal.systems.strapdown.fit.batch import (
    Fit,
    fit,
    followed_by,
    information_of,
    interval_covariance,
    inverse,
    left_over,
    variances_of,
)
from inercal.systems.strapdown.fit.rests import Nodes
from inercal.systems.strapdown.fit.unmodelled import TestedEffect, posed, tests
from inercal.systems.strapdown.limits import LIMITS
from inercal.systems.strapdown.model.samples import Samples
from inercal.systems.strapdown.settings import TURN_NOISE, WALKS, Noise, StrapdownSettings


def opened(fit: Fit, samples: Samples, settings: StrapdownSettings) -> Array:
    """Addition to the covariance (p, p) of the coefficients by noise that was found, that which ``estimate`` names."""
    fixed, parts, s = separated(fit, samples, settings, settings.noise.estimate)
    covariance, more = fit.covariance, np.zeros_like(fit.covariance)
    for k in range(len(s)):
        others = fixed + np.einsum("q,qkab->kab", np.delete(s, k), np.delete(parts, k, axis=0))
        more += _second_moment(fit, others, parts[k], math.sqrt(s[k])) - covariance
    # only what makes u larger, in units of the covariance
    root = np.linalg.cholesky(covariance)
    by = np.linalg.inv(root)
    ratio, axes = np.linalg.eigh(by @ more @ by.T)
    wider = root @ axes * np.sqrt(np.maximum(ratio, 0.0))
    return np.asarray(wider @ wider.T)


def _second_moment(fit: Fit, others: Array, part: Array, found: float) -> Array:
    """Second moment (p, p) about the values of the fit, over the sizes of one noise: its ``part`` (k, m, m) of the
    covariance of intervals for a variance of 1, beside that of ``others`` (k, m, m); ``found`` is the likeliest."""
    here, count = _at(fit, others, part, found), LIMITS.noise_sizes

    def unlikely(size: float) -> bool:
        return _at(fit, others, part, size).deviance - here.deviance > LIMITS.unlikely

    reach = next((size for size in found * 2.0 ** np.arange(1, 30) if unlikely(size)), found * 2.0**30)
    while reach > 2.0 * found and unlikely(0.75 * reach):
        reach *= 0.75
    sizes = reach * (np.arange(count) + 0.5) / count
    tried = [_at(fit, others, part, size) for size in sizes.tolist()]
    return second_moment(
        weighed(np.array([-0.5 * each.deviance for each in tried])),
        np.array([each.covariance for each in tried]),
        np.array([each.step - here.step for each in tried]),
    )


def _at(fit: Fit, others: Array, part: Array, size: float) -> SolvedChain:
    """The last linear problem of a fit with a noise of another size."""
    W = np.asarray(np.linalg.inv(others + size**2 * part))
    return solved(fit.chain._replace(W=W), fit.prior)


_PLACES = {"gyro_walk": 2, "accelerometer_walk": 3, "turn_attitude": 4, "turn_velocity": 5}


class SolvedChain(NamedTuple):
    """A linear problem solved: sum of ``squares`` with those of the prior, ``deviance`` -2 ln L but for a constant,
    residuals ``left`` (k, m) of the intervals, ``rows`` (k + 1, m + 3, n) of the elimination, ``covariance`` (p, p) and
    ``step`` (p,) of the coefficients."""

    squares: float
    deviance: float
    left: Array
    rows: Array
    covariance: Array
    step: Array


def solved(chain: NodeChain, prior: Array) -> SolvedChain:
    """Solve a linear problem; ``prior`` (p,) are sizes of its coefficients."""
    m, p, count = chain.F.shape[1], len(prior), len(chain.rest)
    n = 2 * m + 3 + p
    H, g, rows, right = np.empty((n, n)), np.empty(n), np.empty((count, m + 3, n)), np.empty((count, m + 3))
    forward(chain, H, g, rows, right)
    information = information_of(H, p)
    covariance = inverse(information, prior)
    step, x, angles = covariance @ g[-p:], np.empty((count, m)), np.empty((count, 3))
    backward(chain.rest, rows, right, step, x, angles)
    left = left_over(chain, step, x)
    squares = np.einsum("ki,kij,kj->", left, chain.W, left)
    velocity = chain.velocity * np.sum((chain.v + x[:, 3:6]) ** 2)
    attitude = chain.attitude * np.sum((chain.angles + x[:, :3] - angles) ** 2)
    known = np.sum(chain.start * (chain.begin + x[0]) ** 2) + np.sum(chain.prior * (chain.c + step) ** 2)
    pivots = np.einsum("kii->ki", rows[:, :, : m + 3])
    ends = np.append(np.diff(chain.rest) != 0, True) & (chain.attitude > 0.0)
    volume = np.sum(np.log(pivots[:, :m])) + np.sum(np.log(pivots[ends, m:]))
    volume += np.linalg.slogdet(information * np.outer(prior, prior))[1] - np.linalg.slogdet(chain.W)[1].sum()
    total = float(squares + velocity + attitude + known)
    return SolvedChain(total, total + float(volume), left, rows, covariance, step)


def separated(
    fit: Fit, samples: Samples, settings: StrapdownSettings, names: tuple[str, ...]
) -> tuple[Array, Array, Array]:
    """Of the covariance of intervals what is not of the ``names`` (k, m, m), what each of these adds for a variance of
    1 (q, k, m, m), and their variances (q,)."""
    places = [_PLACES[name] for name in names]
    variances = variances_of(settings.noise)
    fixed = variances.copy()
    fixed[places] = 0.0
    of_others, *parts = (
        interval_covariance(fit, samples, settings, each) for each in (fixed, *np.eye(6)[places])
    )
    return of_others, np.stack(parts), variances[places]


def _scored(fit: Fit, fixed: Array, parts: Array, s: Array, least: Array) -> Highest:
    """Variances of largest likelihood, from ``s`` (q,) on and not below ``least`` (q,), of the ``parts`` (q, k, m, m)
    of the covariance beside what is ``fixed`` (k, m, m)."""

    def score(s: Array) -> Score:
        W = np.asarray(np.linalg.inv(fixed + np.einsum("q,qkab->kab", s, parts)))
        chain = fit.chain._replace(W=W)
        now = solved(chain, fit.prior)
        M = W - W @ followed_by(chain, now.rows, now.covariance).out @ W
        weighted = np.einsum("kab,kb->ka", W, now.left)
        of_data = np.einsum("ka,qkab,kb->q", weighted, parts, weighted)
        through = np.einsum("kab,qkbc->qkac", M, parts)
        slope = 0.5 * (of_data - np.einsum("qkaa->q", through))
        return Score(-0.5 * now.deviance, slope, 0.5 * np.einsum("pkab,qkba->pq", through, through))

    return highest(score, s, least)


class FoundNoise(NamedTuple):
    """Noise found from a recording, by how much -2 ln L falls by it, and the fit with it."""

    noise: Noise
    gain: float
    fit: Fit


def _started(noise: Noise, names: tuple[str, ...], by: float) -> Noise:
    """The noise with something to begin with in place of what is to be estimated: walks that in so many seconds ``by``
    do as much as white noise, and turns of 10 arcsec and 1 mm/s."""
    usual = {
        "gyro_walk": noise.angle_random_walk / by,
        "accelerometer_walk": noise.velocity_random_walk / by,
        "turn_attitude": 5e-5,
        "turn_velocity": 1e-3,
    }
    return _changed(noise, {name: getattr(noise, name) or usual[name] for name in names})


def _changed(noise: Noise, sizes: Mapping[str, float]) -> Noise:
    """The noise with other sizes of these fields."""
    return replace(noise, **cast(dict[str, Any], dict(sizes)))


def with_noise(
    samples: Samples, nodes: Nodes, settings: StrapdownSettings, fitted: Fit, names: tuple[str, ...]
) -> FoundNoise | None:
    """The noise of the ``names`` among `settings.ESTIMABLE` as a recording shows it, and a fit with it, from a fit
    without; None where that runs off."""
    with np.errstate(all="ignore"):
        try:
            found = _iterated(samples, nodes, settings, fitted, names)
        except np.linalg.LinAlgError:
            return None
    sound = found is not None and np.isfinite(found.gain)
    return found if found and sound and found.noise.turn_attitude < LIMITS.wildest_turn else None


def _iterated(
    samples: Samples, nodes: Nodes, settings: StrapdownSettings, fitted: Fit, names: tuple[str, ...]
) -> FoundNoise | None:
    """The noise, of fits and linear problems in turns; raises `numpy.linalg.LinAlgError` where a matrix is singular."""
    noise = _started(settings.noise, names, LIMITS.walk_start)
    least = LIMITS.least_noise**2 * variances_of(noise)[[_PLACES[name] for name in names]]
    for left in reversed(range(LIMITS.noise_rounds)):
        now = replace(settings, noise=noise)
        again = fit(samples, nodes, now, fitted)
        if again is None:
            return None
        fitted = again
        fixed, parts, s = separated(fitted, samples, now, names)
        found = _scored(fitted, fixed, parts, s, least)
        if not left or 2.0 * found.gain < LIMITS.noise_gain:
            break
        noise = _changed(noise, dict(zip(names, np.sqrt(found.variances).tolist(), strict=True)))
    W = np.asarray(np.linalg.inv(fixed + np.einsum("q,qkab->kab", least, parts)))
    without = solved(fitted.chain._replace(W=W), fitted.prior).deviance
    return FoundNoise(noise, without + 2.0 * found.score.value, fitted)


class ShownNoise(NamedTuple):
    """A study with the noise that it left to the recording, of which ``estimate`` then names what was found, the fit
    with that, and the last fit whose biases do not walk, ``still``."""

    settings: StrapdownSettings
    fit: Fit
    still: Fit


def with_noise_shown(samples: Samples, nodes: Nodes, settings: StrapdownSettings, fitted: Fit) -> ShownNoise:
    """The noise that a recording shows, from a fit without.

    Walks are estimated where the study states none; what turns add, where they leave too much; unless an effect outside
    the model that `unmodelled` finds, or a prior that cannot be, explains more of it.
    """
    asked = [name for name in settings.noise.estimate if getattr(settings.noise, name) == 0.0]
    turns = tuple(name for name in TURN_NOISE if name in asked and residuals(fitted)[1] > LIMITS.turn_excess)
    walks = tuple(name for name in WALKS if name in asked)
    shown = ShownNoise(replace(settings, noise=replace(settings.noise, estimate=())), fitted, fitted)
    for names in (turns, (*walks, *turns) if walks else ()):
        found = with_noise(samples, nodes, shown.settings, shown.fit, names) if names else None
        if not found:
            continue
        problem = posed(shown.fit, shown.settings)
        if not _by_others(shown.fit, tests(problem), found.gain, found.noise.walks):
            noise = replace(found.noise, estimate=names)
            still = shown.fit if found.noise.walks else found.fit
            shown = ShownNoise(replace(settings, noise=noise), found.fit, still)
    return shown


def _by_others(fitted: Fit, tested: list[TestedEffect], gain: float, walks: bool) -> bool:
    """True where an effect outside the model that is more than chance, or a wider prior of what lies far outside its
    own, explains more than noise does by a ``gain``. Beside biases that may walk it must do so by more than chance: a
    walk looks like many."""
    c = fitted.c[fitted.free]
    far = np.abs(c) > LIMITS.far_from_prior * fitted.prior
    wider = fitted.chain._replace(prior=np.where(far, 1e-4, 1.0) * fitted.chain.prior)
    by_prior = solved(fitted.chain, fitted.prior).squares - solved(wider, fitted.prior).squares
    better = (each.drop > (gain + each.limit if walks else max(gain, each.limit)) for each in tested)
    return by_prior > gain or any(better)


def residuals(fitted: Fit) -> tuple[float, float]:
    """Residuals over the noise within rests, and over turns: rms by the degrees of freedom that the fit leaves."""
    turns = np.zeros(len(fitted.squares), dtype=bool)
    turns[fitted.nodes.turns] = True
    rest, turn = (
        float(np.sqrt(fitted.squares[which].sum() / fitted.redundancy[which].sum()))
        for which in (~turns, turns)
    )
    return rest, turn
