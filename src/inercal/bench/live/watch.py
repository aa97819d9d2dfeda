"""Samples watched on their way into an estimator, and rows on their way out of it."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from inercal.bench.live.address import Replay, Source
from inercal.bench.live.counts import Stamps, TimeSpread
from inercal.bench.live.feed import Feed
from inercal.faces.stream.lines import Lines, Sample
from inercal.faces.stream.run import Output, Recursive


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
        return {
            name: WatchedValue(value if math.isfinite(value) else None, None, unit)
            for (name, unit), value in pairs
        }

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
