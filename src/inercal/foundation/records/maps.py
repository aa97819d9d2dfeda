"""Column maps: which column of which file is which channel, in which unit (TOML)."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, field_validator

from inercal.foundation._toml import Strict, check, read_toml
from inercal.foundation.errors import InputError, MapError
from inercal.foundation.records.channels import (
    Channel,
    Origin,
    TimeForm,
    is_channel,
    misfit,
    nearest,
    needs_unit,
)
from inercal.foundation.records.file_entry import FileEntry
from inercal.foundation.records.read.table import FileShare
from inercal.foundation.units import parse_quantity, parse_unit, shown

OPEN = "?"
"""The rate of a map that is still to be stated."""

ASIDE = "none"
"""The answer by which channels are left aside."""


class ColumnEntry(Strict):
    """``[columns.NAME]``: where the column is found, its unit, sign and scale."""

    origin: Any = Field(
        alias="from",
        description="column number from 0, name in the header, or the variable (channel path) and its column",
        examples=[1, "ax", ["imu", 0]],
    )
    unit: str | None = Field(
        default=None, description="unit of the numbers in the file, times scale; none for labels and indices"
    )
    sign: Literal[1, -1] = Field(default=1, description="-1 for a reversed axis")
    scale: float = Field(default=1.0, description="what the numbers are multiplied by")
    kind: Literal["rate", "increment"] = Field(
        default="rate", description="increment: angle or velocity gained since the last row"
    )
    grade: Literal["certain", "likely", "guess"] | None = Field(
        default=None, description="how sure a recognised entry is; a map with a guess does not run"
    )
    because: str = Field(default="", description="why a recognised entry is so")
    question: str = Field(default="", description="what a guess asks")

    @field_validator("origin")
    @classmethod
    def _is_origin(cls, value: object) -> Origin:
        """A column number, a header's name, or [variable, column]."""
        match value:
            case bool():
                pass
            case int() if value >= 0:
                return value
            case str() if value:
                return value
            case [str(variable), int(column)] if variable and column >= 0 and not isinstance(column, bool):
                return variable, column
        raise ValueError('expected a column number from 0, a header\'s name or ["variable", column]')

    @field_validator("scale")
    @classmethod
    def _is_scale(cls, value: float) -> float:
        """A scale of zero would leave nothing."""
        if value == 0:
            raise ValueError("expected a number other than 0")
        return value


class StampsEntry(Strict):
    """``[file.NAME.time]``: how the stamps of a file are read, where they differ from those of others."""

    stamps: Literal["year-first", "day-first", "month-first", "time of day"] | None = Field(
        default=None,
        description="order of dates with times in words; time of day alone goes on over midnight",
    )
    beside: Any = Field(
        default=None,
        description="column of what stands beside t: the time of day of a date, or the rest of whole seconds",
        examples=["Time"],
    )
    rest: str | None = Field(default=None, description="unit of the rest of whole seconds", examples=["ns"])
    wrap: float = Field(
        default=0.0, ge=0.0, description="number at which the counter t falls to zero", examples=[4294967296]
    )

    @property
    def of_t(self) -> TimeForm | None:
        """The stamps of the channel t, None where they are plain numbers."""
        if not (self.stamps or self.wrap or self.rest):
            return None
        rest = parse_unit(self.rest, "time.rest").factor if self.rest else 0.0
        beside = tuple(self.beside) if isinstance(self.beside, list) else self.beside
        return TimeForm(self.stamps or "", beside, rest, self.wrap)


class TimeEntry(StampsEntry):
    """``[time]``: the sample rate of files without a time column, or whose stamps can't be trusted."""

    rate: str | None = Field(
        default=None,
        description="sample rate, for files without a time column, perhaps with its standard uncertainty",
        examples=["100.00(1) Hz"],
    )
    ignore: bool = Field(default=False, description="take the rate in the place of stamps not to be trusted")


class NamedFileEntry(FileEntry):
    """``[file.NAME]``: one of several files, or of the clocks of one, with its own layout and columns."""

    path: str = Field(min_length=1, description="the file, beside the map")
    columns: dict[str, ColumnEntry] = Field(min_length=1, description="its channels, each a table as above")
    time: StampsEntry = Field(
        default=StampsEntry(), description="how its stamps are read, if not as `[time]` says"
    )


