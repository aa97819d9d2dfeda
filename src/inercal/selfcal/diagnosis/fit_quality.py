"""Fit of a recording to its study: the innovations of the error-state filter, and their judge."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from inercal.arrays import Array
from inercal.estimate.consistency import nis, surprising, whiteness
from inercal.selfcal.filters.filter_result import FilterResult
from inercal.selfcal.filters.problem import FilterProblem
from inercal.selfcal.filters.run import estimate
from inercal.selfcal.limits import LIMITS
from inercal.selfcal.platform.recording import Recording

Case = tuple[Recording, FilterProblem]
"""A recording and its study."""


class ErrorState:
    """The error-state filter as a judge: its innovations and the sum of NIS."""

    def residuals(self, case: Case) -> Array:
        """(k, 6) normalised innovations: of each step, or of a long recording sums of so many that k steps are left."""
        return summed(case[0], filtered(case))

    def misfit(self, case: Case) -> float:
        """Sum of the normalised innovations squared."""
        return sum_of_squares(filtered(case))


JUDGE = ErrorState()


def filtered(case: Case) -> FilterResult:
    """Result of the error-state filter for a case."""
    return estimate(*case, "error-state", brief=True)


def regular(recording: Recording, result: FilterResult) -> Array:
    """Normalised innovations (n - 1, 6), NaN near gimbal lock."""
    innovations = result.innovations.copy()
    innovations[near_lock(recording)] = np.nan
    return innovations


def together(recording: Recording) -> int:
    """Number of steps that are judged together."""
    return -(-len(recording.t) // LIMITS.judged_rows)


def summed(recording: Recording, result: FilterResult) -> Array:
    """Normalised innovations (k, 6) of steps that are judged together, NaN where there are none but near gimbal lock:
    sums of m of them, over the root of m, are as normal and as independent as they are."""
    innovations, size = regular(recording, result), together(recording)
    if size == 1:
        return innovations
    starts, used = np.arange(0, len(innovations), size), np.isfinite(innovations)
    total = np.add.reduceat(np.where(used, innovations, 0.0), starts)
    count = np.add.reduceat(used, starts, dtype=np.int64)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(count > 0, total / np.sqrt(count), np.nan))


class Sums:
    """Columns (k, 6, m) by the steps that are judged together, put together part by part; as `summed` has them."""

    def __init__(self, recording: Recording, result: FilterResult, m: int) -> None:
        self._size = together(recording)
        self._used = np.isfinite(regular(recording, result))
        self.columns = np.zeros((-(-len(self._used) // self._size), 6, m))

    def take(self, first: int, columns: Array) -> None:
        """Put in those (j, 6, m) of the steps from ``first`` on."""
        if not len(columns):
            return
        used = self._used[first : first + len(columns)]
        if self._size == 1:
            self.columns[first : first + len(columns)] = np.where(used[:, :, None], columns, np.nan)
            return
        of = np.arange(first, first + len(columns)) // self._size
        starts = np.flatnonzero(np.diff(of, prepend=-1))
        self.columns[of[starts]] += np.add.reduceat(np.where(used[:, :, None], columns, 0.0), starts)

    def whole(self) -> Array:
        """All of them; NaN where no step counts. Their room is used up."""
        if self._size > 1:
            count = np.add.reduceat(self._used, np.arange(0, len(self._used), self._size), dtype=np.int64)
            with np.errstate(invalid="ignore", divide="ignore"):
                self.columns /= np.sqrt(np.where(count > 0, count, np.nan))[:, :, None]
        return self.columns


def near_lock(recording: Recording) -> NDArray[np.bool_]:
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
