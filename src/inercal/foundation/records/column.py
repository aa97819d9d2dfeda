"""Columns of a record, three of a sensor together, and their clocks: each time axis once, under a name."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.errors import MissingExtraError, RecordError
from inercal.foundation.findings import Finding
from inercal.foundation.inputs import Source
from inercal.foundation.records.channels import of_a_table, sensor_and_axis
from inercal.foundation.units import RAW, Unit

if TYPE_CHECKING:
    import xarray


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

    @cached_property
    def rate(self) -> float:
        """Median sample rate [Hz]; NaN where the stamps do not increase."""
        t = self.t[np.isfinite(self.t)]
        step = float(np.median(np.diff(t))) if len(t) > 1 else 0.0
        return 1.0 / step if step > 0 else float("nan")


SHORTEST, LONGEST = 1e-6, 1e6
"""Intervals [s] between which samples of inertial sensors come."""


def usable_interval(interval: float, where: object) -> float:
    """A sample interval [s] that recordings have; raises `RecordError` for any other, as of stamps in a wrong unit."""
    if not SHORTEST <= interval <= LONGEST:
        raise RecordError(
            where,
            f"t: found a row every {interval:.3g} s, expected {SHORTEST:g} s to {LONGEST:g} s (check the unit of t)",
        )
    return interval


@dataclass(frozen=True)
class Clocks:
    """Time axes (n,) [s] by name, and the name of the axis that each column has.

    ``labels`` names the axis of the record's labels: the first with as many rows. None where there are none.
    """

    axes: Mapping[str, Array]
    of_column: Mapping[str, str]
    labels: str | None


def clocks(columns: Mapping[str, Column], word: str, labels: int = 0) -> Clocks:
    """Name the time axes of a record with so many ``labels``: ``word`` where there is one, else ``word_<sensor>``.

    The sensor is that of the first column with this axis; another axis of the same sensor is numbered, as in
    ``t_acc_2``. Axes of equal stamps are one.
    """
    distinct: list[Array] = []
    number: dict[str, int] = {}
    for column in columns.values():
        same = (k for k, t in enumerate(distinct) if t is column.t or np.array_equal(t, column.t, True))
        number[column.name] = next(same, len(distinct))
        if number[column.name] == len(distinct):
            distinct.append(column.t)
    names: dict[int, str] = {}
    for column in columns.values():
        name = word if len(distinct) == 1 else f"{word}_{column.sensor}"
        numbered = (f"{name}_{k}" for k in itertools.count(2))
        free = next(each for each in itertools.chain([name], numbered) if each not in names.values())
        names.setdefault(number[column.name], free)
    axes = {names[k]: t for k, t in enumerate(distinct)}
    labelled = (name for name, t in axes.items() if labels and len(t) == labels)
    return Clocks(axes, {name: names[k] for name, k in number.items()}, next(labelled, None))


def counted_rows(columns: Mapping[str, Column]) -> bool:
    """True for a test on a table without time stamps: its axis counts the rows from 0
    (`inercal.foundation.records.read.join`)."""
    return of_a_table(columns) and all(
        np.array_equal(column.t, np.arange(len(column.t))) for column in columns.values()
    )


def to_xarray(columns: Mapping[str, Column], findings: Sequence[Finding] = ()) -> xarray.Dataset:
    """Columns as variables with units, sensor, axis and source as attributes; a dimension for each clock.

    The dimension is ``time`` when all columns share one clock, else ``time_<sensor>`` of the clock's first
    column (``time_<sensor>_2`` for another clock of that sensor). Raises
    `MissingExtraError` where xarray is not installed.
    """
    try:
        import xarray
    except ImportError as error:
        raise MissingExtraError("Record.to_xarray", "xarray") from error
    time = clocks(columns, "time")
    return xarray.Dataset(
        {
            column.name: (
                time.of_column[column.name],
                column.values,
                {
                    "units": column.unit.symbol,
                    "sensor": column.sensor,
                    "axis": column.axis,
                    "frame": column.frame,
                    "source": column.source.path,
                    "sha256": column.source.sha256,
                },
            )
            for column in columns.values()
        },
        coords={name: (name, t, {"units": "s"}) for name, t in time.axes.items()},
        attrs={"findings": "; ".join(f"{finding.code}: {finding.message}" for finding in findings)},
    )
