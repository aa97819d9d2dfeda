"""Streams of the commands: their options, and an estimator run from lines to lines."""

from __future__ import annotations

import math
import sys
import tempfile
from collections.abc import Callable, Iterable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from os.path import realpath
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from inercal.cli import abandon_output
from inercal.cli.options import (
    CheckpointOption,
    FileOutput,
    OutputOptions,
    ReportOutput,
    ResultOutput,
    whole_number,
)
from inercal.cli.records_in import RUN_FILES, Span, map_in
from inercal.foundation.errors import InputError, RecordError, UsageError

if TYPE_CHECKING:
    from inercal.faces.stream.lines import Lines
    from inercal.faces.stream.run import Recursive, Saving

    Estimators = Callable[[Lines], Recursive[Any]]

_STANDARD_INPUT = "standard input"

StreamedFiles = Annotated[list[Path] | None, RUN_FILES]
StreamFile = Annotated[
    Path | None, Parameter(help="Recording, pipe or device to read lines from; standard input if absent.")
]


Every = Annotated[
    str | None, Parameter(help='Time from one line out to the next, such as "1 s"; each row if absent.')
]


def interval_of(every: str | None) -> float:
    """The interval [s] that `Every` states, 0 if absent; raises `InputError`."""
    from inercal.foundation.units import parse_quantity

    interval = 0.0 if every is None else parse_quantity(every, "time", "--every").value
    if every is not None and interval <= 0.0:
        raise InputError("--every", f"found {every}, expected a time above 0")
    return interval


@Parameter(name="*")
@dataclass(frozen=True)
class StreamOptions:
    """The options of a command that works on a stream."""

    checkpoint: CheckpointOption = None
    checkpoint_every: Annotated[
        int, Parameter(converter=whole_number, help="Rows from one save to the next; 1000 if absent.")
    ] = 1000

    after: Annotated[
        str | None,
        Parameter(help='Give no line up to this time, the stamp of the last one received, such as "12.4 s".'),
    ] = None

    @property
    def received(self) -> float:
        """Time [s] of the last line received, -inf if there is none; raises `InputError`."""
        from inercal.foundation.units import parse_quantity

        return -math.inf if self.after is None else parse_quantity(self.after, "time", "--after").value

    @property
    def saving(self) -> Saving | None:
        """The file that the state is saved in, and how often; None where nothing is saved."""
        from inercal.faces.stream.run import Saving

        return None if self.checkpoint is None else Saving(self.checkpoint, self.checkpoint_every)

    def check(self, output: OutputOptions, inputs: Iterable[Path | None]) -> None:
        """Fail before any work is done where lines or state could not be written; raises `InputError`."""
        given = {
            "--json": output.json,
            "--out": isinstance(output, FileOutput) and output.out is not None,
            "--report": isinstance(output, ReportOutput) and output.report is not None,
            "--keep": isinstance(output, ResultOutput) and output.keep,
        }
        for option in (name for name, there in given.items() if there):
            raise InputError(option, "found with a stream, expected its lines on standard output and no more")
        if self.received == math.inf:
            raise InputError("--after", f"found {self.after}, expected the time of a line")
        if self.checkpoint_every < 1:
            raise InputError("--checkpoint-every", f"found {self.checkpoint_every}, expected 1 or more rows")
        if self.checkpoint is None:
            return
        if realpath(self.checkpoint) in {realpath(path) for path in inputs if path is not None}:
            raise InputError(self.checkpoint, "is an input, expected another file for --checkpoint")
        try:
            with tempfile.TemporaryFile(dir=Path(realpath(self.checkpoint)).parent) as file:
                file.write(b"0")
        except OSError as error:
            raise InputError(self.checkpoint, f"cannot be written ({error.strerror or error})") from error


def streamed(files: list[Path] | None) -> Path | None:
    """The file that a stream is read from, None for standard input; raises `InputError` where several are named."""
    if files and len(files) > 1:
        raise InputError("--stream", f"found {len(files)} files, expected one or standard input")
    return files[0] if files else None


def recorded(
    command: str, files: list[Path] | None, options: StreamOptions, every: str | None = None
) -> list[Path]:
    """The recordings of a command that is not to read a stream.

    Raises `UsageError` where there are none, `InputError` for an option that only a stream has.
    """
    if not files:
        raise UsageError(f"{command}: FILES is missing, expected recordings, or --stream")
    for option, given in (
        ("--after", options.after is not None),
        ("--checkpoint", options != StreamOptions()),
        ("--every", every is not None),
    ):
        if given:
            raise InputError(option, "found without --stream, expected them together")
    return files


def stream_study(
    kind: str,
    files: list[Path] | None,
    study: Path,
    keys: list[str],
    every: str | None,
    map_file: Path | None,
    span: Span,
    options: StreamOptions,
    output: ResultOutput,
    prepare: Callable[..., Estimators] | None = None,
) -> Recursive[Any]:
    """Run the estimator of a study on a stream, and give it back; ``prepare`` stands for that of the system."""
    from inercal.faces.python.study import read_study

    replace(span, answers=None).refuse("a stream")
    file, interval = streamed(files), interval_of(every)
    options.check(output, (file, map_file, study))
    of = read_study(kind, study, keys)
    prepare = prepare or of.system.stream
    assert prepare is not None
    with of.at_fault():
        make = prepare(of.settings, interval, output.say, output.say_finding)
    made: list[Recursive[Any]] = []

    def estimator(lines: Lines) -> Recursive[Any]:
        with of.at_fault():
            made.append(make(lines))
        return made[-1]

    run_stream(estimator, file, map_file, output, options, span.answers or ())
    return made[-1]


def run_stream(
    estimator: Estimators,
    file: Path | None,
    map_file: Path | None,
    output: OutputOptions,
    options: StreamOptions,
    answered: Sequence[str] = (),
) -> None:
    """Run the estimator that is made for the columns of a stream, from its lines to lines on standard output.

    Without a map columns are recognised where the header does not say what they are. A reader that leaves ends it in
    order; the lines it did not take are given again after a restart.
    """
    from inercal.faces.stream.lines import Lines
    from inercal.faces.stream.run import run

    record_map = map_in(map_file, answered)
    settle_lines()
    with _opened(file) as stream:
        where = _STANDARD_INPUT if file is None else str(file)
        if map_file is None:
            from inercal.faces.stream.recognised import recognised_stream

            stream, record_map = recognised_stream(stream, where, answered)
            for sensor, words in ({} if record_map is None else record_map.taken).items():
                output.say(f"{sensor}: {words}")
        lines = Lines(stream, where, record_map, output.say_finding)
        try:
            run(estimator(lines), lines, _write, options.saving, output.say, options.received)
        except BrokenPipeError:
            abandon_output()
            output.say("the reader of standard output has left")


def settle_lines() -> None:
    """Write lines on standard output as in a file: UTF-8, and the same line ends everywhere."""
    if hasattr(sys.stdout, "reconfigure"):
        sys.stdout.reconfigure(encoding="utf-8", newline="\n")


def _opened(file: Path | None) -> Any:
    """The stream, as a context."""
    if file is None:
        if sys.stdin is None:
            raise RecordError(_STANDARD_INPUT, "found it closed, expected lines")
        return nullcontext(sys.stdin.buffer)
    try:
        return file.open("rb")
    except OSError as error:
        raise RecordError(
            file, f"cannot be read ({error.strerror or error}), expected a header and lines of numbers"
        ) from error


def _write(text: str) -> None:
    """A line on standard output, at once."""
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()
