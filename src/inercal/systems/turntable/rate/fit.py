"""The fit of a rate test: scale factor, bias, asymmetry, polynomial, and what remains of the straight line.

Of a gyro whose input is the rate x::

    y = D_F + S (x + S_asym |x| / 2 + S2 x^2 + S3 x^3)

so that its slopes on either side of zero are S (1 ± S_asym/2): their difference over their mean is S_asym, as the
gyro standards (IEEE 952-style) define the asymmetry. Non-linearity and hysteresis are what a best straight line
leaves, over the full scale: the largest residual, and the largest difference between readings at one rate that
was reached from below and from above (`inercal.systems.turntable.rate.linearity`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.inference.identifiability import Identifiability, identify
from inercal.systems.turntable.limits import LIMITS
from inercal.systems.turntable.rate.linearity import Deviations, Largest, drawn_errors, largest
from inercal.systems.turntable.rate.stays import Effect, Input, shifts_of
from inercal.systems.turntable.regression import FLOOR, Solution, solve
from inercal.systems.turntable.weights import ReadingNoise, Weights, scatter

ROUNDS = 3
"""Fits that are made: the effect of the table depends on the scale factor, and hardly changes after the first."""


@dataclass(frozen=True, eq=False)
class GyroRateFit:
    """A gyro's fit.

    Attributes
    ----------
    axis : str
        Of the gyro: ``x``, ``y`` or ``z``.
    names : tuple of str
        Terms, those of the fit first, then what the straight line leaves.
    values : (p,)
    left_over : tuple of Largest
        What the straight line leaves, with its bounds.
    gain : (p, n) change of each with each reading
    scale : float
        S as fitted [output per rad/s].
    residuals : (n,) readings minus the best straight line
    remainder : (n, n) how each reading enters each residual
    noise : float
        Standard deviation of a reading beside the table's part; ``noise_dof`` inf where it was stated.
    chi2, dof : weighted sum of squares of the fit, and its degrees of freedom
    stays : indices of the stays about its own axis; of a gyro across it, all
    """

    axis: str
    names: tuple[str, ...]
    values: Array
    left_over: tuple[Largest, ...]
    gain: Array
    scale: float
    residuals: Array
    remainder: Array
    noise: float
    noise_dof: float
    chi2: float
    dof: int
    stays: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Across:
    """Stays of a gyro while the table turns about other axes than its own.

    ``own`` (n,) true for those about its own; ``bias`` (n, b) columns of biases beside that of the first attitude;
    ``names`` (m,) of misalignments with the rates (n, m) about their axes.
    """

    own: NDArray[np.bool_]
    bias: Array
    names: tuple[str, ...]
    rates: Array


def _none_across(n: int) -> Across:
    """All of n stays about the gyro's own axis, at one attitude."""
    return Across(np.ones(n, dtype=bool), np.zeros((n, 0)), (), np.zeros((n, 0)))


def columns(x: Array, order: int, asymmetry: bool) -> Array:
    """Regressors (n, p) of D_F, S, then S_asym, S2, S3 as far as they are wanted."""
    made = [np.ones_like(x), x]
    if asymmetry:
        made.append(0.5 * np.abs(x))
    made += [x**power for power in range(2, order + 1)]
    return np.stack(made, axis=-1)


def symbols(axis: str, order: int, asymmetry: bool) -> tuple[str, ...]:
    """Names of the `columns`."""
    middle = (f"S_asym_{axis}",) if asymmetry else ()
    return (f"D_F_{axis}", f"S_{axis}", *middle, *(f"S{power}_{axis}" for power in range(2, order + 1)))


def separable(rate: Array, axis: str, order: int, asymmetry: bool) -> Identifiability:
    """Identifiability of the terms by the rates.

    By the rates of the table alone, rounded to what counts as one rate: earth rate and jitter would make terms
    seem known that hang on a millionth of the rate.
    """
    size = np.empty(len(rate))
    for same in levels(np.abs(rate)):
        size[same] = np.abs(rate[same]).mean()
    return identify(columns(np.copysign(size, rate), order, asymmetry), symbols(axis, order, asymmetry))


