"""The column of times, and its unit: as stated, as counted since 1970, or by a rate that can be."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.records.channels import TimeForm
from inercal.foundation.records.read.time_stamps import date_and_clock, order_of, seconds_of
from inercal.foundation.records.recognise.units import quoted
from inercal.foundation.records.recognise.words import MEASURED, Said, said

_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_SINCE_1970 = {"ns": 1e17, "us": 1e14, "ms": 1e11, "s": 9e8}  # the least that is a date of today
_RATES = 4.0, 4500.0  # Hz
_FEWEST = 20  # rows


@dataclass(frozen=True)
class ClockFound:
    """The column of times, its ``unit``, the ``grade`` of that, why, what a guess asks, and how stamps are read."""

    column: int
    unit: str
    grade: str
    reason: str
    question: str = ""
    stamps: TimeForm | None = None


def clock(
    names: Sequence[str],
    units: Sequence[str | None],
    values: Array,
    texts: Mapping[int, Sequence[str]] | None = None,
) -> ClockFound | None:
    """The column of ``values`` (n, k) that is the time, by the ``names`` (k,) and ``units`` (k,) above; None if none.

    It never falls but for a counter of 16, 24 or 32 bits that begins anew, and rises by steps alike unless its name
    says that it is a time. ``texts`` are columns, by index, of words, which may be dates. Of several the best unit
    wins, then a word of time and few stamps that repeat.
    """
    found = [*_in_words(names, texts or {}), *_with_rest(names, values)]
    for index, name in enumerate(names):
        words = said(name, units[index] if units else None)
        if not words.sensor and re.fullmatch(r"x_?value", name.strip(), re.IGNORECASE) and not _has_y(names):
            words = Said("t", "", "s", "t |")  # of LabVIEW
        numbers, wrap = _unwrapped(values[:, index])
        if words.sensor in ("acc", "gyro", "mag", "other") or words.axis or not np.isfinite(numbers).all():
            continue
        steps = np.diff(numbers)
        timely = words.sensor == "t"
        if len(steps) < 2 or (steps < 0.0).any() or not (steps > 0.0).any() or not (timely or _even(steps)):
            continue
        if words.never or (not timely and not _measures_time(words) and (steps == 1.0).mean() > 0.98):
            continue  # a counter
        nameless = not any(names)
        if not timely and not _measures_time(words) and numbers[0] < _SINCE_1970["s"] and not nameless:
            continue
        step = float(np.median(steps[steps > 0.0]))
        unit, rank = _unit(words, float(numbers[0]), step)
        grade = {3: "certain", 2: "likely"}.get(rank, "guess")
        score = rank + 0.5 * timely - 3.0 * float((steps == 0.0).mean()) - 0.01 * index
        how = "with this unit" if words.unit == unit else f"the interval is {step:.6g}"
        asked = f"Is the time in {unit}? Its interval is {step:.6g}, and nothing else tells."
        reason = (
            f"the header says {quoted(name.strip())}" if name.strip() else "it rises evenly"
        ) + f"; {how}"
        if wrap:
            reason += f"; it falls to zero at {wrap:.0f}, and goes on"
        stamps = TimeForm(wrap=wrap) if wrap else None
        found.append(
            (score, ClockFound(index, unit, grade, reason, asked if grade == "guess" else "", stamps))
        )
    return max(found, key=lambda scored: scored[0])[1] if found else None


def _in_words(names: Sequence[str], texts: Mapping[int, Sequence[str]]) -> Iterator[tuple[float, ClockFound]]:
    """Columns of dates and times of day, each with its score."""
    orders = {index: found for index, cells in texts.items() if (found := order_of(cells)) is not None}
    for index, (order, doubt) in orders.items():
        cells, beside = texts[index], None
        sample = date_and_clock(cells[len(cells) // 2])
        if sample is None:
            continue
        if sample[1] is None:
            if orders.get(index + 1) != ("", ""):
                continue
            beside = index + 1
        elif not order and (before := orders.get(index - 1)) and before[0]:
            sample_before = date_and_clock(texts[index - 1][len(cells) // 2])
            if sample_before is not None and sample_before[1] is None:
                continue  # the time of day of the date before it
        t = seconds_of(cells, order, None if beside is None else texts[beside])
        steps = np.diff(t[np.isfinite(t)])
        if len(steps) < 2 or (steps < 0.0).mean() > 0.01 or not (steps > 0.0).any():
            continue
        name = f"the header says {quoted(names[index].strip())}" if names[index].strip() else "no name"
        reason = f"{name}; stamps such as {quoted(cells[len(cells) // 2])}" + (f"; {doubt}" if doubt else "")
        repeats = float((steps == 0.0).mean())
        if repeats > 0.01:
            reason += f"; {repeats:.0%} of the stamps repeat"
        stamps = TimeForm(order or "time of day", beside)
        yield 3.2 - 3.0 * repeats - 0.01 * index, ClockFound(index, "s", "certain", reason, "", stamps)


def _with_rest(names: Sequence[str], values: Array) -> Iterator[tuple[float, ClockFound]]:
    """Columns of whole seconds with what is left of them in the next column, each with its score."""
    for index in range(values.shape[1] - 1):
        seconds, rest = values[:, index], values[:, index + 1]
        whole = np.isfinite(seconds).all() and np.isfinite(rest).all() and len(rest) > _FEWEST
        if not whole or (seconds % 1.0).any() or (rest % 1.0).any() or not 1e8 < seconds[0] < 4e9:
            continue
        for unit, size in (("ns", 1e-9), ("us", 1e-6)):
            steps = np.diff(seconds - seconds[0] + size * rest)
            if rest.min() >= 0.0 and 0.5 < size * rest.max() < 1.0 and (steps >= 0.0).all() and _even(steps):
                reason = f"whole seconds, and what is left of them in {unit} beside"
                yield 3.4, ClockFound(index, "s", "certain", reason, "", TimeForm("", index + 1, size))
                break


def _unwrapped(numbers: Array) -> tuple[Array, float]:
    """Numbers that go on where a counter of 16, 24 or 32 bits fell to zero, and where that is, 0 where none fell."""
    steps = np.diff(numbers)
    falls = steps < 0.0
    usual = float(np.median(steps)) if len(steps) else 0.0
    if not falls.any() or falls.mean() > 0.1 or usual <= 0.0:
        return numbers, 0.0
    for wrap in (2.0**32, 2.0**24, 2.0**16):
        if (np.abs(steps[falls] + wrap - usual) < 20.0 * usual + 1.0).all():
            return numbers + wrap * np.cumsum(np.diff(numbers, prepend=numbers[:1]) < 0.0), wrap
    return numbers, 0.0


def _has_y(names: Sequence[str]) -> bool:
    """True where a column is called Y value beside X value."""
    return any(re.fullmatch(r"y_?value", name.strip(), re.IGNORECASE) for name in names)


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