class MapEntry(Strict):
    """A whole map file, less its ``[file.NAME]`` tables."""

    columns: dict[str, ColumnEntry] = Field(default_factory=dict, description="the channels, by name")
    time: TimeEntry = Field(default=TimeEntry(), description="the sample rate, where stamps do not give it")
    file: FileEntry = Field(default=FileEntry(), description="how the file is laid out")


@dataclass(frozen=True)
class RecordMap:
    """A column map, checked.

    ``parts`` holds the plain ``[columns]`` (its name is empty) and each ``[file.NAME]``; ``rate`` is the
    sample rate [Hz] of ``[time]`` or None, ``rate_u`` its relative standard uncertainty, and ``ignore_time`` asks to
    use it in place of any time column. One that is not ``written`` was recognised as the files were read.
    """

    path: Path
    parts: tuple[FileShare, ...]
    rate: float | None = None
    ignore_time: bool = False
    rate_u: float = 0.0
    written: bool = True

    @property
    def channels(self) -> Iterator[Channel]:
        """The channels of all parts."""
        return (channel for part in self.parts for channel in part.channels or ())

    @property
    def taken(self) -> dict[str, str]:
        """For each sensor that was recognised the columns that it is in, their unit, the grade and the reason."""
        said: dict[str, list[Channel]] = {}
        for channel in self.channels:
            if channel.grade:
                said.setdefault(channel.sensor, []).append(channel)
        return {sensor: _in_words(channels) for sensor, channels in said.items()}

    def answered(self, answers: Mapping[str, str]) -> RecordMap:
        """The map with a unit, or ``none``, in place of that of a sensor or channel, and ``rate`` as the sample rate.

        Raises `InputError` for an answer to nothing that there is.
        """
        there = {name for channel in self.channels for name in (channel.name, channel.sensor)}
        check_answers(answers, there)
        rate, rate_u = self.rate, self.rate_u
        if "rate" in answers:
            rate, rate_u = _rate(TimeEntry(rate=answers["rate"]), "--answer")
        parts = tuple(
            replace(part, channels=tuple(_answered(part.channels or (), answers))) for part in self.parts
        )
        return replace(self, parts=parts, rate=rate, rate_u=rate_u)

    @property
    def guessed(self) -> set[str]:
        """The sensors whose entries are guesses."""
        return {channel.sensor for channel in self.channels if channel.grade == "guess"}

    def refuse_guess(self, spare: Collection[str] = ()) -> None:
        """Refuse a map with a guess, but for sensors to ``spare``, by its question and how to answer it; raises
        `MapError`."""
        for part in self.parts:
            for channel in part.channels or ():
                if channel.grade == "guess" and channel.sensor not in spare:
                    table = f"file.{part.name}.columns" if part.name else "columns"
                    asked = channel.question or f"Is the unit of {channel.name} {channel.unit.symbol}?"
                    answer = f"{channel.sensor}={channel.unit.symbol}"
                    aside = f"{channel.sensor}={ASIDE}"
                    edit = ", or correct the unit there and take out grade" if self.written else ""
                    raise MapError(
                        f"{self.path}: {table}.{channel.name}" if self.written else self.path,
                        f'{asked} Answer it with --answer "{answer}" or another unit, or leave it aside with '
                        f'"{aside}"{edit}',
                    )


def answers_of(texts: Iterable[str]) -> dict[str, str]:
    """Answers as typed, ``gyro=deg/s``, by what they are of; raises `InputError` for other texts."""
    answers = {}
    for text in texts:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not (name and equals and value):
            raise InputError("--answer", f"found {shown(text)}, expected NAME=VALUE such as gyro=deg/s")
        answers[name] = value
    return answers


def check_answers(answers: Mapping[str, str], there: Iterable[str]) -> None:
    """Refuse answers to other than a channel or sensor that is there, or the rate; raises `InputError`."""
    known = {*there, "rate"}
    for name in answers:
        if name not in known:
            raise InputError("--answer", f"found {shown(name)}, expected one of {', '.join(sorted(known))}")


def _answered(channels: Iterable[Channel], answers: Mapping[str, str]) -> Iterator[Channel]:
    """Channels with the units that were answered, less those left aside."""
    for channel in channels:
        answer = answers.get(channel.name, answers.get(channel.sensor))
        if answer is None:
            yield channel
        elif answer != ASIDE:
            unit = parse_unit(answer, f"--answer {channel.sensor}")
            if problem := misfit(channel.name, unit, channel.increment):
                raise InputError(f"--answer {channel.sensor}", problem)
            yield replace(channel, unit=unit, grade="certain", because="as answered", question="")


