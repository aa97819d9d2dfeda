"""The angle of a model at rest from the readings of N accelerometers along any axes, in the three ways of the paper.

At rest axis i reads A_i = g h_i . (sin theta, cos theta), h_i = (cos lambda_i, -c sin lambda_i) with c the cosine of
the roll; in motion the readings are to be freed of lever-arm terms before (`inercal.systems.aoa.paper.lever`). Each way
gives the angle and its derivatives by the readings (`Still.gain`): from these `spread` computes the uncertainty, and
`bound` the effect of errors of a given size.

Source: Tan et al. 2021.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.errors import StudyError
from inercal.foundation.geometry.rotations import principal
from inercal.systems.aoa.estimators import Static
from inercal.systems.aoa.layout import Layout, axes, inverse_axes

Indices = NDArray[np.intp]

Errors: TypeAlias = Sequence[tuple[Array | float, Array]]
"""Error covariance of the readings at n rows: the sum of weights (n,) times matrices (N, N) [(m/s^2)^2]."""

_BACKWARD = 1.0 - 1e-9
"""Weight of an axis that looks backward, so that of two antiparallel axes the forward one is taken."""

_LATER = 1e-9
"""Penalty of a later pair of axes, so that of two opposite pairs the first is taken."""

_FLAT = 1e-2
"""Smallest slope of a reading over g against theta; smaller ones are replaced by it."""


class Still(NamedTuple):
    """``theta`` (n,) [rad] within (-pi, pi], and ``gain`` (n, N) [rad s^2/m], its derivative by each reading."""

    theta: Array
    gain: Array


def angle(way: Static, acc: Array, layout: Layout, gravity: float, level: float = 1.0) -> Still:
    """The angle by one of the three ways.

    ``acc`` (n, N) [m/s^2] are readings freed of lever-arm terms, none missing; ``gravity`` [m/s^2]; ``level`` the
    cosine of the roll. Raises `StudyError` where the layout lacks the axes that the way needs.
    """
    return _WAYS[way](acc, layout, gravity, level)


def segmented(acc: Array, layout: Layout, gravity: float, level: float = 1.0) -> Still:
    """theta = lambda_i + asin(A_i / g) by the axis nearest to the angle that least squares over all axes gives.

    An axis that looks backward (cos(theta - lambda_i) < 0) is read on the other branch of the arc sine, so that any two
    axes that are not parallel show all angles. Choosing the smallest reading instead, without the angle, is wrong by
    180 deg where axes are antiparallel. Error dA / (g cos(theta - lambda_i)) >= dA/g. Parameters and errors
    as of `angle`.
    """
    h = _axes(layout, level)
    coarse = _direction(acc @ inverse_axes(layout, level).T)
    slope = _slopes(coarse, h)
    i = np.argmax(np.where(slope < 0.0, -_BACKWARD * slope, slope), axis=1)
    at = np.arange(len(acc)), i
    forward = slope[at] >= 0.0
    size, turn = np.hypot(h[:, 0], h[:, 1])[i], np.arctan2(-h[:, 1], h[:, 0])[i]
    raised = np.arcsin(np.clip(acc[at] / (gravity * size), -1.0, 1.0))
    theta = principal(turn + np.where(forward, raised, math.pi - raised))
    steep = np.maximum(size * np.cos(raised), _FLAT)
    gain = np.zeros(acc.shape)
    gain[at] = np.where(forward, 1.0, -1.0) / (gravity * steep)
    return Still(theta, gain)


def complementary(acc: Array, layout: Layout, gravity: float, level: float = 1.0) -> Still:
    """theta = atan2(A_2, -A_1) by two axes at a right angle: the first such pair.

    Error sqrt(2) dA sin(theta - lambda_2 + 45 deg) / g where both err by dA. Parameters and errors as of
    `angle`.
    """
    first = _pairs(layout, level, "complementary")[:1]
    return _by_two(acc, first, np.zeros(len(acc), dtype=np.intp), gravity)


def improved(acc: Array, layout: Layout, gravity: float, level: float = 1.0) -> Still:
    """As `complementary`, by that of several pairs that suffers least where all axes err alike.

    That is |theta - lambda_2 + 45 deg| <= 45 deg modulo 180 deg, for the three axes -z, +x, +z: the first two below
    theta = 0, the last two above. Error <= dA/g where both err by dA. With one pair it is complementary. Parameters
    and errors as of `angle`.
    """
    pairs = _pairs(layout, level, "improved")
    coarse = acc @ inverse_axes(layout, level).T
    alike = pairs.sum(axis=2)
    suffering = np.abs(coarse[:, 1:] * alike[:, 0] - coarse[:, :1] * alike[:, 1])
    rank = _LATER * gravity * np.arange(len(pairs))
    return _by_two(acc, pairs, np.argmin(suffering + rank, axis=1), gravity)


_WAYS: Mapping[str, Callable[[Array, Layout, float, float], Still]] = {
    "segmented": segmented,
    "complementary": complementary,
    "improved": improved,
}


def spread(gain: Array, errors: Errors) -> Array:
    """(n,) rad: standard uncertainty of the angle, of first order, by errors of the readings."""
    variance = np.zeros(len(gain))
    for weight, matrix in errors:
        variance += weight * np.einsum("ni,ni->n", gain @ matrix, gain)
    return np.sqrt(np.maximum(variance, 0.0))


def bound(gain: Array, size: float, kind: Literal["alike", "independent", "any"]) -> Array:
    """(n,) rad: error of the angle by errors of one ``size`` [m/s^2] in each axis, to first order.

    ``alike``: equal with their signs; ``independent``: standard deviation of random ones; ``any``: the worst signs.
    """
    if kind == "alike":
        return np.asarray(size * np.abs(gain.sum(axis=1)))
    if kind == "independent":
        return np.asarray(size * np.sqrt(np.square(gain).sum(axis=1)))
    return np.asarray(size * np.abs(gain).sum(axis=1))


def _axes(layout: Layout, level: float) -> Array:
    """(N, 2) h."""
    if not layout.spans:
        raise StudyError("sensors", "found parallel axes only, expected two that are not")
    return axes(layout, level)


@lru_cache(maxsize=64)
def _pairs(layout: Layout, level: float, way: Static) -> Array:
    """(K, 2, N): for each pair of square axes the matrix from readings over g to (sin theta, cos theta)."""
    h, square = axes(layout, level), layout.square()
    if not square:
        raise StudyError("sensors", f"found no two axes at a right angle, which {way} needs")
    made = np.zeros((len(square), 2, len(h)))
    for matrix, (i, j) in zip(made, square, strict=True):
        matrix[:, [i, j]] = np.linalg.inv(h[[i, j]])
    return made


def _by_two(acc: Array, ways: Array, taken: Indices, gravity: float) -> Still:
    """The angle of (sin theta, cos theta) by one of the matrices ``ways`` (K, 2, N) for each row, by ``taken`` (n,)."""
    theta, gain = np.empty(len(acc)), np.empty(acc.shape)
    for k, way in enumerate(ways):
        rows = slice(None) if len(ways) == 1 else taken == k
        direction = _direction(acc[rows] @ way.T)
        theta[rows] = np.arctan2(direction[:, 0], direction[:, 1])
        gain[rows] = _slopes(direction, way.T) / gravity
    return Still(principal(theta), gain)


def _direction(force: Array) -> Array:
    """(n, 2) sin theta, cos theta of forward and upward specific force."""
    size = np.hypot(force[:, 0], force[:, 1])
    return np.asarray(force / np.where(size > 0.0, size, 1.0)[:, None])


def _slopes(direction: Array, h: Array) -> Array:
    """(n, N): derivative of h . (sin theta, cos theta) by theta."""
    return np.asarray(direction[:, ::-1] @ (h * [1.0, -1.0]).T)
