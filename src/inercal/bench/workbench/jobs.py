"""Jobs of the workbench: commands in processes of their own, one after the other, kept in a folder each.

A job survives its page, for the page only looks. It ends with the program; begun anew, that finds it again, done or
interrupted.
"""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
import threading
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from enum import StrEnum
from itertools import pairwise
from pathlib import Path
from typing import Any

from inercal.bench.workbench.sessions import PART, is_numbered
from inercal.foundation._files import is_pipe, read_bytes, write_text
from inercal.foundation.addresses import shown_address
from inercal.foundation.errors import InercalError, InputError, plain, spelt
from inercal.systems.listed import SYSTEMS

_ABOUT, _LAST = "job.json", 20_000
_PATIENCE = 5.0
"""Time [s] after which a cancelled command that goes on is killed."""


class JobState(StrEnum):
    """The state of a job."""

    WAITING = "waiting"
    RUNNING = "running"
    DONE = "done"
    REFUSED = "refused"
    CANCELLED = "cancelled"
    INTERRUPTED = "interrupted"


ENDED = frozenset({JobState.DONE, JobState.REFUSED, JobState.CANCELLED, JobState.INTERRUPTED})


@dataclass(frozen=True)
class Job:
    """A job: its number and folder, the session it is of, the arguments of its command, and what became of it.

    ``code`` is the exit code, None before the end: 0 ok, 1 a bad verdict, 2 refused.
    """

    id: str
    folder: Path
    session: str
    arguments: tuple[str, ...]
    where: Path
    state: JobState
    made: str
    code: int | None = None

    @property
    def command(self) -> str:
        """The command as one would type it in the folder of the session."""
        return shlex.join(["inercal", *self.arguments])

    @property
    def calibrates(self) -> bool:
        """True for a calibration, as against what is done with its result."""
        words = " ".join(self.arguments[:2]) if self.arguments[0] == "calibrate" else self.arguments[0]
        return words in {system.command for system in SYSTEMS.values()}

    @property
    def designs(self) -> bool:
        """True for a search for a plan."""
        return self.arguments[0] == "design"

    @property
    def result(self) -> Path | None:
        """The file of the result, None before the end."""
        return path if (path := self.folder / "result.json").is_file() else None

    @property
    def report(self) -> Path | None:
        """The report of the result, None before the end."""
        return path if (path := self.folder / "report.html").is_file() else None

    @property
    def said(self) -> str:
        """The words of the command to people."""
        return _text(self.folder / "said")

    @property
    def progress(self) -> str:
        """The last words of the command on its way."""
        lines = _text(self.folder / "progress").splitlines()
        return lines[-1] if lines else ""


def _text(path: Path) -> str:
    """The last part of a text that may not be there."""
    if is_pipe(path):
        return ""
    try:
        with open(path, "rb") as file:
            file.seek(max(path.stat().st_size - _LAST, 0))
            return file.read(_LAST).decode(errors="replace")
    except OSError:
        return ""


