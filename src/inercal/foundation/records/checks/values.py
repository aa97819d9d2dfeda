"""Checks of time stamps (gaps, rates, their unit) and of measured values (ranges, single samples, units)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.records.column import Column
from inercal.foundation.records.limits import LIMITS
from inercal.foundation.records.places import counted, places
from inercal.foundation.units import STANDARD_GRAVITY, parse_unit

SAMPLE = 100_000


def known(values: Array) -> tuple[Array, NDArray[np.int64]]:
    """The numbers of a column without its NaN, and the rows (from 0) they stand in."""
    rows = np.flatnonzero(np.isfinite(values))
    return (values if rows.size == values.size else values[rows]), rows


def numbers(values: Array) -> Array:
    """The numbers of a column without its NaN."""
    finite = np.isfinite(values)
    return values if finite.all() else values[finite]


def rows_of(values: Array, at: NDArray[np.int64]) -> NDArray[np.int64]:
    """The rows (from 0) in which some of the `numbers` of a column stand, counted from 0."""
    finite = np.isfinite(values)
    return at if finite.all() else np.flatnonzero(finite)[at]


def thinned(values: Array) -> Array:
    """Every so many-th value, about a hundred thousand in all."""
    return values[:: values.size // SAMPLE + 1]


def plateaus(step: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First and last samples of each run of three or more equal ones."""
    equal = np.concatenate([[False], step == 0, [False]]).astype(np.int8)
    change = np.diff(equal)
    starts, ends = np.flatnonzero(change == 1), np.flatnonzero(change == -1)
    long = ends - starts >= 2
    return starts[long], ends[long]


