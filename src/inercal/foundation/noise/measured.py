"""Rows of a recording that are samples: without erased stretches and rows of other packets, values that stand several
rows once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.records.checks.stretches import coarse_step, erased, held, once
from inercal.foundation.records.column import Column
from inercal.foundation.records.places import counted_names


def measured(columns: Sequence[Column]) -> list[tuple[float, list[Column]]]:
    """The columns of one clock in groups that were measured at the same rate, each with its samples alone, behind the
    number of rows for which each value stood."""
    values = np.stack([column.values for column in columns], axis=1)
    kept = np.isfinite(values).any(axis=1) & ~erased(values)
    if not kept.any():
        return [(1.0, list(columns))]
    times: dict[float, Array] = {1.0: columns[0].t[kept]}
    groups: dict[float, list[Column]] = {}
    for column in columns:
        own = replace(column, values=column.values[kept], t=times[1.0])
        rows = held(own.values)
        if rows > 1.0:
            at = once(own.values, rows)
            t = own.t[0] + np.arange(len(at)) * float(np.median(np.diff(own.t))) * rows
            own = replace(own, values=own.values[at], t=times.setdefault(rows, t))
        groups.setdefault(rows, []).append(own)
    return list(groups.items())


def of_held(rows: float, columns: Sequence[Column]) -> list[Finding]:
    """``held_samples``: columns whose values stood for so many ``rows`` each."""
    if rows == 1.0:
        return []
    rate = 1.0 / float(np.median(np.diff(columns[0].t)))
    names = counted_names([column.name for column in columns])
    return [
        Finding(
            "held_samples",
            f"{names}: each value stands for {rows:.3g} rows, so that the true rate is {rate:.4g} Hz.",
            action="Nothing needs to be done: each value counts once.",
        )
    ]


def of_coarse(columns: Sequence[Column]) -> list[Finding]:
    """``coarse_output``: columns whose noise is below a step of their output, and not known."""
    steps = {column.name: coarse_step(column.values) for column in columns}
    units = {column.name: column.unit.symbol for column in columns}
    return [
        Finding(
            "coarse_output",
            f"{name} has steps of {step:.3g} {units[name]}, larger than its noise, which is not known.",
            "",
            (name,),
            action="Record more digits, or set a narrower range of the sensor.",
        )
        for name, step in steps.items()
        if step
    ]
