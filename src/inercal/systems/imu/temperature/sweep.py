"""Output at rest against temperature, from one static recording over a sweep of it.

The output of a gyro at rest is its bias (and earth rate); that of an accelerometer is its bias and its scale factor
times gravity along it, so that of the latter only the change with temperature belongs to the instrument. A sweep goes
up and down, and its branches differ: the thermometer lags behind the sensor, and materials remember. The polynomial
goes through the middle; the difference is a coefficient of its own.
"""

from __future__ import annotations

import re
from itertools import combinations

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import InputError, RecordError
from inercal.foundation.findings import Finding
from inercal.foundation.records.checks.values import is_dead
from inercal.foundation.records.column import Column
from inercal.foundation.records.places import counted
from inercal.foundation.records.record import Record
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.temperature.model import REFERENCE, Curve, TemperatureModel, assemble, no_span
from inercal.systems.imu.temperature.polynomial import (
    HIGHEST_ORDER,
    PARTS,
    fit_sweep,
    kink,
    order_of,
    with_next_power,
)

_MEASURED = re.compile(r"acc_[xyz]|gyro_[xyz]|a[1-9]\d*|gyro(_roll|_yaw)?")
_MEDIAN_OF_A_SQUARE = 0.455  # of a standard normal variable


def fit_recording(record: Record, reference: float = REFERENCE, order: int | None = None) -> TemperatureModel:
    """Fit every accelerometer and gyro channel of a static recording against its temperature channel.

    A channel that never changes is left out: it is dead, as the record's findings say.

    Parameters
    ----------
    record : Record
        ``temperature`` and the channels; the instrument must be at rest throughout.
    reference : float
        T0 [degC].
    order : int, optional
        Highest power of temperature, 1 to 5. Without it the data tell that of each channel, and u holds what the next
        power would change.

    Raises
    ------
    RecordError
        No temperature channel, no other channel, or too few samples.
    InputError
        No such order.
    """
    if order is not None and not 1 <= order <= HIGHEST_ORDER:
        raise InputError("order", f"found {order}, expected 1 to {HIGHEST_ORDER}")
    temperature = record["temperature"]
    channels = [column for name, column in record.columns.items() if _MEASURED.fullmatch(name)]
    where = temperature.source.path
    if not channels:
        raise RecordError(where, f"found {', '.join(record.columns)}, expected acc_x.., gyro_x.. to fit")
    finite = temperature.si()
    finite = finite[np.isfinite(finite)]
    if len(finite) < 2 * PARTS:
        raise RecordError(
            where, f"found {counted(len(finite), 'temperature')}, expected at least {2 * PARTS}"
        )
    low, high = float(finite.min()), float(finite.max())
    if high - low < LIMITS.temperature_span:
        return TemperatureModel(no_span(low, high, record.sources, record.findings))
    live = [channel for channel in channels if not is_dead(channel.values)]
    if not live:
        names = ", ".join(channel.name for channel in channels)
        raise RecordError(where, f"{names}: never changing, expected a live sensor")
    curves = tuple(
        _curve(channel, temperature, reference, order, LIMITS.hysteresis_probability / len(live))
        for channel in live
    )
    findings = (*record.findings, *(finding for curve in curves if (finding := _kinked(curve))))
    what = f"{counted(len(curves), 'channel')} at rest"
    estimate = assemble(
        curves, reference, record.sources, findings, {"reference_degC": reference, "order": order}, what
    )
    return TemperatureModel(estimate, curves)


def _curve(channel: Column, temperature: Column, reference: float, order: int | None, risk: float) -> Curve:
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
    terms = 1 + (order_of(T, y) if order is None else order)
    fit = fit_sweep(T, y, reference, nothing, terms)
    both = min(np.count_nonzero(rising > 0), np.count_nonzero(rising < 0)) * 8 > len(T)
    return Curve(
        channel.name,
        channel.unit.symbol,
        T,
        y,
        rising,
        fit if order is not None else with_next_power(fit, T, y),
        fit_sweep(T, y, reference, rising[:, None], terms) if both else None,
        *_apart(T, y, risk),
    )


def _kinked(curve: Curve) -> Finding | None:
    """The finding of an output that jumps or bends at a temperature, which no coefficient of a polynomial describes."""
    found = kink(curve.temperature, curve.values)
    if found.gain < LIMITS.kink_gain:
        return None
    whole = curve.polynomial
    parted = fit_sweep(curve.temperature, curve.values, whole.reference, found.shape[:, None], whole.terms)
    size = float(parted.coefficients[-1])
    off = parted.value(curve.temperature) + size * found.shape - whole.value(curve.temperature)
    most = float(np.max(np.abs(off)))
    names = tuple(curve.name + (f"_T{power}" if power else "") for power in range(whole.terms))
    change = (
        f"jumps by {size:.3g} {curve.unit}"
        if found.jumps
        else f"changes its slope by {size:.3g} {curve.unit}/K"
    )
    return Finding(
        "temperature_kink",
        f"{curve.name} {change} at {found.temperature:.1f} degC, a polynomial is off by up to {most:.3g} {curve.unit}",
        harm=names,
        action="look for a compensation table or a heater of the instrument, or fit both sides apart (--begin, --end)",
    )


def _apart(T: Array, y: Array, risk: float) -> tuple[float, bool]:
    """Largest difference between two passes (stretches of one direction) at one temperature, and is it beyond chance.

    Chance is at worst a random walk with the second differences of neighbouring parts: over k parts its deviation is
    sqrt(k) times that of a step. White noise and wander of any other length make less. Each pair of parts counts as a
    comparison.
    """
    from scipy.special import ndtri

    at, means = _part_means(T), _part_means(y)
    turns = np.flatnonzero(np.diff(np.sign(np.diff(at))) != 0) + 1
    passes = [part for part in np.split(np.arange(PARTS), turns) if len(part) > 2]
    grid = np.linspace(at.min(), at.max(), 101)
    values: list[Array] = []
    times: list[Array] = []
    for part in passes:
        order = part[np.argsort(at[part])]
        for curves, of in ((values, means), (times, np.arange(float(PARTS)))):
            curves.append(np.interp(grid, at[order], of[order], left=np.nan, right=np.nan))
    bends = [np.diff(means[part], 2) ** 2 for part in passes]
    # of a step: by the median, for the ends of the passes are no noise
    step = np.sqrt(np.median(np.concatenate(bends)) / _MEDIAN_OF_A_SQUARE / 2.0) if passes else 0.0
    most = -float(ndtri(risk / (PARTS * (PARTS - 1.0)))) * step
    largest, beyond = 0.0, False
    for one, other in combinations(range(len(passes)), 2):
        apart = np.abs(values[one] - values[other])
        shared = np.isfinite(apart)
        if shared.any():
            apart, k = apart[shared], np.abs(times[one] - times[other])[shared]
            largest = max(largest, float(np.max(apart)))
            beyond |= bool(np.any(apart > most * np.sqrt(np.maximum(k, 1.0))))
    return largest, beyond


def _part_means(values: Array) -> Array:
    """Means (PARTS,) of equal parts of a sweep."""
    return np.array([part.mean() for part in np.array_split(values, PARTS)])


def branches(temperature: Array) -> Array:
    """+1/2 (n,) on rising temperature, -1/2 on falling, 0 where it hardly changes."""
    slope = np.gradient(_part_means(temperature))
    sign = np.where(np.abs(slope) > LIMITS.flat_temperature * np.max(np.abs(slope)), np.sign(slope), 0.0)
    return np.repeat(0.5 * sign, [len(part) for part in np.array_split(temperature, PARTS)])
