"""The column of times, and its unit: as stated, as counted since 1970, or by a rate that can be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.records.recognise.units import quoted
from inercal.foundation.records.recognise.words import MEASURED, Said, said

_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_SINCE_1970 = {"ns": 1e17, "us": 1e14, "ms": 1e11, "s": 9e8}  # the least that is a date of today
_RATES = 4.0, 4500.0  # Hz


@dataclass(frozen=True)
class ClockFound:
    """The column of times, its ``unit``, the ``grade`` of that, why, and what a guess asks."""

    column: int
    unit: str
    grade: str
    reason: str
    question: str = ""


def clock(names: Sequence[str], units: Sequence[str | None], values: Array) -> ClockFound | None:
    """The column of ``values`` (n, k) that is the time, by the ``names`` (k,) and ``units`` (k,) above; None if none.

    It never falls, and rises by steps alike unless its name says that it is a time. Of several the best unit wins, then
    a word of time and few stamps that repeat.
    """
    found = []
    for index, name in enumerate(names):
        words = said(name, units[index] if units else None)
        numbers = values[:, index]
        if words.sensor in ("acc", "gyro", "mag", "other") or words.axis or not np.isfinite(numbers).all():
            continue
        steps = np.diff(numbers)
        timely = words.sensor == "t"
        if len(steps) < 2 or (steps < 0.0).any() or not (steps > 0.0).any() or not (timely or _even(steps)):
            continue
        if words.never or (not timely and not _measures_time(words) and (steps == 1.0).mean() > 0.98):
            continue  # a counter
        if not timely and not _measures_time(words) and numbers[0] < _SINCE_1970["s"]:
            continue
        step = float(np.median(steps[steps > 0.0]))
        unit, rank = _unit(words, float(numbers[0]), step)
        grade = {3: "certain", 2: "likely"}.get(rank, "guess")
        score = rank + 0.5 * timely - 3.0 * float((steps == 0.0).mean()) - 0.01 * index
        how = "with this unit" if words.unit == unit else f"the interval is {step:.6g}"
        asked = f"Is the time in {unit}? Its interval is {step:.6g}, and nothing else tells."
        reason = f"the header says {quoted(name.strip())}; {how}"
        found.append((score, ClockFound(index, unit, grade, reason, asked if grade == "guess" else "")))
    return max(found, key=lambda scored: scored[0])[1] if found else None


def _even(steps: Array) -> bool:
    """True for steps most of which are alike."""
    middle = np.median(steps[steps > 0.0])
    return bool((np.abs(steps[steps > 0.0] - middle) < 0.6 * middle).mean() > 0.7)


def _measures_time(words: Said) -> bool:
    """True where the unit is one of time."""
    return MEASURED.get(words.unit) == "t"


def _unit(words: Said, start: float, step: float) -> tuple[str, int]:
    """The unit, and 3 where it is certain, 2 where one alone leaves a rate that can be, else 1."""
    if _measures_time(words):
        return words.unit, 3
    for unit, least in _SINCE_1970.items():
        if least < start < 22.0 * least and 0.5 < 1.0 / (step * _SECONDS[unit]) < 30000.0:
            return unit, 3
    able = [unit for unit, size in _SECONDS.items() if _RATES[0] < 1.0 / (step * size) < _RATES[1]]
    return (able[0], 2 if len(able) == 1 else 1) if able else ("s", 1)
