"""The fusion of sensors that are limited to a band, row by row: the digits of the whole recording.

The first rows are held until their rate is known, for which the filter is made. Then each row has its answer at once:
the angle that the model carries on from the last row that was fused (`inercal.aoa.fusion.ahead`), none before the
fusion has started.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from inercal.aoa.band import WHOLE
from inercal.aoa.fusion import band
from inercal.aoa.fusion.ahead import carried_on
from inercal.aoa.fusion.band import BandState
from inercal.aoa.fusion.live import Answers, Live, LiveState
from inercal.aoa.fusion.loop import BESIDE, MOTION, OUTPUTS
from inercal.aoa.fusion.problem import FilterProblem
from inercal.aoa.limits import LIMITS
from inercal.aoa.reading.clock import usual_step
from inercal.arrays import Array
from inercal.errors import RecordError
from inercal.geometry.rotations import principal


class LimitedState(NamedTuple):
    """State after a row: ``head`` (k, N + 6) the rows that are held, time first; ``rate`` [Hz] of rows, 0 before it is
    known; states of the filter and of the fusion; the ``motion`` (`MOTION`,) of the last row that was fused, and its
    stamp ``at`` [s]; ``t`` [s] of the last row, and the number of rows since that were not later."""

    head: Array
    rate: float
    band: BandState
    fusion: LiveState
    motion: Array
    at: float
    t: float
    late: int


class LimitedLive:
    """As `inercal.aoa.fusion.live.Live`, for a problem with a band; a band for which nothing is filtered is none."""

    def __init__(
        self, problem: FilterProblem, state: LimitedState | None = None, where: object = "t"
    ) -> None:
        self._problem, self._where = problem, where
        self._inner = replace(problem, band=WHOLE)
        width = problem.count + BESIDE
        if state is None:
            empty = BandState(*(np.empty((0,) * n) for n in (3, 1, 1, 1, 1)))
            none, motion = np.empty((0, width + 1)), np.full(MOTION, np.nan)
            state = LimitedState(none, 0.0, empty, Live(self._inner).state, motion, math.nan, -math.inf, 0)
        self._state = state._replace(band=BandState(*(each.copy() for each in state.band)))
        self._live = Live(self._inner, state.fusion, where)
        self._filter = band.filter_of(replace(problem.band, rate=state.rate)) if state.rate else None

    @property
    def state(self) -> LimitedState:
        """The state now, in arrays of its own."""
        limited = BandState(*(each.copy() for each in self._state.band))
        return self._state._replace(band=limited, fusion=self._live.state)

    def feed(
        self,
        t: float,
        acceleration: Array,
        gyro: float = math.nan,
        roll: float = math.nan,
        yaw: float = math.nan,
        zero_angle: float = math.nan,
        zero_angle_u: float = math.nan,
    ) -> Answers:
        """Go on by one sample, as `Live.feed`: none while the rate is not known, then those of all rows held."""
        row = np.array([t, *acceleration, gyro, zero_angle, zero_angle_u, roll, yaw])
        return self.feed_rows(row[None])

    def feed_rows(self, rows: Array) -> Answers:
        """Go on by rows (m, N + 6), time first."""
        if not self._state.rate:
            rows = np.vstack([self._state.head, rows])
            stamps = np.maximum.accumulate(rows[np.isfinite(rows[:, 0]), 0])
            stamps = stamps[np.diff(stamps, prepend=-math.inf) > 0.0]
            if len(stamps) < LIMITS.rate_rows:
                self._state = self._state._replace(head=rows)
                return self._answers(rows[:0])
            self._begin(stamps)
        return self._answers(rows)

    def finish(self) -> Answers:
        """Answers for the rows that are still held: the record ends here."""
        head = self._state.head
        stamps = np.unique(head[np.isfinite(head[:, 0]), 0])
        if not self._state.rate and len(stamps) > 1:
            self._begin(stamps)
        return self._answers(head if self._state.rate or not len(head) else np.full_like(head, np.nan))

    def _begin(self, stamps: Array) -> None:
        """Make the filter for the rate of the first ``stamps``."""
        rate = 1.0 / usual_step(stamps[: LIMITS.rate_rows])
        self._filter = band.filter_of(replace(self._problem.band, rate=rate))
        width = self._problem.count + BESIDE
        state = self._state.band if self._filter is None else band.initial(self._filter, width)
        # the noise of the rows that are fused follows from the rate
        self._state = self._state._replace(rate=rate, head=self._state.head[:0], band=state)

    def _answers(self, rows: Array) -> Answers:
        """Answers for rows (m, N + 6)."""
        each = [self._one(row) for row in rows]
        out = np.array([row for row, _ in each]).reshape(len(each), OUTPUTS + self._problem.count + 1)
        roll = np.array([roll for _, roll in each]).reshape(len(each), 2)
        return Answers(rows[:, 0].copy(), out, roll if self._problem.spatial else None)

    def _one(self, row: Array) -> tuple[Array, Array]:
        """The row of output, and the roll (2,), of a row."""
        state, of, count = self._state, self._filter, self._problem.count
        out, roll, t = np.full(OUTPUTS + count + 1, np.nan), np.full(2, np.nan), float(row[0])
        if not t > state.t or of is None:
            self._late(t)
            return out, roll
        fused = band.causal(of, state.band, row[:1], row[None, 1:])
        motion, at = state.motion, state.at
        if len(fused.t):
            z, at = fused.rows[0], float(fused.t[0])
            answers = self._live.feed(
                at, z[:count], z[count], z[count + 3], z[count + 4], z[count + 1], z[count + 2]
            )
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
            raise RecordError(
                self._where,
                f"t: {late} rows in a row are not later than {self._state.t:.10g} s, the last at {t:.10g} s, expected "
                "time to increase",
            )
