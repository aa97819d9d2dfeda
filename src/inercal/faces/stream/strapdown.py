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
from inercal.faces.stream.shell import Channels, Rows, StreamRow, SystemOnStream
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
"""Stamps off the even steps that are said."""

_CHECK = 1.0
"""Time [s] from one look for the end of a rest to the next."""


class StrapdownState(NamedTuple):
    """State after a row: the ``rows`` (7 columns) with stamp, rate and force in SI; first and last sample of the
    ``rests`` (k, 2) so far, coefficients ``c`` (51,) and attitude at the start ``q`` (4,) after the last of them, NaN
    before; ``checked`` rows when rests were last looked for; ``off``: the last stamp was off the even steps, on which
    it was put."""

    rows: Rows
    rests: Array
    c: Array
    q: Array
    checked: int
    off: bool


class Strapdown(SystemOnStream[StrapdownState]):
    """Calibrates a strapdown unit rest by rest; a line has the time of the end
    of a rest, the number of rests, and each coefficient with its standard uncertainty.

    Raises `RecordError` for columns that are missing or not in physical units, and later for a gap.
    """

    kind = "strapdown"

    def __init__(
        self,
        lines: Lines,
        settings: StrapdownSettings,
        every: float = 0.0,
        say: Callable[[Finding], None] = lambda _: None,
    ) -> None:
        super().__init__(every, say)
        self._settings, self._where, record = settings, lines.where, lines.record
        self._channels = Channels.of(
            lines, [f"{sensor}_{axis}" for sensor in ("gyro", "acc") for axis in "xyz"]
        )
        self._outputs = record["acc_x"].unit.factor, record["gyro_x"].unit.factor
        self._free = free_places(settings.terms, settings.gravity_u > 0.0, settings.site.latitude_u > 0.0)
        self._names = names(settings.terms, settings.frame)
        self.columns = ["t [s]", "rests [1]"]
        for name in self._names:
            unit = TERMS[name].unit_for(record["acc_x" if name.startswith("K") else "gyro_x"].unit.symbol)
            self.columns += [f"{name} [{unit}]", f"u_{name} [{unit}]"]

    @property
    def deciding(self) -> Mapping[str, object]:
        """The study, and where its columns are."""
        return {"study": repr(self._settings), "columns": ", ".join(map(str, self._channels.places.tolist()))}

    def begun(self) -> StrapdownState:
        """No row seen."""
        c, q = np.full(SIZE, math.nan), np.full(4, math.nan)
        return StrapdownState(Rows.of(7, 1024), np.empty((0, 2)), c, q, 0, False)

    def stepped(self, state: StrapdownState, sample: Sample) -> tuple[StrapdownState, Sequence[StreamRow]]:
        """The state after a row, and a line where a rest has ended."""
        values, count = self._channels.si(sample), state.rows.used
        if math.isnan(sample.t) and count < 2:
            return state._replace(rows=state.rows._replace(used=0)), ()  # nothing says when it was
        t, off = self._stamp(state, sample, values)
        if off and not math.isnan(sample.t):
            text = f"t: {sample.t:.10g} s is off the even steps, on which {t:.10g} s is taken"
            self.say(Finding("outlying_time", text, f"row {count + 1}"), times=_SAID)
        state = state._replace(rows=state.rows.after(np.array([t, *values])), off=off)
        count = state.rows.used
        if count < _HEAD or (count - state.checked) * self._ts(state) < _CHECK:
            return state, ()
        return self._looked(state._replace(checked=count), ended=False)

    def ended(self, state: StrapdownState) -> Sequence[StreamRow]:
        """The line of the last rest."""
        return self._looked(state, ended=True)[1] if state.rows.used >= _HEAD else ()

    def _stamp(self, state: StrapdownState, sample: Sample, values: Array) -> tuple[float, bool]:
        """The stamp [s] of a row, on the even steps where it has none or is alone off them; and whether it is off.

        Raises `RecordError` for a gap, and for what is no number: a solution is carried through every sample.
        """
        rows, count, t = state.rows.filled, state.rows.used, sample.t
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
        stamps = state.rows.filled[:, 0]
        return float(stamps[-1] - stamps[0]) / (len(stamps) - 1)

    def _looked(self, state: StrapdownState, ended: bool) -> tuple[StrapdownState, Sequence[StreamRow]]:
        """The state with rests that have ended since, and a line where there is one."""
        ts, count, known = self._ts(state), state.rows.used, state.rests.astype(int)
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

    def _estimated(self, state: StrapdownState, ts: float) -> tuple[StrapdownState, Sequence[StreamRow]]:
        """The state with coefficients after the last rest, and their line."""
        settings, rests = self._settings, tuple(Dwell(*each) for each in state.rests.astype(int).tolist())
        end = rests[-1].stop
        stamp = float(state.rows.filled[end - 1, 0])
        samples = _samples(state, 0, end, ts)
        none, before = np.empty(0), None
        if np.isfinite(state.c).all():
            before = Filtered(state.c, state.q, none, 0, True, none, none)
        nodes = nodes_of(samples, rests, settings.rests.node)
        found = filtered(samples, nodes, settings, before) or filtered(samples, nodes, settings)
        if found is None or not found.converged:
            text = "the filter does not come to rest: take the batch on the whole recording"
            self.alarm("filter_fails", text, stamp)
        if found is None:
            return state, ()

        def in_words(free: Array) -> Array:
            c = found.c.copy()
            c[self._free] = free
            return stated(c, settings.terms, settings.frame, self._outputs)

        values, J = in_words(found.c[self._free]), slope(in_words, found.c[self._free])
        with np.errstate(invalid="ignore"):  # of a recording that no solution fits: no number
            u = np.sqrt(np.diag(J @ found.covariance @ J.T))
        line = [stamp, float(len(rests)), *np.stack([values, u], axis=1).ravel().tolist()]
        return state._replace(c=found.c, q=found.q_nb), [StreamRow(stamp, lambda: line)]


def _samples(state: StrapdownState, first: int, end: int, ts: float) -> Samples:
    """Rows from the ``first`` to before the ``end`` as samples every ``ts`` [s]."""
    rate, force = (np.ascontiguousarray(state.rows.filled[first:end, k : k + 3]) for k in (1, 4))
    return Samples(rate, force, ts)


def load_kernels(settings: StrapdownSettings) -> None:
    """Load, or compile, the kernels of a live calibration."""
    still = np.tile([0.0, 0.0, settings.site.gravity], (60, 1))
    samples = Samples(np.zeros((60, 3)), still, 0.1)
    filtered(samples, nodes_of(samples, (Dwell(0, 20), Dwell(40, 60)), 1.0), settings)
