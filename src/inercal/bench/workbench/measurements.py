"""Measurements of sessions: instruments by wire, measured in threads of this process, one at most for each session.

They go on when a page is closed, and end with the workbench. Recordings stay, in the folder ``live`` of the session.
The monitor of streams looks at each sample beside the estimator, and says whether the instrument is at rest.
"""

from __future__ import annotations

import math
import shlex
import shutil
import threading
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from inercal.bench.live.address import Sink, placed, sink_of, source_of, target
from inercal.bench.live.feed import frame_of
from inercal.bench.live.measurement import MeasurementPlan, RunningMeasurement
from inercal.bench.workbench.sessions import MAP, STUDY, Session, Sessions, safe_name
from inercal.foundation.errors import InercalError, InputError, plain
from inercal.foundation.records.maps import read_map
from inercal.systems.listed import SYSTEMS

if TYPE_CHECKING:
    from inercal.faces.stream.estimators import Make, Say, SayFinding
    from inercal.faces.stream.lines import Lines, Sample
    from inercal.faces.stream.monitor import Monitor
    from inercal.faces.stream.run import Output, Recursive


_LOOK = 0.2
"""Time [s] between two rows of the monitor."""


class RestState:
    """Rest of the instrument as the monitor tells it, whatever is measured: ``at`` rest (None where it is not known),
    and for how ``long`` [s]."""

    def __init__(self) -> None:
        self.at: bool | None = None
        self.long = math.nan

    def beside(self, make: Make) -> Make:
        """The estimator, each sample of which the monitor looks at first; its rows are its own."""

        def both(lines: Lines) -> Recursive[Any]:
            from inercal.faces.stream.monitor import Monitor
            from inercal.foundation.noise.running import load_kernels

            inner = make(lines)
            try:
                monitor = Monitor(lines, _LOOK)
            except InercalError:  # no sensor that it could look at
                return inner
            load_kernels()
            return _WithMonitor(inner, monitor, self)

        return both

    def take(self, columns: Sequence[str], row: Output) -> None:
        """Take a row of the monitor."""
        at, long = (row[columns.index(name)] for name in ("rest", "still [s]"))
        told = not isinstance(at, str) and math.isfinite(at)
        self.at = bool(at) if told else None
        self.long = math.nan if isinstance(long, str) else long


class _WithMonitor:
    """An estimator with a monitor beside it (`inercal.faces.stream.run.Recursive`)."""

    def __init__(self, inner: Recursive[Any], monitor: Monitor, rest: RestState) -> None:
        self.inner, self.kind, self.columns = inner, inner.kind, inner.columns
        self._monitor: Monitor | None = monitor
        self._state, self._rest = monitor.initial(), rest

    @property
    def settings(self) -> object:
        """The settings of the estimator within."""
        return self.inner.settings

    @property
    def failure(self) -> str:
        """The failure of the estimator within, in words; empty without one."""
        return str(getattr(self.inner, "failure", ""))

    def initial(self) -> Any:
        """The state before the first sample."""
        return self.inner.initial()

    def step(self, state: Any, sample: Sample) -> tuple[Any, Sequence[Output]]:
        """The state after a sample, and its lines."""
        if self._monitor is not None:
            try:
                self._state, rows = self._monitor.step(self._state, sample)
            except InercalError:  # stamps that tell no time
                self._monitor, rows = None, ()
            for row in rows:
                self._rest.take(self._monitor.columns if self._monitor else (), row)
        return self.inner.step(state, sample)

    def finish(self, state: Any) -> Sequence[Output]:
        """The lines of rows that were held."""
        return self.inner.finish(state)


FOLDER = "live"
"""Folder of recordings and sinks in that of a session."""

MEASURED = {kind: system.streams for kind, system in SYSTEMS.items() if system.stream}
"""Quantities that a study of each kind measures."""

MOST = 4
"""Measurements that may be at work at the same time."""

_PATIENCE = 10.0


@dataclass(frozen=True)
class Wish:
    """A wish for a measurement: address of the ``source``, name of a new file to ``record`` raw rows in (empty for
    none), sinks to send the rows ``to``, and the interval [s] of these rows ``every``, 0 for one each sample."""

    source: str
    record: str = ""
    to: tuple[str, ...] = ()
    every: float = 0.0


@dataclass(frozen=True, eq=False)
class WishedMeasurement:
    """A measurement of a session as it was wished for, the rest detector beside it, and the command that does the
    same."""

    wish: Wish
    measurement: RunningMeasurement
    rest: RestState
    command: str
    recording: Path | None

    @property
    def gone(self) -> bool:
        """True while a source that died is tried again; a recording that was read to its end is not gone."""
        of, replayed = self.measurement, self.wish.source.lower().startswith("replay:")
        return of.state in ("waiting", "running") and not (of.alive or replayed)

    @property
    def ended(self) -> bool:
        """True once it is over."""
        return self.measurement.state == "ended"


