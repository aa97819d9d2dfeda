"""The bench, which pages and REST call: sessions, jobs, recordings looked at, results."""

from __future__ import annotations

import os
import shutil
import tempfile
import threading
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from inercal.bench.workbench.jobs import Job, Queue
from inercal.bench.workbench.measurements import MEASURED, Measurements
from inercal.bench.workbench.sessions import MAP, PART, STUDY, Session, Sessions, put
from inercal.faces.python.study import PLANNED
from inercal.foundation._files import read_bytes, write_text
from inercal.foundation.addresses import without_secrets
from inercal.foundation.errors import InercalError, InputError, plain, spelt
from inercal.laboratory.store import VARIABLE
from inercal.systems.listed import SYSTEMS

if TYPE_CHECKING:
    from inercal.bench.workbench.charts import ChannelCourse, Notes
    from inercal.faces.python.result import Result
    from inercal.faces.python.study import Study
    from inercal.foundation.arrays import Array
    from inercal.foundation.designs.foresight import Foresight
    from inercal.foundation.records.record import Record
    from inercal.laboratory.catalog import Listed

VALIDATION = "validation"
"""The jobs of the validation, which are of no session."""

_LONGEST = 900
"""Characters of the words of an error."""

_HELD = 2
"""Recordings that are held in memory."""


@dataclass(frozen=True, eq=False)
class Looked:
    """A run that was read: names of its ``files``, the record, its channels as they are drawn, and notes on them."""

    files: str
    record: Record
    courses: tuple[ChannelCourse, ...]
    notes: Notes


