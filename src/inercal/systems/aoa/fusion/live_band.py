"""The fusion of sensors that are limited to a band, row by row: the digits of the whole recording.

Each row has its answer at once: the angle that the model carries on from the last row that was fused
(`inercal.systems.aoa.fusion.ahead`), none before the fusion has started. Without a band the fusion answers by itself.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.rotations import principal
from inercal.systems.aoa.band import WHOLE, Band
from inercal.systems.aoa.fusion import band, live
from inercal.systems.aoa.fusion.ahead import carried_on
from inercal.systems.aoa.fusion.band import BandState
from inercal.systems.aoa.fusion.live import Answers, Live, LiveState
from inercal.systems.aoa.fusion.loop import BESIDE, MOTION, OUTPUTS
from inercal.systems.aoa.fusion.problem import FusionProblem
from inercal.systems.aoa.fusion.watch import watched
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.recording import set_back

_EMPTY = BandState(np.empty((0, 2, 0)), *np.empty((4, 0)))


class LimitedState(NamedTuple):
    """State after a row: of the filter, and of the fusion; the ``motion`` (`MOTION`,) of the last row that was fused,
    and its stamp ``at`` [s]; ``t`` [s] of the last row, and the number of rows since that were not later."""

    band: BandState
    fusion: LiveState
    motion: Array
    at: float
    t: float
    late: int


class LimitedLive:
    """As `inercal.systems.aoa.fusion.live.Live`, for a problem with or without a band."""

    def __init__(
        self, problem: FusionProblem, state: LimitedState | None = None, where: object = "t"
    ) -> None:
        self._problem, self._where = problem, where
        self._filter = band.filter_of(problem.band)
        inner = replace(problem, band=WHOLE)
        if state is None:
            width = problem.count + BESIDE
            limited = _EMPTY if self._filter is None else band.initial(self._filter, width)
            motion = np.full(MOTION, np.nan)
            state = LimitedState(limited, Live(inner).state, motion, math.nan, -math.inf, 0)
        self._live = Live(inner, state.fusion, where)
        self._state = _apart(state)

    @property
    def state(self) -> LimitedState:
        """The state now, in arrays of its own."""
        return _apart(self._state._replace(fusion=self._live.state))

    def feed(self, t: float, readings: Array) -> Answers:
        """Go on by one sample, as `Live.feed` does."""
        if self._filter is None:
            return self._live.feed(t, readings)
        return self.feed_rows(np.concatenate([[t], readings])[None])

    def feed_rows(self, rows: Array) -> Answers:
        """Go on by rows (m, N + 6), time first."""
        if self._filter is None:
            return self._live.feed_rows(rows)
        each = [self._one(row, self._filter) for row in rows]
        out = np.array([row for row, _ in each]).reshape(len(each), OUTPUTS + self._problem.count + 1)
        roll = np.array([roll for _, roll in each]).reshape(len(each), 2)
        return Answers(rows[:, 0].copy(), out, roll if self._problem.spatial else None)

    def finish(self) -> Answers:
        """Answers for the rows that are still held: the record ends here."""
        if self._filter is None:
            return self._live.finish()
        return self.feed_rows(np.empty((0, self._problem.count + BESIDE + 1)))

    def _one(self, row: Array, of: band.BandFilter) -> tuple[Array, Array]:
        """The row of output, and the roll (2,), of a row."""
        state, count = self._state, self._problem.count
        out, roll, t = np.full(OUTPUTS + count + 1, np.nan), np.full(2, np.nan), float(row[0])
        if not t > state.t:
            self._late(t)
            return out, roll
        fused = band.causal(of, state.band, row[:1], row[None, 1:])
        motion, at = state.motion, state.at
        if len(fused.t):
            at = float(fused.t[0])
            answers = self._live.feed(at, fused.rows[0])
            motion = np.full(MOTION, np.nan)
            if len(answers.t) and math.isfinite(answers.out[-1, 0]):
                motion, out[OUTPUTS:] = self._live.motion, answers.innovations[-1]
        self._state = state._replace(motion=motion, at=at, t=t, late=0)
        if math.isfinite(motion[0]):
            ahead = carried_on(motion[None], np.array([t - at]), self._problem.constants)[0]
            out[:OUTPUTS], roll = ahead[:OUTPUTS], ahead[OUTPUTS:]
            roll[0] = principal(roll[0])
        return out, roll

    def _late(self, t: float) -> None:
        """Count a row that is not later; raises `RecordError` where the clock was set back."""
        late = self._state.late + 1
        self._state = self._state._replace(late=late)
        if late >= LIMITS.backward_rows:
            raise set_back(self._where, late, self._state.t, t)


def load_kernels(problem: FusionProblem) -> None:
    """Load, or compile, the kernels of the causal fusion, with a band or without."""
    live.load_kernels(problem)
    row = np.full((1, problem.count + BESIDE + 1), np.nan)
    row[0, 0] = 0.0
    LimitedLive(replace(problem, band=Band(np.inf, (1.0,), 10.0))).feed_rows(row)
    carried_on(np.zeros((1, MOTION)), np.zeros(1), problem.constants)
    watched(np.zeros(1), row[:, : problem.count + 1], problem.constants.gate)


def _apart(state: LimitedState) -> LimitedState:
    """The same state with a filter's in arrays of its own."""
    return state._replace(band=BandState(*(each.copy() for each in state.band)))
