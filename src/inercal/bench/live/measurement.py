"""A measurement that runs: a source, the estimator of a study, sinks, and what is known at this moment.

The samples go through the recursive estimators of `inercal.faces.stream` by their own loop, so that every line has the
digits that ``--stream`` gives for the same lines.
"""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from inercal.bench.live.address import Sink, Source, sink_of, source_of
from inercal.bench.live.counts import Counts, SinkCounts, Watch, Watched, WatchedValue
from inercal.bench.live.feed import Feed
from inercal.bench.live.pieces import EstimatorRow, quantities_of
from inercal.bench.live.sinks import Outlet, new_file
from inercal.bench.live.sources import Intake, is_datagrams, may_begin_within_a_row
from inercal.faces.stream.lines import Lines
from inercal.faces.stream.run import Output, Saving, run
from inercal.foundation.errors import InercalError, InputError, RecordError
from inercal.foundation.findings import Finding

if TYPE_CHECKING:
    from inercal.faces.stream.estimators import Make, Say, SayFinding
    from inercal.foundation.records.maps import RecordMap

KEPT, THIN = 3000, 0.02
"""Rows that are kept for a look back, and the least time [s] between them."""

ALARMS = 200
"""Messages that are kept."""


@dataclass(frozen=True)
class Alarm:
    """Something that was said: how long the measurement had run [s], a code of findings or empty, and a sentence."""

    at: float
    code: str
    message: str


@dataclass(frozen=True)
class MeasurementPlan:
    """The settings of a measurement.

    ``make`` prepares the estimator: it is called with what takes messages and findings, and loads kernels, which may
    take seconds. ``files`` are inputs that no sink and no recording may replace.
    """

    source: Source
    make: Callable[[Say, SayFinding], Make]
    record_map: RecordMap | None = None
    record: Path | None = None
    sinks: Sequence[Sink] = ()
    saving: Saving | None = None


