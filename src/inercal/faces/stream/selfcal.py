"""A platform calibrated while it turns: rows in, coefficients and their uncertainties out, each at once.

A recursive filter of `inercal.systems.selfcal` goes on by one row at a time, to the digits that it gives on the whole
file. Where a file takes a second pass, a stream goes through all its rows again each time that they have doubled, up to
`LIMITS.kept_rows` (`inercal.systems.selfcal.filters.second_pass`). Rows are taken as `inercal.systems.selfcal.reading`
says: the first row with all angles and a rate is the start; where no rate is recorded the platform is taken to turn on
as before (`inercal.systems.selfcal.filters.gaps`); other missing values are not measured. A row that
is not later than the one before is left out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType, ModuleType
from typing import NamedTuple

import numpy as np

from inercal.faces.stream.lines import Lines, Sample
from inercal.faces.stream.shell import Channels, StreamRow, StreamState, SystemOnStream
from inercal.foundation.arrays import Array
from inercal.foundation.errors import RecordError, StudyError
from inercal.foundation.findings import Finding
from inercal.foundation.inference.consistency import RunningNis
from inercal.systems.selfcal.filters.filter_result import (
    Estimates,
    FilterState,
    RowHistory,
    Trace,
    estimate_of,
)
from inercal.systems.selfcal.filters.gaps import advance, held_rate, initial, usual
from inercal.systems.selfcal.filters.problem import FilterProblem
from inercal.systems.selfcal.filters.run import load_kernels as load_filter
from inercal.systems.selfcal.filters.run import recursive
from inercal.systems.selfcal.filters.second_pass import KeptRows
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.coefficients import KA1, divisor
from inercal.systems.selfcal.platform.recording import Steps
from inercal.systems.selfcal.platform.states import KIND_OF, TEMPERATURE
from inercal.systems.selfcal.result.columns import columns, rows

_SETTLED = 50
"""Rows before which the mean NIS is not judged."""

_SAID = 5
"""Gaps that are said."""

_ALARMS = ("excess_scatter", "filter_fails", "gimbal_lock")


class SelfcalState(NamedTuple):
    """State after a row.

    ``begun``: a start was found; until then the others mean nothing. ``filter`` is that of the filter; ``next``
    (3,) [rad/s] the rate that the last row has for the step to come (NaN where it has none, or rates of the step
    before); ``rate`` (3,) [rad/s] the last one known whole and ``rated`` [s] the row that it stands in; ``read`` [s]
    the row of the last whole angles, which are in ``filter``. ``t`` [s] of the last row, ``steps`` (9,) [s] the last
    intervals (NaN before). ``doubt``: a rate was held and the encoders have not read since. ``angles`` (3,) [rad]
    of the estimated attitude; ``nis`` up to the row. ``late`` rows in a row had no later time; ``kept`` are the rows
    for further passes.
    """

    begun: bool
    filter: FilterState
    next: Array
    rate: Array
    rated: float
    read: float
    t: float
    steps: Array
    doubt: bool
    angles: Array
    nis: RunningNis
    late: int
    kept: KeptRows


class Selfcal(SystemOnStream[SelfcalState]):
    """Calibrates a platform row by row; columns as
    `inercal.systems.selfcal.result.columns` has them.

    Parameters
    ----------
    lines : Lines
        With the columns of a recording: rates ``wc`` (else ``gyro``), angles ``th``, accelerometers ``acc``.
    problem : FilterProblem
        Its filter must be a recursive one.
    every : float
        Interval [s] of the lines, in the time of the record; 0 for a line each row.
    fixed : mapping
        Angle [rad] of the joints that are fixed and have no column, by name.
    goal : mapping
        Wanted standard uncertainty [SI] by name; where all are met a line is due, and `enough` says so.
    say : callable
        Told of gaps, of the first few; and once each when the innovations contradict the model, when the filter
        diverges, and when the gimbals lock.

    Raises
    ------
    RecordError
        Columns that are missing or not in physical units; or, later, time that stays behind.
    StudyError
        The filter works on whole recordings only.
    """

    kind = "selfcal"

    def __init__(
        self,
        lines: Lines,
        problem: FilterProblem,
        every: float = 0.0,
        say: Callable[[Finding], None] = lambda _: None,
        fixed: Mapping[str, float] = MappingProxyType({}),
        goal: Mapping[str, float] = MappingProxyType({}),
    ) -> None:
        super().__init__(every, say)
        self._module, self._problem, self._where = filter_of(problem), problem, lines.where
        sensor = "gyro" if "gyro_x" in lines.record and "wc_x" not in lines.record else "wc"
        wanted = [f"{name}_{axis}" for name in (sensor, "th", "acc") for axis in "xyz"]
        there = [name for name in wanted if name not in fixed]
        self._channels, channels = Channels.of(lines, there), [lines.record[name] for name in there]
        rates = {column.name for column in channels[:3] if not column.increment}
        first = {column.name for column in channels if column.name not in rates and column.sensor != "th"}
        lines.leave_unsaid(first, rates)
        self._fixed = [(k, fixed[name]) for k, name in enumerate(wanted) if name in fixed]
        self._wanted = np.array([goal.get(name, math.inf) for name in problem.names])
        self._measured = sensor == "gyro"
        self._gained = np.array([column.increment for column in channels[:3]])
        self.columns = [f"{name} [{unit}]" for name, unit in [("t", "s"), *columns(problem.names)]]

    @property
    def deciding(self) -> Mapping[str, object]:
        """The problem, and the rate's columns."""
        problem = self._problem
        return {
            "world": problem.world,
            "noise": problem.noise,
            "prior": problem.prior,
            "filter": repr(problem.filter),
            "rate": ", ".join(map(str, [*self._channels.places.tolist(), *self._gained.tolist()])),
        } | ({"fixed": str(self._fixed)} if self._fixed else {})

    def begun(self) -> SelfcalState:
        """Nothing known."""
        none = np.zeros(3)
        return SelfcalState(
            begun=False, filter=self._module.initial(self._problem, none), next=none.copy(), rate=none.copy(),
            rated=math.nan, read=math.nan, t=math.nan, steps=np.full(LIMITS.recent_intervals, np.nan), doubt=False,
            angles=none.copy(), nis=RunningNis(), late=0, kept=KeptRows(),
        )  # fmt: skip

    def stepped(self, state: SelfcalState, sample: Sample) -> tuple[SelfcalState, Sequence[StreamRow]]:
        """The state after a row, and a line where one is due."""
        if math.isnan(sample.t):
            return state, ()
        numbers = self._channels.si(sample).tolist()
        for k, angle in self._fixed:
            numbers.insert(k, angle)
        rate, th, acc = np.array(numbers).reshape(3, 3)
        over = np.where(self._gained, rate, state.next)
        following = np.where(self._gained, np.nan, rate)
        if not state.begun or (math.isnan(state.steps[-1]) and not np.isfinite(over).all()):
            return self._begin(state, sample.t, following, th)
        dt = sample.t - state.t
        if dt <= 0.0:
            return self._late(state, sample.t), ()
        state = self._seen(state, sample.t, dt)
        state, over, walked = self._rate(state, sample.t, over)
        doubt, seen = walked is not None or state.doubt, bool(np.isfinite(th).all())
        walk, behind = dt if walked is None else walked, over if self._gained.any() else np.full(3, np.nan)
        later = np.where(np.isfinite(following), following, behind)
        step = Steps(np.array([dt]), over[None], acc[None], th[None], later[None], np.zeros(1))
        filter_, trace = advance(
            self._module,
            state.filter,
            self._problem,
            step,
            (0,) if doubt else (),
            walked=np.array([walk]),
        )
        kept = state.kept.after(step, doubt, walk)
        estimate: RowHistory | Estimates = trace.estimates
        if kept.full:
            filter_, kept = kept.passed(self._problem, filter_)
            estimate = estimate_of(filter_, self._problem)
        if trace.restarts:
            text = "the platform did not turn on as before: its attitude is taken anew from the encoders"
            self._gap(sample.t, text)
        nis, dims = float(trace.estimates.nis[0]), int(trace.estimates.dims[0])
        state = state._replace(
            filter=filter_, next=following, t=sample.t, late=0, doubt=doubt and not seen,
            read=sample.t if seen else state.read, kept=kept,
        )  # fmt: skip
        if math.isfinite(nis):
            state = state._replace(nis=state.nis.after(nis, dims))
        self._judge(state, trace)
        return self._line(state, estimate, nis)

    def enough(self, state: StreamState[SelfcalState]) -> str:
        """Words for a state in which all goals are met, and nothing contradicts the model; empty for others."""
        of = self.within(state)
        if not of.begun or not np.isfinite(self._wanted).any():
            return ""
        estimate = estimate_of(of.filter, self._problem)
        u = estimate.u[-1] / divisor(estimate.coefficients)[-1]
        count = int(np.isfinite(self._wanted).sum())
        return f"all {count} goals are met at t = {of.t:.10g} s" if self._met(of, u) else ""

    def _met(self, state: SelfcalState, u: Array) -> bool:
        """True where standard uncertainties (p,) are within the goals, if there are any, no alarm was given, and the
        innovations have been judged."""
        sound = state.nis.rows >= _SETTLED and not self.has_said(*_ALARMS)
        return bool(sound and np.isfinite(self._wanted).any() and (u <= self._wanted).all())

    def _begin(
        self, state: SelfcalState, t: float, rate: Array, th: Array
    ) -> tuple[SelfcalState, Sequence[StreamRow]]:
        """The start, where all angles and the rate from here on are known; else it is waited for."""
        begun = bool(np.isfinite(th).all() and (np.isfinite(rate) | self._gained).all())
        if not begun:
            return state._replace(begun=False), ()
        filter_ = initial(self._module, self._problem, th, np.where(np.isfinite(rate), rate, 0.0))
        kept = KeptRows.of(self._problem.filter.kind, self._problem, th)
        state = state._replace(
            begun=True, filter=filter_, next=rate, t=t, read=t, doubt=False, angles=th, kept=kept
        )
        return self._line(state, estimate_of(filter_, self._problem), math.nan)

    def _late(self, state: SelfcalState, t: float) -> SelfcalState:
        """A row left out, which is not later than the one before."""
        if state.late + 1 == LIMITS.late_rows:
            raise RecordError(
                self._where,
                f"t: {LIMITS.late_rows} rows in a row are not later than {state.t:.10g} s, the last at {t:.10g} s, "
                "expected time to increase",
            )
        return state._replace(late=state.late + 1)

    def _seen(self, state: SelfcalState, t: float, dt: float) -> SelfcalState:
        """The state with an interval seen; a gap is said."""
        state = state._replace(steps=np.append(state.steps[1:], dt))
        if dt > LIMITS.gap_ratio * usual(state.steps):
            self._gap(t, f"{dt:.4g} s without rows, the platform is taken to turn on as before")
        return state

    def _gap(self, t: float, text: str) -> None:
        """Say something of a gap."""
        more = "; further gaps are not said" if self.times_said("gap") + 1 == _SAID else ""
        self.alarm("gap", f"{text}{more}", t, times=_SAID)

    def _rate(self, state: SelfcalState, t: float, rate: Array) -> tuple[SelfcalState, Array, float | None]:
        """The rate (3,) from the last row to ``t``, NaN where not recorded, without gaps; and where it is held, the
        time [s] over which its noise gathers."""
        whole, gained = bool(np.isfinite(rate).all()), bool(self._gained.all())
        if whole:
            state = state._replace(rate=rate, rated=t if gained else state.t)
        dt, step = t - state.t, float(usual(state.steps))
        long, half = dt > LIMITS.gap_ratio * step, 0.5 * step
        if whole and not long:
            return state, rate, None
        middle = state.rated - half if gained else state.rated + half
        held = held_rate(
            state.rate, state.filter.th, self._problem.world, middle - state.read, state.t - state.read, dt
        )
        begun = state.t if whole else state.rated - step if gained else state.rated
        walked = ((t - begun) ** 2 - (state.t - begun) ** 2) / step if self._measured else dt
        return state, np.where(long | ~np.isfinite(rate), held, rate), walked

    def _judge(self, state: SelfcalState, trace: Trace) -> None:
        """Give the alarms that are due now."""
        nis, out = state.nis.nis, trace.estimates
        if state.nis.rows >= _SETTLED and nis.mean > nis.limit(LIMITS.nis_sigmas):
            text = (
                f"NIS is {nis.mean:.4g} on average, expected {nis.expected:.4g}: the rows contradict the model or the "
                "stated noise"
            )
            self.alarm("excess_scatter", text, state.t)
        numbers = (out.coefficients, out.u, out.attitude_u)
        without_scale = bool((out.coefficients[:, KA1] == -1.0).any())
        if without_scale or not all(np.isfinite(values).all() for values in numbers):
            text = "the filter diverged: its coefficients or their uncertainties are no numbers any more"
            self.alarm("filter_fails", text, state.t)
        if self._problem.filter.kind == "gimbal-ukf" and trace.gimbal_cosine < LIMITS.singular_cosine:
            text = (
                "outer and platform axis coincide, where the gimbal-angle model does not hold: use a quaternion "
                "filter"
            )
            self.alarm("gimbal_lock", text, state.t)

    def _line(
        self, state: SelfcalState, estimate: RowHistory | Estimates, nis: float
    ) -> tuple[SelfcalState, Sequence[StreamRow]]:
        """The state with its angles, and its line, which is due where all goals are met."""
        (row,) = rows(
            estimate.attitude,
            estimate.attitude_u,
            estimate.coefficients,
            estimate.u,
            state.angles,
            self._problem.world,
        )
        state = state._replace(angles=row[:3].copy())
        line = StreamRow(
            state.t, lambda: [state.t, *row.tolist(), nis, state.nis.nis.mean], self._met(state, row[11::2])
        )
        return state, [line]


def filter_of(problem: FilterProblem) -> ModuleType:
    """The module of the filter of a problem; raises `StudyError` for one that works on whole recordings only."""
    module = recursive(problem.filter.kind)
    if module is None:
        raise StudyError(
            "filter.kind",
            f"found {problem.filter.kind}, which works on whole recordings, expected error-state, svd-qukf or "
            "gimbal-ukf for a stream",
        )
    if any(KIND_OF[name] in TEMPERATURE for name in problem.names):
        text = "found temperature, whose mean is that of a whole recording, expected states without it for a stream"
        raise StudyError("model.states", text)
    return module


def load_kernels(problem: FilterProblem) -> None:
    """Load, or compile, the kernels of a live calibration."""
    load_filter(problem.filter.kind, problem)
    p = len(problem.prior)
    none = np.empty((0, 3))
    rows(np.empty((0, 4)), none, np.empty((0, p)), np.empty((0, p)), np.zeros(3), problem.world)