class Queue:
    """The jobs of a folder, of which one runs at a time, begun in the order in which they came.

    ``environment`` holds variables for their commands beside those of this process: what is secret stands there and not
    in arguments, which every user of the machine can read.
    """

    def __init__(self, root: Path, environment: Mapping[str, str] | None = None) -> None:
        root.mkdir(parents=True, exist_ok=True)
        self.root = root
        self._environment = {**os.environ, **(environment or {})}
        self._changed = threading.Condition()
        self._process: subprocess.Popen[bytes] | None = None
        self._running: str | None = None
        self._closed = False
        self._jobs = {job.id: job for job in map(_found, sorted(root.iterdir())) if job is not None}
        self._stored = frozenset(self._jobs)  # by anybody who can write here: not to be run unseen
        for job in [*self._jobs.values()]:
            self._put(self._seen(job))
        self._thread = threading.Thread(target=self._work, name="jobs", daemon=True)
        self._thread.start()

    def __iter__(self) -> Any:
        """The jobs, the newest first."""
        with self._changed:
            return iter(sorted(self._jobs.values(), key=lambda job: job.id, reverse=True))

    def get(self, number: str) -> Job:
        """The job of that number; raises `InputError` where there is none."""
        with self._changed:
            if number not in self._jobs:
                raise InputError(f"job {number}", "found none, expected one of the list")
            return self._jobs[number]

    def folder_of(self, number: int) -> Path:
        """The folder of a job."""
        return self.root / f"{number:05d}"

    def add(self, session: str, where: Path, arguments: Sequence[str]) -> Job:
        """A new job at the end of the queue; ``{out}`` in its arguments is its own folder, as seen from ``where``."""
        with self._changed:
            for before, word in pairwise(("the command", *arguments)):
                plain(before if before.startswith("--") else "the command", word)
            numbers = (int(each.name) for each in self.root.iterdir() if is_numbered(each.name))
            folder = self.folder_of(max(numbers, default=0) + 1)
            folder.mkdir()
            words = tuple(word.replace("{out}", os.path.relpath(folder, where)) for word in arguments)
            made = datetime.now(UTC).isoformat(timespec="seconds")
            job = Job(folder.name, folder, session, words, where, JobState.WAITING, made)
            _tell(job)
            self._jobs[job.id] = job
            self._changed.notify_all()
            return job

    def again(self, number: str) -> Job:
        """The same command as a new job; raises `InputError` where a workbench before this one left another kind."""
        old = self.get(number)
        if number in self._stored:
            self._check(old)
        own = os.path.relpath(old.folder, old.where)
        return self.add(old.session, old.where, [word.replace(own, "{out}") for word in old.arguments])

    def cancel(self, number: str) -> Job:
        """Take a job out of the queue, or end its process."""
        with self._changed:
            job = self.get(number)
            if job.state in ENDED:
                return job
            job = replace(job, state=JobState.CANCELLED)
            self._put(job)
            process = self._process if self._running == number else None
        if process is not None:
            process.terminate()
            with suppress(subprocess.TimeoutExpired):
                process.wait(_PATIENCE)
            process.kill()
        return job

    def wait(self, number: str, timeout: float | None = None) -> Job:
        """The job once it has ended, or as it is after ``timeout`` [s]."""
        with self._changed:
            self._changed.wait_for(
                lambda: self._jobs[number].state in ENDED and self._running != number, timeout
            )
            return self._jobs[number]

    def close(self) -> None:
        """End the running job, and begin no more."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
            process = self._process
        if process is not None:
            process.kill()
        self._thread.join()

    def _check(self, job: Job) -> None:
        """Refuse a job that was found and is not to be run; raises `InputError`."""
        _check_stored(job.arguments, job.where, self.root.parent, job.folder)

    def _seen(self, job: Job) -> Job:
        """A job that was found, refused where it waits and is not to be run."""
        try:
            if job.state is JobState.WAITING:
                self._check(job)
        except (InercalError, OSError, ValueError) as error:
            return _refused(job, error)
        return job

    def _put(self, job: Job) -> None:
        """Keep what has become of a job, in memory and, where there is room, on the disk."""
        self._jobs[job.id] = job
        with suppress(InercalError, OSError):
            _tell(job)

    def _work(self) -> None:
        """Run the jobs that wait, one by one; whatever befalls one, the next is begun."""
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._closed or self._next() is not None)
                job = self._next()
                if self._closed or job is None:
                    return
            try:
                self._run(job)
            except Exception as error:  # of a process, which may be refused for many reasons
                with self._changed:
                    if self._process is not None:
                        self._process.kill()
                    self._process, self._running = None, None
                    self._put(_refused(job, error))
                    self._changed.notify_all()

    def _run(self, job: Job) -> None:
        """Run a job to its end; raises what the system has against its process."""
        with self._changed:
            if self._jobs[job.id].state is not JobState.WAITING:  # cancelled meanwhile
                return
            job = replace(job, state=JobState.RUNNING)
            self._put(job)
            process = _begun(job, self._environment)
            self._process, self._running = process, job.id
        process.wait()
        if process.stdin is not None:
            process.stdin.close()
        with self._changed:
            self._process, self._running = None, None
            job = self._jobs[job.id]
            if job.state is JobState.RUNNING:
                self._put(_ended(job))
            self._changed.notify_all()

    def _next(self) -> Job | None:
        """The job that has waited longest."""
        return next((job for _, job in sorted(self._jobs.items()) if job.state is JobState.WAITING), None)


def _tell(job: Job) -> None:
    """Write what a job is; raises `InputError`."""
    about = {
        "session": job.session,
        "arguments": job.arguments,
        "where": str(job.where),
        "state": job.state.value,
        "made": job.made,
        "code": job.code,
    }
    write_text(job.folder / _ABOUT, json.dumps(about) + "\n")


def _refused(job: Job, error: Exception) -> Job:
    """A job that cannot be begun, with the reason among its words."""
    why = str(error)
    if isinstance(error, OSError):  # its folder has gone, it is too long, no room for another process
        why = f"{error.filename or 'the command'}: {error.strerror or error}"
    said = " ".join(spelt(why).split())
    with suppress(InercalError, OSError):
        write_text(job.folder / "said", f"inercal: error: {said}\n")
    return replace(job, state=JobState.REFUSED, code=2)


def _begun(job: Job, environment: Mapping[str, str]) -> subprocess.Popen[bytes]:
    """The process of a job, with its variables; it imports nothing from its folder, where files that were sent lie."""
    with open(job.folder / "said", "wb") as said, open(job.folder / "printed", "wb") as printed:
        return subprocess.Popen(
            [sys.executable, "-P", "-m", "inercal.bench.workbench.child", str(job.folder), *job.arguments],
            cwd=job.where,
            env=environment,
            stdin=subprocess.PIPE,
            stdout=printed,
            stderr=said,
        )


def _ended(job: Job) -> Job:
    """A job whose process has gone: done or refused where it left an exit code, else interrupted."""
    try:
        code = int(read_bytes(job.folder / "end"))
    except (OSError, ValueError):
        return replace(job, state=JobState.INTERRUPTED)
    return replace(job, state=JobState.DONE if code in (0, 1) else JobState.REFUSED, code=code)


def _without_store(arguments: Iterable[str]) -> tuple[str, ...]:
    """Arguments without the store, which 0.2.0 put there and the environment holds now, and without other secrets."""
    kept, words = [], iter(arguments)
    for word in words:
        if word == "--store":
            next(words, None)
        else:
            kept.append(shown_address(word))
    return tuple(kept)


def _found(folder: Path) -> Job | None:
    """The job of a folder, as the program that ended left it; None where it is none."""
    try:
        about = json.loads(read_bytes(folder / _ABOUT))
        state, code, arguments = JobState(about["state"]), about["code"], about["arguments"]
        texts = [about["session"], about["where"], about["made"], *arguments]
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None
    sound = isinstance(arguments, list) and arguments and isinstance(code, int | None)
    if not (sound and is_numbered(folder.name) and all(isinstance(each, str) for each in texts)):
        return None
    session, where, made, *words = map(spelt, texts)
    if not (kept := _without_store(words)):
        return None
    job = Job(folder.name, folder, session, kept, Path(where), state, made, code)
    if state is JobState.RUNNING:
        return _ended(job)
    if state is JobState.WAITING and [session, where, made, *words] != texts:
        return _refused(job, ValueError("found a text that no command can have, expected plain text"))
    return job


def _check_stored(arguments: tuple[str, ...], where: Path, work: Path, own: Path) -> None:
    """Refuse a command line that was found in a work folder, where anybody may have written it, and leads elsewhere.

    It is held against the lists of `inercal.cli.stored_line`; files come from the folder ``work``, and go to that of
    the job, ``own``; ``where`` it is run. Raises `InputError`, naming the word.
    """
    from inercal.cli.stored_line import stored_line
    from inercal.laboratory.again import LaidOut

    line = stored_line(list(arguments))
    inside, files = _is_inside(where, work), {}
    for name, values in line.given.items():
        use = line.use(name)
        if use == "dropped" and name not in ("--json", "--quiet"):
            raise InputError(
                name, "found in a job of an earlier workbench, expected options that only compute"
            )
        for value in values:
            if use == "below" and not _is_inside(where / value, own):
                raise InputError(value, "lies outside the folder of the job, expected a file in it")
            if use == "file":
                inside = inside and _is_inside(where / str(value), work)
                files[os.path.normpath(str(value))] = os.path.normpath(str(value))
            if not inside:
                raise InputError(value, "lies outside the work folder, expected a file in it")
    if any(path.suffix != PART for path in where.glob(".*")):
        raise InputError(where, "holds a hidden file, as settings of other programs are, expected none")
    line.check_named(LaidOut(work.resolve(), where, files))


def _is_inside(path: Path, folder: Path) -> bool:
    """True for a place in a folder, links followed."""
    return path.resolve().is_relative_to(folder.resolve())