class RunningMeasurement:
    """A source measured in threads of its own, from `start` until it ends, fails or is asked to stop.

    Parameters
    ----------
    plan : Plan
    say : callable
        Told in words what happens, at once.
    say_finding : callable
        Told what the estimator and the reading of rows find.
    print_line : callable
        Takes lines for the sink ``text:-``.
    """

    def __init__(
        self,
        plan: MeasurementPlan,
        say: Callable[[str], None] = lambda _: None,
        say_finding: Callable[[Finding], None] = lambda _: None,
        print_line: Callable[[str], None] = lambda _: None,
    ) -> None:
        self._plan, self._tell, self._tell_finding, self._print = plan, say, say_finding, print_line
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._work, name=f"measurement of {plan.source}", daemon=True)
        self._intake = Intake(plan.source, self._said)
        self._feed: Feed | None = None
        self._outlets: list[Outlet] = []
        self._stop, self._done = threading.Event(), threading.Event()
        self._watch = Watch(self._stop, plan.source)
        self._alarms: deque[Alarm] = deque(maxlen=ALARMS)
        self._view: deque[tuple[float | str, ...]] = deque(maxlen=KEPT)
        self._given, self._thinned = 0, -math.inf
        self._latest: Output = ()
        self._begun = time.monotonic()
        self.columns: tuple[str, ...] = ()
        """Titles of the rows, such as ``theta [deg]``; empty before the first sample has come."""
        self.state = "new"
        """``new``, ``preparing`` (kernels are loaded), ``waiting`` (for rows), ``running`` or ``ended``."""
        self.failure = ""
        """A sentence on why it ended with an error, once it has; empty for a good end."""
        self.error: BaseException | None = None
        """The error of `failure`."""
        self.verdict = ""
        """A sentence on rows that are not to be used, once it has ended; empty for good ones."""

    def start(self) -> None:
        """Begin in a thread; what fails is in `failure`."""
        self._thread.start()

    def stop(self, wait: float = 0.0) -> None:
        """End in order: what has come is worked on, sinks and recording are closed. Wait for it so long [s]."""
        self._stop.set()
        self._intake.stop()
        if wait > 0.0:
            self.join(wait)

    def join(self, timeout: float | None = None) -> bool:
        """Wait; True once it has ended. An interrupt ends the waiting alone, which `threading.Thread.join` mistakes
        for the end of the thread."""
        return self._done.wait(timeout)

    @property
    def alive(self) -> bool:
        """True as long as the source is open: false while it is tried again."""
        return self._intake.alive

    @property
    def latest(self) -> dict[str, WatchedValue]:
        """The last row: each quantity of it by name, with u; empty before the first."""
        with self._lock:
            values = self._latest
        return {
            name: WatchedValue(each["value"], _number(each.get("u")), str(each["unit"]))
            for name, each in (quantities_of(self.columns, values) if values else {}).items()
        }

    @property
    def channels(self) -> dict[str, WatchedValue]:
        """The last sample that came, by channel."""
        return self._watch.channels

    def rows(self, after: int = 0) -> tuple[int, list[tuple[float | str, ...]]]:
        """Rows of the last minute, thinned to 50 a second, of those that came after the first ``after`` ones; and
        the number to ask with next time."""
        with self._lock:
            new = min(self._given - after, len(self._view))
            return self._given, list(self._view)[len(self._view) - new :] if new > 0 else []

    @property
    def alarms(self) -> list[Alarm]:
        """The last 200 messages and findings, the oldest first."""
        with self._lock:
            return list(self._alarms)

    @property
    def counts(self) -> Counts:
        """Counts of pieces, rows and losses."""
        feed, intake, watch, stamps = self._feed, self._intake, self._watch, self._watch.stamps
        used, left_out = (0, 0) if feed is None else (feed.used, feed.left_out)
        missing = None if feed is None else feed.missing
        return Counts(
            received=intake.received,
            used=used,
            left_out=left_out,
            dropped=intake.dropped,
            waiting=intake.received - used - left_out - intake.dropped,
            rows=watch.rows,
            lost=stamps.lost if missing is None else missing,
            disordered=stamps.disordered,
            repeated=stamps.repeated,
            outlying=stamps.outlying,
            late=stamps.late,
            cut=0 if feed is None else feed.cut,
            damaged=0 if feed is None else feed.damaged,
            datagrams_lost=intake.lost_datagrams,
            reconnections=intake.reconnections,
            step_median=watch.times.quantile(0.5),
            step_p99=watch.times.quantile(0.99),
            sinks=self._sink_counts(),
        )

    def _sink_counts(self) -> dict[str, SinkCounts]:
        """Rows written and dropped by each sink."""
        return {outlet.name: outlet.counts for outlet in self._outlets}

    @property
    def incomplete(self) -> bool:
        """True where a sink or the recording has failed; a reader of standard output may leave."""
        failed = self._feed is not None and self._feed.record_failed
        return failed or any(outlet.failure and outlet.name != "text:-" for outlet in self._outlets)

    def _work(self) -> None:
        """Prepare, run and end."""
        try:
            self._run()
        except InercalError as error:
            self.error, self.failure = error, str(error)
        except Exception as error:
            self.error, self.failure = error, f"unexpected {type(error).__name__} ({error})"
        finally:
            self.state = "ended"
            self._done.set()

    def _run(self) -> None:
        """Run to the end of the source."""
        plan = self._plan
        self.state = "preparing"
        make = plan.make(self._said, self._found)
        with ExitStack() as closing:
            record = closing.enter_context(_recording(plan.record))
            source = plan.source
            feed = Feed(self._intake, plan.record_map, may_begin_within_a_row(source), record, self._said)
            closing.callback(self._close_outlets)
            for sink in plan.sinks:
                self._outlets.append(Outlet(sink, self._print, self._said))
            closing.callback(self._intake.end)
            self._intake.begin()
            self._feed, self.state = feed, "waiting"
            try:
                lines = Lines(feed, str(source), feed.record_map, self._found)
            except RecordError:
                if self._stop.is_set():
                    return  # before a row came
                raise
            if not lines.stamped and feed.missing is None and is_datagrams(source):
                self._said("rows have neither stamps nor a counter: what is lost cannot be seen")
            estimator = Watched(make(lines), self._watch, lines, feed)
            self.columns = tuple(estimator.columns)
            for outlet in self._outlets:
                outlet.begin(self.columns)
            self.state = "running"
            saving = plan.saving
            if saving is not None:
                saving = Saving(saving.path, saving.every, self._settle)
            run(estimator, lines, self._written(estimator, feed), saving, self._said)
            self.verdict = getattr(estimator.inner, "failure", "")
        if self._intake.failure is not None:
            raise self._intake.failure

    def _written(self, estimator: Watched, feed: Feed) -> Callable[[str], None]:
        """A function that hands a line to all sinks and to the view; the first, the titles, they have already."""
        titles = iter([True])

        def write(text: str) -> None:
            if next(titles, False):
                return
            row = EstimatorRow(text, estimator.given.popleft(), self._watch.due or feed.arrived)
            for outlet in self._outlets:
                outlet.offer(row)
            self._seen(row)
            none_left = bool(self._outlets) and all(each.failure for each in self._outlets)
            if none_left and self._plan.record is None and not self._stop.is_set():
                self._said("no sink is left, the measurement ends")
                self.stop()

        return write

    def _seen(self, row: EstimatorRow) -> None:
        """Keep a row for who looks."""
        with self._lock:
            self._latest = row.values
            if row.at - self._thinned >= THIN:
                self._thinned = row.at
                self._view.append(tuple(row.values))
                self._given += 1

    def _settle(self) -> None:
        """Let every sink write its rows."""
        for outlet in self._outlets:
            outlet.settle()

    def _close_outlets(self) -> None:
        """Close every sink."""
        for outlet in self._outlets:
            outlet.close()

    def _said(self, text: str) -> None:
        """Keep and pass on a message."""
        self._keep(Alarm(time.monotonic() - self._begun, "", text))
        self._tell(text)

    def _found(self, finding: Finding) -> None:
        """Keep and pass on a finding."""
        where = f" ({finding.where})" if finding.where else ""
        self._keep(Alarm(time.monotonic() - self._begun, finding.code, f"{finding.message}{where}"))
        self._tell_finding(finding)

    def _keep(self, alarm: Alarm) -> None:
        """Keep a message."""
        with self._lock:
            self._alarms.append(alarm)


