"""Counts of a measurement: rows that are missing, out of order or late by their stamps, and how long rows take.

Samples are watched on their way into an estimator, and rows on their way out.
"""

from __future__ import annotations

import math
import statistics
import threading
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from inercal.bench.live.address import Replay, Source
from inercal.bench.live.feed import Feed
from inercal.faces.stream.lines import Lines, Sample
from inercal.faces.stream.run import Output, Recursive
from inercal.foundation.arrays import finite

_STEPS = 65
_LATE = 0.25
_MINUTE = 60.0
_BINS_PER_OCTAVE, _OCTAVES, _LEAST = 8, 32, 1e-6


@dataclass(frozen=True)
class SinkCounts:
    """Rows that a sink has ``written`` and ``dropped``, and the time [s] from sample in to row out there: its median
    and the one that 99 of 100 rows keep within. ``failure`` says in words why it takes no more, if it does not."""

    written: int
    dropped: int
    median: float
    p99: float
    failure: str


@dataclass(frozen=True)
class Counts:
    """Counts of pieces, rows and losses of a measurement.

    ``received`` bytes are ``used`` in rows, ``left_out`` (in no whole or sound row), ``dropped`` for want of room, or
    still ``waiting``. Of ``rows``, ``lost`` are missing by their counter or their stamps, ``disordered`` came after a
    later one, ``repeated`` have the stamp of another, ``outlying`` a wrong one, ``late`` came 0.25 s later than the
    quickest of the last minute.
    ``cut`` rows were begun or ended at a join, ``damaged`` frames have a wrong check. ``step_median`` and ``step_p99``
    [s] are the estimator's own time for a row.
    """

    received: int
    used: int
    left_out: int
    dropped: int
    waiting: int
    rows: int
    lost: int
    disordered: int
    repeated: int
    outlying: int
    late: int
    cut: int
    damaged: int
    datagrams_lost: int
    reconnections: int
    step_median: float
    step_p99: float
    sinks: dict[str, SinkCounts]

    def __str__(self) -> str:
        """The counts in one line."""
        parts = [f"{self.rows} rows"]
        named = {
            "lost": self.lost, "out of order": self.disordered, "repeated": self.repeated,
            "with a wrong stamp": self.outlying, "late": self.late, "cut at joins": self.cut,
            "frames damaged": self.damaged, "datagrams dropped by the system": self.datagrams_lost,
            "bytes in no row": self.left_out, "bytes dropped": self.dropped, "reconnections": self.reconnections,
        }  # fmt: skip
        parts += [f"{count} {name}" for name, count in named.items() if count]
        for name, sink in self.sinks.items():
            told = f"{name}: {sink.written} written"
            told += f", {sink.dropped} dropped" if sink.dropped else ""
            if sink.written and math.isfinite(sink.p99):
                told += f", 99 % within {1e3 * sink.p99:.2g} ms"
            parts.append(told)
        if self.rows and math.isfinite(self.step_p99):
            parts.append(f"a step {1e3 * self.step_median:.2g} ms, 99 % within {1e3 * self.step_p99:.2g} ms")
        return "; ".join(parts)


class Stamps:
    """Judges the order of time stamps, row by row."""

    def __init__(self) -> None:
        self.lost = self.disordered = self.repeated = self.outlying = self.late = 0
        self._newest = -math.inf
        self._steps: deque[float] = deque(maxlen=_STEPS)
        self._interval, self._rows = math.nan, 0
        self._aside = 0
        self._least = [math.inf, math.inf]
        self._since = math.nan

    def on(self, t: float, arrived: float | None) -> None:
        """Take a row's stamp [s], and when it came [s], None where that tells nothing, as in a recording."""
        if not math.isfinite(t):
            return
        step = t - self._newest
        if step == 0.0:
            self.repeated += 1
        elif step < 0.0:
            self.disordered += 1
            if self.lost and step > -_STEPS * self._interval:
                self.lost -= 1  # it was not lost, only late
        elif math.isfinite(step):
            self._rows += 1
            self.lost += max(self._missing(step) - self._aside, 0)
            self._aside = 0
            self._steps.append(step)
            if len(self._steps) == _STEPS and self._rows % _STEPS == 0:
                first, self._interval = math.isnan(self._interval), statistics.median(self._steps)
                if first:
                    self.lost += sum(self._missing(each) for each in self._steps)
        self._newest = max(self._newest, t)
        if arrived is not None:
            self._timed(arrived - t, arrived)

    def set_aside(self) -> None:
        """Take a row whose stamp is wrong: it is not missing from the step of those beside it."""
        self.outlying += 1
        self._aside += 1

    def _missing(self, step: float) -> int:
        """Rows that are missing in a step [s], once the interval is known."""
        return round(step / self._interval) - 1 if step > 1.5 * self._interval else 0

    def _timed(self, delay: float, arrived: float) -> None:
        """Compare a delay, but for a constant, with the least of the last minute or two: clocks drift."""
        if not arrived - self._since < _MINUTE:
            self._since, self._least = arrived, [self._least[1], math.inf]
        self._least[1] = min(self._least[1], delay)
        self.late += delay - min(self._least) > _LATE