@dataclass(frozen=True, eq=False)
class Bench:
    """A work folder: its sessions, its queue of jobs, the store for what is kept, the user's own if None, and the
    measurements by wire that are at work."""

    root: Path
    sessions: Sessions
    queue: Queue
    store: str | None = field(default=None, repr=False)
    measurements: Measurements = field(default_factory=Measurements)
    _looked: OrderedDict[tuple[Any, ...], tuple[Looked, ...]] = field(default_factory=OrderedDict, repr=False)
    _lock: threading.Lock = field(default_factory=threading.Lock, repr=False)

    def look(self, session: Session) -> tuple[Looked, ...]:
        """Read the recordings of a session, of each repeat run; raises `InputError`. Those of the last few are held."""
        from inercal.bench.workbench.charts import Notes, courses, marks_of
        from inercal.foundation.records.dwells import quiet
        from inercal.foundation.records.read import read_runs

        files = [*session.recordings, *filter(None, [session.map])]
        if not session.recordings:
            raise InputError(session.title, "found no recording, expected one")
        key = tuple((str(path), path.stat().st_mtime_ns, path.stat().st_size) for path in files)
        with self._lock:  # one at a time: a recording may take much memory
            if key not in self._looked:
                while len(self._looked) >= _HELD:
                    self._looked.popitem(last=False)
                self._looked[key] = tuple(
                    Looked(_files_of(record), record, courses(record), Notes(marks_of(record), quiet(record)))
                    for record in read_runs(session.recordings, session.map)
                )
            self._looked.move_to_end(key)
            return self._looked[key]

    def arrived(self, session: Session, path: Path) -> Session:
        """The session with the kind of a study that has come; raises `StudyError` where that cannot be read."""
        from inercal.faces.python.study import kind_of

        return self.sessions.of_kind(session, kind_of(path)) if path.name == STUDY else session

    def begin_study(self, session: Session, kind: str | None = None, rate: str | None = None) -> Session:
        """Write a study, and a guessed map, for the recordings of a session; those there are replaced, but for a map
        that came without a study.

        Raises `InputError` where the recordings cannot be read or the kind is none.
        """
        from inercal.faces.python.beginning import begun, kind_of_record

        plain("rate", rate or "")
        names = session.recordings
        known = kind_of_record(names) if kind is None else kind
        stays = session.map is not None and session.study is None
        session = self.sessions.of_kind(session, known)
        study, column_map = begun(known, names, Path(STUDY), Path(MAP), rate)
        write_text(session.folder / STUDY, study)
        if column_map is not None and not stays:
            write_text(session.folder / MAP, column_map)
        elif not stays:
            (session.folder / MAP).unlink(missing_ok=True)
        return session

    def begin_map(self, session: Session) -> None:
        """Write a guessed map for the recordings of a session; raises `InputError` where they cannot be read."""
        from inercal.foundation.records.recognise.map_text import guess_map

        put(session, MAP, guess_map(session.recordings, **SYSTEMS[session.kind].guess))

    def run(self, session: Session) -> Job:
        """Put the calibration of a session into the queue; raises `InputError` where a part is missing."""
        words = session.command(Path("{out}/result.json"), Path("{out}/report.html"))
        return self.queue.add(session.id, session.folder, words)

    def plan(self, kind: str) -> Session:
        """A new session with a study of that kind to plan a test with, without a recording; raises `InputError`."""
        if kind not in PLANNED:
            raise InputError("kind", f"found {kind!r}, expected one of {', '.join(PLANNED)}")
        session = self.sessions.begin(f"plan of a test: {SYSTEMS[kind].title}")
        return self.begin_study(session, kind)

    def again_as(self, session: Session, kind: str) -> Session:
        """A new session with recordings and map of another, and a study of that kind; raises `InputError`."""
        made = self.sessions.begin(f"{session.title}, as {SYSTEMS[kind].title}")
        for path in (*session.recordings, *filter(None, [session.map])):
            try:
                os.link(
                    path, made.folder / path.name
                )  # what comes later takes its place, in one of them alone
            except OSError:
                shutil.copyfile(path, made.folder / path.name)
        return self.begin_study(made, kind)

    def foreseen(self, session: Session) -> tuple[Study, Foresight, Array]:
        """The study of a session, what its plan makes expect, and the vertical (r, 3) on the instrument at each stop.

        Raises `InputError`.
        """
        from inercal.faces.python.study import foresight, read_study, verticals

        if session.study is None:
            raise InputError(session.title, "found no study, expected one")
        study = read_study(session.kind, session.study)
        seen = foresight(study)
        seen.u(np.ones(len(seen.levers)))  # loads what it is computed with
        return study, seen, verticals(study)

    def design(self, session: Session, settings: Sequence[str] = ()) -> Job:
        """Put the search for a better plan into the queue, with ``settings`` as of ``--set``; raises `InputError`."""
        if (plan := SYSTEMS[session.kind].plan) is None or session.study is None:
            raise InputError(
                session.title, f"found no study that plans a test, expected one of {', '.join(PLANNED)}"
            )
        words = ["design", plan.design, STUDY, *(f"--set={setting}" for setting in settings)]
        out = ["--out", f"{{out}}/plan{plan.ending}"] if plan.ending else []
        return self.queue.add(session.id, session.folder, [*words, *out, "--report", "{out}/report.html"])

    def result(self, job: Job) -> Result:
        """The result of a job; raises `InputError` where there is none."""
        from inercal.faces.python.calibrations import load

        if job.result is None:
            raise InputError(f"job {job.id}", f"has no result, it is {job.state.value}")
        return load(job.result)

    def change(self, session: Session, path: str, value: str) -> None:
        """Set a key of the study of a session; raises `InputError` where that cannot be."""
        from inercal.faces.studies.text import changed

        if session.study is None:
            raise InputError(session.title, "found no study, expected one")
        text = read_bytes(session.study).decode(errors="replace")
        put(session, STUDY, changed(text, path, value))

    def keep(self, job: Job, instrument: str = "") -> Job:
        """Put into the queue that the result of a job, with its report, is kept in the store."""
        words = ["keep", self._result_of(job)]
        words += ["--report", os.path.relpath(job.report, job.where)] if job.report else []
        words += ["--instrument", instrument] if instrument else []
        return self.queue.add(job.session, job.where, words)

    @property
    def lab(self) -> Path:
        """The statements of the laboratory in its certificates."""
        return self.root / "lab.toml"

    def state(self, text: str) -> None:
        """Write what the laboratory states; raises `InputError` where it is not so that a certificate can say it."""
        from inercal.laboratory.certificate.lab import read_lab

        plain("lab.toml", text)
        with tempfile.TemporaryDirectory(dir=self.root) as folder:
            trial = Path(folder) / self.lab.name
            write_text(trial, text)
            read_lab(trial)
        write_text(self.lab, text)

    def certify(self, job: Job, number: str) -> Job:
        """Put into the queue that a certificate is written of the result of a job."""
        words = [
            "certificate",
            self._result_of(job),
            "--lab",
            os.path.relpath(self.lab, job.where),
            "--number",
            number,
        ]
        words += ["--page", os.path.relpath(job.report, job.where)] if job.report else []
        words += ["--html", "{out}/certificate.html", "--out", "{out}/certificate.xml"]
        return self.queue.add(job.session, job.where, words)

    def convert(self, job: Job, tool: str) -> Job:
        """Put into the queue that the result of a job is written as another tool reads it; raises `InputError`."""
        from inercal.faces.convert.other_tools import CONVENTIONS

        if tool not in CONVENTIONS:
            raise InputError("tool", f"found {tool!r}, expected one of {', '.join(CONVENTIONS)}")
        out = f"{{out}}/{tool}{CONVENTIONS[tool].suffixes[0]}"
        return self.queue.add(
            job.session, job.where, ["convert", self._result_of(job), "--to", tool, "--out", out]
        )

    def compare(self, before: Job, after: Job) -> Job:
        """Put into the queue that two results of one instrument are compared."""
        words = [
            "compare",
            os.path.relpath(before.folder / "result.json", after.where),
            self._result_of(after),
        ]
        words += ["--out", "{out}/result.json", "--report", "{out}/report.html"]
        return self.queue.add(after.session, after.where, words)

    def _result_of(self, job: Job) -> str:
        """The file of a result, as from the folder of its session; raises `InputError`."""
        if job.result is None:
            raise InputError(f"job {job.id}", f"has no result, it is {job.state.value}")
        return os.path.relpath(job.result, job.where)

    def validate(self) -> Job:
        """Put the validation of this machine into the queue."""
        words = ["validate", "--out", "{out}/result.json", "--report", "{out}/report.html"]
        return self.queue.add(VALIDATION, self.root, words)

    def instruments(self) -> list[dict[str, Any]]:
        """The instruments of the store; raises `InputError`."""
        from inercal.laboratory.catalog import instruments
        from inercal.laboratory.store import open_store

        return instruments(open_store(self.store))

    def kept(self, serial: str) -> tuple[list[Listed], list[dict[str, Any]]]:
        """Results and certificates of an instrument of the store, the oldest first; raises `InputError`."""
        from inercal.laboratory.catalog import certificates, results
        from inercal.laboratory.store import open_store

        store = open_store(self.store)
        plain("instrument", serial)
        return results(store, serial), certificates(store, serial)

    def certificate(self, number: str, page: bool = False) -> bytes:
        """A certificate of the store as XML, or as a page; raises `InputError` where there is none."""
        from inercal.laboratory.catalog import certificates
        from inercal.laboratory.store import open_store

        store = open_store(self.store)
        row = next((each for each in certificates(store) if each["number"] == number), None)
        place = None if row is None else row["page" if page else "object"]
        if place is None:
            raise InputError(
                f"certificate {number}", f"found none in {store.where}, expected one of the list"
            )
        return store.objects.read(place)

    def last_job(self, session: Session) -> Job | None:
        """The newest calibration of a session, None without any."""
        return next((job for job in self.queue if job.session == session.id and job.calibrates), None)

    def last_design(self, session: Session) -> Job | None:
        """The newest search for a plan of a session, None without any."""
        return next((job for job in self.queue if job.session == session.id and job.designs), None)

    def drop(self, session: Session) -> None:
        """Delete a session with its files; what is measured for it ends before."""
        self.measurements.drop(session)
        self.sessions.drop(session)

    def by_wire(self, kind: str) -> Session:
        """A new session with a study of that kind to measure by wire, without a recording; raises `InputError`."""
        if kind not in MEASURED:
            raise InputError("kind", f"found {kind!r}, expected one of {', '.join(MEASURED)}")
        return self.begin_study(self.sessions.begin(f"by wire: {SYSTEMS[kind].title}"), kind)

    def close(self) -> None:
        """End the running job, and all measurements."""
        self.measurements.close()
        self.queue.close()


