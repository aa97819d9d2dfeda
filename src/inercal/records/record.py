"""A record: labelled columns of one or more files, frozen, exactly as they were read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from inercal.errors import RecordError
from inercal.findings import Finding
from inercal.inputs import Source
from inercal.records.clocks import to_xarray
from inercal.records.column import Column, Triad

if TYPE_CHECKING:
    import xarray


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
        return to_xarray(self.columns, self.findings)
