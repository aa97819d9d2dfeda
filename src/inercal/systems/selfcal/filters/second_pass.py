"""A second pass of the error-state filter, linearised at what the first one found.

A filter linearises where it stands. While the base and the scale of the gyros are unknown, products of two errors of
some hundred parts in a million are larger than what is left of low noise in the end: the first rows then make up
information that no later row takes back. A second pass begins at the coefficients of the first, with a prior of some of
their standard uncertainties, and so never leaves them by more than these. The prior of the study is put in its place
at the end, exactly, for all of it is linear there: with P, m of the second pass and its prior N, c,

    Q^-1 = P^-1 + Pi^-1 - N^-1,   Q the covariance with the study's prior 0, Pi,
    m + Q (N^-1 (m - c) - Pi^-1 m).

One Gauss-Newton step from the first pass, that is: it reaches the batch optimum to a tenth of u at low noise. (Bell and
Cathey 1993, "The iterated Kalman filter update as a Gauss-Newton method", IEEE Transactions on Automatic Control 38.)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.rotations import boxplus, normalize
from inercal.systems.selfcal.estimators import FilterKind
from inercal.systems.selfcal.filters import error_state
from inercal.systems.selfcal.filters.filter_result import FilterState
from inercal.systems.selfcal.filters.gaps import advance, initial
from inercal.systems.selfcal.filters.problem import FilterProblem
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.coefficients import NAMES
from inercal.systems.selfcal.platform.recording import Steps


def is_due(kind: FilterKind, problem: FilterProblem) -> bool:
    """True for the error-state filter of more than the paper's coefficients."""
    return kind == "error-state" and len(problem.prior) > len(NAMES)


def second_pass(
    begun: FilterState,
    found: FilterState,
    problem: FilterProblem,
    steps: Steps,
    held: Sequence[int],
    walked: Array | None = None,
) -> FilterState:
    """The state after a second pass through all steps; that ``found`` by the first where numbers are lost.

    ``begun`` is the state before the first step, and used up; other arguments as of
    `inercal.systems.selfcal.filters.gaps.advance`.
    """
    p = len(problem.prior)
    about, variance = found.coefficients.copy(), np.diag(found.covariance)[-p:]
    if not (np.isfinite(about).all() and np.isfinite(variance).all() and (variance > 0.0).all()):
        return found
    narrow = np.minimum(problem.prior, LIMITS.second_prior * np.sqrt(variance))
    walks = problem.states.walks  # what they were in the beginning is not what they are in the end
    about[walks], narrow[walks] = 0.0, problem.prior[walks]
    begun.coefficients[:] = about
    begun.covariance[-p:, -p:] = np.diag(narrow**2)
    if begun.covariance[
        :3, 3:
    ].any():  # the attitude is that of the encoders, whose errors are those of the states
        begun = error_state.with_attitude(begun, problem, None, problem.noise.encoder, steps.rate[0])
    state, _ = advance(error_state, begun, problem, steps, held, False, walked)
    again = _with_prior(state, (about, narrow), (problem.mean, problem.prior))
    sound = np.isfinite(again.covariance).all() and (np.diag(again.covariance) > 0.0).all()
    return again if sound else found


class KeptRows(NamedTuple):
    """Rows that a stream keeps for further passes: of ``rows`` (m, 16) the first ``used``, the first angles and then
    steps of `inercal.systems.selfcal.filters.gaps.advance`: dt, rate, acc, th, 1 where held, walked, later, warm. None
    of a filter that needs no second pass, or once there are `LIMITS.kept_rows`."""

    rows: Array = np.empty((0, 16))
    used: int = 0

    @staticmethod
    def of(kind: FilterKind, problem: FilterProblem, th: Array) -> KeptRows:
        """The rows kept from a start with those angles (3,) [rad] on."""
        if not is_due(kind, problem):
            return KeptRows()
        rows = np.zeros((64, 16))
        rows[0, 7:10] = th
        return KeptRows(rows, 1)

    def after(self, step: Steps, held: bool, walked: float) -> KeptRows:
        """The rows with one step more."""
        if not self.used:
            return self
        rows = self.rows
        rows[self.used] = np.hstack(
            [step.dt, step.rate[0], step.acc[0], step.th[0], held, walked, step.later[0], step.warm]
        )
        return KeptRows(rows, self.used + 1)

    @property
    def full(self) -> bool:
        """True where another pass is due."""
        return 0 < len(self.rows) == self.used

    def passed(self, problem: FilterProblem, found: FilterState) -> tuple[FilterState, KeptRows]:
        """The state after another pass through all rows kept, and the rows with room for as many more."""
        first, steps = self.rows[0, 7:10], self.rows[1:]
        held = np.flatnonzero(steps[:, 10]).tolist()
        rate, acc, th, later = (np.ascontiguousarray(steps[:, k : k + 3]) for k in (1, 4, 7, 12))
        dt, warm = (np.ascontiguousarray(steps[:, k]) for k in (0, 15))
        taken = Steps(dt, rate, acc, th, later, warm)
        begun = initial(error_state, problem, first, steps[0, 1:4])
        state = second_pass(begun, found, problem, taken, held, steps[:, 11])
        more = (
            KeptRows() if self.used >= LIMITS.kept_rows else KeptRows(np.vstack([self.rows] * 2), self.used)
        )
        return state, more


def _with_prior(
    state: FilterState, taken_out: tuple[Array, Array], put_in: tuple[Array, Array]
) -> FilterState:
    """The state with one prior, mean and standard deviations (p,), in the place of another."""
    (about, narrow), (mean, prior) = taken_out, put_in
    P, p = state.covariance, len(prior)
    more = 1.0 / prior**2 - 1.0 / narrow**2
    try:
        taken = np.linalg.solve(np.eye(p) + more[:, None] * P[-p:, -p:], more[:, None] * P[-p:])
    except np.linalg.LinAlgError:
        return state._replace(covariance=np.full_like(P, np.nan))
    Q = P - P[:, -p:] @ taken
    Q = 0.5 * (Q + Q.T)
    c = state.coefficients
    shift = Q[:, -p:] @ ((c - about) / narrow**2 - (c - mean) / prior**2)
    return state._replace(
        attitude=normalize(boxplus(state.attitude, shift[:3])), coefficients=c + shift[-p:], covariance=Q
    )
