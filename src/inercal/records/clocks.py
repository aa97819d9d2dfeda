"""The clocks of a record: its time axes, each once, under a name."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from inercal.errors import RecordError
from inercal.records.channels import of_a_table
from inercal.records.record import Array, Column, Record

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


def clocks(record: Record, word: str) -> Clocks:
    """Name the time axes of a record: ``word`` where there is one, else ``word_<sensor>``.

    The sensor is that of the first column with this axis; another axis of the same sensor is numbered, as in
    ``t_acc_2``. Axes of equal stamps are one.
    """
    distinct: list[Array] = []
    number: dict[str, int] = {}
    for column in record.columns.values():
        same = (k for k, t in enumerate(distinct) if t is column.t or np.array_equal(t, column.t, True))
        number[column.name] = next(same, len(distinct))
        if number[column.name] == len(distinct):
            distinct.append(column.t)
    names: dict[int, str] = {}
    for column in record.columns.values():
        name = word if len(distinct) == 1 else f"{word}_{column.sensor}"
        numbered = (f"{name}_{k}" for k in itertools.count(2))
        free = next(each for each in itertools.chain([name], numbered) if each not in names.values())
        names.setdefault(number[column.name], free)
    axes = {names[k]: t for k, t in enumerate(distinct)}
    labelled = (name for name, t in axes.items() if record.labels and len(t) == len(record.labels))
    return Clocks(axes, {name: names[k] for name, k in number.items()}, next(labelled, None))


def counted_rows(columns: Mapping[str, Column]) -> bool:
    """True for a test on a table without time stamps: its axis counts the rows from 0 (`inercal.records.read.join`)."""
    return of_a_table(columns) and all(
        np.array_equal(column.t, np.arange(len(column.t))) for column in columns.values()
    )
