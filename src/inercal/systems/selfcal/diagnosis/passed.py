"""The one pass that judges a calibration: whitened innovations at its values, with all questions that are asked."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.inference.scores import ErrorColumns, PassSums, joined
from inercal.systems.selfcal.diagnosis.questions import PlatformQuestion, Waves, asked
from inercal.systems.selfcal.filters.filter_result import FilterResult
from inercal.systems.selfcal.filters.problem import FilterProblem
from inercal.systems.selfcal.filters.residuals import gimbals
from inercal.systems.selfcal.filters.whitened import whitened
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.recording import Recording
from inercal.systems.selfcal.platform.states import ALL, MOST_WAVES


@dataclass(frozen=True, eq=False)
class PlatformPass:
    """A pass through a ``recording`` at the values of the ``result`` of a filter.

    ``errors`` are the names of the states of the rig that are not fitted, the first columns of its ``sums``; behind
    them come earth rate and specific force. ``z`` (n - 1, 6) whitened innovations, NaN where nothing was read;
    ``covariance`` (p, p) of the states, linear form.
    """

    recording: Recording
    problem: FilterProblem
    result: FilterResult
    errors: tuple[str, ...]
    questions: tuple[PlatformQuestion, ...]
    sums: PassSums
    z: Array
    covariance: Array

    @property
    def final(self) -> FilterResult:
        """The result of the filter, with innovations and their squares those at its values."""
        squares, dims = np.nansum(np.square(self.z), axis=1), np.isfinite(self.z).sum(axis=1)
        return replace(
            self.result,
            innovations=self.z,
            nis=np.where(dims > 0, squares, np.nan),
            dims=dims.astype(np.int64),
        )

    @property
    def constants(self) -> tuple[str, ...]:
        """Names of the states that do not walk."""
        return self.problem.states.without_walks.names

    def of_names(self, names: tuple[str, ...]) -> ErrorColumns:
        """Columns of states of the rig that are not fitted."""
        return ErrorColumns(np.array([self.errors.index(name) for name in names], dtype=np.int64))

    def moved(self, there: FilterProblem) -> ErrorColumns:
        """The one column of what a problem of another world, or of other stated errors, has other than this one."""
        here, first = self.problem, len(self.errors)
        at = [*range(first, first + 6)]
        by = [*(there.world.earth - here.world.earth), *(there.world.up - here.world.up)]
        change = there.states.stated - here.states.stated
        for k in np.flatnonzero(change):
            if ALL[k] in self.errors:
                at.append(self.errors.index(ALL[k]))
                by.append(change[k])
        return ErrorColumns(np.array(at, dtype=np.int64), by=np.array(by)[:, None])

    def reach(self, columns: ErrorColumns) -> Array:
        """Shift (p, k) of the states, linear form, by one unit of each column; of those that walk 0."""
        made = self.sums.reach(columns)
        out = np.zeros((len(self.problem.prior), made.shape[1]))
        out[~self.problem.states.walks] = made
        return out

    def with_stated(self, there: list[FilterProblem]) -> PassSums:
        """The sums with what problems have other than this one as constants, each known to one of it."""
        if not there:
            return self.sums
        return self.sums.with_stated(joined([self.moved(each) for each in there]), np.ones(len(there)))


def pass_of(
    recording: Recording, problem: FilterProblem, result: FilterResult, waves: Waves = ()
) -> PlatformPass | None:
    """The pass at the values of a filter's result, with questions about ``waves`` of encoders; None where these are
    none."""
    u = np.sqrt(np.maximum(np.diag(result.covariance), 0.0))
    if not (result.converged and np.isfinite(result.coefficients).all() and (u > 0.0).all()):
        return None
    if not result.dims.any():
        return None
    table = asked(recording, problem, waves)
    harmonics = (*problem.states.harmonics, *waves)
    wide = replace(problem, vector=replace(problem.states, harmonics=harmonics)) if waves else problem
    try:
        made = whitened(recording, wide, result.coefficients, u, table.errors, result.restarts)
        sums = made.sums
        usable = bool(np.isfinite(made.covariance).all() and np.isfinite(sums.change).all())
    except (np.linalg.LinAlgError, ZeroDivisionError):  # an accelerometer without a scale
        return None
    if not usable:
        return None
    return PlatformPass(
        recording, problem, result, table.errors.names, table.questions, sums, made.z, made.covariance
    )


def periodic(passed: PlatformPass) -> list[tuple[int, int]]:
    """Joints whose encoders seem to err with a period of their angle, and which of `LIMITS.harmonic_orders` most:
    Fisher's ordinates of a periodogram, exponential where innovations are white."""
    th, z = passed.recording.th[1:], passed.z[:, 3:]
    there = np.isfinite(z).all(axis=1) & np.isfinite(th).all(axis=1)
    th, z = th[there], z[there]
    if not len(th):
        return []
    _, joints = gimbals(th, passed.problem.world)
    alternatives, waves = 3 * LIMITS.harmonic_orders, list[tuple[int, int]]()
    for joint in range(3):
        by = np.einsum("kij,ki->kj", joints, z)[:, joint]  # not quite the joint's own, yet white
        wave, once = np.exp(1j * th[:, joint]), np.exp(1j * th[:, joint])
        turned, size = float(np.ptp(th[:, joint])), float(np.sum(np.square(by)))
        powers = np.zeros(LIMITS.harmonic_orders)
        for order in range(1, LIMITS.harmonic_orders + 1):
            if order * turned > math.pi:
                powers[order - 1] = abs(np.sum(wave * by)) ** 2 / max(size, 1e-300)
            wave = wave * once
        if powers.max() > math.log(alternatives / LIMITS.risk):
            waves.append((joint, 1 + int(np.argmax(powers))))
    return waves[: MOST_WAVES - len(passed.problem.states.harmonics)]
