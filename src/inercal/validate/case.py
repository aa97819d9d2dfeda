"""A case of the validation, and the verdict on it.

A case compares numbers that the package finds with numbers from elsewhere: a publication, a certified data set, a
closed form, the truth behind a simulation. It passes where all of them are within their limits, which follow from the
digits that were printed, from what was stated by the source, or from statistics.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from inercal.arrays import Array


@dataclass(frozen=True, eq=False)
class Case:
    """One comparison.

    Attributes
    ----------
    name
        Short, of small letters, digits and hyphens.
    shows
        What a pass says, in a sentence without a full stop.
    source
        Where the expected numbers are from: a key of `inercal.validate.sources.SOURCES`.
    expected, limit
        The numbers (n,) and the largest difference allowed (n,), or one number for all of them.
    find
        The numbers (n,) as the package has them.
    unit
        Of the numbers; empty where they have none.
    """

    name: str
    shows: str
    source: str
    expected: ArrayLike
    limit: ArrayLike
    find: Callable[[], ArrayLike]
    unit: str = ""


@dataclass(frozen=True, eq=False)
class Numbers:
    """Outcome of a case: ``values`` (n,) and the ``seconds`` they took; ``error`` says in one line why there are
    none."""

    values: Array
    seconds: float = 0.0
    error: str = ""


@dataclass(frozen=True)
class Outcome:
    """The verdict on a case, and of its ``count`` numbers the one that is furthest off in terms of its limit.

    ``figure`` was found where ``expected`` was, with ``limit`` allowed; ``seconds`` it took. ``error`` says why there
    are no numbers; ``figure`` is then NaN.
    """

    name: str
    passed: bool
    figure: float
    expected: float
    limit: float
    count: int
    seconds: float
    error: str = ""


def find(case: Case) -> Numbers:
    """The numbers of a case; whatever goes wrong is kept as a reason, for the next case is to be tried too."""
    began = time.perf_counter()
    try:
        values = np.asarray(case.find(), dtype=float).ravel()
    except Exception as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        return Numbers(np.empty(0), time.perf_counter() - began, reason)
    return Numbers(values, time.perf_counter() - began)


def judge(case: Case, numbers: Numbers) -> Outcome:
    """The verdict on what a case found: numbers that are missing, too many, or none (NaN) do not pass."""
    expected = np.asarray(case.expected, dtype=float).ravel()
    limit = np.broadcast_to(np.asarray(case.limit, dtype=float).ravel(), expected.shape)
    values, error = numbers.values, numbers.error
    if not error and len(values) != len(expected):
        error = f"found {len(values)} numbers, expected {len(expected)}"
    if error:
        values = np.full(len(expected), np.nan)
    off = np.abs(values - expected)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(off > 0.0, off / limit, np.where(off == 0.0, 0.0, np.inf))
    worst = int(np.argmax(share))
    return Outcome(
        case.name,
        bool(np.all(off <= limit)),  # not so of NaN
        float(values[worst]),
        float(expected[worst]),
        float(limit[worst]),
        len(expected),
        numbers.seconds,
        error,
    )
