"""A record: labelled columns of one or more files, frozen, exactly as they were read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from inercal.errors import RecordError
from inercal.findings import Finding
from inercal.inputs import Source
from inercal.records.checks import check
from inercal.records.clocks import clocks, to_xarray
from inercal.records.column import Column, Triad
from inercal.records.places import counted
from inercal.records.span import cut, seconds

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True, eq=False, repr=False)
class Record:
    """Columns by name, in the order read, with what was found suspicious while reading.

    Reading never drops, sorts or interpolates: rows that could not be read stand as NaN and are listed in
    ``findings``. Columns of files with different clocks keep their own time axes. ``labels`` holds the text
    of a label column (one string a row), if the map names one. ``span`` says what part of the sources it is, as
    ``begin_s`` and ``end_s`` from the first stamp of each clock; empty for all. ``rate_u`` is the relative standard
    uncertainty of a sample rate that was typed, 0 if it had none; None where stamps are the clock.
    """

    columns: Mapping[str, Column]
    findings: tuple[Finding, ...] = ()
    sources: tuple[Source, ...] = ()
    labels: tuple[str, ...] = ()
    span: Mapping[str, float] = field(default_factory=dict)
    rate_u: float | None = None

    def __repr__(self) -> str:
        """Ten lines at most: columns by clock with units and rows, and the findings."""
        time = clocks(self.columns, "t")
        lines = [f"Record of {counted(len(self.columns), 'column')}"]
        for name, t in time.axes.items():
            own = [each for each in self.columns.values() if time.of_column[each.name] == name]
            titles = ", ".join(f"{each.name} [{each.unit.symbol}]" for each in own[:9])
            more = ", ..." if len(own) > 9 else ""
            lasts = f" over {float(t[-1] - t[0]):.6g} s" if len(t) else ""
            lines.append(f"  {titles}{more}: {counted(len(t), 'row')}{lasts}")
        if len(lines) > 7:
            lines = [*lines[:7], f"  ... {len(lines) - 7} clocks more"]
        codes = ", ".join(dict.fromkeys(finding.code for finding in self.findings))
        return "\n".join([*lines, f"  findings: {codes or 'nothing suspicious'}"])

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

    def between(self, begin: str | float | None = None, end: str | float | None = None) -> Record:
        """The part of the record from ``begin`` to ``end``, both from the first stamp of each clock.

        Parameters
        ----------
        begin, end : str, float or None
            A time with its unit, ``"12.5 s"``, or in seconds; None: no limit.

        Returns
        -------
        Record
            What is suspicious about this part alone is among its findings, with all that was found while reading.

        Raises
        ------
        InputError
            Nothing lies within, the rows have no time, or a text is no time.

        Examples
        --------
        >>> import inercal as ic
        >>> record = ic.record(acc_z=[9.8, 9.9, 9.8, 9.7], rate=2.0)
        >>> record.between("0.5 s", 1.0)["acc_z"].values
        array([9.9, 9.8])
        """
        given = {"begin_s": seconds(begin, "begin"), "end_s": seconds(end, "end")}
        span = {key: value for key, value in given.items() if value is not None}
        if not span:
            return self
        columns, labels = cut(self.columns, self.labels, given["begin_s"], given["end_s"])
        whole = check(self.columns)
        read = [finding for finding in self.findings if finding not in whole]
        return replace(self, columns=columns, findings=(*read, *check(columns)), labels=labels, span=span)

    def to_xarray(self) -> xarray.Dataset:
        """As an xarray Dataset, one time dimension for each clock; needs the extra ``xarray``."""
        return to_xarray(self.columns, self.findings)
