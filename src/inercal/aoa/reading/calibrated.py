"""Indications of a sensor as measured values, in SI, for a whole record and for a single sample."""

from __future__ import annotations

from collections.abc import Collection, Iterable

import numpy as np
from numpy.typing import NDArray

from inercal.aoa.layout import Layout
from inercal.aoa.limits import LIMITS
from inercal.aoa.settings import GYROS, Calibration
from inercal.arrays import Array
from inercal.errors import RecordError
from inercal.records.column import Column
from inercal.records.places import counted_names

_PER = {"voltage": "V", "count": "count"}


def check_unit(column: Column, how: Calibration, where: object) -> None:
    """Refuse a column in volts or counts without a scale for these, or such a scale for another column.

    Raises
    ------
    RecordError
        The unit of the column is not that of the study's scale.
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
    """Mask (m,) of samples at or beyond the range, ``measured`` or, in a column of physical units, ``indicated``.

    An output in physical units ends at its range before its bias is taken off; either way it is at an end. With a zero
    point of some volts or counts the range is that of the measured value alone.
    """
    if how.range is None:
        return np.zeros(np.shape(indicated), dtype=np.bool_)
    limit = (1.0 - LIMITS.range_rounding) * how.range
    at: NDArray[np.bool_] = np.abs(measured) >= limit
    return at | (np.abs(indicated * how.scale) >= limit) if how.per == "1" else at


def check_axes(there: Collection[str], columns: Iterable[str], layout: Layout, where: object) -> None:
    """Refuse accelerometers ``there`` among ``columns`` that do not show the angle all around.

    Raises
    ------
    RecordError
        There are none, or their axes are parallel.
    """
    if not there:
        names = counted_names([*columns], 12) or "no columns"
        raise RecordError(
            where, f"found no accelerometer among {names}, expected t, {', '.join(layout.names)} and gyro"
        )
    if not layout.of(*(layout.names.index(name) for name in there)).spans:
        lacking = ", ".join(name for name in layout.names if name not in there) or "one of another axis"
        raise RecordError(
            where,
            f"found {', '.join(there)} alone with varying numbers, whose axes are parallel, expected {lacking} too",
        )
