"""The fusion while a model is measured: samples or blocks of them in, angles out, to the digits of the whole record.

The first rows are held until the filter can start (`Limits.starting_rows`), and where theta is lost rows are
held again: their angles then come all at once. A row that is not later than those before it has no angle
(`inercal.systems.aoa.reading.recording`); every row is answered, in the order in which it came.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inercal.foundation._jit import compiled
from inercal.foundation.arrays import Array
from inercal.systems.aoa.angles import Angles
from inercal.systems.aoa.fusion import loop
from inercal.systems.aoa.fusion import run as fusion
from inercal.systems.aoa.fusion.filter_result import roll_of
from inercal.systems.aoa.fusion.loop import BESIDE, OUTPUTS, Belief, FusedRows, Kept
from inercal.systems.aoa.fusion.problem import FusionProblem
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.recording import Recording, later, set_back


class LiveState(NamedTuple):
    """State after a row, in the sense of `inercal.faces.stream.checkpoint`.

    ``fusion`` is the state of the filter, ``waiting`` (j,) [s] the stamps of the rows that are not answered yet, and
    ``late`` the number of successive rows at the end that are not later than those before.
    """

    fusion: fusion.FusionState
    waiting: Array
    late: int


class Answers(NamedTuple):
    """Angles of k rows: their stamps ``t`` (k,) [s], and ``out`` (k, `OUTPUTS` + N + 1) as of
    `inercal.systems.aoa.fusion.loop.advance`, NaN in rows without an angle; ``roll`` (k, 2) with its standard
    uncertainty [rad] where it is estimated."""

    t: Array
    out: Array
    roll: Array | None = None

    @property
    def angles(self) -> Angles:
        """Angles (k,) with rates and their standard uncertainties, and roll."""
        roll = () if self.roll is None else self.roll.T
        return Angles("fusion", *self.out[:, :4].T, *roll)

    @property
    def innovations(self) -> Array:
        """(k, N + 1) of accelerometers and gyro, each over its standard deviation before the gate."""
        return self.out[:, OUTPUTS:]


class Live:
    """The causal fusion, fed with samples: the digits of `inercal.systems.aoa.fusion.filter_result.estimate` on all of
    them.

    ``state`` is that in which an earlier `Live` of the same ``problem`` ended; ``where`` names the samples in errors.

    Examples
    --------
    >>> live = Live(problem(settings))
    >>> for t, readings in zip(recording.t, recording.rows):
    ...     answers = live.feed(t, readings)
    """

    def __init__(self, problem: FusionProblem, state: LiveState | None = None, where: object = "t") -> None:
        self._problem, self._where = problem, where
        state = LiveState(fusion.initial(problem), np.empty(0), 0) if state is None else state
        self._fusion, self._waiting, self._late = _apart(state.fusion), state.waiting, state.late
        self._dt, self._row = np.empty(1), np.empty((1, problem.count + BESIDE))
        self._out = np.empty((1, OUTPUTS + problem.count + 1))
        self._kept = np.empty((int(problem.spatial), 2 * problem.size))
        rows, kept = FusedRows(self._dt, self._row), Kept(self._kept, 1, 0)
        self._arguments = rows, problem.model, self._out, kept, loop.NONE, loop.NO_MOTIONS
        belief = Belief(self._fusion.x, self._fusion.P, self._fusion.turns)
        self._advance = compiled(loop._advance, belief, *self._arguments)

    @property
    def state(self) -> LiveState:
        """The state now, in arrays of its own."""
        return LiveState(_apart(self._fusion), self._waiting, self._late)

    def feed(
        self,
        t: float,
        readings: Array,
    ) -> Answers:
        """Go on by one sample at ``t`` [s]; answers for it: none while rows are held, then those of all held rows.

        ``readings`` (N + 5,) are a row of `inercal.systems.aoa.reading.recording.Recording.rows`, NaN where missing or
        saturated. Raises `RecordError` where time does not go on.
        """
        problem, state, row = self._problem, self._fusion, self._row
        row[0] = readings
        if not (state.started and t > state.t):
            return self._block(np.array([t]), row.copy())
        self._dt[0] = t - state.t
        if steps := fusion.fading_steps(state.t, t, state.since):
            fusion.fade(state.x, state.P, problem, steps)
        done = self._advance(Belief(state.x, state.P, state.turns), *self._arguments)
        stamp = np.array([t])
        self._late = 0
        if not done:  # theta is lost
            self._fusion = state._replace(started=False, held=np.column_stack([stamp, row]))
            self._waiting = stamp
            return Answers(stamp[:0], self._out[:0], self._roll(self._kept[:0]))
        self._fusion = fusion.FusionState(state.x, state.P, state.turns, t, True, state.held, state.since)
        return Answers(stamp, self._out.copy(), self._roll(self._kept))

    @property
    def motion(self) -> Array:
        """(`MOTION`,) from which the angle is carried on (`inercal.systems.aoa.fusion.ahead`), while the filter
        runs."""
        out, (x, P, turns, *_) = np.empty(loop.MOTION), self._fusion
        loop.moving(x, P, turns[0], turns[1], self._problem.model, out)
        return out

    def feed_rows(self, rows: Array) -> Answers:
        """Go on by rows (m, N + 6), time first, as `feed` does."""
        return self._block(rows[:, 0], rows[:, 1:])

    def feed_block(self, recording: Recording) -> Answers:
        """Go on by the rows of a recording, any number of them, as `feed` does."""
        return self._block(recording.t, recording.rows)

    def finish(self) -> Answers:
        """Answers for the rows that are still held: the record ends here."""
        return self._block(np.empty(0), np.empty((0, self._problem.count + BESIDE)), last=True)

    def _block(self, t: Array, rows: Array, last: bool = False) -> Answers:
        """Go on by the rows of ``t`` (m,) [s] and ``rows`` (m, N + 5)."""
        before = self._fusion
        waiting = np.append(self._waiting, t)
        taken = later(waiting, before.t, self._where)
        self._late = self._late_rows(waiting, taken)
        new = taken[len(before.held) :] - len(self._waiting)
        spatial = self._problem.spatial
        kept = np.full((spatial * (len(before.held) + len(new)), 2 * self._problem.size), np.nan)
        self._fusion, trace = fusion.advance(before, self._problem, t[new], rows[new], kept, last=last)
        done = len(trace.out)
        answered = int(taken[done]) if done < len(taken) else len(waiting)
        out = np.full((answered, trace.out.shape[1]), np.nan)
        out[taken[:done]] = trace.out
        states = np.full((answered, kept.shape[1]), np.nan)
        if spatial:
            states[taken[:done]] = kept[:done]
        self._waiting = waiting[answered:]
        return Answers(waiting[:answered], out, self._roll(states))

    def _roll(self, states: Array) -> Array | None:
        """Roll and its standard uncertainty (k, 2) of states (k, 2 n); None where it is not estimated."""
        return roll_of(self._problem, states) if self._problem.spatial else None

    def _late_rows(self, waiting: Array, taken: NDArray[np.int64]) -> int:
        """Number of the last rows that were not taken; raises `RecordError` where the clock was set back."""
        if taken.size:
            late = self._late + int(taken[0])
            rest = len(waiting) - 1 - int(taken[-1])
        else:
            late = rest = self._late + len(waiting)
        if late >= LIMITS.backward_rows:
            raise set_back(self._where, late, self._fusion.t, float(waiting[-1]))
        return rest


def load_kernels(problem: FusionProblem) -> None:
    """Load, or compile, the kernels of the causal fusion."""
    belief = Belief(problem.mean.copy(), problem.covariance.copy(), np.zeros(problem.count + 3))
    rows = FusedRows(np.empty(0), np.empty((0, problem.count + BESIDE)))
    loop.advance(belief, rows, problem.model, np.empty((0, OUTPUTS + problem.count + 1)))


def _apart(state: fusion.FusionState) -> fusion.FusionState:
    """The same state in arrays of its own."""
    return state._replace(x=state.x.copy(), P=state.P.copy(), turns=state.turns.copy())