def measure(
    source: str,
    study: Any,
    *,
    map: str | Path | None = None,
    record: str | Path | None = None,
    to: Sequence[str] = (),
    every: float = 0.0,
) -> RunningMeasurement:
    """Begin to measure a source by a study, in a thread.

    Parameters
    ----------
    source : str
        Address, such as ``"udp://127.0.0.1:5005"`` (`inercal.bench.live.address`).
    study : Study, str or Path
        Of the kind aoa (angles), selfcal or strapdown (coefficients) or imu (rest and noise).
    map : path, optional
        Column map of lines or frames.
    record : path, optional
        A new file that takes the raw rows, for ``replay:``.
    to : sequence of str
        Addresses of sinks.
    every : float
        Interval [s] of the rows; 0 for one each sample.

    Returns
    -------
    Measurement
        At work: `RunningMeasurement.latest`, `RunningMeasurement.counts`, `RunningMeasurement.stop`.

    Raises
    ------
    InputError
        An address, study or map that is wrong in itself. What fails later is in `RunningMeasurement.failure`.
    """
    from inercal.faces.python.study import study_of
    from inercal.faces.stream.estimators import of_study

    wire, sinks, of = source_of(source), [sink_of(each) for each in to], study_of(study)
    record_map = None
    if map is not None:
        from inercal.foundation.records.maps import read_map

        record_map = read_map(map)
        record_map.refuse_guess()
    if not every >= 0.0:
        raise InputError("every", f"found {every}, expected a time from 0 on")

    def make(say: Say, say_finding: SayFinding) -> Make:
        return of_study(of, every, say, say_finding)

    began = RunningMeasurement(
        MeasurementPlan(wire, make, record_map, None if record is None else Path(record), sinks)
    )
    began.start()
    return began


def _recording(path: Path | None) -> Any:
    """The new file of a recording, without a buffer, as a context; of none None."""
    from contextlib import nullcontext

    if path is None:
        return nullcontext()
    opened: IO[bytes] = open(new_file(str(path)), "wb", buffering=0)  # noqa: SIM115
    return opened


def _number(value: float | str | None) -> float | None:
    """A number, None for a text."""
    return None if isinstance(value, str) else value
