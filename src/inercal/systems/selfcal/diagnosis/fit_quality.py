"""Fit of a recording to its study: the innovations of the error-state filter."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.inference.consistency import nis, surprising
from inercal.systems.selfcal.filters.filter_result import FilterResult
from inercal.systems.selfcal.filters.problem import FilterProblem
from inercal.systems.selfcal.filters.run import estimate
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.recording import Recording


def filtered(recording: Recording, problem: FilterProblem) -> FilterResult:
    """Result of the error-state filter."""
    return estimate(recording, problem, "error-state", brief=True)


def regular(recording: Recording, innovations: Array) -> Array:
    """Normalised innovations (n - 1, 6), NaN near gimbal lock."""
    kept = innovations.copy()
    kept[_near_lock(recording)] = np.nan
    return kept


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
