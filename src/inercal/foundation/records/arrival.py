"""Stamps of arrival: they come in bursts, or in coarse ticks, of rows that were sampled evenly.

Rows that stamps put in bursts were sampled at the mean rate, not at the median one; where rows are lost the median
stays, and so does the gap.
"""

from __future__ import annotations

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.records.limits import LIMITS


def evenly(t: Array, subject: str) -> tuple[Array, Finding | None]:
    """Even steps of the mean rate in the place of stamps ``t`` (n,) [s] of arrival, and a finding that says so of the
    ``subject``; the stamps themselves, and None, where they are sound or rows are lost."""
    if len(t) < LIMITS.arrival_rows or not np.isfinite(t).all():
        return t, None
    steps = np.diff(t)
    if (steps < 0.0).any() or not (steps > 0.0).any():
        return t, None
    mean, median = float(t[-1] - t[0]) / len(steps), float(np.median(steps))
    repeats = float((steps == 0.0).mean())
    if abs(mean - median) <= LIMITS.mean_from_median * mean and repeats <= LIMITS.mean_from_median:
        return t, None
    if not (_in_ticks(t, steps, mean) or _in_bursts(steps, mean)):
        return t, None
    words = f"median step {1e3 * median:.4g} ms, mean {1e3 * mean:.4g} ms"
    words += f", {100.0 * repeats:.0f} % repeat" if repeats > LIMITS.mean_from_median else ""
    text = f"{subject}: stamps are of arrival, and even steps of the mean rate, {1.0 / mean:.5g} Hz, take their place"
    return t[0] + mean * np.arange(len(t)), Finding("arrival_stamps", text, words)


def _in_ticks(t: Array, steps: Array, mean: float) -> bool:
    """True where the stamps (n,) lie within a tick of their resolution about a straight line over the rows."""
    kinds = np.unique(np.round(steps / mean, 6))
    if len(kinds) > LIMITS.arrival_rows:
        return False
    tick = mean * float(min(np.min(np.diff(kinds), initial=kinds[-1]), kinds[kinds > 0.0][0]))
    away = t - t[0] - mean * np.arange(len(t))
    return bool(np.ptp(away) <= 2.0 * tick)


def _in_bursts(steps: Array, mean: float) -> bool:
    """True where the steps are short and long ones all along, and the long ones are not those of a few lost rows."""
    short = float(np.median(steps[steps > 0.0]))
    long = steps[steps > LIMITS.leap_steps * short] / short
    if len(long) < LIMITS.long_steps * len(steps) or mean < LIMITS.mean_of_bursts * short:
        return False
    whole = float((np.abs(long - np.round(long)) < 0.1).mean())
    if whole > 0.8 and float(np.median(long)) < LIMITS.lost_rows:
        return False
    pieces = np.array([piece.mean() for piece in np.array_split(steps, 20)])
    return bool((np.abs(pieces - mean) < LIMITS.burst_pieces * mean).all())