class TimeSpread:
    """Times in bins of an eighth of an octave: their quantiles in memory that does not grow."""

    def __init__(self) -> None:
        self._bins = [0] * (_BINS_PER_OCTAVE * _OCTAVES)
        self._count = 0

    def on(self, seconds: float) -> None:
        """Take a time."""
        place = int(_BINS_PER_OCTAVE * math.log2(max(seconds, _LEAST) / _LEAST))
        self._bins[min(place, len(self._bins) - 1)] += 1
        self._count += 1

    def quantile(self, share: float) -> float:
        """The time [s] within which that share of them lies, NaN of none."""
        left = share * self._count
        for place, count in enumerate(self._bins):
            left -= count
            if left <= 0.0 and self._count:
                return _LEAST * math.exp2((place + 1) / _BINS_PER_OCTAVE)
        return math.nan


@dataclass(frozen=True)
class WatchedValue:
    """A value, its standard uncertainty where it has one, and the unit of both; None for what is not known."""

    value: float | str | None
    u: float | None
    unit: str


class Watch:
    """Samples seen on their way: channels, stamps, times; those of a recording wait until they are due."""

    def __init__(self, stop: threading.Event, source: Source) -> None:
        self.stamps, self.times, self.rows = Stamps(), TimeSpread(), 0
        self.due = 0.0
        self._replayed = isinstance(source, Replay)
        self._speed = source.speed if isinstance(source, Replay) else 0.0
        self._stop, self._origin = stop, math.nan
        self._titles: list[tuple[str, str]] = []
        self._sample: Sample | None = None

    def describe(self, lines: Lines) -> None:
        """Take the titles of the channels."""
        self._titles = [(name, column.unit.symbol) for name, column in lines.record.columns.items()]

    @property
    def channels(self) -> dict[str, WatchedValue]:
        """The last sample, by channel."""
        sample = self._sample
        if sample is None:
            return {}
        pairs = [(("t", "s"), sample.t), *zip(self._titles, sample.values, strict=True)]
        return {name: WatchedValue(finite(value), None, unit) for (name, unit), value in pairs}

    def take(self, sample: Sample, arrived: float) -> None:
        """Look at a sample."""
        if self._replayed:
            self._wait(sample.t)
        self.rows += 1
        if sample.wrong:
            self.stamps.set_aside()
        else:
            self.stamps.on(sample.t, None if self._replayed else arrived)
        self._sample = sample

    def _wait(self, t: float) -> None:
        """Wait until the time of a sample has come, by the clock of the first one."""
        if self._speed and math.isfinite(t):
            now = time.perf_counter()
            if math.isnan(self._origin):
                self._origin = now - t / self._speed
            if self._origin + t / self._speed > now:
                self._stop.wait(self._origin + t / self._speed - now)
        self.due = time.perf_counter()


class Watched:
    """An estimator whose samples and rows are seen (`inercal.faces.stream.run.Recursive`)."""

    def __init__(self, inner: Recursive[Any], watch: Watch, lines: Lines, feed: Feed) -> None:
        self.inner, self._watch, self._feed = inner, watch, feed
        self.kind, self.columns = inner.kind, inner.columns
        self.given: deque[Output] = deque()
        watch.describe(lines)

    @property
    def settings(self) -> object:
        """The settings of the estimator."""
        return self.inner.settings

    def initial(self) -> Any:
        """The state before the first sample."""
        return self.inner.initial()

    def step(self, state: Any, sample: Sample) -> tuple[Any, Sequence[Output]]:
        """The state after a sample, and its lines."""
        self._watch.take(sample, self._feed.arrived)
        before = time.perf_counter()
        state, outputs = self.inner.step(state, sample)
        self._watch.times.on(time.perf_counter() - before)
        self.given.extend(outputs)
        return state, outputs

    def finish(self, state: Any) -> Sequence[Output]:
        """The lines of rows that were held."""
        outputs = self.inner.finish(state)
        self.given.extend(outputs)
        return outputs