def time_axis(t: Array, subject: str = "t") -> list[Finding]:
    """``duplicate_time``, ``backward_time``, ``gap`` and ``rate_change`` of a time axis (n,) [s].

    A gap is an interval longer than 1.5 times the median around it: the longest median of the neighbouring
    parts of the recording, so that a change of rate is not taken for gaps, and well beyond their jitter. Nor is
    the interval beside a repeated or
    backward stamp, if the stamps around both are as far apart as they should be.
    """
    stamps, rows = known(t)
    if stamps.size < 3:
        return []
    step = np.diff(stamps)
    findings = []
    for code, wrong, noun in (
        ("duplicate_time", step == 0, "repeated stamp"),
        ("backward_time", step < 0, "backward stamp"),
    ):
        if count := int(np.count_nonzero(wrong)):
            where = places("row", rows[1:][wrong] + 1)
            findings.append(Finding(code, f"{subject}: {counted(count, noun)}", where, harm=()))
    if 2 * np.count_nonzero(step > 0) <= step.size:
        return findings
    if rows[-1] - rows[0] > step.size:  # rows without a stamp have been said by the reader
        step = step / np.diff(rows)
    parts = np.array_split(step, np.clip(step.size // 100, 1, 20))
    medians = [np.median(part[part > 0]) if (part > 0).any() else 0.0 for part in parts]
    jitter = [
        LIMITS.gap_deviations * np.median(np.abs(part - middle))
        for part, middle in zip(parts, medians, strict=True)
    ]
    limits = [
        max(1.5 * max(medians[near]), max(medians[near]) + max(jitter[near]))
        for near in (slice(max(index - 1, 0), index + 2) for index in range(len(parts)))
    ]
    limit = np.repeat(limits, [len(part) for part in parts])
    long = np.flatnonzero((step > limit) & ~_made_up(step, limit))
    if long.size:
        text = f"{subject}: {counted(long.size, 'gap')}, the longest {np.diff(stamps)[long].max():.4g} s"
        findings.append(Finding("gap", text, places("row", np.union1d(rows[long], rows[long + 1]) + 1)))
    return findings + _rate_change(parts, limits, rows, subject)


def _made_up(step: Array, limit: Array) -> NDArray[np.bool_]:
    """Intervals (n,) in a stretch of too long and of zero or negative ones whose mean is within the limit."""
    odd = (step <= 0) | (step > limit)
    starts = np.flatnonzero(np.diff(odd, prepend=not odd[0]))  # each stretch of odd ones, and of others
    count = np.diff(np.append(starts, step.size))
    even = np.add.reduceat(step, starts) <= np.add.reduceat(limit, starts)
    return np.asarray(odd & np.repeat(even, count))


def _rate_change(
    parts: Sequence[Array], limits: Sequence[float], rows: NDArray[np.int64], subject: str
) -> list[Finding]:
    """``rate_change``: parts whose mean and median interval both differ by more than 2 % and their scatter."""
    ends = np.cumsum([len(part) for part in parts])
    usual = [part[(part >= 0) & (part <= limit)] for part, limit in zip(parts, limits, strict=True)]
    kept = [index for index, part in enumerate(usual) if part.any()]
    means = np.array([usual[index].mean() for index in kept])
    medians = np.array([np.median(usual[index]) for index in kept])
    scatter = max(usual[index].std() / np.sqrt(usual[index].size) for index in kept)
    allowed = 0.02 * np.median(means) + 5.0 * scatter
    changed = np.flatnonzero((np.abs(means - means[0]) > allowed) & (np.abs(medians - medians[0]) > allowed))
    if changed.size == 0:
        return []
    first = kept[changed[0]]
    text = f"{subject}: the rate goes from {1 / means[0]:.5g} Hz to {1 / means[changed[0]]:.5g} Hz"
    late_rows = rows[ends[first] - len(parts[first]) : ends[first] + 1]
    return [Finding("rate_change", text, places("row", late_rows + 1))]


def time_unit(t: Array, subject: str = "t") -> list[Finding]:
    """``unit_suspect``: intervals of seconds or of microseconds, where inertial data is sampled."""
    stamps = numbers(t)
    if stamps.size < 500:
        return []
    interval = float(np.median(np.diff(stamps)))
    if interval >= 2.0:
        looks = next(unit for unit, limit in (("ms", 500.0), ("us", 5e5), ("ns", np.inf)) if interval < limit)
        text = f"{subject}: an interval of {interval:.4g} s looks like {looks} taken for s."
    elif 0.0 < interval < 2e-5:
        text = f"{subject}: an interval of {interval:.4g} s looks like s taken for a smaller unit."
    else:
        return []
    return [Finding("unit_suspect", text, harm=("t",), action=_CORRECT)]


_CORRECT = "Correct the unit in the header or the map."


def saturation(values: Array, name: str) -> list[Finding]:
    """``saturation``: three or more equal samples at an extreme that motion has run into."""
    rows = saturated(values)
    if rows.size == 0:
        return []
    at = " and ".join(f"{level:.6g}" for level in np.unique(values[rows]))
    text = f"{name}: {counted(rows.size, 'sample')} in runs at {at}, an end of its range."
    action = "Set a wider range of the sensor, or move it less."
    return [Finding("saturation", text, places("row", rows + 1), (name,), action=action)]


def saturated(values: Array) -> NDArray[np.int64]:
    """Rows of ``values`` (n,) in runs of three or more equal samples at an extreme that motion has run into.

    Quiet signals rest on the steps of their converter, and noise-free ones on any level. So a run counts
    only if the samples before and after are well off the extreme (by more than three of the smallest steps
    and by 2 % of a large one), and only if there are not as many samples in such runs at other levels, nor most of
    all samples in them.
    """
    none = np.zeros(0, dtype=np.int64)
    signal = numbers(values)
    if signal.size < LIMITS.fewest_samples:
        return none
    low, high = signal.min(), signal.max()
    if max(np.count_nonzero(signal == low), np.count_nonzero(signal == high)) < 3:
        return none
    step = np.diff(signal)
    starts, ends = plateaus(step)
    if starts.size == 0:
        return none
    size = np.abs(step[step != 0])
    if size.size == 0 or high - low < 20 * size.min():
        return none
    before = np.where(starts > 0, np.abs(step[starts - 1]), np.inf)
    after = np.where(ends < step.size, np.abs(step[np.minimum(ends, step.size - 1)]), np.inf)
    sharp = np.minimum(before, after) > max(3 * size.min(), 0.02 * np.quantile(thinned(size), 0.99))
    starts, ends = starts[sharp], ends[sharp]
    extreme = (signal[starts] == low) | (signal[starts] == high)
    length = ends - starts + 1
    samples = int(length[extreme].sum())
    if 2 * samples <= length.sum() or 2 * samples > signal.size:
        return none
    runs = np.concatenate([np.arange(a, b + 1) for a, b in zip(starts[extreme], ends[extreme], strict=True)])
    return rows_of(values, runs)


def at_ends(values: Array) -> NDArray[np.bool_]:
    """Samples (n,) of a signal at an extreme that it is `saturated` at elsewhere: single ones too, for what was beyond
    is lost."""
    return np.isin(values, np.unique(values[saturated(values)]))


def outliers(values: Array, name: str) -> list[Finding]:
    """``outlier``: single samples far from their neighbours.

    A rate that is nearer to zero than both is none: from one turn to the next many a rig stops within a sample.
    """
    rows = outlying(values)
    if name.startswith(("wc", "gyro")) and rows.size:
        signal, known_rows = known(values)
        at = np.searchsorted(known_rows, rows)
        before, own, after = signal[at - 1], signal[at], signal[at + 1]
        same = (np.sign(before) == np.sign(own)) & (np.sign(after) == np.sign(own))
        rows = rows[~(same & (np.abs(own) < np.minimum(np.abs(before), np.abs(after))))]
    if rows.size == 0:
        return []
    text = f"{name}: {counted(rows.size, 'sample')} far from both neighbours."
    action = "Look for knocks and wrong bits there."
    return [Finding("outlier", text, places("row", rows + 1), harm=(), action=action)]


def outlying(values: Array) -> NDArray[np.int64]:
    """Rows of single samples off both neighbours, to the same side, by more than 12 times the noise.

    The noise is the standard deviation of the steps from sample to sample, the larger of two: from their
    median over the recording, and from the fifth largest of the 42 around the sample (two of them its own),
    so that motion is measured against motion.
    """
    signal = numbers(values)
    if signal.size <= LIMITS.outlier_steps:
        return np.zeros(0, dtype=np.int64)
    every = (signal.size - 1) // SAMPLE + 1
    usual = np.abs(signal[1::every] - signal[:-1:every])
    noise = max(np.median(usual) / 0.674, usual.min(initial=np.inf, where=usual > 0))
    windows = sliding_window_view(signal, LIMITS.outlier_steps + 1)
    peaks = []
    for first in range(0, signal.size - 2, SAMPLE // 4):  # what a processor keeps near
        step = np.diff(signal[first : first + SAMPLE // 4 + 2])
        large = np.flatnonzero(np.abs(step) > 12.0 * noise)
        suspects = large[:-1][np.diff(large) == 1]
        suspects = suspects[(step[suspects] > 0) != (step[suspects + 1] > 0)]
        height = np.minimum(np.abs(step[suspects]), np.abs(step[suspects + 1]))
        near = windows[np.clip(first + suspects - LIMITS.outlier_steps // 2, 0, len(windows) - 1)]
        steps = np.abs(np.diff(near, axis=1))
        moved = np.partition(steps, LIMITS.outlier_steps - 5, axis=1)[:, LIMITS.outlier_steps - 5] / 1.645
        peaks.append(first + suspects[height > 12.0 * moved])
    return rows_of(values, np.concatenate(peaks) + 1)


def accelerometer_unit(columns: Mapping[str, Column]) -> list[Finding]:
    """``unit_suspect``: the median norm is that of gravity in another unit than the one stated."""
    axes = [columns[name] for name in ("acc_x", "acc_y", "acc_z") if name in columns]
    if len(axes) < 3 or any(axis.unit != axes[0].unit or axis.t is not axes[0].t for axis in axes):
        return []
    if any(is_dead(axis.values) for axis in axes):  # what is left of gravity tells no unit
        return []
    given = axes[0].unit
    norms = np.sqrt(sum(thinned(axis.values) ** 2 for axis in axes))
    norms = norms[np.isfinite(norms)]
    if given.dimension != "acceleration" or norms.size == 0:
        return []
    norm = float(np.median(norms))
    fitting = [
        unit
        for unit in (given, *(parse_unit(text) for text in ("g", "m/s^2", "mg", "ug", "cm/s^2")))
        if 0.8 < norm * unit.factor / STANDARD_GRAVITY < 1.2
    ]
    if not fitting or given in fitting:
        return []
    text = f"acc: a median norm of {norm:.4g} {given.symbol} looks like {fitting[0].symbol}."
    return [Finding("unit_suspect", text, harm=("acc_x", "acc_y", "acc_z"), action=_CORRECT)]


def gyro_unit(columns: Mapping[str, Column]) -> list[Finding]:
    """``unit_suspect``: rates that no gyro measures, one in a thousand beyond 100 rad/s."""
    findings = []
    for name in ("gyro_x", "gyro_y", "gyro_z", "gyro", "gyro_roll", "gyro_yaw"):
        if name in columns and (unit := columns[name].unit).dimension == "rate":
            signal = numbers(columns[name].values)
            if 1000 * np.count_nonzero(np.abs(signal) > 100.0 / unit.factor) > signal.size:
                looks = {"rad/s": "deg/s", "deg/s": "mdeg/s"}.get(unit.symbol, "a smaller unit")
                text = f"{name}: rates up to {np.abs(signal).max():.6g} {unit.symbol} look like {looks}."
                findings.append(Finding("unit_suspect", text, harm=(name,), action=_CORRECT))
    return findings


def temperature_unit(column: Column) -> list[Finding]:
    """``unit_suspect``: temperatures that no instrument stands, one in a thousand outside -100 to 200 degC."""
    signal = numbers(column.values)
    if column.unit.dimension != "temperature" or signal.size == 0:
        return []
    low, high = ((limit - column.unit.zero) / column.unit.factor for limit in (-100.0, 200.0))
    if 1000 * np.count_nonzero((signal < low) | (signal > high)) <= signal.size:
        return []
    span = f"{signal.min():.6g} to {signal.max():.6g} {column.unit.symbol}"
    text = f"{column.name}: {span} are hardly temperatures of an instrument."
    return [Finding("unit_suspect", text, harm=(column.name,), action=_CORRECT)]


def dead_channel(values: Array, name: str) -> list[Finding]:
    """``dead_channel``: a sensor that never changes, which its noise alone would make it do."""
    if not is_dead(values):
        return []
    signal = numbers(values)
    text = f"{name}: all {signal.size} samples are {signal[0]:.6g}, a dead or empty channel."
    return [
        Finding("dead_channel", text, harm=(name,), action="Look at its wiring, or leave it out in the map.")
    ]


def is_dead(values: Array) -> bool:
    """True if all of at least ten values (n,) are equal."""
    for part in (values[:SAMPLE], values):  # the first of them tell of most
        signal = numbers(part)
        if (signal != signal[:1]).any():
            return False
    return signal.size >= LIMITS.fewest_samples
