"""Checks of a record just read: what its stamps and values tell about how it was recorded.

Nothing is changed, dropped or decided here; a check only says what is suspicious and where, and ordinary
motion and noise say nothing. Rows are counted from 1, the first row of data.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from inercal.records.channels import of_a_table
from inercal.records.findings import Finding
from inercal.records.places import counted, places
from inercal.records.record import Array, Column
from inercal.units import STANDARD_GRAVITY, parse_unit

_MEASURED = re.compile(r"acc_[xyz]|a\d+|gyro\w*|y_[xy]|temperature")
_SAMPLE = 100_000
_AROUND = 42


def check(columns: Mapping[str, Column]) -> tuple[Finding, ...]:
    """Everything suspicious about the columns of a record, apart from what their readers have said.

    Parameters
    ----------
    columns : mapping of str to Column
        Those of a record, by name; each time axis they share is looked at once.
    """
    clocks = {id(column.t): column for column in columns.values()}
    sampled = not of_a_table(columns)
    findings: list[Finding] = []
    with np.errstate(all="ignore"):
        for column in clocks.values():
            subject = "t" if len(clocks) == 1 else f"t of {Path(column.source.path).name}"
            findings += time_axis(column.t, subject)
            findings += time_unit(column.t, subject) if sampled else []
        for column in columns.values():
            if _MEASURED.fullmatch(column.name):
                findings += saturation(column.values, column.name)
                findings += outliers(column.values, column.name)
        findings += accelerometer_unit(columns)
        findings += gyro_unit(columns)
    return tuple(findings)


def missing(values: Mapping[str, Array]) -> tuple[Finding, ...]:
    """``nan``: rows of each column (by name) that hold no number."""
    empty = {name: np.flatnonzero(np.isnan(column)) for name, column in values.items()}
    return tuple(
        Finding("nan", f"{name}: {counted(rows.size, 'missing value')}", places("row", rows + 1))
        for name, rows in empty.items()
        if rows.size
    )


def time_axis(t: Array, subject: str = "t") -> list[Finding]:
    """``duplicate_time``, ``backward_time``, ``gap`` and ``rate_change`` of a time axis (n,) [s].

    A gap is an interval longer than 1.5 times the median around it: the longest median of the neighbouring
    parts of the recording, so that a change of rate is not taken for gaps.
    """
    stamps, rows = _known(t)
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
            findings.append(Finding(code, f"{subject}: {counted(count, noun)}", where))
    if 2 * np.count_nonzero(step > 0) <= step.size:
        return findings
    if rows[-1] - rows[0] > step.size:  # rows without a stamp have been said by the reader
        step = step / np.diff(rows)
    parts = np.array_split(step, np.clip(step.size // 100, 1, 20))
    medians = [np.median(part[part > 0]) if (part > 0).any() else 0.0 for part in parts]
    limits = [1.5 * max(medians[max(index - 1, 0) : index + 2]) for index in range(len(parts))]
    long = np.flatnonzero(np.concatenate([part > limit for part, limit in zip(parts, limits, strict=True)]))
    if long.size:
        text = f"{subject}: {counted(long.size, 'gap')}, the longest {np.diff(stamps)[long].max():.4g} s"
        findings.append(Finding("gap", text, places("row", np.union1d(rows[long], rows[long + 1]) + 1)))
    return findings + _rate_change(parts, limits, rows, subject)


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
    found = rows[ends[first] - len(parts[first]) : ends[first] + 1]
    return [Finding("rate_change", text, places("row", found + 1))]


def time_unit(t: Array, subject: str = "t") -> list[Finding]:
    """``unit_suspect``: intervals of seconds or of microseconds, where inertial data is sampled."""
    stamps, _ = _known(t)
    if stamps.size < 500:
        return []
    interval = float(np.median(np.diff(stamps)))
    if interval >= 2.0:
        looks = next(unit for unit, limit in (("ms", 500.0), ("us", 5e5), ("ns", np.inf)) if interval < limit)
        text = f"{subject}: an interval of {interval:.4g} s looks like {looks} taken for s"
    elif 0.0 < interval < 2e-5:
        text = f"{subject}: an interval of {interval:.4g} s looks like s taken for a smaller unit"
    else:
        return []
    return [Finding("unit_suspect", text)]


def saturation(values: Array, name: str) -> list[Finding]:
    """``saturation``: three or more equal samples at an extreme that motion has run into."""
    rows = saturated(values)
    if rows.size == 0:
        return []
    at = " and ".join(f"{level:.6g}" for level in np.unique(values[rows]))
    text = f"{name}: {counted(rows.size, 'sample')} in runs at {at}"
    return [Finding("saturation", text, places("row", rows + 1))]


def saturated(values: Array) -> NDArray[np.int64]:
    """Rows of ``values`` (n,) in runs of three or more equal samples at an extreme that motion has run into.

    Quiet signals rest on the steps of their converter, and noise-free ones on any level. So a run counts
    only if the samples before and after are well off the extreme (by more than three of the smallest steps
    and by 2 % of a large one), and only if there are not as many such runs at other levels, nor most of the
    samples in them.
    """
    none = np.zeros(0, dtype=np.int64)
    signal, rows = _known(values)
    if signal.size < 10:
        return none
    low, high = signal.min(), signal.max()
    if max(np.count_nonzero(signal == low), np.count_nonzero(signal == high)) < 3:
        return none
    step = np.diff(signal)
    size = np.abs(step[step != 0])
    if size.size == 0 or high - low < 20 * size.min():
        return none
    starts, ends = _plateaus(step)
    before = np.where(starts > 0, np.abs(step[starts - 1]), np.inf)
    after = np.where(ends < step.size, np.abs(step[np.minimum(ends, step.size - 1)]), np.inf)
    sharp = np.minimum(before, after) > max(3 * size.min(), 0.02 * np.quantile(_thinned(size), 0.99))
    starts, ends = starts[sharp], ends[sharp]
    extreme = (signal[starts] == low) | (signal[starts] == high)
    samples = int((ends - starts + 1)[extreme].sum())
    if 2 * np.count_nonzero(extreme) <= extreme.size or 2 * samples > signal.size:
        return none
    runs = np.concatenate([np.arange(a, b + 1) for a, b in zip(starts[extreme], ends[extreme], strict=True)])
    return np.asarray(rows[runs], dtype=np.int64)


def _plateaus(step: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First and last samples of each run of three or more equal ones."""
    equal = np.concatenate([[False], step == 0, [False]]).astype(np.int8)
    change = np.diff(equal)
    starts, ends = np.flatnonzero(change == 1), np.flatnonzero(change == -1)
    long = ends - starts >= 2
    return starts[long], ends[long]


