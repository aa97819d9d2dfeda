"""Common options of the commands, messages, and results going out."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from os.path import realpath
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from inercal.cli import printable, show
from inercal.foundation.errors import InputError

if TYPE_CHECKING:
    from cyclopts import Token

    from inercal.faces.python.study import Study as StudyOfFile
    from inercal.foundation.computing.executors import Executor
    from inercal.foundation.findings import Finding

StudyFile = Annotated[Path, Parameter(name="--study", help="Study file (TOML); `inercal new` writes one.")]
Study = Annotated[Path, Parameter(help="Study file (TOML); `inercal new` writes one.")]
Overrides = Annotated[
    list[str] | None, Parameter(name="--set", help="Override one study key: key=value. May be repeated.")
]


PROGRESS = "INERCAL_PROGRESS"
"""Variable of the environment that names a file which takes the progress of a command, its last words alone."""

_LONG = 10.0
"""Time [s] after which a command that has no terminal to show its progress on says that it is at work."""


@Parameter(name="*")
@dataclass(frozen=True)
class OutputOptions:
    """The common options of every command."""

    json: Annotated[bool, Parameter(help="Print one JSON object, and nothing else, on standard output.")] = (
        False
    )
    quiet: Annotated[bool, Parameter(help="No messages and no progress on standard error.")] = False
    _unsaid: Annotated[list[str], Parameter(parse=False)] = field(
        default_factory=list, init=False, repr=False, compare=False
    )

    def say(self, text: str) -> None:
        """A message for people, on standard error; beside JSON once that is out, for an error must stand alone."""
        if self.json:
            self._unsaid.append(text)
        else:
            self.say_now(text)

    def say_now(self, text: str) -> None:
        """A message about the progress of a command."""
        if not self.quiet:
            print(printable(text), file=sys.stderr)

    def say_finding(self, finding: Finding) -> None:
        """A finding for people."""
        self.say(finding.line)

    def emit(self, data: Mapping[str, Any], text: str) -> None:
        """The result on standard output: the JSON object, or the text for people."""
        if self.json:
            show(json.dumps(data, indent=1, allow_nan=False))
            for message in self._unsaid:
                self.say_now(message)
        elif text:
            show(text)


@Parameter(name="*")
@dataclass(frozen=True)
class FileOutput(OutputOptions):
    """The options of a command that writes a file."""

    out: Annotated[Path | None, Parameter(help="Write the result to this file.")] = None

    @property
    def targets(self) -> tuple[Path, ...]:
        """The files to be written."""
        return () if self.out is None else (self.out,)

    def check(self, suffixes: Sequence[str], inputs: Iterable[str | Path | None] = ()) -> None:
        """Fail before any work is done where a result could not be written; raises `InputError`.

        Without ``suffixes`` a file may have any.
        """
        if self.out is not None and suffixes and self.out.suffix.lower() not in suffixes:
            raise InputError(
                self.out, f"found the suffix {self.out.suffix!r} for --out, expected {' or '.join(suffixes)}"
            )
        for path in self.targets:
            if path.is_dir() or not path.parent.is_dir():
                raise InputError(path, "cannot be written, expected a file name in a folder that exists")
        self.spare(inputs)

    def spare(self, inputs: Iterable[str | Path | None]) -> None:
        """Fail where a result would take the place of an input; raises `InputError`."""
        resolved = {realpath(path) for path in inputs if path is not None}
        for path in self.targets:
            if realpath(path) in resolved:
                raise InputError(path, "is an input, expected another file")


@Parameter(name="*")
@dataclass(frozen=True)
class ReportOutput(FileOutput):
    """The options of a command that writes a file and a report."""

    report: Annotated[Path | None, Parameter(help="Write a self-contained HTML report.")] = None

    @property
    def targets(self) -> tuple[Path, ...]:
        """The files to be written."""
        return super().targets if self.report is None else (*super().targets, self.report)

    def check(self, suffixes: Sequence[str], inputs: Iterable[str | Path | None] = ()) -> None:
        """Fail before any work is done where a result could not be written; raises `InputError`."""
        if self.report is not None and self.report.suffix.lower() not in (".html", ".htm"):
            raise InputError(
                self.report, f"found the suffix {self.report.suffix!r} for --report, expected .html"
            )
        super().check(suffixes, inputs)


StoreOption = Annotated[
    str | None,
    Parameter(
        help="Folder of the store, or URL of its database; INERCAL_STORE, or the user's own, if absent."
    ),
]


InstrumentOption = Annotated[
    str | None, Parameter(help='The instrument: its serial number, or "maker, model, serial".')
]


@Parameter(name="*")
@dataclass(frozen=True)
class ResultOutput(ReportOutput):
    """The options of a command whose result can be kept in a store."""

    keep: Annotated[bool, Parameter(help="Keep the result, its files and report in the store.")] = False
    store: StoreOption = None
    instrument: InstrumentOption = None

    def check(self, suffixes: Sequence[str], inputs: Iterable[str | Path | None] = ()) -> None:
        """Fail before any work is done where a result could not be written or kept; raises `InputError`."""
        super().check(suffixes, inputs)
        if self.keep:
            from inercal.laboratory.store import open_store

            open_store(self.store)
            return
        for option, text in (("--store", self.store), ("--instrument", self.instrument)):
            if text is not None:
                raise InputError(option, "found without --keep, expected with it")


def study_in(
    kind: str, path: Path, overrides: Iterable[str] | None, output: FileOutput
) -> tuple[StudyOfFile, float]:
    """A study, whose files the output is to spare, and the time that reading took [s]."""
    from inercal.faces.python.study import read_study

    clock = time.perf_counter()
    study = read_study(kind, path, overrides or ())
    output.spare(study.files)
    return study, time.perf_counter() - clock


def whole_number(kind: object, tokens: Sequence[Token]) -> int:
    """The whole number typed for an option; raises `InputError`, for 1.5 too."""
    (typed,) = tokens
    try:
        return int(typed.value)
    except ValueError as error:
        raise InputError(typed.keyword, f"found {typed.value!r}, expected a whole number") from error


def _last_words(path: Path, text: str) -> None:
    """Put the progress into a file, in the place of what was there."""
    with suppress(OSError):
        path.write_text(printable(text), encoding="utf-8")


WorkersOption = Annotated[
    int | None,
    Parameter(
        converter=whole_number,
        help="Processes at work. If absent, a search has one, many runs or units one for each processor.",
    ),
]
ClusterOption = Annotated[
    str | None,
    Parameter(
        help="Cluster of dask to work on: tcp://host:8786, a scheduler file, or local. The extra `cluster` is needed."
    ),
]

CheckpointOption = Annotated[
    Path | None, Parameter(help="Save here what is done, and go on from it where it exists.")
]


def count_of(workers: int | None, cluster: str | None) -> int:
    """Number of processes, threads or workers of a local cluster by the two options; raises `InputError`."""
    if workers is not None and workers < 1:
        raise InputError("--workers", f"found {workers}, expected 1 or more")
    if workers is not None and cluster not in (None, "local"):
        raise InputError("--workers", f"found beside the cluster {cluster}, expected only one of them")
    return workers or os.cpu_count() or 1


def place_of(workers: int | None, cluster: str | None) -> Executor:
    """The place in which starts or positions are computed, by the two options; raises `InputError`."""
    from inercal.foundation.computing.cluster import place

    return place(1 if workers is None and cluster is None else count_of(workers, cluster), cluster)


@contextmanager
def working(output: OutputOptions) -> Iterator[Callable[[str], None]]:
    """A callback (text) that shows progress on a terminal and leaves nothing; elsewhere see `_once`."""
    if PROGRESS in os.environ:
        yield partial(_last_words, Path(os.environ[PROGRESS]))
        return
    if output.quiet or not sys.stderr.isatty():
        yield _once(output)
        return
    from rich.console import Console

    with Console(stderr=True).status("") as status:
        yield status.update


def _once(output: OutputOptions) -> Callable[[str], None]:
    """A callback (text) that says one line in a log, and only of what lasts."""
    due = time.perf_counter() + _LONG

    def say(text: str) -> None:
        nonlocal due
        if time.perf_counter() > due:
            due = float("inf")
            output.say_now(f"still at it: {text}")

    return say


@contextmanager
def reading(output: OutputOptions, what: str = "reading") -> Iterator[Callable[[int, int], None] | None]:
    """A callback (done, total) that shows a bar on a terminal once a second has passed; elsewhere see `_once`."""
    if PROGRESS in os.environ:
        path = Path(os.environ[PROGRESS])
        yield lambda done, total: _last_words(path, f"{what}, {100 * done / max(total, 1):.0f} %")
        return
    if output.quiet:
        yield None
        return
    if not sys.stderr.isatty():
        say = _once(output)
        yield lambda done, total: say(f"{what}, {done} of {total}")
        return
    began = time.perf_counter()
    bar: Any = None
    task: Any = None

    def advance(done: int, total: int) -> None:
        nonlocal bar, task
        if bar is None and time.perf_counter() - began > 1.0:
            from rich.console import Console
            from rich.progress import Progress

            bar = Progress(console=Console(stderr=True), transient=True)
            bar.start()
            task = bar.add_task(what, total=total)
        if bar is not None:
            bar.update(task, completed=done, total=total)

    try:
        yield advance
    finally:
        if bar is not None:
            bar.stop()
