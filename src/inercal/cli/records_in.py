"""Recordings in: the options of commands that read them, their column maps, and what is recognised without one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from inercal.cli.options import FileOutput, reading
from inercal.foundation.errors import InputError

if TYPE_CHECKING:
    from inercal.foundation.records.maps import RecordMap
    from inercal.foundation.records.record import Record

Files = Annotated[
    list[Path], Parameter(help="Recordings; several files with distinct channels are one record.")
]
RUN_FILES = Parameter(
    help="Recordings; files with distinct channels are one record, with the same ones repeat runs."
)
RunFiles = Annotated[list[Path], RUN_FILES]
MapFile = Annotated[
    Path | None, Parameter(name="--map", help="Column map (TOML) for files without canonical headers.")
]


Answers = Annotated[
    list[str] | None,
    Parameter(
        name="--answer",
        help="Answer to what a recording does not say: gyro=deg/s, rate=95 Hz, gyro=none. May be repeated.",
    ),
]


@Parameter(name="*")
@dataclass(frozen=True)
class Span:
    """The options of a command that reads a recording: which part of it, and what it does not say itself."""

    begin: Annotated[
        str | None, Parameter(help='Leave out what comes before, such as "10 s" after the first stamp.')
    ] = None
    end: Annotated[
        str | None, Parameter(help='Leave out what comes after, such as "30 min" after the first stamp.')
    ] = None
    answers: Answers = None

    def check(self) -> None:
        """Refuse a time that is none, before anything is read; raises `InputError`."""
        from inercal.foundation.records.record import seconds

        for option, text in self.given.items():
            seconds(text, option)

    @property
    def given(self) -> dict[str, str]:
        """The options that were given."""
        both = {"--begin": self.begin, "--end": self.end}
        return {option: text for option, text in both.items() if text is not None}

    def of(self, record: Record) -> Record:
        """The part of a record; raises `InputError`, naming the options, where nothing lies within."""
        try:
            return record.between(self.begin, self.end)
        except InputError as error:
            raise InputError(", ".join(self.given), error.message) from error

    def refuse(self, beside: str) -> None:
        """Refuse the options where there is no recording to take a part of; raises `InputError`."""
        for option in self.given:
            raise InputError(option, f"found with {beside}, expected a recording")
        if self.answers:
            raise InputError("--answer", f"found with {beside}, expected a recording")


def read_record(
    files: Sequence[Path],
    map_file: Path | None,
    output: FileOutput,
    span: Span = Span(),
    with_guess: bool = False,
) -> Record:
    """Read recordings, with a progress bar where it takes long, and take the part that is asked for.

    Without a map, columns are recognised where the headers do not say what they are; a guess among them is refused,
    but for a look ``with_guess``.
    """
    from inercal.foundation.records.read import read

    span.check()
    record_map = map_of_files(files, map_file, span, with_guess=with_guess)
    return _read(lambda *given: [read(*given)], files, record_map, output, span)[0]


def read_repeats(
    files: Sequence[Path],
    map_file: Path | None,
    output: FileOutput,
    span: Span = Span(),
    counted: bool = False,
    how: Mapping[str, Any] | None = None,
) -> list[Record]:
    """As `read_record`, but files with the same channels are the records of repeat runs.

    ``counted``: rows need no times, as means of poses. ``how`` columns are recognised: options of
    `inercal.foundation.records.recognise.map_text.recognised`.
    """
    from inercal.foundation.records.read import read_runs

    span.check()
    record_map = map_of_files(files, map_file, span, how)
    return _read(partial(read_runs, counted=counted), files, record_map, output, span)


def _read(
    read: Callable[..., list[Record]],
    files: Sequence[Path],
    record_map: RecordMap | None,
    output: FileOutput,
    span: Span,
) -> list[Record]:
    """Records by one of the readers, and the part of each that is asked for; says what was taken for what."""
    with reading(output) as progress:
        records = read(files, record_map, progress)
    if record_map is not None and not record_map.written:
        for sensor, words in record_map.taken.items():
            output.say(f"{sensor}: {words}")
    output.spare(source.path for record in records for source in record.sources)
    return [span.of(record) for record in records]


def map_in(map_file: Path | None, answers: Sequence[str] = (), with_guess: bool = False) -> RecordMap | None:
    """The column map of a file that was named, None without one.

    Raises `inercal.foundation.errors.MapError`, unless ``with_guess`` also for one with a guess that nobody answered.
    """
    if map_file is None:
        return None
    from inercal.foundation.records.maps import answers_of, read_map  # slow to load, for it brings a checker

    record_map = read_map(map_file).answered(answers_of(answers))
    if not with_guess:
        record_map.refuse_guess()
    return record_map


def map_of_files(
    files: Sequence[Path],
    map_file: Path | None,
    span: Span,
    how: Mapping[str, Any] | None = None,
    with_guess: bool = False,
) -> RecordMap | None:
    """The map of recordings: that of the file, else what is recognised; None where they say themselves what they hold.

    Raises as `map_in`, and `inercal.foundation.errors.RecordError`.
    """
    if map_file is not None:
        return map_in(map_file, span.answers or (), with_guess)
    from inercal.foundation.records.read import canonical_units

    if not span.answers and (not files or canonical_units(files) is not None):
        return None
    from inercal.foundation.records.maps import answers_of
    from inercal.foundation.records.recognise.map_text import (
        recognised,  # slow to load, for it brings a checker
    )

    record_map = recognised(files, answers_of(span.answers or ()), **(how or {}))
    if record_map is not None and not with_guess:
        record_map.refuse_guess()
    return record_map