def _in_words(channels: list[Channel]) -> str:
    """Channels of one sensor in a line."""
    columns = ", ".join(
        json.dumps(list(channel.origin) if isinstance(channel.origin, tuple) else channel.origin)
        for channel in channels
    )
    first = channels[0]
    unit = f" in {first.unit.symbol}" if needs_unit(first.name) else ""
    return f"column{'s' if len(channels) > 1 else ''} {columns}{unit}, {first.grade}: {first.because}"


def read_map(path: str | Path) -> RecordMap:
    """Read a column map, a TOML file as in the reference of records.

    Raises `MapError`, naming the key, what was found and what was expected.
    """
    return map_of(read_toml(path, MapError), path)


def map_of(data: dict[str, Any], path: str | Path, written: bool = True) -> RecordMap:
    """A parsed map, of the file ``path`` or, not ``written``, of the recording there that it was recognised from.

    Raises `MapError`.
    """
    if data.keys() & {"site", "rig", "imu"} and not data.keys() & {"columns", "file"}:
        raise MapError(path, "found a study, which goes behind --study, expected a column map")
    table = data.get("file")
    named = {}
    if isinstance(table, dict):
        named = {key: value for key, value in table.items() if isinstance(value, dict)}
        data["file"] = {key: value for key, value in table.items() if key not in named}
    entry = check(MapEntry, data, path, MapError)
    if not entry.columns and not named:
        raise MapError(path, "columns: missing, expected at least one [columns.NAME] or [file.NAME]")
    of_t = entry.time.of_t
    plain = (FileShare(_channels(entry.columns, path, of_t), entry.file.laid_out),) if entry.columns else ()
    rate, rate_u = _rate(entry.time, path)
    parts = (*plain, *(_part(name, named[name], path, of_t) for name in named))
    files = sorted({Path(part.path) for part in parts if part.name})
    if len({file.name for file in files}) < len(files):
        names = ", ".join(map(str, files))
        raise MapError(path, f"file: found one file name in two folders in {names}, expected distinct ones")
    return RecordMap(Path(path), parts, rate, entry.time.ignore, rate_u, written)


def _part(name: str, table: Mapping[str, Any], path: object, of_t: TimeForm | None) -> FileShare:
    """One ``[file.NAME]``."""
    where = f"{path}: file.{name}"
    entry = check(NamedFileEntry, table, where, MapError)
    of_t = entry.time.of_t or of_t
    return FileShare(_channels(entry.columns, where, of_t), entry.laid_out, name, entry.path)


def _rate(entry: TimeEntry, path: object) -> tuple[float | None, float]:
    """The stated sample rate [Hz], and its relative standard uncertainty."""
    where = f"{path}: time.rate"
    if entry.rate is None or entry.rate.strip() == OPEN:
        if entry.ignore:
            raise MapError(where, 'missing, expected a rate such as "100 Hz" where time.ignore = true')
        return None, 0.0
    rate = parse_quantity(entry.rate, "frequency", where)
    if rate.value <= 0:
        raise MapError(where, f"found {shown(entry.rate)}, expected a rate above 0")
    return rate.value, rate.u / rate.value


def _channels(
    columns: Mapping[str, ColumnEntry], where: object, of_t: TimeForm | None
) -> tuple[Channel, ...]:
    """The channels of a ``columns`` table, names and units checked; the time has stamps ``of_t``."""
    channels = [
        _channel(name, entry, f"{where}: columns.{shown(name)[1:-1]}") for name, entry in columns.items()
    ]
    return tuple(replace(each, stamps=of_t) if each.name == "t" else each for each in channels)


def _channel(name: str, entry: ColumnEntry, where: str) -> Channel:
    """One ``[columns.NAME]``."""
    if not is_channel(name):
        raise MapError(where, f"unknown channel, {nearest(name)}")
    increment = entry.kind == "increment"
    if entry.unit is None and needs_unit(name):
        raise MapError(f"{where}.unit", 'missing, expected a unit such as "m/s^2", "deg/s", "s" or "count"')
    unit = parse_unit(entry.unit or "1", f"{where}.unit")
    problem = misfit(name, unit, increment)
    if problem:
        raise MapError(f"{where}.unit", problem)
    said = entry.grade or "", entry.because, entry.question
    return Channel(name, entry.origin, unit, entry.sign * entry.scale, increment, *said)
