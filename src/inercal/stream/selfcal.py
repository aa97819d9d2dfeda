"""A platform calibrated while it turns: rows in, coefficients and their uncertainties out, each at once.

A recursive filter of `inercal.selfcal` goes on by one row at a time, to the digits that it gives on the whole file
(`inercal.selfcal.reading` says how rows are taken): the first row with all angles and a rate is the start; a rate is
held until the next one is known; what else is missing is not measured. Only time is treated more kindly: a row that is
not later than the one before is left out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import ModuleType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inercal.errors import RecordError, StudyError
from inercal.records.findings import Finding
from inercal.selfcal.filtered import History, Problem, State, Trace
from inercal.selfcal.filtering import LOCK, known_in, load_kernels, recursive
from inercal.selfcal.history import columns, rows
from inercal.stream.lines import Lines, Sample
from inercal.stream.run import Output, Slots

Array = NDArray[np.float64]

_BAND = 5.0
"""Standard deviations that the running mean of NIS may be above its expectation."""

_SETTLED = 50
"""Rows before which that is not judged."""

_LONG = 1.5
"""Steps, as long as the first, beyond which an interval is a gap."""

_SAID = 5
_PATIENCE = 10


class LiveState(NamedTuple):
    """What is known after a row.

    ``begun``: a start was found; until then the others mean nothing. ``filter`` is the state of the filter; ``rate``
    (3,) [rad/s] of the platform, held from the last row on; ``t`` [s] of that row, and the first interval ``step`` [s]
    (NaN before). ``angles`` (3,) [rad] of the estimated attitude. ``nis`` and ``dims``: sums of the normalised
    innovations squared and of the scalars in them, in ``rows`` rows. ``late`` rows in a row had no later time, ``gaps``
    were seen, ``said`` are the alarms given, one bit each; ``slots`` that of the last line.
    """

    begun: bool
    filter: State
    rate: Array
    t: float
    step: float
    angles: Array
    nis: float
    dims: int
    rows: int
    late: int
    gaps: int
    said: int
    slots: Slots


class Selfcal:
    """Calibrates a platform row by row (`inercal.stream.run.Recursive`); columns as `inercal.selfcal.history` has them.

    Parameters
    ----------
    lines : Lines
        With the columns of a recording: rates ``wc`` (else ``gyro``), angles ``th``, accelerometers ``acc``.
    problem : Problem
        Its filter must be a recursive one.
    every : float
        Interval [s] of the lines, in the time of the record; 0 for a line each row.
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
        problem: Problem,
        every: float = 0.0,
        say: Callable[[Finding], None] = lambda _: None,
    ) -> None:
        self._module, self._problem, self._every, self._say = filter_of(problem), problem, every, say
        self._where, record = lines.where, lines.record
        sensor = "gyro" if "gyro_x" in record and "wc_x" not in record else "wc"
        found = [record[f"{name}_{axis}"] for name in (sensor, "th", "acc") for axis in "xyz"]
        for column in found:
            column.si()  # refuses counts
        names = list(record.columns)
        self._places = [names.index(column.name) for column in found]
        self._factors = [column.unit.factor for column in found]
        self._gained = np.array([column.increment for column in found[:3]])
        self.columns = [f"{name} [{unit}]" for name, unit in [("t", "s"), *columns(len(problem.prior))]]

    @property
    def settings(self) -> Mapping[str, object]:
        """The problem, the rate's columns, and the interval of the lines."""
        problem = self._problem
        return {
            "world": problem.world,
            "noise": problem.noise,
            "prior": problem.prior,
            "filter": repr(problem.filter),
            "rate": ", ".join(map(str, [*self._places, *self._gained.tolist()])),
            "every": self._every,
        }

    def initial(self) -> LiveState:
        """Nothing known."""
        none = np.zeros(3)
        return LiveState(
            begun=False, filter=self._module.initial(self._problem, none), rate=none.copy(), t=math.nan, step=math.nan,
            angles=none.copy(), nis=0.0, dims=0, rows=0, late=0, gaps=0, said=0, slots=Slots(),
        )  # fmt: skip

    def step(self, state: LiveState, sample: Sample) -> tuple[LiveState, Output | None]:
        """The state after a row, and a line where one is due."""
        if math.isnan(sample.t):
            return state, None
        values = zip(self._places, self._factors, strict=True)
        rate, th, acc = np.array([sample.values[i] * factor for i, factor in values]).reshape(3, 3)
        known = np.isfinite(rate)
        gained = np.where(self._gained & known, rate, state.rate)
        if not state.begun or (math.isnan(state.step) and not np.isfinite(gained).all()):
            return self._begin(state, sample.t, np.where(self._gained, np.nan, rate), th)
        dt = sample.t - state.t
        if dt <= 0.0:
            return self._late(state, sample.t), None
        state = self._after(state, sample.t, dt)
        filter_, trace = self._module.advance(
            state.filter, self._problem, np.array([dt]), gained[None], acc[None], th[None]
        )
        nis, dims = float(trace.nis[0]), int(trace.dims[0])
        state = state._replace(
            filter=filter_, rate=np.where(~self._gained & known, rate, gained), t=sample.t, late=0
        )
        if math.isfinite(nis):
            state = state._replace(nis=state.nis + nis, dims=state.dims + dims, rows=state.rows + 1)
        return self._line(self._alarmed(state, trace), trace, nis)

    def _begin(self, state: LiveState, t: float, rate: Array, th: Array) -> tuple[LiveState, Output | None]:
        """The start, where all angles and the rate from here on are known; else it is waited for."""
        begun = bool(np.isfinite(th).all() and (np.isfinite(rate) | self._gained).all())
        if not begun:
            return state._replace(begun=False), None
        filter_ = self._module.initial(self._problem, th)
        state = state._replace(begun=True, filter=filter_, rate=rate, t=t, angles=th)
        return self._line(state, known_in(filter_, self._problem), math.nan)

    def _late(self, state: LiveState, t: float) -> LiveState:
        """A row left out, which is not later than the one before."""
        if state.late + 1 == _PATIENCE:
            raise RecordError(
                self._where,
                f"t: {_PATIENCE} rows in a row are not later than {state.t:.10g} s, the last at {t:.10g} s, expected "
                "time to increase",
            )
        return state._replace(late=state.late + 1)

    def _after(self, state: LiveState, t: float, dt: float) -> LiveState:
        """The state with an interval seen; a gap is said."""
        if math.isnan(state.step):
            return state._replace(step=dt)
        if dt <= _LONG * state.step:
            return state
        if state.gaps < _SAID:
            more = "; further gaps are not said" if state.gaps + 1 == _SAID else ""
            said = f"{dt:.4g} s without rows, the rate before is held{more}"
            self._say(Finding("gap", said, f"t = {t:.10g} s"))
        return state._replace(gaps=state.gaps + 1)

    def _alarmed(self, state: LiveState, trace: Trace) -> LiveState:
        """The state with the alarms that were due now."""
        above = state.nis - state.dims > _BAND * math.sqrt(2.0 * state.dims)
        alarms = (
            (
                state.rows >= _SETTLED and above,
                "excess_scatter",
                f"NIS is {state.nis / max(state.rows, 1):.4g} on average, expected "
                f"{state.dims / max(state.rows, 1):.4g}: the rows contradict the model or the stated noise",
            ),
            (
                not np.isfinite(trace.coefficients).all(),
                "filter_fails",
                "the filter diverged: no coefficient is a number any more",
            ),
            (
                self._problem.filter.kind == "gimbal-ukf" and trace.gimbal_cosine < LOCK,
                "gimbal_lock",
                "outer and platform axis coincide, where the gimbal-angle model does not hold: use a quaternion filter",
            ),
        )
        for k, (due, code, text) in enumerate(alarms):
            if due and not state.said & 1 << k:
                self._say(Finding(code, text, f"t = {state.t:.10g} s"))
                state = state._replace(said=state.said | 1 << k)
        return state

    def _line(self, state: LiveState, known: History | Trace, nis: float) -> tuple[LiveState, Output | None]:
        """The state with its angles, and the line where one is due."""
        (row,) = rows(
            known.attitude, known.attitude_u, known.coefficients, known.u, state.angles, self._problem.world
        )
        state = state._replace(angles=row[:3].copy())
        slots = state.slots.at(state.t, self._every)
        if slots is None:
            return state, None
        mean = state.nis / state.rows if state.rows else math.nan
        return state._replace(slots=slots), [state.t, *row.tolist(), nis, mean]


def filter_of(problem: Problem) -> ModuleType:
    """The module of the filter of a problem; raises `StudyError` for one that works on whole recordings only."""
    module = recursive(problem.filter.kind)
    if module is None:
        raise StudyError(
            "filter.kind",
            f"found {problem.filter.kind}, which works on whole recordings, expected error-state, mukf, svd-qukf or "
            "gimbal-ukf for a stream",
        )
    return module


def load(problem: Problem) -> None:
    """Load, or compile, the kernels of a live calibration."""
    load_kernels(problem.filter.kind, problem)
    p = len(problem.prior)
    none = np.empty((0, 3))
    rows(np.empty((0, 4)), none, np.empty((0, p)), np.empty((0, p)), np.zeros(3), problem.world)
