"""A record: labelled columns of one or more files, frozen, exactly as they were read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from inercal.errors import RecordError
from inercal.records.channels import sensor_and_axis
from inercal.records.findings import Finding
from inercal.units import Unit

if TYPE_CHECKING:
    import xarray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Source:
    """A file that was read: its path as given, and the SHA-256 of its bytes."""

    path: str
    sha256: str


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
        if self.unit.dimension in ("count", "voltage"):
            raise RecordError(
                self.source.path, f"{self.name} is in {self.unit.symbol}, expected physical units"
            )
        return self.values * self.unit.factor + self.unit.zero


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


@dataclass(frozen=True, eq=False)
class Record:
    """Columns by name, in the order read, with what was found suspicious while reading.

    Reading never drops, sorts or interpolates: rows that could not be read stand as NaN and are listed in
    ``findings``. Columns of files with different clocks keep their own time axes. ``labels`` holds the text
    of a label column (one string a row), if the map names one.
    """

    columns: Mapping[str, Column]
    findings: tuple[Finding, ...] = ()
    sources: tuple[Source, ...] = ()
    labels: tuple[str, ...] = field(default=(), repr=False)

    def __contains__(self, name: str) -> bool:
        """True if there is such a column."""
        return name in self.columns

    def __getitem__(self, name: str) -> Column:
        """The column of that name; raises `RecordError` naming those there are."""
        try:
            return self.columns[name]
        except KeyError:
            where = ", ".join(source.path for source in self.sources) or "record"
            raise RecordError(where, f"no column {name}, found {', '.join(self.columns) or 'none'}") from None

    def triad(self, sensor: str) -> Triad:
        """The axes x, y, z of a sensor (``acc``, ``gyro``) as one array; raises `RecordError`."""
        x, y, z = (self[f"{sensor}_{axis}"] for axis in "xyz")
        for other in (y, z):
            if other.t is not x.t or other.unit != x.unit:
                raise RecordError(
                    other.source.path,
                    f"{other.name} in {other.unit.symbol} has another unit or clock than {x.name} in "
                    f"{x.unit.symbol}, expected one for the triad",
                )
        return Triad(sensor, x.unit, x.t, np.stack([x.values, y.values, z.values], axis=-1), x.source)

    def to_xarray(self) -> xarray.Dataset:
        """As an xarray Dataset, one time dimension for each clock; needs the extra ``xarray``."""
        from inercal.records.to_xarray import to_xarray

        return to_xarray(self)