def outliers(values: Array, name: str) -> list[Finding]:
    """``outlier``: single samples off both neighbours, to the same side, by more than 12 times the noise.

    The noise is the standard deviation of the steps from sample to sample, the larger of two: from their
    median over the recording, and from the fifth largest of the 42 around the sample (two of them its own),
    so that motion is measured against motion.
    """
    signal, rows = _known(values)
    if signal.size <= _AROUND:
        return []
    step = np.diff(signal)
    size = np.abs(step)
    height = np.minimum(size[:-1], size[1:])
    height[(step[:-1] > 0) == (step[1:] > 0)] = 0.0
    thinned = _thinned(size)
    noise = max(np.median(thinned) / 0.674, thinned.min(initial=np.inf, where=thinned > 0))
    suspects = np.flatnonzero(height > 12.0 * noise)
    windows = sliding_window_view(size, _AROUND)
    found = []
    for some in np.array_split(suspects, suspects.size // _SAMPLE + 1):
        near = windows[np.clip(some - _AROUND // 2, 0, len(windows) - 1)]
        moved = np.partition(near, _AROUND - 5, axis=1)[:, _AROUND - 5] / 1.645
        found.append(some[height[some] > 12.0 * moved])
    single = np.concatenate(found) + 1
    if single.size == 0:
        return []
    text = f"{name}: {counted(single.size, 'sample')} far from both neighbours, knocks or wrong bits"
    return [Finding("outlier", text, places("row", rows[single] + 1))]


def accelerometer_unit(columns: Mapping[str, Column]) -> list[Finding]:
    """``unit_suspect``: the median norm is that of gravity in another unit than the one stated."""
    axes = [columns[name] for name in ("acc_x", "acc_y", "acc_z") if name in columns]
    if len(axes) < 3 or any(axis.unit != axes[0].unit or axis.t is not axes[0].t for axis in axes):
        return []
    stated = axes[0].unit
    norms = np.sqrt(sum(_thinned(axis.values) ** 2 for axis in axes))
    norms = norms[np.isfinite(norms)]
    if stated.dimension != "acceleration" or norms.size == 0:
        return []
    norm = float(np.median(norms))
    fitting = [
        unit
        for unit in (stated, *(parse_unit(text) for text in ("g", "m/s^2", "mg", "ug", "cm/s^2")))
        if 0.8 < norm * unit.factor / STANDARD_GRAVITY < 1.2
    ]
    if not fitting or stated in fitting:
        return []
    text = f"acc: a median norm of {norm:.4g} {stated.symbol} looks like {fitting[0].symbol}"
    return [Finding("unit_suspect", text)]


def gyro_unit(columns: Mapping[str, Column]) -> list[Finding]:
    """``unit_suspect``: rates in rad/s that only deg/s can be, one in a thousand beyond 100 rad/s."""
    findings = []
    for name in ("gyro_x", "gyro_y", "gyro_z", "gyro"):
        if name in columns and columns[name].unit.symbol == "rad/s":
            signal, _ = _known(columns[name].values)
            if 1000 * np.count_nonzero(np.abs(signal) > 100.0) > signal.size:
                text = f"{name}: rates up to {np.abs(signal).max():.4g} rad/s look like deg/s"
                findings.append(Finding("unit_suspect", text))
    return findings


def _known(values: Array) -> tuple[Array, NDArray[np.int64]]:
    """The numbers of a column without its NaN, and the rows (from 0) they stand in."""
    rows = np.flatnonzero(np.isfinite(values))
    return (values if rows.size == values.size else values[rows]), rows


def _thinned(values: Array) -> Array:
    """Every so many-th value, about a hundred thousand in all."""
    return values[:: values.size // _SAMPLE + 1]