def levels(rate: Array) -> list[NDArray[np.int64]]:
    """Stays (indices, in the order taken) at each distinct rate, lowest first."""
    order = np.argsort(rate, kind="stable")
    steps = np.diff(rate[order])
    apart = steps > LIMITS.same_rate * np.maximum(
        np.abs(rate[order])[1:], 1e-3 * np.abs(rate).max(initial=0.0)
    )
    return [np.sort(part) for part in np.split(order, np.flatnonzero(apart) + 1)]


def approaches(rate: Array) -> NDArray[np.int64]:
    """+1 (n,) where a rate was reached from below, -1 from above; the first from rest, 0 if that is at rest."""
    level = np.empty(len(rate))
    for same in levels(rate):
        level[same] = rate[same].mean()
    smallest = LIMITS.same_rate * 1e-3 * np.abs(level).max(initial=0.0)
    steps = np.diff(level, prepend=0.0)
    directions = np.where(np.abs(steps) <= smallest, 0, np.sign(steps)).astype(np.int64)
    for k in range(1, len(directions)):
        if directions[k] == 0:
            directions[k] = directions[k - 1]
    return directions


def fit_rates(
    axis: str,
    rate: Array,
    y: Array,
    given: Input,
    noise: float | None,
    order: int,
    asymmetry: bool,
    full_scale: float,
    rng: np.random.Generator,
    across: Across | None = None,
) -> GyroRateFit:
    """Fit one gyro.

    Parameters
    ----------
    axis : str
    rate : (n,) rad/s, of the table
    y : (n,) readings
    given : Input
        The rate about the gyro's axis and what it is uncertain by.
    noise : float or None
        Standard deviation of a reading; None: from the scatter, which needs more readings than terms.
    order, asymmetry
        Terms; the rates must let them be separated (`separable`).
    full_scale : float
        rad/s
    rng : Generator
        Of the draws behind the bounds of what the straight line leaves.
    across : Across, optional
        Stays about other axes, of which there are misalignments.
    """
    beside = across or _none_across(len(rate))
    own = np.flatnonzero(beside.own)
    terms = np.column_stack([_columns(given.x, order, asymmetry, beside), beside.rates])
    n, p = terms.shape
    rows = np.column_stack([_with_hysteresis(terms, rate, beside), beside.bias])
    free = rows.shape[1]
    floor = FLOOR * float(np.sqrt(np.mean(np.square(y))) or 1.0)
    c: Array = np.asarray(np.linalg.lstsq(rows, y, rcond=None)[0], dtype=float)
    sigma = floor
    for _ in range(ROUNDS):
        weight = weights_of(given.effects, float(c[1]), n)
        noise_fit = scatter(rows[:, None, :], y[:, None], weight, [noise], np.array([floor]))
        sigma = float(noise_fit.std[0])
        solution = weighted(rows, y, weight, sigma)
        c = solution.c
    biases = beside.bias[:, beside.bias[own].any(axis=0)]
    straight = np.column_stack([1.0 - biases.sum(axis=1), given.x, biases])
    remainder = np.eye(n)
    line = weighted(straight[own], y[own], _of(weight, own), sigma)
    remainder[np.ix_(own, own)] -= straight[own] @ line.gain[:, :, 0]
    residuals = np.where(beside.own, y - straight @ line.c, 0.0)
    values, gain = _relative(c[:p], solution.gain[:p, :, 0])
    span = abs(float(c[1])) * full_scale
    curve = _noise_beside_a_curve(rate, given.x, y, weight, noise, order, asymmetry, floor, beside)
    own_noise = curve or noise_fit
    errors = drawn_errors(
        given.effects, float(c[1]), float(own_noise.std[0]), float(own_noise.dof[0]), n, rng
    )
    left_over = tuple(
        largest(each, errors, span) for each in _left_over(axis, rate[own], residuals[own], remainder[own])
    )
    return GyroRateFit(
        axis,
        (*symbols(axis, order, asymmetry), *beside.names, *(each.name for each in left_over)),
        np.concatenate([values, [each.value for each in left_over]]),
        left_over,
        np.vstack([gain, *(each.gain[None] for each in left_over)]),
        float(c[1]),
        residuals,
        remainder,
        sigma,
        float(noise_fit.dof[0]),
        solution.chi2,
        n - free,
        own,
    )


