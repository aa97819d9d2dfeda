"""Checks of time axes: stamps, gaps, rates and their unit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from inercal.arrays import Array
from inercal.findings import Finding
from inercal.records.checks.samples import known
from inercal.records.places import counted, places

_JITTER = 8.0
"""Median deviations of intervals from the median by which one is longer at least where samples are missing."""


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
            findings.append(Finding(code, f"{subject}: {counted(count, noun)}", where))
    if 2 * np.count_nonzero(step > 0) <= step.size:
        return findings
    if rows[-1] - rows[0] > step.size:  # rows without a stamp have been said by the reader
        step = step / np.diff(rows)
    parts = np.array_split(step, np.clip(step.size // 100, 1, 20))
    medians = [np.median(part[part > 0]) if (part > 0).any() else 0.0 for part in parts]
    jitter = [_JITTER * np.median(np.abs(part - middle)) for part, middle in zip(parts, medians, strict=True)]
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
    stamps, _ = known(t)
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
    return [Finding("unit_suspect", text, harm=("t",))]