class Measurements:
    """All measurements that this workbench has begun, the last one of each session."""

    def __init__(self) -> None:
        self._held: dict[str, WishedMeasurement] = {}
        self._lock = threading.Lock()

    def of(self, session: Session) -> WishedMeasurement | None:
        """The measurement of a session, None without one."""
        return self._held.get(session.id)

    @property
    def at_work(self) -> dict[str, WishedMeasurement]:
        """Measurements that have not ended, by session."""
        return {number: live for number, live in self._held.items() if not live.ended}

    def begin(self, session: Session, wish: Wish) -> WishedMeasurement:
        """Begin to measure; raises `InputError` where an address, study or map is wrong, or another is at work."""
        with self._lock:
            before = self.of(session)
            if before is not None and not before.ended:
                raise InputError(session.title, "is measured already, expected that to be stopped first")
            if len(self.at_work) >= MOST:
                raise InputError(
                    session.title,
                    f"found {MOST} measurements at work, expected one of them to be stopped first",
                )
            live = _prepared(session, wish)
            live.measurement.start()
            self._held[session.id] = live
        return live

    def stop(self, session: Session) -> WishedMeasurement:
        """Ask a measurement to end in order; raises `InputError` where there is none."""
        live = self.of(session)
        if live is None:
            raise InputError(session.title, "is not measured")
        live.measurement.stop()
        return live

    def drop(self, session: Session) -> None:
        """End the measurement of a session, if there is one, and forget it."""
        live = self._held.pop(session.id, None)
        if live is not None:
            live.measurement.stop(_PATIENCE)

    def close(self) -> None:
        """End all measurements."""
        for live in self.at_work.values():
            live.measurement.stop()
        for live in self._held.values():
            if live.measurement.state != "new":
                live.measurement.join(_PATIENCE)


def interval_of(text: str) -> float:
    """The interval [s] of rows that was typed, such as "0.1 s", 0 for nothing; raises `InputError`."""
    from inercal.foundation.units import parse_quantity

    found = parse_quantity(text, "time", "interval").value if text else 0.0
    if text and not 0.0 < found < math.inf:
        raise InputError("interval", f"found {text}, expected a time above 0")
    return found


def _prepared(session: Session, wish: Wish) -> WishedMeasurement:
    """A measurement that has not begun; raises `InputError`."""
    from inercal.faces.python.study import read_study
    from inercal.faces.stream.estimators import of_study

    if session.study is None:
        raise InputError(session.title, "found no study, expected one that says what is measured")
    if not 0.0 <= wish.every < math.inf:
        raise InputError("every", f"found {wish.every}, expected a time from 0 on")
    for where, text in (
        ("source", wish.source),
        ("record", wish.record),
        *(("to", each) for each in wish.to),
    ):
        plain(where, text)
    study = read_study(session.kind, session.study)
    folder = session.folder / FOLDER
    typed = [sink_of(each) for each in wish.to]
    if "text:-" in map(str, typed):
        raise InputError("to", "found text:-, expected a file, for a page has no standard output")

    def read(path: Path) -> Path:
        return _there(path, session.folder)

    def written(path: Path) -> Path:
        return folder / _plain(path)

    source = placed(source_of(wish.source), read, written)
    sinks = [placed(sink, read, written) for sink in typed]
    recording = folder / safe_name(wish.record) if wish.record else None
    names = [place for place in (recording, *map(target, sinks)) if place is not None]
    if len(set(names)) < len(names) or len(set(map(str, sinks))) < len(sinks):
        raise InputError("to", "found one place for two things, expected a name for each")
    for place in names:
        if place.exists():
            raise InputError(place.name, "is there already, expected the name of a new file")
    folder.mkdir(exist_ok=True)
    rest = RestState()

    def make(say: Say, say_finding: SayFinding) -> Make:
        return rest.beside(of_study(study, wish.every, say, say_finding))

    record_map = None if session.map is None else read_map(session.map)
    if record_map is not None:
        record_map.refuse_guess()
    measurement = RunningMeasurement(MeasurementPlan(source, make, record_map, recording, sinks))
    return WishedMeasurement(wish, measurement, rest, _command(session, wish, sinks, recording), recording)


def _there(path: Path, folder: Path) -> Path:
    """A file of the session, or of its folder ``live``; raises `InputError`."""
    name = path.name
    for typed, place in ((name, folder), (f"{FOLDER}/{name}", folder / FOLDER)):
        with suppress(InputError):
            if str(path) == typed and safe_name(name) == name and (place / name).is_file():
                return place / name
    raise InputError(str(path), "is no file of this session, expected the name of one that was added to it")


def _plain(path: Path) -> str:
    """A name without any folder; raises `InputError`."""
    if safe_name(str(path)) != str(path):
        raise InputError(str(path), "is no plain name, expected one without folders")
    return str(path)


def _command(session: Session, wish: Wish, sinks: Sequence[Sink], recording: Path | None) -> str:
    """The command that does the same in the folder of the session."""
    words = ["inercal", "live", wish.source, "--study", STUDY]
    words += ["--map", MAP] if session.map is not None else []
    words += ["--record", f"{FOLDER}/{recording.name}"] if recording is not None else []
    for typed, sink in zip(wish.to, sinks, strict=True):
        own = target(sink) is not None
        words += ["--to", typed.replace(":", f":{FOLDER}/", 1) if own else typed]
    words += ["--every", f"{wish.every:g} s"] if wish.every else []
    return shlex.join(words)


def next_name(session: Session) -> str:
    """A name for the next recording that no file has yet."""
    ending = ".csv"
    if session.map is not None:
        with suppress(InercalError):
            ending = ".bin" if frame_of(read_map(session.map)) is not None else ".csv"
    number = 1
    while (session.folder / FOLDER / f"live-{number}{ending}").exists():
        number += 1
    return f"live-{number}{ending}"


def recordings(session: Session) -> list[Path]:
    """Files that measurements have recorded or written, in the order of the names."""
    folder = session.folder / FOLDER
    return sorted(path for path in folder.iterdir() if path.is_file()) if folder.is_dir() else []


def begun_with(sessions: Sessions, session: Session, name: str) -> Session:
    """A new session with a recording of a measurement, and the map and study of its session; raises `InputError`."""
    source = session.folder / FOLDER / safe_name(name)
    if safe_name(name) != name or not source.is_file():
        raise InputError(name, "is no recording of this session")
    new = sessions.begin(name, session.kind)
    for path in (source, session.map, session.study):
        if path is not None:
            shutil.copyfile(path, new.folder / path.name)
    return new
