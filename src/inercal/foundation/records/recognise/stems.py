"""Columns of one stem that are counted: a triad, a time and a triad, or an attitude."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.records.read.limits import TITLE
from inercal.foundation.records.recognise.physics import gravity_unit

_COUNTED = re.compile(r"(.*?[^\W\d_])([ _.]?)(?:\[(\d)\]|(\d))(\s*[\[(][^\d\[\]()][^\[\]()]*[\])])?")


def by_count(names: Sequence[str], values: Array) -> tuple[str, ...]:
    """Names (k,) as their count tells them: ``acc0`` to ``acc2`` become x, y and z, and so do the last three of four
    whose first rises as a time does; four of norm 1 are an attitude. ``values`` (n, k) are the columns.

    Others that are counted from 0 or beyond 3 lose their number, which is that of no axis.
    """
    groups: dict[tuple[str, str], dict[int, int]] = {}
    for index, name in enumerate(names):
        if len(name) <= TITLE and (match := _COUNTED.fullmatch(name.strip())):
            number = int(match[3] or match[4])
            groups.setdefault((match[1], match[5] or ""), {}).setdefault(number, index)
    called = list(names)
    for (stem, unit), places in groups.items():
        first, last = min(places), max(places)
        columns = [places[number] for number in sorted(places)]
        if last - first != len(places) - 1:
            continue
        if len(columns) == 4 and _is_time(values[:, columns[0]]):
            words = ["time", *(f"{stem} {axis}" for axis in "xyz")]
        elif len(columns) == 4 and _is_attitude(values[:, columns]):
            words = [f"{stem} attitude {number}" for number in range(4)]
        elif len(columns) == 3 and (first == 0 or (first == 1 and gravity_unit(values[:, columns]))):
            words = [f"{stem} {axis}" for axis in "xyz"]
        elif len(columns) > 3:
            words = [f"{stem} number {number}" for number in sorted(places)]
        else:
            continue
        for index, word in zip(columns, words, strict=True):
            called[index] = word if word == "time" else f"{word}{unit}"
    return tuple(called)


def _is_time(values: Array) -> bool:
    """True for numbers that always rise, by steps most of which are alike."""
    steps = np.diff(values)
    if len(steps) < 2 or not np.isfinite(values).all() or not (steps > 0.0).all():
        return False
    return bool((np.abs(steps - np.median(steps)) < 0.6 * np.median(steps)).mean() > 0.7)


def _is_attitude(values: Array) -> bool:
    """True for four columns (n, 4) of norm 1 in every row."""
    norm = np.linalg.norm(values[np.isfinite(values).all(axis=1)], axis=1)
    return bool(norm.size and (np.abs(norm - 1.0) < 2e-3).all())
