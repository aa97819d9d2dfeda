"""How well a recording of a platform fits its study: the innovations of the error-state filter, and their judge."""

from __future__ import annotations

import math

import numpy as np

from inercal.arrays import Array
from inercal.estimate.consistency import nis, surprising, whiteness
from inercal.selfcal.filters.filter_result import FilterResult
from inercal.selfcal.filters.problem import FilterProblem
from inercal.selfcal.filters.run import estimate
from inercal.selfcal.limits import LIMITS
from inercal.selfcal.platform.recording import Recording

Case = tuple[Recording, FilterProblem]
"""A recording and its study, of which hypotheses speak."""


class ErrorState:
    """The error-state filter as a judge: its innovations and the sum of NIS."""

    def residuals(self, case: Case) -> Array:
        """(n - 1, 6) normalised innovations."""
        return regular(case[0], filtered(case))

    def misfit(self, case: Case) -> float:
        """Sum of the normalised innovations squared."""
        return sum_of_squares(filtered(case))


JUDGE = ErrorState()


def filtered(case: Case) -> FilterResult:
    """What the error-state filter makes of a case."""
    return estimate(*case, "error-state")


def regular(recording: Recording, found: FilterResult) -> Array:
    """Normalised innovations (n - 1, 6), NaN near gimbal lock."""
    near = ~(np.abs(np.cos(recording.th[1:, 1])) >= LIMITS.lock_cosine)
    innovations = found.innovations.copy()
    innovations[near & np.isfinite(recording.th[1:, 1])] = np.nan
    return innovations


def sum_of_squares(found: FilterResult) -> float:
    """Sum of NIS; infinite where the filter diverged or nothing is measured."""
    total = float(found.nis[found.dims > 0].sum())
    return total if found.converged and found.dims.any() and math.isfinite(total) else math.inf


def sound(found: FilterResult) -> bool:
    """True where a filter agrees with its recording, as a whole and in each row; not where nothing is measured."""
    if not found.converged or not found.dims.any():
        return False
    excess = nis(found.nis, found.dims).excess
    return excess <= LIMITS.nis_sigmas and not len(surprising(found.nis, found.dims, LIMITS.risk))


def white(case: Case, found: FilterResult) -> bool:
    """True where innovations are of the size that is stated and uncorrelated."""
    return sound(found) and whiteness(regular(case[0], found)) > LIMITS.risk
