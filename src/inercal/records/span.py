"""The part of a recording between two times, cut out before anything is computed from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from inercal.arrays import Array
from inercal.errors import InputError
from inercal.records.clocks import clocks, counted_rows
from inercal.records.column import Column
from inercal.units import parse_quantity

WHERE = "begin, end"
"""Name of the place in a sentence that refuses a span."""


def seconds(time: str | float | None, where: str) -> float | None:
    """A time from the first stamp on [s], given as a number or as a text such as "12.5 s"; raises `InputError`."""
    return parse_quantity(time, "time", where, "12.5 s").value if isinstance(time, str) else time


def cut(
    columns: Mapping[str, Column], labels: Sequence[str], begin: float | None, end: float | None
) -> tuple[dict[str, Column], tuple[str, ...]]:
    """Columns and labels from ``begin`` to ``end`` [s], both from the first stamp of each clock; None: all.

    Raises
    ------
    InputError
        Nothing lies within, or the rows of the recording have no time.
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
