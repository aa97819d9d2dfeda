"""The paper's way on a stream: lever-arm terms taken off each row, and its angle as at rest, at once.

The angles are, but for rounding, those of the whole file by the same methods where none of them looks ahead: a low pass
does, and so does a decision by the seconds about a row. A gyro is taken for prompt, for a late one would have to
be waited for, and a zero is known after its stretch alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from inercal.aoa.limits import LIMITS
from inercal.aoa.paper.methods import check_sensors, each_row
from inercal.aoa.reading.clock import set_back
from inercal.aoa.reading.recording import Recording
from inercal.aoa.result.columns import columns, rows
from inercal.aoa.result.systematic import by_methods, gravity_u
from inercal.aoa.settings import AoaSettings, Methods
from inercal.arrays import Array
from inercal.errors import StudyError
from inercal.findings import Finding
from inercal.stream.aoa_sensors import Sensors, watched_limits
from inercal.stream.lines import Lines, Sample
from inercal.stream.run import Alarms, Output, Slots


class PaperState(NamedTuple):
    """State after a row: ``t`` [s] of the last one and the number of those since that were not later; ``temperature``
    [degC] the last known one; ``before`` (N + 2,) the last row, its time first; ``beyond`` [s] the last row beyond the
    limits; of all ``rows`` those ``unanswered``; ``remarked``: the findings on the sensors were given."""

    t: float
    late: int
    temperature: float
    before: Array
    beyond: float
    unanswered: int
    rows: int
    remarked: bool
    alarms: Alarms
    slots: Slots


class PaperAoa:
    """Measures angles row by row by methods of the paper (`inercal.stream.run.Recursive`); parameters and what is
    raised as of `inercal.stream.aoa.Aoa`, and `StudyError` where a method would look ahead."""

    kind = "aoa by the paper"

    def __init__(
        self,
        lines: Lines,
        settings: AoaSettings,
        methods: Methods,
        every: float = 0.0,
        say: Callable[[Finding], None] = lambda _: None,
    ) -> None:
        _check(settings, methods)
        self._settings, self._methods, self._every, self._say = settings, methods, every, say
        self._where, self._sensors = lines.where, Sensors(lines, settings)
        check_sensors(settings, methods, self._sensors.has_gyro)
        self.columns = [f"{name} [{unit}]" for name, unit in (("t", "s"), *columns(settings))]
        self.failure = ""
        """A sentence on angles that are not to be used, once the stream has ended; empty for good ones."""

    @property
    def settings(self) -> Mapping[str, object]:
        """All that decides the digits."""
        of = self._settings
        return {
            **self._sensors.settings,
            "layout": of.layout.geometry,
            "gravity": repr((of.site.gravity, gravity_u(of))),
            "study": repr((of.noise, of.prior, of.timing, of.attitude, of.alarm)),
            "methods": repr(self._methods),
            "every": self._every,
        }

    def initial(self) -> PaperState:
        """The state before the first row."""
        none = np.full(len(self._settings.layout.names) + 2, np.nan)
        return PaperState(-math.inf, 0, math.nan, none, math.nan, 0, 0, False, Alarms(), Slots())

    def step(self, state: PaperState, sample: Sample) -> tuple[PaperState, Sequence[Output]]:
        """The state after a row, and its line where one is due."""
        if not state.remarked:
            for finding in self._sensors.remarks:
                self._say(finding)
        temperature = self._sensors.temperature(sample, state.temperature)
        values, saturated = self._sensors.measured(sample, temperature)
        alarms = state.alarms
        for k, text in saturated:
            alarms = alarms.give(k, "saturation", text, sample.t, self._say)
        state = state._replace(temperature=temperature, remarked=True, alarms=alarms, rows=state.rows + 1)
        if not sample.t > state.t:
            late = state.late + 1
            if late >= LIMITS.backward_rows:
                raise set_back(self._where, late, state.t, sample.t)
            return self._line(state._replace(late=late), sample.t, np.full(len(self.columns) - 1, np.nan))
        now = np.array([sample.t, *values[: len(state.before) - 1]])
        # the one before is needed for differences alone
        pair = np.vstack([state.before, now] if math.isfinite(state.before[0]) else [now])
        angles = by_methods(_recording(pair), self._settings, self._methods, each_row)
        state = state._replace(t=sample.t, late=0, before=now)
        return self._line(state, sample.t, rows(angles, self._settings)[-1])

    def finish(self, state: PaperState) -> Sequence[Output]:
        """No lines: none are held."""
        if 2 * state.unanswered >= state.rows:
            self.failure = f"{state.unanswered} rows of {state.rows} have no angle"
        return []

    def _line(self, state: PaperState, t: float, row: Array) -> tuple[PaperState, Sequence[Output]]:
        """The state with a row counted, and its line where one is due."""
        lost = math.isnan(row[0])
        beyond = watched_limits(self._settings, t, row.tolist(), state.beyond, self._say)
        state = state._replace(unanswered=state.unanswered + lost, beyond=beyond)
        if self._every > 0.0:
            slots = None if lost else state.slots.at(t, self._every)
            if slots is None:
                return state, []
            state = state._replace(slots=slots)
        return state, [[t, *row.tolist()]]


def _recording(read: Array) -> Recording:
    """Rows (k, N + 2) of time, accelerometers and gyro as a recording."""
    none = np.full((len(read), 2), np.nan)
    return Recording(read[:, 0], read[:, 1:-1], read[:, -1], none, none)


def _check(settings: AoaSettings, methods: Methods) -> None:
    """Refuse what looks ahead."""
    if methods.centrifugal not in ("none", "mechanical"):
        raise StudyError(
            "methods.centrifugal",
            f"found {methods.centrifugal} with a stream, expected mechanical or none: it looks ahead",
        )
    if settings.timing.gyro_delay:
        raise StudyError(
            "timing.gyro_delay",
            f"found {1e3 * settings.timing.gyro_delay:g} ms with the paper's way on a stream, expected none: a gyro "
            "that is late would have to be waited for",
        )
    if settings.zero is not None:
        raise StudyError(
            "zero",
            "found with the paper's way on a stream, expected none: it is known after its stretch alone",
        )
