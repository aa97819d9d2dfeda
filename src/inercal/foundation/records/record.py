"""A record: labelled columns of one or more files, frozen, exactly as they were read."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.errors import InputError, RecordError
from inercal.foundation.findings import Finding
from inercal.foundation.inputs import Source
from inercal.foundation.records.checks import check
from inercal.foundation.records.column import Column, Triad, clocks, counted_rows, to_xarray
from inercal.foundation.records.places import counted
from inercal.foundation.units import Quantity, Unit, parse_quantity, parse_unit

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True, eq=False, repr=False)
class Record:
    """Columns by name, in the order read, with what was found suspicious while reading.

    Reading never drops, sorts or interpolates: rows that could not be read, and stamps that are wrong, stand as NaN
    and are listed in ``findings``. Columns of files with different clocks keep their own time axes. ``labels`` holds
    the text of a label column (one string a row), if the map names one. ``span`` says what part of the sources it is,
    as ``begin_s`` and ``end_s`` from the first stamp of each clock; empty for all. ``rate_u`` is the relative standard
    uncertainty of a sample rate that was typed, 0 if it had none; None where stamps are the clock. ``taken`` says of
    each sensor that was recognised which columns it is in, in which unit, how sure that is, and why.
    """

    columns: Mapping[str, Column]
    findings: tuple[Finding, ...] = ()
    sources: tuple[Source, ...] = ()
    labels: tuple[str, ...] = ()
    span: Mapping[str, float] = field(default_factory=dict)
    rate_u: float | None = None
    taken: Mapping[str, str] = field(default_factory=dict)

    def __repr__(self) -> str:
        """Ten lines at most: columns by clock with units and rows, and the findings."""
        time = clocks(self.columns, "t")
        lines = [f"Record of {counted(len(self.columns), 'column')}"]
        for name, t in time.axes.items():
            own = [each for each in self.columns.values() if time.of_column[each.name] == name]
            titles = ", ".join(f"{each.name} [{each.unit.symbol}]" for each in own[:9])
            more = ", ..." if len(own) > 9 else ""
            known = t[np.isfinite(t)]
            lasts = f" over {float(known[-1] - known[0]):.6g} s" if len(known) else ""
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


WHERE = "begin, end"
"""Name of the place in a sentence that refuses a span."""


def seconds(time: str | float | None, where: str) -> float | None:
    """A time from the first stamp on [s], given as a number or as a text such as "12.5 s"; raises `InputError`."""
    return parse_quantity(time, "time", where, "12.5 s").value if isinstance(time, str) else time


def cut(
    columns: Mapping[str, Column], labels: Sequence[str], begin: float | None, end: float | None
) -> tuple[dict[str, Column], tuple[str, ...]]:
    """Columns and labels from ``begin`` to ``end`` [s], both from the first stamp of each clock; None: all.

    Raises `InputError` where nothing lies within, or the rows of the recording have no time.
    """
    if counted_rows(columns):
        raise InputError(WHERE, "found a recording whose rows have no time, expected one with a column t")
    low, high = 0.0 if begin is None else begin, np.inf if end is None else end
    inside: dict[int, tuple[NDArray[np.bool_], Array]] = {}
    kept = {}
    for name, column in columns.items():
        if id(column.t) not in inside:
            start = np.nanmin(column.t, initial=np.inf)
            rows = (column.t >= start + low) & (column.t <= start + high)
            inside[id(column.t)] = rows, column.t[rows]
        rows, t = inside[id(column.t)]
        kept[name] = replace(column, t=t, values=column.values[rows])
    if not any(rows.any() for rows, _ in inside.values()):
        stamps = (column.t[np.isfinite(column.t)] for column in columns.values())
        lasts = max((float(np.ptp(t)) for t in stamps if t.size), default=0.0)
        later = "and later" if np.isinf(high) else f"to {high:g} s"
        raise InputError(
            WHERE,
            f"found {low:g} s {later}, expected a span within the record, which lasts {lasts:.4g} s",
        )
    return kept, _labels(columns, labels, inside)


def _labels(
    columns: Mapping[str, Column],
    labels: Sequence[str],
    inside: Mapping[int, tuple[NDArray[np.bool_], Array]],
) -> tuple[str, ...]:
    """The labels of the rows that were kept; none where no clock has as many rows."""
    named = clocks(columns, "t", len(labels))
    column = next((each for name, each in columns.items() if named.of_column[name] == named.labels), None)
    if column is None:
        return ()
    return tuple(label for label, kept in zip(labels, inside[id(column.t)][0], strict=True) if kept)


SIMULATED = Source("simulated", "")


def record_of(columns: Iterable[tuple[str, Unit, Array]], t: Array, source: Source = SIMULATED) -> Record:
    """A record of (name, unit, (n,) values in that unit) on one clock ``t`` (n,) [s].

    ``source`` says where it comes from, in place of a file.
    """
    made = {
        name: Column(name, unit, np.ascontiguousarray(values), t, source) for name, unit, values in columns
    }
    return Record(made, sources=(source,))


def recorded_temperature(record: Record) -> Quantity | None:
    """The mean of the temperature channel [degC], with the standard deviation as its u; None without such a channel."""
    column = record.columns.get("temperature")
    if column is None or column.unit.dimension != "temperature" or not np.isfinite(column.values).any():
        return None
    known = column.si()
    mean, u = float(np.nanmean(known)), float(np.nanstd(known))
    return Quantity(mean, u, parse_unit("degC"), f"{mean:.1f} degC")
