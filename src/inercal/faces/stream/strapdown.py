"""A strapdown unit calibrated while it is turned: rows in, coefficients and their uncertainties out after each rest.

Rests are found as they end. After each, the error-state filter goes over all rows so far, from the result after the
rest before, so that a line says what `inercal calibrate strapdown --filter error-state` says of the recording up to it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from inercal.faces.stream.lines import Lines, Sample
from inercal.faces.stream.run import Output
from inercal.foundation.arrays import Array
from inercal.foundation.errors import RecordError
from inercal.foundation.findings import Finding
from inercal.foundation.instruments.terms import TERMS
from inercal.foundation.records.dwells import Dwell
from inercal.systems.strapdown.fit.error_state import Filtered, filtered
from inercal.systems.strapdown.fit.rests import found_rests, nodes_of
from inercal.systems.strapdown.limits import LIMITS
from inercal.systems.strapdown.model.coefficients import SIZE, free_places, names, slope, stated
from inercal.systems.strapdown.model.samples import Samples
from inercal.systems.strapdown.settings import StrapdownSettings

_HEAD = 51
"""Rows that tell the interval of the samples, before anything is looked for."""

_SAID = 5

_CHECK = 1.0
"""Time [s] from one look for the end of a rest to the next."""


class StrapdownState(NamedTuple):
    """State after a row: ``rows`` (capacity, 7), of which ``filled`` are in use, with stamp, rate and force in SI;
    first and last sample of the ``rests`` (k, 2) so far, coefficients ``c`` (51,) and attitude at the start ``q`` (4,)
    after the last of them, NaN before; ``checked`` rows when rests were last looked for; ``failed`` was said; ``off``:
    the last stamp was off the even steps, on which it was put; ``told`` such rows were said."""

    rows: Array
    filled: int
    rests: Array
    c: Array
    q: Array
    checked: int
    failed: bool
    off: bool
    told: int


class Strapdown:
    """Calibrates a strapdown unit rest by rest (`inercal.faces.stream.run.Recursive`); a line has the time of the end
    of a rest, the number of rests, and each coefficient with its standard uncertainty.

    Raises `RecordError` for columns that are missing or not in physical units, and later for a gap.
    """

    kind = "strapdown"

    def __init__(
        self, lines: Lines, settings: StrapdownSettings, say: Callable[[Finding], None] = lambda _: None
    ) -> None:
        self._settings, self._say, self._where, record = settings, say, lines.where, lines.record
        channels = [record[f"{sensor}_{axis}"] for sensor in ("gyro", "acc") for axis in "xyz"]
        for column in channels:
            column.si()  # refuses counts
        order = list(record.columns)
        self._places = [order.index(column.name) for column in channels]
        self._factors = np.array([column.unit.factor for column in channels])
        self._outputs = record["acc_x"].unit.factor, record["gyro_x"].unit.factor
        self._free = free_places(settings.terms, settings.gravity_u > 0.0, settings.site.latitude_u > 0.0)
        self._names = names(settings.terms, settings.frame)
        self.columns = ["t [s]", "rests [1]"]
        for name in self._names:
            unit = TERMS[name].unit_for(record["acc_x" if name.startswith("K") else "gyro_x"].unit.symbol)
            self.columns += [f"{name} [{unit}]", f"u_{name} [{unit}]"]

    @property
    def settings(self) -> Mapping[str, object]:
        """The study, and where its columns are."""
        return {"study": repr(self._settings), "columns": ", ".join(map(str, self._places))}

    def initial(self) -> StrapdownState:
        """No row seen."""
        c, q = np.full(SIZE, math.nan), np.full(4, math.nan)
        return StrapdownState(np.empty((1024, 7)), 0, np.empty((0, 2)), c, q, 0, False, False, 0)

    def step(self, state: StrapdownState, sample: Sample) -> tuple[StrapdownState, Sequence[Output]]:
        """The state after a row, and a line where a rest has ended."""
        values = np.array([sample.values[i] for i in self._places]) * self._factors
        rows, count = state.rows, state.filled
        if math.isnan(sample.t) and count < 2:
            return state._replace(filled=0), ()  # nothing says when it was
        t, off = self._stamp(state, sample, values)
        if off and not math.isnan(sample.t) and state.told < _SAID:
            text = f"t: {sample.t:.10g} s is off the even steps, on which {t:.10g} s is taken"
            self._say(Finding("outlying_time", text, f"row {count + 1}"))
            state = state._replace(told=state.told + 1)
        if count == len(rows):
            rows = np.concatenate([rows, np.empty_like(rows)])
        rows[count, 0], rows[count, 1:] = t, values
        state = state._replace(rows=rows, filled=count + 1, off=off)
        if state.filled < _HEAD or (state.filled - state.checked) * self._ts(state) < _CHECK:
            return state, ()
        return self._looked(state._replace(checked=state.filled), ended=False)

    def finish(self, state: StrapdownState) -> Sequence[Output]:
        """The line of the last rest."""
        return self._looked(state, ended=True)[1] if state.filled >= _HEAD else ()

    def _stamp(self, state: StrapdownState, sample: Sample, values: Array) -> tuple[float, bool]:
        """The stamp [s] of a row, on the even steps where it has none or is alone off them; and whether it is off.

        Raises `RecordError` for a gap, and for what is no number: a solution is carried through every sample.
        """
        rows, count, t = state.rows, state.filled, sample.t
        if not np.isfinite(values).all():
            raise RecordError(self._where, f"row {count + 1} holds no number, expected one in every column")
        if count < _HEAD and not math.isnan(t):
            return t, False
        before, usual = float(rows[count - 1, 0]), float(np.median(np.diff(rows[: min(count, _HEAD), 0])))
        if math.isnan(t):
            return before + usual, state.off
        if abs(t - before - usual) <= LIMITS.uneven * usual:
            return t, False
        if state.off:  # so it was the row before that did not go on
            raise RecordError(
                self._where,
                f"t: a step of {t - before:.4g} s after row {count - 1} where {usual:.4g} s is usual, expected samples "
                "without gaps",
            )
        return before + usual, True

    def _ts(self, state: StrapdownState) -> float:
        """Interval [s] of the samples."""
        return float(state.rows[state.filled - 1, 0] - state.rows[0, 0]) / (state.filled - 1)

    def _looked(self, state: StrapdownState, ended: bool) -> tuple[StrapdownState, Sequence[Output]]:
        """The state with rests that have ended since, and a line where there is one."""
        ts, count, known = self._ts(state), state.filled, state.rests.astype(int)
        first, last = (0, 0) if not len(known) or self._settings.rests.list else known[-1].tolist()
        tail = _samples(state, first, count, ts)
        over = 0 if ended else round((self._settings.rests.margin + LIMITS.window) / ts)
        listed = self._settings.rests.list
        if listed:
            ends = [(round(begin / ts), round(end / ts)) for begin, end in listed]
        else:
            ends = [
                (each.start + first, each.stop + first) for each in found_rests(tail, self._settings.rests)
            ]
        new = [
            each
            for each in ends
            if each[0] >= last and each[1] + over <= count and [*each] not in known.tolist()
        ]
        if not new:
            return state, ()
        rests = np.array([*known.tolist(), *new], dtype=float)
        state = state._replace(rests=rests)
        return self._estimated(state, ts) if len(rests) > 1 else (state, ())

    def _estimated(self, state: StrapdownState, ts: float) -> tuple[StrapdownState, Sequence[Output]]:
        """The state with coefficients after the last rest, and their line."""
        settings, rests = self._settings, tuple(Dwell(*each) for each in state.rests.astype(int).tolist())
        end = rests[-1].stop
        samples = _samples(state, 0, end, ts)
        none, before = np.empty(0), None
        if np.isfinite(state.c).all():
            before = Filtered(state.c, state.q, none, 0, True, none, none)
        nodes = nodes_of(samples, rests, settings.rests.node)
        found = filtered(samples, nodes, settings, before) or filtered(samples, nodes, settings)
        if found is None or not found.converged:
            if not state.failed:
                text = "the filter does not come to rest: take the batch on the whole recording"
                self._say(Finding("filter_fails", text, f"t = {state.rows[end - 1, 0]:.10g} s"))
            state = state._replace(failed=True)
        if found is None:
            return state, ()

        def in_words(free: Array) -> Array:
            c = found.c.copy()
            c[self._free] = free
            return stated(c, settings.terms, settings.frame, self._outputs)

        values, J = in_words(found.c[self._free]), slope(in_words, found.c[self._free])
        u = np.sqrt(np.diag(J @ found.covariance @ J.T))
        line = [
            float(state.rows[end - 1, 0]),
            float(len(rests)),
            *np.stack([values, u], axis=1).ravel().tolist(),
        ]
        return state._replace(c=found.c, q=found.q_nb), [line]


def _samples(state: StrapdownState, first: int, end: int, ts: float) -> Samples:
    """Rows from the ``first`` to before the ``end`` as samples every ``ts`` [s]."""
    rate, force = (np.ascontiguousarray(state.rows[first:end, k : k + 3]) for k in (1, 4))
    return Samples(rate, force, ts)


def load_kernels(settings: StrapdownSettings) -> None:
    """Load, or compile, the kernels of a live calibration."""
    still = np.tile([0.0, 0.0, settings.site.gravity], (60, 1))
    samples = Samples(np.zeros((60, 3)), still, 0.1)
    filtered(samples, nodes_of(samples, (Dwell(0, 20), Dwell(40, 60)), 1.0), settings)
