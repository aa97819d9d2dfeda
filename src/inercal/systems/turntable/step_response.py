"""Response of an accelerometer to small steps about level: dead zone, threshold, hysteresis.

Of inputs x, taken in senses s = ±1 (raised, lowered) at times t::

    y = K0 + K1 (x - d + s K_hyst / 2) + drift t

Within the dead zone, of width K_dz about a middle m, the output stands: d = x - m. Below and above it d is -q and q: 0
where the output jumps to what it would be without a dead zone (friction that breaks loose), half the width where it
follows on (backlash), or between. The threshold K_th is the input from the middle at which half of the change of output
that K1 promises is there (IEEE Std 528): half the width, or 2 q where that is more.

Which inputs lie within the dead zone is tried out. For each choice the model is linear: a level within, two parallel
lines outside. Edges may be anywhere between two inputs, so that values and covariance are those of draws from all
choices, each weighted by its likelihood . Priors of K0, K1, m and
K_dz are flat, that of the part f = 2 q / K_dz is 1 / sqrt(f (1 - f)), since friction and backlash are its ends. It is
that of f for half of the weight, of q for the other: the one alone leans to no dead zone, the other to a wide one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.systems.turntable.limits import LIMITS

SEED = 20261122
"""Of the draws: a record gives the same values each time."""

_DRAWS = 40_000
"""Draws, about: of a probability of 95 % they miss 0.1 %."""

_LEAST_ROOM = 1e-3
"""Of a part f of an interval f (1 - f), at least: the prior 1 / sqrt(f (1 - f)) has no upper end."""

SYMBOLS = ("K0", "K1", "K_dz", "K_th", "K_hyst")
"""Terms of a test; the last one where inputs were both raised and lowered."""


@dataclass(frozen=True, eq=False)
class Tilted:
    """An accelerometer that steps tilt about level.

    Attributes
    ----------
    channel : str
    x : (n,) m/s^2
        Specific force along its axis.
    sense : (n,)
        +1 where that was last raised, -1 lowered.
    level : (k,)
        Its mean change for one standard deviation of each constant error of the table [m/s^2].
    blur : float
        Standard deviation that the other errors of the table add to each input [m/s^2].
    """

    channel: str
    x: Array
    sense: Array
    level: Array
    blur: float


@dataclass(frozen=True, eq=False)
class Response:
    """The response of one accelerometer.

    Attributes
    ----------
    axis : str
        ``x``, ``y`` or ``z``.
    values, covariance : (p,), (p, p)
        Of the `SYMBOLS`, [output] and m/s^2; all 0 where no dead zone fits (``chi2`` tells).
    middle : float
        Of the dead zone [m/s^2].
    line : (n,)
        Likeliest outputs, in the order of the readings, without drift and hysteresis.
    residuals : (n,)
        Readings less the likeliest outputs.
    columns : (n, p)
        Of the likeliest choice.
    noise, noise_dof : float
        Standard deviation of a reading, and its degrees of freedom; inf where it was stated.
    dof : int
    at_end : float
        Probability that the dead zone reaches as far as the inputs allow.
    """

    axis: str
    values: Array
    covariance: Array
    middle: float
    line: Array
    residuals: Array
    columns: Array
    noise: float
    noise_dof: float
    dof: int
    at_end: float

    @property
    def names(self) -> tuple[str, ...]:
        """The terms."""
        return tuple(f"{symbol}_{self.axis}" for symbol in SYMBOLS[: len(self.values)])


def respond(
    axis: str, x: Array, sense: Array, t: Array, y: Array, noise: float | None, floor: float
) -> Response:
    """Fit the response.

    Parameters
    ----------
    axis : str
    x : (n,) m/s^2
        Specific force along the input axis; at least ``2 * OUTSIDE + 1`` distinct values.
    sense : (n,)
        +1 where the input was last raised, -1 lowered, 0 not yet changed.
    t : (n,) s
    y : (n,) readings
    noise : float or None
        Standard deviation of a reading; None: from the scatter, which takes more readings than the 6 terms.
    floor : float
        Standard deviation of a reading below which nothing can be told from rounding.
    """
    rng = np.random.default_rng(SEED)
    x_size, y_size, y_mean = float(np.ptp(x)), float(np.ptp(y)) or 1.0, float(y.mean())
    beside = [(t - t.mean()) / (float(np.ptp(t)) or 1.0)]
    if both_ways := bool(np.any(sense > 0) and np.any(sense < 0)):
        beside.insert(0, sense)
    xs, ys = x / x_size, (y - y_mean) / y_size
    least = max(floor / y_size, 1e-12)
    known = None if noise is None else max(noise / y_size, least)
    choices = [_choice(xs, ys, beside, i, j, known, least) for i, j in _pairs(np.unique(xs))]
    likely = max(each.log for each in choices)
    taken = [each for each in choices if each.log > likely - 25.0]
    count = max(64, _DRAWS // len(taken))
    drawn = [_draws(each, both_ways, count, known is None, rng) for each in taken]
    values = np.concatenate([each for each, _ in drawn])
    weight = np.concatenate(
        [np.exp(choice.log - likely) * w / count for choice, (_, w) in zip(taken, drawn, strict=True)]
    )
    if not weight.sum() > 0.0:  # the likeliest lines leave no room for a dead zone: take none
        weight = np.exp(np.repeat([each.log - likely for each in taken], count))
        values[:, [2, 3]] = 0.0
    weight /= weight.sum()
    apart = weight / np.maximum(values[:, 2], 1e-9)
    weight = 0.5 * weight + 0.5 * apart / apart.sum()
    mean = weight @ values
    away = values - mean
    covariance = (weight[:, None] * away).T @ away
    parts = weight.reshape(len(taken), count).sum(axis=1)
    best = taken[int(np.argmax(parts))]
    fitted = best.columns @ best.c
    still = fitted - best.columns[:, best.free :] @ best.c[best.free :]
    units = np.array([y_size, y_size / x_size, x_size, x_size, x_size][: values.shape[1] - 1])
    return Response(
        axis,
        mean[:-1] * units + np.eye(len(units))[0] * y_mean,
        covariance[:-1, :-1] * np.outer(units, units),
        float(mean[-1] * x_size),
        y_mean + y_size * still,
        y_size * (ys - fitted),
        best.columns,
        y_size * best.sigma,
        float(best.dof) if noise is None else np.inf,
        best.dof,
        float(parts @ [each.at_end for each in taken]),
    )


def senses(x: Array) -> Array:
    """+1 (n,) where an input was last raised, -1 where lowered; 0 before it changes."""
    steps = np.diff(x, prepend=x[:1])
    sign = np.where(np.abs(steps) < 1e-6 * np.ptp(x), 0.0, np.sign(steps))
    for k in range(1, len(sign)):
        sign[k] = sign[k] or sign[k - 1]
    return np.asarray(sign)


@dataclass(frozen=True, eq=False)
class _Choice:
    """Inputs within a dead zone, chosen: its left edge lies in ``left`` (2,), its right one in ``right``.

    ``c`` (p,) of the ``columns`` (n, p): levels below, (within,) above, K1, and what is beside from ``free`` on;
    ``root`` (p, p) of their covariance for unit variance, ``log`` of the likelihood.
    """

    left: tuple[float, float]
    right: tuple[float, float]
    c: Array
    columns: Array
    root: Array
    free: int
    sigma: float
    dof: int
    log: float
    at_end: bool


def _pairs(levels: Array) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    """All pairs of stretches between distinct inputs in which the two edges may lie."""
    stretches = list(zip(levels[:-1].tolist(), levels[1:].tolist(), strict=True))
    inner = stretches[LIMITS.outside_zone - 1 : len(stretches) - LIMITS.outside_zone + 1]
    return [(one, other) for k, one in enumerate(inner) for other in inner[k:]]


def _choice(
    x: Array,
    y: Array,
    beside: list[Array],
    left: tuple[float, float],
    right: tuple[float, float],
    known: float | None,
    least: float,
) -> _Choice:
    """The linear fit of a choice."""
    from math import lgamma, log, pi

    below, above = x <= left[0], x >= right[1]
    within = ~(below | above)
    parts = [below, within, above] if within.any() else [below, above]
    columns = np.column_stack([*parts, np.where(within, 0.0, x), *beside]).astype(float)
    n, p = columns.shape
    c, _, rank, singular = np.linalg.lstsq(columns, y, rcond=None)
    dof = max(n - p, 1)
    squares = max(float(np.sum(np.square(y - columns @ c))), least**2 * dof)
    sigma = float(np.sqrt(squares / dof)) if known is None else known
    if rank < p:
        root, volume = np.zeros((p, p)), -np.inf
    else:
        root = np.linalg.inv(np.linalg.qr(columns, mode="r"))
        volume = 0.5 * p * log(2.0 * pi) - float(np.log(singular).sum())
    if known is None:
        likelihood = lgamma(0.5 * dof) - 0.5 * dof * log(0.5 * squares)
    else:
        likelihood = p * log(sigma) - 0.5 * squares / sigma**2
    size = abs(float(c[len(parts)])) or 1.0  # from levels to K0, m and q
    return _Choice(
        left,
        right,
        c,
        columns,
        root,
        len(parts) + 1,
        sigma,
        dof,
        volume + likelihood - (len(parts) - 1) * log(size),
        bool(
            len(np.unique(x[below])) <= LIMITS.outside_zone or len(np.unique(x[above])) <= LIMITS.outside_zone
        ),
    )


def _draws(
    choice: _Choice, both_ways: bool, count: int, heavy: bool, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Draws (count, q) of the terms, the middle last, and their weights; ``heavy``: the noise is estimated."""
    p = len(choice.c)
    spread = np.full(count, choice.sigma)
    if heavy:
        spread *= np.sqrt(choice.dof / rng.chisquare(choice.dof, count))
    c = choice.c + spread[:, None] * (rng.standard_normal((count, p)) @ choice.root.T)
    K1 = c[:, choice.free - 1]
    low, high = c[:, 0], c[:, choice.free - 2]
    lag = 0.5 * (low - high) / K1
    (l0, l1), (r0, r1) = choice.left, choice.right
    if choice.free == 4:
        middle = (c[:, 1] - 0.5 * (low + high)) / K1
        narrow, wide = np.maximum(r0 - middle, middle - l1), np.minimum(r1 - middle, middle - l0)
        area = np.ones(count)
    else:
        middle = l0 + (l1 - l0) * rng.random(count)
        narrow, wide = np.zeros(count), np.minimum(r1 - middle, middle - l0)
        area = np.full(count, l1 - l0)
    narrow = np.maximum(np.maximum(narrow, lag), 0.0)
    half = narrow + (wide - narrow) * rng.random(count)
    fits = (lag >= 0.0) & (wide > narrow)
    part = np.where(fits, lag, 0.0) / np.where(fits, half, 1.0)
    weight = area * (wide - narrow) / np.sqrt(np.maximum(part * (1.0 - part), _LEAST_ROOM))
    weight = np.where(fits, weight, 0.0)
    terms = [0.5 * (low + high), K1, 2.0 * half, np.maximum(half, 2.0 * lag)]
    if both_ways:
        terms.append(2.0 * c[:, choice.free] / K1)
    return np.stack([*terms, middle], axis=-1), weight
