"""Rests and turns of a body by hand: its attitude at any time, and what its sensors feel over a sample."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .samples import progress
from .trial import EARTH_RATE, Array, turned_by


@dataclass(frozen=True)
class Motion:
    """A body that rests and is turned: ``start`` takes body to east-north-up, turns are about axes of the body.

    ``begins``, ``times`` (m,) [s], ``axes`` (m, 3), ``angles`` (m,) and ``ways`` (m, 3), by which it is carried [m].
    """

    start: Array
    begins: Array
    times: Array
    axes: Array
    angles: Array
    ways: Array

    def _stands(self) -> Array:
        found = [self.start]
        for axis, angle in zip(self.axes, self.angles, strict=True):
            found.append(found[-1] @ turned_by(axis * angle))
        return np.array(found)

    def at(self, t: Array) -> tuple[Array, Array, Array, Array]:
        """Attitude (n, 3, 3), rate, angular acceleration and carrying acceleration, in east-north-up, (n, 3)."""
        k = np.clip(np.searchsorted(self.begins, t, side="right") - 1, 0, len(self.begins) - 1)
        way, speed, rise = progress((t - self.begins[k]) / self.times[k])
        angle, axis, time = self.angles[k], self.axes[k], self.times[k]
        attitude = self._stands()[k] @ turned_by((way * angle)[:, None] * axis)
        rate, gain = (speed * angle / time)[:, None] * axis, (rise * angle / time**2)[:, None] * axis
        return attitude, rate, gain, (rise / time**2)[:, None] * self.ways[k]

    def turned(self, t: Array, step: float) -> Array:
        """Mean rate (n, 3) against the Earth over the samples that end at t."""
        k = np.clip(np.searchsorted(self.begins, t - step / 2, side="right") - 1, 0, len(self.begins) - 1)
        ways = [progress((time - self.begins[k]) / self.times[k])[0] for time in (t - step, t)]
        return np.asarray(((ways[1] - ways[0]) * self.angles[k] / step)[:, None] * self.axes[k])

    def feel(self, t: Array, step: float, gravity: float, latitude: float, late: float = 0.0,
             arms: Array | None = None) -> tuple[Array, Array]:  # fmt: skip
        """Mean force and rate (n, 3) over the samples that end at t; ``late`` and ``arms`` (3, 3) of accelerometers."""
        earth = EARTH_RATE * np.array([0.0, np.cos(latitude), np.sin(latitude)])
        force = np.zeros((len(t), 3))
        for share, before in ((1 / 6, 1.0), (4 / 6, 0.5), (1 / 6, 0.0)):
            attitude, rate, gain, carried = self.at(t - before * step - late)
            felt = np.einsum("nji,nj->ni", attitude, carried + np.array([0.0, 0.0, gravity]))
            if arms is not None:
                for i, arm in enumerate(arms):
                    across = np.cross(gain, arm) + np.cross(rate, np.cross(rate, arm))
                    felt[:, i] += across[:, i]
            force += share * felt
        attitude = self.at(t - step / 2)[0]
        return force, self.turned(t, step) + np.einsum("nji,j->ni", attitude, earth)

    def numbers(self, t: Array) -> tuple[Array, Array]:
        """Number of the turn and of the rest of each sample, -1 outside."""
        k = np.searchsorted(self.begins, t, side="right") - 1
        moving = (k >= 0) & (t < self.begins[k] + self.times[k])
        return np.where(moving, k, -1), np.where(moving, -1, k + 1)
