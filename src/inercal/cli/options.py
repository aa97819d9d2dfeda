"""What the commands share: their common options, messages, and results going out."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from inercal.errors import InputError

if TYPE_CHECKING:
    from inercal.records.record import Record

Files = Annotated[
    list[Path], Parameter(help="Recordings; several files with distinct channels are one record.")
]
MapFile = Annotated[
    Path | None, Parameter(name="--map", help="Column map (TOML) for files without canonical headers.")
]
StudyFile = Annotated[Path, Parameter(name="--study", help="Study file (TOML); `inercal new` writes one.")]
Overrides = Annotated[
    list[str] | None, Parameter(name="--set", help="Override one study key: key=value. May be repeated.")
]


@Parameter(name="*")
@dataclass(frozen=True)
class Output:
    """Where results go."""

    json: Annotated[bool, Parameter(help="Print one JSON object, and nothing else, on standard output.")] = (
        False
    )
    out: Annotated[Path | None, Parameter(help="Write the result to this file.")] = None
    report: Annotated[Path | None, Parameter(help="Write a self-contained HTML report.")] = None
    quiet: Annotated[bool, Parameter(help="No messages and no progress on standard error.")] = False

    def check(self, *suffixes: str) -> None:
        """Fail before any work is done where a result could not be written; raises `InputError`."""
        if self.out is not None and self.out.suffix.lower() not in suffixes:
            raise InputError(
                self.out, f"found the suffix {self.out.suffix!r} for --out, expected {' or '.join(suffixes)}"
            )
        if self.report is not None and self.report.suffix.lower() not in (".html", ".htm"):
            raise InputError(
                self.report, f"found the suffix {self.report.suffix!r} for --report, expected .html"
            )
        for path in (self.out, self.report):
            if path is not None and (path.is_dir() or not path.parent.is_dir()):
                raise InputError(path, "cannot be written, expected a file name in a folder that exists")

    def say(self, text: str) -> None:
        """A message for people, on standard error."""
        if not self.quiet:
            print(text, file=sys.stderr)

    def emit(self, data: dict[str, Any], text: str) -> None:
        """The result on standard output: the JSON object, or the text for people."""
        if self.json:
            print(json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False))
        elif text:
            print(text)


def read_record(files: Sequence[Path], map_file: Path | None, output: Output) -> Record:
    """Read recordings, with a progress bar where it takes long."""
    from inercal.records.maps import read_map
    from inercal.records.read import read

    record_map = None if map_file is None else read_map(map_file)
    with reading(output) as progress:
        return read(files, record_map, progress)


@contextmanager
def working(output: Output) -> Iterator[Callable[[str], None]]:
    """A callback (text) that says on a terminal what is being done, and leaves nothing behind."""
    if output.quiet or not sys.stderr.isatty():
        yield lambda _: None
        return
    from rich.console import Console

    with Console(stderr=True).status("") as status:
        yield status.update


@contextmanager
def reading(output: Output) -> Iterator[Callable[[int, int], None] | None]:
    """A callback (done, total) that shows a bar on standard error once a second has passed."""
    if output.quiet or not sys.stderr.isatty():
        yield None
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
            task = bar.add_task("reading", total=total)
        if bar is not None:
            bar.update(task, completed=done, total=total)

    try:
        yield advance
    finally:
        if bar is not None:
            bar.stop()
