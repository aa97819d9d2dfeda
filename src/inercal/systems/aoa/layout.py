"""Positions and axes of the accelerometers of a wind-tunnel model, and their lever arms.

At a fixed roll of cosine c an accelerometer at angle lambda and position (r, 0, z) reads, with w the rate of pitch and
al its acceleration (`inercal.systems.aoa.fusion.model`),

    A = g (sin theta cos lambda - c cos theta sin lambda) - q w^2 + p al
    q = r cos lambda - c^2 z sin lambda,    p = -c (z cos lambda + r sin lambda)
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.rotations import principal
from inercal.systems.aoa.limits import LIMITS

#: text of an axis -> lambda [rad], counted from +x (forward) towards -z (down)
AXES = {"+x": 0.0, "-z": 0.5 * math.pi, "-x": math.pi, "+z": -0.5 * math.pi}

STATED = "stated"
"""Name of the layout under [sensors] of a study, where others stand beside it."""


@dataclass(frozen=True, eq=False)
class Layout:
    """N accelerometers: ``names`` such as ``a1``, in the order of the record.

    ``angle`` (N,) lambda [rad]: at rest accelerometer i reads g sin(theta - lambda_i); ``r`` (N,) and ``z`` (N,) [m]
    the positions ahead of the pivot and above it.
    """

    names: tuple[str, ...]
    angle: Array
    r: Array
    z: Array

    @property
    def geometry(self) -> Array:
        """(N, 4) cos lambda, sin lambda, r, z: for kernels."""
        return np.stack([np.cos(self.angle), np.sin(self.angle), self.r, self.z], axis=-1)

    def of(self, *chosen: int) -> Layout:
        """The layout of some of the accelerometers, by number from 0."""
        k = list(chosen)
        if k == list(range(len(self.names))):
            return self
        return Layout(tuple(self.names[i] for i in k), self.angle[k], self.r[k], self.z[k])

    @cached_property
    def turned(self) -> Array:
        """(N, N) rad: lambda of the column less that of the row, within (-pi, pi]."""
        apart = self.angle[None, :] - self.angle[:, None]
        return principal(apart)

    def square(self) -> list[tuple[int, int]]:
        """Pairs (i, j) whose axis j is a right angle ahead of axis i: lambda_j = lambda_i + 90 deg."""
        return self._pairs(np.abs(self.turned - 0.5 * math.pi))

    def opposed(self) -> list[tuple[int, int]]:
        """Pairs i < j whose axes are antiparallel."""
        return [(i, j) for i, j in self._pairs(np.abs(self.turned) - math.pi) if i < j]

    def aligned(self) -> list[tuple[int, int]]:
        """Pairs i < j whose axes are parallel and look the same way."""
        return [(i, j) for i, j in self._pairs(self.turned) if i < j]

    def _pairs(self, off: Array) -> list[tuple[int, int]]:
        """Pairs (i, j) at which ``off`` (N, N) [rad] is 0."""
        return [(int(i), int(j)) for i, j in np.argwhere(np.abs(off) < LIMITS.parallel_axes)]

    @cached_property
    def spans(self) -> bool:
        """True where two axes are not parallel, so that one sample tells the angle all around."""
        return bool((np.abs(np.sin(self.turned)) > LIMITS.parallel_axes).any())


_ROUNDING = 1e-12


@lru_cache(maxsize=64)
def axes(layout: Layout, level: float = 1.0) -> Array:
    """(N, 2): coefficients by which each axis reads (sin theta, cos theta) at rest, over g."""
    return _kept(np.stack([np.cos(layout.angle), -level * np.sin(layout.angle)], axis=-1))


@lru_cache(maxsize=64)
def inverse_axes(layout: Layout, level: float = 1.0) -> Array:
    """(2, N): pseudo-inverse of `axes`."""
    return _kept(np.asarray(np.linalg.pinv(axes(layout, level)), dtype=np.float64))


@lru_cache(maxsize=64)
def centrifugal_arms(layout: Layout, level: float = 1.0) -> Array:
    """(N,) q [m]: each axis reads -q w^2."""
    return _arms(layout.r * np.cos(layout.angle) - level**2 * layout.z * np.sin(layout.angle))


@lru_cache(maxsize=64)
def tangential_arms(layout: Layout, level: float = 1.0) -> Array:
    """(N,) p [m]: each axis reads p al."""
    return _arms(-level * (layout.z * np.cos(layout.angle) + layout.r * np.sin(layout.angle)))


def _arms(length: Array) -> Array:
    """Arms, 0 where they are only rounding: such an axis needs no gyro."""
    return _kept(np.where(np.abs(length) < _ROUNDING, 0.0, length))


def _kept(array: Array) -> Array:
    """An array that is handed out again and again: nobody may change it."""
    array.flags.writeable = False
    return array


@lru_cache(maxsize=64)
def pair_weights(layout: Layout, level: float = 1.0) -> Array | None:
    """(N,) d [1/m] for the paper's dual accelerometer, al = d . A with A free of w^2; None without such a pair.

    Of all pairs of antiparallel or parallel axes, in which gravity cancels, that with the longest arm L: (A_i + A_j)/L,
    L = p_i + p_j, for antiparallel axes, (A_i - A_j)/L, L = p_i - p_j, for parallel ones. For the three axes -z, +x, +z
    L = r_3 - r_1. Calibrated axes are not quite parallel: a third axis, the one nearest to square with them, takes off
    the rest of gravity.
    """
    p, h = tangential_arms(layout, level), axes(layout, level)
    pairs = [(p[i] + p[j], i, j, 1.0) for i, j in layout.opposed()]
    pairs += [(p[i] - p[j], i, j, -1.0) for i, j in layout.aligned()]
    arm, i, j, sign = max(pairs, key=lambda pair: abs(pair[0]), default=(0.0, 0, 0, 1.0))
    if abs(arm) < LIMITS.pair_arm:
        return None
    weights = np.zeros(len(p))
    weights[i], weights[j] = 1.0, sign
    k = int(np.argmax(np.abs(np.sin(layout.turned[i]))))
    if layout.spans:
        three = [i, j, k]
        weights[three] = np.cross(h[three, 0], h[three, 1])
        weights = np.where(np.abs(weights) < _ROUNDING * np.abs(weights).max(), 0.0, weights)
    return np.asarray(weights / (weights @ p))


@lru_cache(maxsize=64)
def all_weights(layout: Layout) -> Array | None:
    """(N,) d [1/m] for the angular acceleration d . A by least squares from all axes; None where they do not show it.

    Gravity cancels for all axes: d is the part of the arms p outside of the plane in which gravity moves the readings.
    At a roll of cosine c the sum is c al, as the gyro reads c w.
    """
    p, of_gravity = tangential_arms(layout), axes(layout)
    beside = p - of_gravity @ np.linalg.lstsq(of_gravity, p, rcond=None)[0]
    power = float(beside @ beside)
    return _kept(beside / power) if power > LIMITS.pair_arm**2 else None
