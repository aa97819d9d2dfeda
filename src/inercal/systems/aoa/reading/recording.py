"""A recording of a wind-tunnel model for the estimators: in SI, calibrated, on one clock, NaN where samples lack."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.inputs import Source
from inercal.foundation.units import Quantity
from inercal.systems.aoa.reading.clock import in_time


@dataclass(frozen=True, eq=False)
class Recording:
    """Samples of the sensors of a model, one row for each of n rows of the record; NaN where missing or saturated.

    ``t`` [s] as recorded: rows in which time stands still or runs backward are left out by estimators. ``acc`` (n, N)
    [m/s^2] calibrated, in the order of the layout; ``gyro`` [rad/s] nose-up; ``turns`` (n, 2) [rad/s] of the gyros for
    roll (about x) and yaw (about z), right-handed. ``zero_angle`` (n, 2) [rad]: angle known from elsewhere, as at
    wind-off, and its standard uncertainty. ``point`` and ``trigger`` are numbers to be handed on; ``reference`` is the
    angle ``theta_ref`` [rad], without jumps of a turn; ``masked`` (n, N + 1) marks saturated samples of accelerometers
    and gyro; ``temperature`` is the mean of that recorded, with its standard deviation.
    """

    t: Array
    acc: Array
    gyro: Array
    turns: Array
    zero_angle: Array
    point: Array | None = None
    trigger: Array | None = None
    reference: Array | None = None
    masked: NDArray[np.bool_] | None = None
    findings: tuple[Finding, ...] = ()
    sources: tuple[Source, ...] = ()
    temperature: Quantity | None = None

    @property
    def rows(self) -> Array:
        """(n, N + 5) as `inercal.systems.aoa.fusion.loop.advance` takes them."""
        return np.column_stack([self.acc, self.gyro, self.zero_angle, self.turns])

    @cached_property
    def interval(self) -> float:
        """Median time [s] from one row to the next, of those that go on in time; NaN of fewer than two."""
        t = self.t[in_time(self.t)]
        return float(np.median(np.diff(t))) if len(t) > 1 else math.nan

    def of(self, rows: slice | NDArray[np.int64]) -> Recording:
        """These rows, less all that no filter takes."""
        return Recording(
            self.t[rows], self.acc[rows], self.gyro[rows], self.turns[rows], self.zero_angle[rows]
        )

    @cached_property
    def spatial(self) -> bool:
        """True where roll and yaw gyros are there."""
        return bool(np.isfinite(self.turns).all(axis=1).any())


def plain(t: Array, acc: Array, gyro: Array) -> Recording:
    """A recording of accelerometers and one gyro alone."""
    none = np.full((len(t), 2), np.nan)
    return Recording(t, acc, gyro, none, none.copy())