def _files_of(record: Record) -> str:
    """Names of the files that a record is from."""
    return ", ".join(dict.fromkeys(Path(column.source.path).name for column in record.columns.values()))


def open_bench(root: Path, store: str | None = None) -> Bench:
    """The bench of a work folder, which is made where it is not there; raises `InputError`."""
    if store is not None and "://" not in store:
        store = str(Path(store).expanduser().absolute())  # commands run in the folders of sessions
    environment = {} if store is None else {VARIABLE: store}
    try:
        (root / "sessions").mkdir(parents=True, exist_ok=True)
        for part in root.glob(f"sessions/*/.*{PART}"):  # of uploads that a crash cut off
            part.unlink(missing_ok=True)
        return Bench(root, Sessions(root / "sessions"), Queue(root / "jobs", environment), store)
    except OSError as error:
        raise InputError(root, f"cannot be made a work folder ({error.strerror})") from error


def said_of(error: BaseException) -> str:
    """The words of an error for a page."""
    words = " ".join(spelt(without_secrets(str(error))).split())
    if len(words) > _LONGEST:  # the beginning says where, the end what was expected
        words = f"{words[: 2 * _LONGEST // 3]} ... {words[-_LONGEST // 3 :]}"
    if isinstance(error, InercalError):
        return words
    return f"unexpected {type(error).__name__} ({words}), a fault of inercal's own: please report it"
