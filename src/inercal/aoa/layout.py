"""Positions and axes of the accelerometers of a wind-tunnel model."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from inercal.aoa.limits import LIMITS
from inercal.arrays import Array
from inercal.geometry.rotations import principal

#: text of an axis -> lambda [rad], counted from +x (forward) towards -z (down)
AXES = {"+x": 0.0, "-z": 0.5 * math.pi, "-x": math.pi, "+z": -0.5 * math.pi}


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
        return Layout(tuple(self.names[i] for i in k), self.angle[k], self.r[k], self.z[k])

    @property
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

    @property
    def spans(self) -> bool:
        """True where two axes are not parallel, so that one sample tells the angle all around."""
        return bool((np.abs(np.sin(self.turned)) > LIMITS.parallel_axes).any())
