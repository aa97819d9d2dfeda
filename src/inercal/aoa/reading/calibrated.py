"""Indications of a sensor as what it measures, in SI: of a whole record and of a single sample alike."""

from __future__ import annotations

from collections.abc import Collection, Iterable

import numpy as np
from numpy.typing import NDArray

from inercal.aoa.layout import Layout
from inercal.aoa.settings import GYROS, Calibration
from inercal.arrays import Array
from inercal.errors import RecordError
from inercal.records.column import Column
from inercal.records.places import counted_names

_ROUNDING = 1e-6
"""Part of a range by which a saturated sample may fall short of it, written with a few digits."""

_PER = {"voltage": "V", "count": "count"}


def check_unit(column: Column, how: Calibration, where: object) -> None:
    """Refuse a column in volts or counts without a scale for these, or such a scale for another column.

    Raises
    ------
    RecordError
        What the study's scale is for is not what the record holds.
    """
    holds = _PER.get(column.unit.dimension, "1")
    if holds == how.per:
        return
    name, symbol = column.name, column.unit.symbol
    if holds == "1":
        raise RecordError(where, f"{name} is in {symbol}, expected {how.per} as the study's scale is for")
    example = f"{'1 deg/s' if name in GYROS else '1e-3 g'}/{holds}"
    raise RecordError(
        where,
        f'{name} is in {symbol}, expected a scale under [sensors.{name}] of the study, such as "{example}"',
    )


def indication(column: Column, values: Array) -> Array:
    """``values`` (m,) of a column in SI, volts or counts."""
    return values * column.unit.factor + column.unit.zero


def at_range(indicated: Array, measured: Array, how: Calibration) -> NDArray[np.bool_]:
    """Which samples (m,) are at or beyond the range, ``measured`` or, of a column in physical units, ``indicated``.

    Such an output ends at its range before its bias is taken off; either way it is at an end. A range about a zero
    point of some volts or counts is of what is measured alone.
    """
    if how.range is None:
        return np.zeros(np.shape(indicated), dtype=np.bool_)
    limit = (1.0 - _ROUNDING) * how.range
    at: NDArray[np.bool_] = np.abs(measured) >= limit
    return at | (np.abs(indicated * how.scale) >= limit) if how.per == "1" else at


def check_axes(there: Collection[str], columns: Iterable[str], layout: Layout, where: object) -> None:
    """Refuse accelerometers ``there`` among ``columns`` that do not tell the angle all around.

    Raises
    ------
    RecordError
        There is none, or their axes are parallel.
    """
    if not there:
        found = counted_names([*columns], 12) or "no columns"
        raise RecordError(
            where, f"found no accelerometer among {found}, expected t, {', '.join(layout.names)} and gyro"
        )
    if not layout.of(*(layout.names.index(name) for name in there)).spans:
        lacking = ", ".join(name for name in layout.names if name not in there) or "one of another axis"
        raise RecordError(
            where,
            f"found {', '.join(there)} alone with varying numbers, whose axes are parallel, expected {lacking} too",
        )
