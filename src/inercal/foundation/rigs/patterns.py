"""Elementary errors of a rig: their distributions, and errors that follow a commanded angle.

The exact analysis needs expectations of trigonometric polynomials. Every distribution has quadrature nodes that give
them to rounding, so that one rule serves all densities. Patterns over the angle are harmonics of an encoder, a measured
table, and values for each angle.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache, cached_property, partial
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.rotations import Axis
from inercal.foundation.inputs import Source

NODES = 64
"""Gauss nodes of a density: cosines and sines of twice the error are integrated to rounding up to a half
width of 180 deg, or a standard deviation of 60 deg."""


@dataclass(frozen=True, eq=False)
class Distribution:
    """Distribution of an error [rad, or m for an offset], known by its quantiles and quadrature nodes.

    Attributes
    ----------
    kind : str
        ``uniform``, ``normal``, ``triangular``, ``two_point`` or ``density``.
    size : float
        As specified: half width of ``uniform``, ``triangular`` and ``two_point``, one standard deviation of
        ``normal`` and ``density``.
    nodes, weights : (m,)
        Abscissae and weights, summing to one: ``weights @ f(nodes)`` is the expectation of f.
    quantile : callable
        Inverse distribution function, from probabilities (*batch) to errors (*batch).
    """

    kind: str
    size: float
    nodes: Array = field(repr=False)
    weights: Array = field(repr=False)
    quantile: Callable[[Array], Array] = field(repr=False)

    @cached_property
    def mean(self) -> float:
        """Expectation [rad or m]; exactly 0 for the symmetric kinds."""
        return 0.0 if self.kind != "density" else float(self.weights @ self.nodes)

    @cached_property
    def std(self) -> float:
        """Standard deviation [rad or m]."""
        return float(np.sqrt(self.weights @ np.square(self.nodes - self.mean)))

    def sample(self, rng: np.random.Generator, shape: int | tuple[int, ...]) -> Array:
        """Independent draws of the given shape."""
        return np.asarray(self.quantile(rng.random(shape)))

    def scaled(self, factor: float) -> Distribution:
        """The same shape, ``factor`` times as wide (about zero)."""
        return Distribution(
            self.kind,
            self.size * factor,
            self.nodes * factor,
            self.weights,
            partial(_scaled, self.quantile, factor),
        )


# Functions of the module and no others: a distribution can then be sent to another process.


def _scaled(quantile: Callable[[Array], Array], factor: float, p: Array) -> Array:
    """Quantiles of the same shape, ``factor`` times as wide."""
    return np.asarray(quantile(p) * factor)


def _of_uniform(half: float, p: Array) -> Array:
    """Quantiles of a uniform error."""
    return half * (2.0 * p - 1.0)


def _of_normal(sigma: float, p: Array) -> Array:
    """Quantiles of a normal error."""
    from scipy.special import ndtri

    return np.asarray(sigma * ndtri(np.clip(p, 2.0**-54, None)))


def _of_triangular(half: float, p: Array) -> Array:
    """Quantiles of a triangular error."""
    return np.asarray(
        half * np.where(p < 0.5, np.sqrt(2.0 * p) - 1.0, 1.0 - np.sqrt(2.0 * np.maximum(1.0 - p, 0.0)))
    )


def _of_two_points(half: float, p: Array) -> Array:
    """Quantiles of one of two sizes."""
    return np.where(p < 0.5, -half, half)


def _of_density(cumulative: Array, grid: Array, p: Array) -> Array:
    """Quantiles of a density with its ``cumulative`` sums on a ``grid``."""
    return np.asarray(np.interp(p * cumulative[-1], cumulative, grid))


#: nodes and weights by their number
_legendre = cache(np.polynomial.legendre.leggauss)
_hermite = cache(np.polynomial.hermite_e.hermegauss)


def uniform(half_width: float) -> Distribution:
    """Uniform on ±``half_width``."""
    nodes, weights = _legendre(NODES)
    half = _positive(half_width)
    return Distribution("uniform", half, half * nodes, 0.5 * weights, partial(_of_uniform, half))


def normal(std: float) -> Distribution:
    """Normal with mean zero and standard deviation ``std``."""
    nodes, weights = _hermite(NODES)
    sigma = _positive(std)

    return Distribution("normal", sigma, sigma * nodes, weights / weights.sum(), partial(_of_normal, sigma))


def triangular(half_width: float) -> Distribution:
    """Symmetric triangular on ±``half_width``: the sum of two equal uniform errors."""
    half = _positive(half_width)

    x, w = _legendre(NODES // 2)
    up = 0.5 * (x + 1.0)  # 0 to 1, on either side of the peak
    nodes, weights = np.concatenate([-up[::-1], up]), 0.5 * w * (1.0 - up)
    weights = np.concatenate([weights[::-1], weights])
    return Distribution("triangular", half, half * nodes, weights, partial(_of_triangular, half))


def two_point(size: float) -> Distribution:
    """+``size`` or -``size``, equally likely."""
    half = _positive(size)
    return Distribution(
        "two_point",
        half,
        np.array([-half, half]),
        np.array([0.5, 0.5]),
        partial(_of_two_points, half),
    )


def density(pdf: Callable[[Array], ArrayLike], low: float, high: float) -> Distribution:
    """Any smooth density on [``low``, ``high``], also an asymmetric one; it need not be normalised.

    Raises
    ------
    ValueError
        An empty interval, a density that is negative, not finite or zero throughout, or one too rough or too
        narrow for the nodes.
    """
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise ValueError(f"found the interval {low:g} to {high:g}, expected two finite ends in order")
    x, w = _legendre(NODES)
    nodes = 0.5 * (low + high) + 0.5 * (high - low) * x
    grid = np.linspace(low, high, 4097)
    mass, steps = (np.broadcast_to(np.asarray(pdf(at), dtype=float), at.shape) for at in (nodes, grid))
    mass = 0.5 * (high - low) * w * mass
    total = float(mass.sum())
    if not (np.all(mass >= 0.0) and np.all(steps >= 0.0) and math.isfinite(steps.sum()) and total > 0.0):
        raise ValueError("found a density that is negative, not finite or zero throughout")
    weights = mass / total
    cumulative = np.concatenate([[0.0], np.cumsum(0.5 * (steps[1:] + steps[:-1]))])
    if abs(cumulative[-1] * (grid[1] - grid[0]) / total - 1.0) > 1e-3:
        raise ValueError(f"found a density too rough or too narrow for {NODES} nodes, expected a smooth one")

    std = float(np.sqrt(weights @ np.square(nodes - weights @ nodes)))
    return Distribution("density", std, nodes, weights, partial(_of_density, cumulative, grid))


def _positive(size: float) -> float:
    """A positive size; a distribution without spread is no error."""
    if not (math.isfinite(size) and size > 0.0):
        raise ValueError(f"found the size {size:g}, expected a number above zero")
    return float(size)


Numbers: TypeAlias = NDArray[np.int64]

SAME_ANGLE = float(np.radians(3.0 / 60.0))
"""Difference [rad] up to which two angles of a joint are one commanded angle: above the noise of an encoder, below any
step of a plan."""


class Pattern(Protocol):
    """The size of an error, in units of its distribution, by the angle of its joint."""

    def __call__(self, angle: Array) -> Array:
        """Factor (*batch) at angles (*batch) [rad]."""


@dataclass(frozen=True)
class Harmonic:
    """``sin(order angle + phase)``, phase in rad."""

    order: int
    phase: float

    def __call__(self, angle: Array) -> Array:
        """Factor (*batch) at angles (*batch) [rad]."""
        return np.asarray(np.sin(self.order * angle + self.phase))


@dataclass(frozen=True, eq=False)
class Tabulated:
    """Straight lines between ``values`` (m,) at rising ``angles`` (m,) [rad] within one turn, and round the circle."""

    angles: Array
    values: Array

    def __call__(self, angle: Array) -> Array:
        """Value (*batch) at angles (*batch) [rad]."""
        return np.interp(angle, self.angles, self.values, period=2.0 * np.pi)


@dataclass(frozen=True, eq=False)
class Known:
    """A measured error: a rotation about ``axis`` by ``value`` [rad] and by ``parts`` of the angle of the joint before.

    ``parts`` are sizes [rad] with their patterns; ``source`` is the file of a measured table.
    """

    axis: Axis
    value: float = 0.0
    parts: tuple[tuple[float, Pattern], ...] = field(default=())
    source: Source | None = None

    def at(self, angle: Array) -> Array:
        """The error (*batch) [rad] at angles (*batch) [rad] of its joint."""
        return np.asarray(self.value + sum(size * pattern(angle) for size, pattern in self.parts))


def commanded(angle: Array) -> Numbers:
    """Number (n,) of the commanded angle to which each of the angles (n,) [rad] belongs, whole turns apart or not."""
    turned = np.remainder(angle, 2.0 * np.pi)
    order = np.argsort(turned, kind="stable")
    steps = np.diff(turned[order]) > SAME_ANGLE
    ranks = np.concatenate([[0], np.cumsum(steps)])
    if ranks[-1] and turned[order[0]] + 2.0 * np.pi - turned[order[-1]] <= SAME_ANGLE:
        ranks[ranks == ranks[-1]] = 0
    numbers = np.empty(len(turned), dtype=np.int64)
    numbers[order] = ranks
    return numbers
