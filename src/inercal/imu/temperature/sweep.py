"""Output at rest against temperature, from one static recording over a sweep of it.

The output of a gyro at rest is its bias (and earth rate); that of an accelerometer is its bias and its scale factor
times gravity along it, so that of the latter only the change with temperature belongs to the instrument. A sweep goes
up and down, and its branches differ: the thermometer lags behind the sensor, and materials remember. The cubic goes
through the middle; the difference is a coefficient of its own.
"""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from inercal.errors import RecordError
from inercal.imu.temperature.cubic import PARTS, fit_sweep
from inercal.imu.temperature.model import LEAST_SPAN, REFERENCE, Curve, TemperatureModel, assemble, no_span
from inercal.records.places import counted
from inercal.records.record import Column, Record

Array = NDArray[np.float64]

_MEASURED = re.compile(r"acc_[xyz]|gyro_[xyz]|a[1-9]\d*|gyro(_roll|_yaw)?")
_NEITHER = 0.05


def fit_recording(record: Record, reference: float = REFERENCE) -> TemperatureModel:
    """Fit every accelerometer and gyro channel of a static recording against its temperature channel.

    Parameters
    ----------
    record : Record
        ``temperature`` and the channels; the instrument must be at rest throughout.
    reference : float
        T0 [degC].

    Raises
    ------
    RecordError
        No temperature channel, no other channel, or too few samples.
    """
    temperature = record["temperature"]
    channels = [column for name, column in record.columns.items() if _MEASURED.fullmatch(name)]
    where = temperature.source.path
    if not channels:
        raise RecordError(where, f"found {', '.join(record.columns)}, expected acc_x.., gyro_x.. to fit")
    known = temperature.si()
    known = known[np.isfinite(known)]
    if len(known) < 2 * PARTS:
        raise RecordError(where, f"found {counted(len(known), 'temperature')}, expected at least {2 * PARTS}")
    low, high = float(known.min()), float(known.max())
    if high - low < LEAST_SPAN:
        return TemperatureModel(no_span(low, high, record.sources, record.findings))
    curves = tuple(_curve(channel, temperature, reference) for channel in channels)
    what = f"{counted(len(curves), 'channel')} at rest"
    estimate = assemble(
        curves, reference, record.sources, record.findings, {"reference_degC": reference}, what
    )
    return TemperatureModel(estimate, curves)


def _curve(channel: Column, temperature: Column, reference: float) -> Curve:
    """One channel, at its samples that have both a value and a temperature."""
    at = temperature.si()
    if channel.t is not temperature.t:
        good = np.isfinite(at) & np.isfinite(temperature.t)
        at = np.interp(channel.t, temperature.t[good], at[good], left=np.nan, right=np.nan)
    good = np.isfinite(channel.values) & np.isfinite(at)
    if np.count_nonzero(good) < 2 * PARTS:
        raise RecordError(
            channel.source.path,
            f"{channel.name}: found {counted(int(np.count_nonzero(good)), 'sample')} with a temperature, expected at "
            f"least {2 * PARTS}",
        )
    T, y = at[good], channel.values[good]
    rising = branches(T)
    nothing = np.empty((len(T), 0))
    both = min(np.count_nonzero(rising > 0), np.count_nonzero(rising < 0)) * 8 > len(T)
    return Curve(
        channel.name,
        channel.unit.symbol,
        T,
        y,
        rising,
        fit_sweep(T, y, reference, nothing),
        fit_sweep(T, y, reference, rising[:, None]) if both else None,
        _apart(T, y),
    )


def _apart(T: Array, y: Array) -> float:
    """Largest difference between the means of two passes (stretches of one direction) at the same temperature."""
    at, means = _part_means(T), _part_means(y)
    turns = np.flatnonzero(np.diff(np.sign(np.diff(at))) != 0) + 1
    passes = [part for part in np.split(np.arange(PARTS), turns) if len(part) > 2]
    grid = np.linspace(at.min(), at.max(), 101)
    curves = []
    for part in passes:
        order = part[np.argsort(at[part])]
        curves.append(np.interp(grid, at[order], means[order], left=np.nan, right=np.nan))
    drawn = np.array(curves)
    shared = drawn[:, np.count_nonzero(np.isfinite(drawn), axis=0) > 1]
    return float(np.max(np.nanmax(shared, axis=0) - np.nanmin(shared, axis=0), initial=0.0))


def _part_means(values: Array) -> Array:
    """Means (PARTS,) of equal parts of a sweep."""
    return np.array([part.mean() for part in np.array_split(values, PARTS)])


def branches(temperature: Array) -> Array:
    """+1/2 where it gets warmer, -1/2 where it gets colder, 0 where it does hardly either (n,)."""
    slope = np.gradient(_part_means(temperature))
    sign = np.where(np.abs(slope) > _NEITHER * np.max(np.abs(slope)), np.sign(slope), 0.0)
    return np.repeat(0.5 * sign, [len(part) for part in np.array_split(temperature, PARTS)])