def _of(weight: Weights, stays: NDArray[np.int64]) -> Weights:
    """The weights of some of the stays."""
    return Weights(weight.within[stays], weight.common[stays])


def _columns(x: Array, order: int, asymmetry: bool, beside: Across) -> Array:
    """The `columns`, with the bias of the first attitude alone in the first."""
    made = columns(x, order, asymmetry)
    made[:, 0] -= beside.bias.sum(axis=1)
    return made


def _with_hysteresis(terms: Array, rate: Array, beside: Across) -> Array:
    """The regressors with one more for the way a rate was reached, where some rate was reached both ways.

    Without it hysteresis would pass for curvature: at the ends of a run up and down it does not average out.
    """
    own = rate[beside.own]
    way = approaches(own)
    both = any(np.ptp(way[same]) == 2 for same in levels(own))
    if not both or len(own) <= terms.shape[1] - len(beside.names) + 1:
        return terms
    column = np.zeros(len(rate))
    column[beside.own] = way
    return np.column_stack([terms, column])


def _relative(c: Array, gain: Array) -> tuple[Array, Array]:
    """Terms (p,) from linear coefficients, all but the first two over the second, with their gain (p, n)."""
    values, made = c.copy(), gain.copy()
    values[2:] = c[2:] / c[1]
    made[2:] = (gain[2:] - values[2:, None] * gain[1]) / c[1]
    return values, made


def _noise_beside_a_curve(
    rate: Array,
    x: Array,
    y: Array,
    weight: Weights,
    noise: float | None,
    order: int,
    asymmetry: bool,
    floor: float,
    beside: Across,
) -> ReadingNoise | None:
    """Noise of a reading about a cubic, so that a curve that was not asked for does not count as noise.

    None where the noise is stated, the curve was asked for, or the rates leave too little to judge by.
    """
    if noise is not None or order == 3 or not _full_rank(rate[beside.own], asymmetry):
        return None
    rows = np.column_stack([_columns(x, 3, asymmetry, beside), beside.rates])
    rows = np.column_stack([_with_hysteresis(rows, rate, beside), beside.bias])
    if len(rows) < rows.shape[1] + LIMITS.scatter_dof:
        return None
    return scatter(rows[:, None, :], y[:, None], weight, [None], np.array([floor]))


def _full_rank(rate: Array, asymmetry: bool) -> bool:
    """True if the rates separate all terms of a cubic."""
    identified = separable(rate, "x", 3, asymmetry)
    return identified.rank == len(identified.names)


def _left_over(axis: str, rate: Array, residuals: Array, remainder: Array) -> list[Deviations]:
    """Non-linearity and hysteresis where the test shows them."""
    shown = []
    groups, way = levels(rate), approaches(rate)
    if len(groups) > 2:
        shown.append(Deviations(f"S_nl_{axis}", residuals, remainder))
    contrasts = []
    for same in groups:
        up, down = same[way[same] > 0], same[way[same] < 0]
        if len(up) and len(down):
            contrast = np.zeros(len(rate))
            contrast[up], contrast[down] = 1.0 / len(up), -1.0 / len(down)
            contrasts.append(contrast)
    if contrasts:
        by_rate = np.array(contrasts)
        shown.append(Deviations(f"S_hyst_{axis}", by_rate @ residuals, by_rate @ remainder))
    return shown


def weights_of(effects: Sequence[Effect], scale: float, n: int) -> Weights:
    """Covariance of the readings (one channel) without noise, for a scale factor."""
    redrawn, common = (scale * shifts for shifts in shifts_of(effects, n))
    return Weights(np.square(redrawn).sum(axis=1)[:, None, None], common[:, None, :])


def weighted(rows: Array, y: Array, weight: Weights, sigma: float) -> Solution:
    """The weighted fit with that noise."""
    return solve(rows[:, None, :], y[:, None], Weights(weight.within + sigma**2, weight.common))
