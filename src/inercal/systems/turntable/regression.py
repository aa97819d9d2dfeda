"""Coefficients from readings: generalised least squares with the table's errors in the covariance.

The readings of all channels are stacked, ``y = A c + J chi + e``: chi the errors of the table with the
derivatives J of the readings. Errors redrawn at each position add to the covariance V of the readings there;
errors that stay constant over the test are unknowns with the prior variance of their distribution::

    [V^-1/2 y]   [V^-1/2 A   V^-1/2 J s]  [ c     ]
    [   0    ] = [   0           1     ]  [ chi/s ]

which is the same as weighting with V + J s^2 J^T, and also says what the test tells about chi. J depends on c,
so that the fit is repeated until c rests. Effects beside the instrument's terms (a drift, a fault that is tried) are
more columns of A, free, or more of J, random. Where squares and products of the errors matter against u, they are in
the readings and in V (`inercal.systems.turntable.second_order`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.inference.identifiability import Identifiability, few_terms, identify, in_words
from inercal.foundation.instruments.by_angle import ChannelModel
from inercal.systems.turntable.limits import LIMITS
from inercal.systems.turntable.model import TableModel
from inercal.systems.turntable.second_order import SecondOrder, second_order
from inercal.systems.turntable.weights import (
    Samples,
    Weights,
    beside_inputs,
    least_noise,
    scatter,
    weights,
    weights_of,
    whitened,
)

_ROUNDS = 6
"""Fits that are made at most; the derivatives hardly change after the first."""

FLOOR = 1e-12
"""Least standard deviation of a reading, over the rms of the readings: that of a simulation without noise."""


@dataclass(frozen=True, eq=False)
class Effects:
    """Effects beside the terms of the instrument: ``free`` (n, c, m) columns, and ``random`` (n, c, q) ones, each times
    a variable of variance 1."""

    free: Array
    random: Array

    @classmethod
    def none(cls, n: int, channels: int) -> Effects:
        """No effects on so many readings."""
        return cls(np.zeros((n, channels, 0)), np.zeros((n, channels, 0)))

    def beside(self, free: Array) -> Effects:
        """These, and more ``free`` ones (n, c, m)."""
        return Effects(np.concatenate([self.free, free], axis=-1), self.random)


@dataclass(frozen=True, eq=False)
class Regression:
    """A fit of linear coefficients.

    Attributes
    ----------
    model : TableModel
    angles : (n, joints) rad
    y : (n, c) readings
    c : (p,) linear coefficients [output per monomial]
    covariance : (p, p) of them
    gain : (p, n, c) how each reading enters each coefficient: ``c = gain y``, y less the stated terms
    residuals : (n, c) readings minus model at the nominal attitudes
    chi2, dof : weighted sum of squares, prior of the constant errors included, and its degrees of freedom
    noise : (c,) standard deviation of a reading beside the table's part
    noise_dof : (c,) its degrees of freedom; inf where it was stated
    slopes : (n, c, k) derivatives of the readings with respect to all errors of the table
    beside : (n, c, b) change of the readings by one standard uncertainty of each input beside the table
    samples : (n,) rows behind each reading
    table : (q,) estimated constant errors [rad or m], in the order of ``constant``
    table_u : (q,) their standard uncertainties
    constant : (q,) indices of the constant errors among the chain's
    effects : the effects beside the terms that were fitted
    effect : (m,) values of the free ones
    effect_covariance : (m, m) of them
    effect_gain : (m, n, c) how each reading enters each
    random_effect : (q,) values of the random ones, in their standard deviations
    random_covariance : (q, q) of them
    likelihood : restricted log-likelihood, but for a constant
    second : SecondOrder
        Second order of the readings, by which they are corrected and weighted; None where it does not matter
    """

    model: TableModel
    angles: Array
    y: Array
    c: Array
    covariance: Array
    gain: Array
    residuals: Array
    chi2: float
    dof: int
    noise: Array
    noise_dof: Array
    slopes: Array
    beside: Array
    samples: Samples
    table: Array
    table_u: Array
    constant: NDArray[np.int64]
    effects: Effects
    effect: Array
    effect_covariance: Array
    effect_gain: Array
    random_effect: Array
    random_covariance: Array
    likelihood: float
    second: SecondOrder | None = None

    @property
    def rows(self) -> Array:
        """Regressors (n, c, p + m) of the terms and of the free effects."""
        return np.concatenate([self.model.rows(self.angles), self.effects.free], axis=-1)

    def weights(self, noise: Array) -> Weights:
        """Covariance of the readings with ``noise`` (c,), second order and random effects included."""
        chain = self.model.chain
        table = weights_of(chain, self.slopes, self.angles, self.beside, noise, self.samples)
        table = table if self.second is None else self.second.added(table)
        return table.with_common(self.effects.random)

    def shift(self, columns: Array) -> Array:
        """Change (p, m) of the linear coefficients by effects ``columns`` (n, c, m) that are not fitted."""
        return np.asarray(np.einsum("pnc,ncm->pm", self.gain, columns))

    def with_effects(self, effects: Effects, noise: Sequence[float | None]) -> Regression:
        """The readings fitted again with other ``effects``, to the same order of the errors; raises as `fit`."""
        to_second = self.second is not None
        return fit_to_order(self.model, self.angles, self.y, noise, self.c, self.samples, effects, to_second)


@dataclass(frozen=True, eq=False)
class Solution:
    """One weighted fit: ``c`` (p,), ``root`` (p + q, p + q) of the covariance, ``gain`` (p, n, c), chi (q,), chi2."""

    c: Array
    root: Array
    gain: Array
    chi: Array
    chi2: float

    @property
    def joint(self) -> Array:
        """(p + q, p + q) covariance of c and chi."""
        return np.asarray(self.root @ self.root.T)


@dataclass(frozen=True)
class Identified:
    """Identifiability of the terms of a channel: rank and null vectors, ``words`` for each null vector."""

    identifiability: Identifiability
    words: tuple[str, ...]


def identify_channels(model: TableModel, angles: Array) -> tuple[Identified, ...]:
    """Rank and null vectors of each channel at these positions."""
    rows = model.rows(angles)
    channels = []
    for k, (channel, block) in enumerate(zip(model.channels, model.blocks, strict=True)):
        own = identify(rows[:, k, block], channel.symbols)
        channels.append(Identified(own, _null_words(own, full_inputs(model, channel))))
    return tuple(channels)


def worst_rank(seen: Sequence[Identified]) -> tuple[int, int]:
    """Rank and number of terms of the channel that lacks most; of the largest one where none lacks any."""
    pairs = [(each.identifiability.rank, len(each.identifiability.names)) for each in seen]
    return max(pairs, key=lambda pair: (pair[1] - pair[0], pair[1]))


def full_inputs(model: TableModel, channel: ChannelModel) -> Array:
    """Size (p,) of the monomials of a channel when the whole of a and of earth rate acts."""
    a, w = float(np.linalg.norm(model.a_n)), float(np.linalg.norm(model.w_n))
    return np.array([a**each.order * w ** sum(each.powers[3:]) for each in channel.monomials])


def _null_words(own: Identifiability, sizes: Array) -> tuple[str, ...]:
    """The null vectors in words, with as few terms as they can have, each times its full input."""
    if not len(own.null_vectors):
        return ()
    return tuple(
        in_words(vector, own.names, 1e-9) for vector in few_terms(own.null_vectors / own.scale * sizes)
    )


def solve(rows: Array, y: Array, weight: Weights) -> Solution:
    """The weighted fit; raises LinAlgError where a position's covariance is not positive definite.

    Parameters
    ----------
    rows : (n, c, p) regressors
    y : (n, c) readings
    weight : Weights
    """
    n, channels, p = rows.shape
    white = whitened(rows, y, weight)
    u, s, vt = np.linalg.svd(white.rows, full_matrices=False)
    root = vt.T / s / white.length[:, None]
    inverse = root @ u.T
    solution = inverse[:, : n * channels] @ white.right
    misfit = np.concatenate([white.right, np.zeros(len(solution) - p)]) - white.rows @ (
        solution * white.length
    )
    # c = inverse L^-1 y, with L block diagonal
    gain = np.einsum("pnd,ndc->pnc", inverse[:p, : n * channels].reshape(p, n, channels), white.inverse)
    return Solution(solution[:p], root, gain, solution[p:], float(misfit @ misfit))


def fit(
    model: TableModel,
    angles: Array,
    y: Array,
    noise: Sequence[float | None],
    start: Array | None = None,
    samples: Samples | None = None,
    effects: Effects | None = None,
) -> Regression:
    """Fit all channels together.

    Parameters
    ----------
    model : TableModel
        Whose terms the positions identify (see `identify_channels`).
    angles : (n, joints) rad
    y : (n, c) readings
    noise : (c,) standard deviation of a reading; None where it is to be estimated from the scatter
    start : (p,) coefficients for the first derivatives; from an unweighted fit if absent
    samples : (n,) rows behind each reading, over which errors of scope ``sample`` average; one if absent
    effects : Effects, optional
        Beside the terms, which the positions identify with them.

    Raises
    ------
    LinAlgError
        Terms so large that errors of the table, which they multiply, drown the readings: their weights do not settle.
    """
    straight = fit_to_order(model, angles, y, noise, start, samples, effects, False)
    if not second_order_matters(straight):
        return straight
    return fit_to_order(model, angles, y, noise, straight.c, samples, effects, True)


def second_order_matters(straight: Regression) -> bool:
    """True if the second order changes a coefficient, or its u, noticeably against its u."""
    bent = second_order(straight.model, straight.angles, straight.c, straight.samples)
    mean, columns = bent.shifts(straight.gain)
    rms = np.sqrt(np.square(mean) + np.square(columns).sum(axis=1))
    return bool(np.any(rms > LIMITS.second_order * np.sqrt(np.diag(straight.covariance))))


def fit_to_order(
    model: TableModel,
    angles: Array,
    y: Array,
    noise: Sequence[float | None],
    start: Array | None,
    samples: Samples | None,
    effects: Effects | None,
    to_second_order: bool,
) -> Regression:
    """As `fit`, with or without the second order of the table's errors."""
    n, channels, p = model.rows(angles).shape
    effects = Effects.none(n, channels) if effects is None else effects
    rows = np.concatenate([model.rows(angles), effects.free], axis=-1)
    m = rows.shape[-1] - p
    samples = np.ones(n, dtype=np.int64) if samples is None else samples
    size = np.sqrt(np.mean(np.square(y), axis=0))
    least = FLOOR * np.where(size > 0.0, size, 1.0)
    read, y = y, y - model.outputs(angles, np.zeros(p))  # what is stated
    plain = Weights(np.broadcast_to(np.eye(channels), (n, channels, channels)), np.zeros((n, channels, 0)))
    c = solve(rows, y, plain).c[:p] if start is None else start
    u, settled, bent, readings = np.zeros(p), True, None, y
    for _ in range(_ROUNDS):
        if not np.isfinite(c).all():
            break
        table = weights(model, angles, c, np.zeros(channels), samples=samples)
        if to_second_order:
            bent = second_order(model, angles, c, samples)
            table, y = bent.added(table), readings - bent.mean
        table = table.with_common(effects.random)
        noise_fit = scatter(rows, y, table, noise, np.maximum(least, least_noise(table.within)))
        sigma = noise_fit.std
        solution = solve(rows, y, Weights(table.within + np.diag(sigma**2), table.common))
        change, c = np.abs(solution.c[:p] - c), solution.c[:p]
        before, u = u, np.sqrt(np.diag(solution.joint)[:p])
        if np.all(change <= 1e-3 * u):
            break
    else:
        settled = bool((u <= LIMITS.runaway * before).all())
    if not (
        settled and np.isfinite(c).all() and np.isfinite(solution.joint).all() and (noise_fit.dof > 0.0).all()
    ):
        raise np.linalg.LinAlgError("the weights of the readings do not settle")
    constant = np.flatnonzero([error.scope.constant for error in model.chain.errors])
    std, free = model.chain.std[constant], slice(p, p + m)
    last = slice(len(solution.chi) - effects.random.shape[-1], None)
    of_table = np.diag(solution.joint)[p + m : p + m + len(std)]
    return Regression(
        model,
        angles,
        read,
        c,
        solution.joint[:p, :p],
        solution.gain[:p],
        y - np.einsum("ncp,p->nc", rows, solution.c),
        solution.chi2,
        n * channels - p - m,
        sigma,
        noise_fit.dof,
        model.by_errors(angles, c),
        beside_inputs(model, angles, c),
        samples,
        solution.chi[: len(std)] * std,
        np.sqrt(of_table) * std,
        constant,
        effects,
        solution.c[free],
        solution.joint[free, free],
        solution.gain[free],
        solution.chi[last],
        solution.joint[p + m :, p + m :][last, last],
        noise_fit.likelihood,
        bent,
    )
