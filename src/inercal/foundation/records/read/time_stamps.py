"""Stamps in words: dates and times of day as loggers write them, in seconds."""

from __future__ import annotations

import datetime
import functools
import re
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from inercal.foundation.arrays import Array

ORDERS = {"year-first": (0, 1, 2), "day-first": (2, 1, 0), "month-first": (2, 0, 1)}
"""Orders of a date: the places of year, month and day in it."""

_EITHER = ("day-first", "month-first")
_MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_DATE = re.compile(r"(\d{1,4})([-/. ])\s?(\d{1,2}|[A-Za-z]{3})\2\s?(\d{2,4})")
_CLOCK = re.compile(r"(\d{1,2})([:.])(\d{2})\2(\d{2})(?:[.,:](\d{1,9}))?\s*([AaPp])?(?:[Mm]|\.[Mm]\.)?")
_ZONE = re.compile(r"\s?(?:Z|UTC|([+-])(\d\d):?(\d\d))$")
_DAY = 86400.0
_LOOKED_AT = 500


def date_and_clock(text: str) -> tuple[tuple[str, str, str] | None, float | None] | None:
    """The three parts of the date of a stamp, and the seconds of its day less its zone; None where it is no stamp."""
    text = text.strip().strip('"[]')
    if not text[:1].isdigit():
        return None
    date = _DATE.match(text)
    rest = text[date.end() :].lstrip(" T_,") if date else text
    parts = (date[1], date[3], date[4]) if date else None
    if parts and not rest:
        return parts, None
    zone = _ZONE.search(rest)
    clock = _CLOCK.fullmatch(rest[: zone.start()] if zone else rest)
    if clock is None or (date is None and clock[2] != ":"):
        return None
    hour, minute, second = int(clock[1]), int(clock[3]), int(clock[4])
    if clock[6]:
        hour = hour % 12 + 12 * (clock[6].lower() == "p")
    if hour > 23 or minute > 59 or second > 60:
        return None
    part = int(clock[5]) / 10 ** len(clock[5]) if clock[5] else 0.0
    east = (
        (int(zone[2]) * 3600 + int(zone[3]) * 60) * (-1 if zone[1] == "-" else 1) if zone and zone[1] else 0
    )
    return parts, hour * 3600 + minute * 60 + second + part - east


def order_of(cells: Sequence[str]) -> tuple[str, str] | None:
    """The order of dates, empty of times of day alone, and what is not sure of it; None of texts that are none."""
    sample = [
        found for cell in cells[: 1 + len(cells) // 2][-500:] if (found := date_and_clock(cell)) is not None
    ]
    sample += [found for cell in cells[-20:] if (found := date_and_clock(cell)) is not None]
    if len(sample) < 0.9 * (min(len(cells[: 1 + len(cells) // 2]), 500) + min(len(cells), 20)):
        return None
    dates = {date for date, _ in sample if date}
    if not dates:
        return "", ""
    if any(len(date[0]) == 4 for date in dates):
        return "year-first", ""
    text = cells[len(cells) // 2].strip().strip('"[]')
    if (
        "." in text[:4]
        or any(date[1].isalpha() for date in dates)
        or any(int(date[0]) > 12 for date in dates)
    ):
        return "day-first", ""
    if re.search(r"[AP]M\s*$", text, re.IGNORECASE) or any(int(date[1]) > 12 for date in dates):
        return "month-first", ""
    steps = {order: _largest_step([date for date, _ in sample if date], ORDERS[order]) for order in _EITHER}
    if steps["month-first"] == 1.0 < steps["day-first"]:
        return "month-first", ""
    sure = steps["day-first"] == 1.0 < steps["month-first"]
    return "day-first", "" if sure else "day and month could change places, which matters only over midnight"


def _largest_step(dates: Sequence[tuple[str, str, str]], places: tuple[int, int, int]) -> float:
    """The largest step from one date to the next [d], in an order."""
    days = [_day(date, places) for date in dates]
    return max((abs(later - before) for before, later in pairwise(days)), default=0.0)


def seconds_of(cells: Sequence[str], order: str, beside: Sequence[str] | None = None) -> Array:
    """Times [s] (n,) of stamps from the midnight before the first, NaN of what is none.

    ``order`` is one of `ORDERS`, or anything else for times of day alone, which go on over midnight; ``beside`` are the
    times of day of dates that stand alone.
    """
    places = ORDERS.get(order)
    days, clocks = np.full(len(cells), np.nan), np.full(len(cells), np.nan)
    for row, cell in enumerate(cells):
        found = date_and_clock(cell)
        if found is None:
            continue
        date, clock = found
        if places is None or date is not None:
            days[row] = 0.0 if places is None or date is None else _day(date, places)
            clocks[row] = np.nan if clock is None else clock
    if beside is not None:
        clocks = np.array([_clock(cell) for cell in beside], dtype=np.float64)
    known = np.flatnonzero(np.isfinite(days))
    if not known.size:
        return np.full(len(cells), np.nan)
    t: Array = (days - days[known[0]]) * _DAY + clocks
    if places is None or len(np.unique(days[known])) == 1:
        sound = np.flatnonzero(np.isfinite(t))
        t[sound] += _DAY * np.cumsum(np.diff(t[sound], prepend=t[sound[:1]]) < -0.5 * _DAY)
    return t


def _clock(cell: str) -> float:
    """Seconds of the day of a time of day, NaN of another text."""
    found = date_and_clock(cell)
    return np.nan if found is None or found[1] is None else found[1]


@functools.lru_cache(1 << 10)
def _day(date: tuple[str, str, str], places: tuple[int, int, int]) -> float:
    """The number of a day, NaN of none such."""
    year, month, day = (date[place] for place in places)
    try:
        of_year = _MONTHS.index(month.lower()) + 1 if month.isalpha() else int(month)
        return float(datetime.date(int(year) + 2000 * (len(year) == 2), of_year, int(day)).toordinal())
    except ValueError:
        return np.nan
