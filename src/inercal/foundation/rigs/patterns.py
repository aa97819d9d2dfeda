"""Errors of a rig that follow a commanded angle: harmonics of an encoder, a measured table, values for each angle."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.rotations import Axis
from inercal.foundation.inputs import Source

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
