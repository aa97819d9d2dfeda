"""One channel of a record, and three of a sensor together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inercal.arrays import Array, short_repr
from inercal.errors import RecordError
from inercal.inputs import Source
from inercal.records.channels import sensor_and_axis
from inercal.units import RAW, Unit


@short_repr
@dataclass(frozen=True, eq=False)
class Column:
    """One channel.

    ``values`` (n,) are in ``unit``, sign and scale of the map already applied; ``t`` (n,) [s] is the time
    axis of its file, the same object for all columns of that file. ``frame`` is that of its axis.
    ``increment``: a rate that was recorded as what was gained since the row before.
    """

    name: str
    unit: Unit
    values: Array
    t: Array
    source: Source
    frame: str = "b"
    increment: bool = False

    @property
    def sensor(self) -> str:
        """``acc`` of ``acc_x``; the name itself where there is no axis."""
        return sensor_and_axis(self.name)[0]

    @property
    def axis(self) -> str:
        """``x`` of ``acc_x``; empty where there is no axis."""
        return sensor_and_axis(self.name)[1]

    def si(self) -> Array:
        """Values (n,) in SI units; raises `RecordError` for raw counts and volts."""
        if self.unit.dimension in RAW:
            raise RecordError(
                self.source.path, f"{self.name} is in {self.unit.symbol}, expected physical units"
            )
        return self.values * self.unit.factor + self.unit.zero


@short_repr
@dataclass(frozen=True, eq=False)
class Triad:
    """Three axes of one sensor: ``t`` (n,) [s], ``values`` (n, 3) in ``unit``, ``source`` as in `Column`."""

    sensor: str
    unit: Unit
    t: Array
    values: Array
    source: Source

    @property
    def rate(self) -> float:
        """Median sample rate [Hz]; NaN where the stamps do not increase."""
        step = float(np.median(np.diff(self.t))) if len(self.t) > 1 else 0.0
        return 1.0 / step if step > 0 else float("nan")
