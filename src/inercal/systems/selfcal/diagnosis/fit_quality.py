"""Fit of a recording to its study: the innovations of the error-state filter, and their judge."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.inference.consistency import nis, surprising, whiteness
from inercal.systems.selfcal.filters.averaged import averaged, block
from inercal.systems.selfcal.filters.filter_result import FilterResult
from inercal.systems.selfcal.filters.problem import FilterProblem
from inercal.systems.selfcal.filters.run import estimate
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.recording import Recording

Case = tuple[Recording, FilterProblem]
"""A recording and its study."""


class ErrorState:
    """The error-state filter as a judge: its innovations and the sum of NIS."""

    def residuals(self, case: Case) -> Array:
        """(n - 1, 6) normalised innovations."""
        return regular(case[0], filtered(case))

    def misfit(self, case: Case) -> float:
        """Sum of the normalised innovations squared."""
        return sum_of_squares(filtered(case))


JUDGE = ErrorState()


Made = TypeVar("Made")
_KEPT = list[Callable[[], None]]()


def once(function: Callable[..., Made]) -> Callable[..., Made]:
    """A function whose last results, of one and the same arguments, are kept until `forget`."""
    kept = functools.lru_cache(maxsize=3)(function)
    _KEPT.append(kept.cache_clear)
    return kept


def forget() -> None:
    """Keep no results any longer."""
    for clear in _KEPT:
        clear()


@once
def filtered(case: Case) -> FilterResult:
    """Result of the error-state filter for a case."""
    return estimate(*case, "error-state", brief=True)


@once
def short(case: Case) -> Case:
    """A case of no more rows than small errors are sought in: a long recording by means over blocks of rows."""
    return averaged(*case, filtered(case)) if block(case[0]) > 1 else case


def regular(recording: Recording, result: FilterResult) -> Array:
    """Normalised innovations (n - 1, 6), NaN near gimbal lock."""
    innovations = result.innovations.copy()
    innovations[_near_lock(recording)] = np.nan
    return innovations


def _near_lock(recording: Recording) -> NDArray[np.bool_]:
    """Steps (n - 1,) that end near gimbal lock."""
    angle = recording.th[1:, 1]
    return np.asarray(~(np.abs(np.cos(angle)) >= LIMITS.lock_cosine) & np.isfinite(angle))


def sum_of_squares(result: FilterResult) -> float:
    """Sum of NIS; infinite where the filter diverged or nothing is measured."""
    total = float(result.nis[result.dims > 0].sum())
    return total if result.converged and result.dims.any() and math.isfinite(total) else math.inf


def sound(result: FilterResult) -> bool:
    """True where a filter agrees with its recording, as a whole and in each row; not where nothing is measured."""
    if not result.converged or not result.dims.any():
        return False
    excess = nis(result.nis, result.dims).excess
    return excess <= LIMITS.nis_sigmas and not len(surprising(result.nis, result.dims, LIMITS.risk))


def white(case: Case, result: FilterResult) -> bool:
    """True where innovations are of the stated size and uncorrelated."""
    return sound(result) and whiteness(regular(case[0], result)) > LIMITS.risk
