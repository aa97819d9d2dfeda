"""A system on a stream: the shell around its steps, the same for all systems.

A system gives its columns and its steps (`SystemOnStream.begun`, `stepped`, `ended`). The shell gives a line for each
interval, says each finding as often as it is worth saying, and keeps both in the state, so that a run that goes on
neither repeats nor forgets.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar, Generic, NamedTuple, TypeVar

import numpy as np

from inercal.faces.stream.lines import Lines, Sample
from inercal.faces.stream.run import Output
from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding

S = TypeVar("S")


class StreamRow(NamedTuple):
    """A line that may be given: the stamp ``t`` [s] by which its interval counts, NaN where it is of none, and its
    ``values``, computed where it is given; ``due``: it is given in any case."""

    t: float
    values: Callable[[], Output]
    due: bool = False


class LineInterval(NamedTuple):
    """Intervals of which each has one line: the time [s] from which they are counted, NaN before the first line, and
    the number of that of the last line."""

    first: float = math.nan
    number: int = -1

    def at(self, t: float, every: float) -> LineInterval | None:
        """The interval of a line that is due at a stamp, None where none is; all are due with ``every`` [s] 0."""
        if every == 0.0:
            return self
        first = t if math.isnan(self.first) else self.first
        intervals = (t - first) / every
        if math.isnan(intervals):
            return None
        # a stamp written in decimals may fall short of its interval by its rounding
        number = math.floor(intervals + 1e-12 * abs(intervals) + 1e-9)
        return None if number == self.number else LineInterval(first, number)


class Rows(NamedTuple):
    """Rows that are kept while a stream runs: of a ``table`` (capacity, k) the first ``used``."""

    table: Array
    used: int = 0

    @staticmethod
    def of(columns: int, capacity: int = 64) -> Rows:
        """No rows yet, of so many columns."""
        return Rows(np.empty((capacity, columns)))

    @property
    def filled(self) -> Array:
        """The rows (used, k)."""
        return self.table[: self.used]

    def after(self, row: Array) -> Rows:
        """The rows with one more, whose table may be used up."""
        table = self.table
        if self.used == len(table):
            table = np.concatenate([table, np.empty_like(table)])
        table[self.used] = row
        return Rows(table, self.used + 1)


class Channels(NamedTuple):
    """Channels of a stream: their ``places`` (n,) among the values of a sample, and ``factors`` (n,) to SI."""

    places: Array
    factors: Array

    @staticmethod
    def of(lines: Lines, names: Sequence[str]) -> Channels:
        """The channels of those names. Raises `RecordError` for one that is missing or in counts."""
        columns, order = [lines.record[name] for name in names], list(lines.record.columns)
        for column in columns:
            column.si()  # refuses counts
        places = np.array([order.index(column.name) for column in columns], dtype=int)
        return Channels(places, np.array([column.unit.factor for column in columns]))

    def si(self, sample: Sample) -> Array:
        """Values (n,) of a sample in SI."""
        return np.asarray(np.array(sample.values)[self.places] * self.factors)


class StreamState(NamedTuple, Generic[S]):
    """State of a system on a stream: that of the ``system``, the ``interval`` of the last line, and the names of
    findings ``said``, a line each."""

    system: S
    interval: LineInterval
    said: str


class SystemOnStream(ABC, Generic[S]):
    """A system that goes from sample to sample (`inercal.faces.stream.run.Recursive`).

    Parameters
    ----------
    every : float
        Interval [s] of the lines, in the time of the record; 0 for a line each row.
    say : callable
        Takes the findings.
    """

    kind: ClassVar[str]
    columns: list[str]

    def __init__(self, every: float, say: Callable[[Finding], None]) -> None:
        self._every, self.tell, self._said = every, say, list[str]()

    @property
    @abstractmethod
    def deciding(self) -> Mapping[str, object]:
        """All that decides the numbers, but for the samples and the interval of the lines."""

    @abstractmethod
    def begun(self) -> S:
        """The state of the system before the first sample."""

    @abstractmethod
    def stepped(self, state: S, sample: Sample) -> tuple[S, Sequence[StreamRow]]:
        """The state of the system after a sample, and its lines."""

    def ended(self, state: S) -> Sequence[StreamRow]:
        """The lines of rows that were held, where the stream ends."""
        return ()

    @property
    def settings(self) -> Mapping[str, object]:
        """All that, with the samples, decides the lines."""
        return {**self.deciding, "every": self._every}

    def initial(self) -> StreamState[S]:
        """The state before the first sample."""
        return StreamState(self.begun(), LineInterval(), "")

    def step(self, state: StreamState[S], sample: Sample) -> tuple[StreamState[S], Sequence[Output]]:
        """The state after a sample, and the lines that are due."""
        system, lines = self.stepped(self.within(state), sample)
        return self._after(system, state.interval, lines)

    def finish(self, state: StreamState[S]) -> Sequence[Output]:
        """The lines of rows that were held."""
        system = self.within(state)
        return self._after(system, state.interval, self.ended(system))[1]

    def within(self, state: StreamState[S]) -> S:
        """The state of the system, with what was said up to it known again."""
        self._said = state.said.splitlines()
        return state.system

    def _after(
        self, system: S, interval: LineInterval, lines: Sequence[StreamRow]
    ) -> tuple[StreamState[S], list[Output]]:
        """The state, and those of its lines that are due."""
        outputs = []
        for line in lines:
            if (now := interval.at(line.t, self._every)) is not None or line.due:
                interval = now or interval
                outputs.append(line.values())
        return StreamState(system, interval, "\n".join(self._said)), outputs

    def say(self, finding: Finding, name: str = "", times: int = 1) -> None:
        """Say a finding, of one ``name`` (its code if absent) so many ``times`` at most."""
        name = name or finding.code
        if self.times_said(name) < times:
            self._said.append(name)
            self.tell(finding)

    def alarm(self, code: str, text: str, t: float, name: str = "", times: int = 1) -> None:
        """Say a finding on the row at ``t`` [s], as `say` does."""
        self.say(Finding(code, text, f"t = {t:.10g} s"), name, times)

    def times_said(self, name: str) -> int:
        """Times that a finding of that name was said."""
        return self._said.count(name)

    def has_said(self, *names: str) -> bool:
        """True where a finding of these names was said."""
        return not set(names).isdisjoint(self._said)
