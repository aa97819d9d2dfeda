"""Samples from a stream of lines, read as the same lines in a file are read.

The layout is found out from the header and the first row. A row is handed on as soon as its line has ended:
nothing is read ahead. A field that is no number becomes NaN, and a finding names its line.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from inercal.foundation.errors import InputError, MapError, RecordError
from inercal.foundation.findings import Finding
from inercal.foundation.inputs import Source
from inercal.foundation.records.channels import Channel, may_be_empty
from inercal.foundation.records.column import Column
from inercal.foundation.records.read.join import FileTable, check_present, conversion, row_rate
from inercal.foundation.records.read.layout import UNENDED, TextLayout, comment_marks, find_layout, is_rounded
from inercal.foundation.records.read.rewriting import is_rewritten
from inercal.foundation.records.read.table import FileShare, RawTable
from inercal.foundation.records.read.text import contents, locate
from inercal.foundation.records.record import Record
from inercal.foundation.records.stamps import beside

if TYPE_CHECKING:
    from inercal.foundation.records.maps import RecordMap

_BOM = b"\xef\xbb\xbf"
_LONGEST = 1 << 20
_PATIENCE = 3
_SAID = 5


class StreamLine(NamedTuple):
    """A line: its bytes without the line end, its number from 1, and whether it has ended."""

    data: bytes
    number: int
    whole: bool

    @property
    def text(self) -> str:
        """UTF-8, else Latin-1."""
        try:
            return self.data.decode("utf-8")
        except UnicodeDecodeError:
            return self.data.decode("latin-1")


class LineSource(Protocol):
    """Lines of bytes, one after the other."""

    def readline(self, size: int = -1, /) -> bytes:
        """The next line, or at most ``size`` bytes of it; empty at the end."""


class Sample(NamedTuple):
    """A row: its number from 0, its time [s], the values in the order of the record's columns, and its label;
    ``wrong``: it had a time, which is NaN for it was wrong."""

    row: int
    t: float
    values: list[float]
    label: str
    wrong: bool = False


class _Field(NamedTuple):
    """Column of a value in a row, and its factors, applied one after the other."""

    name: str
    column: int
    factors: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class _Fields:
    """Fields of a row: ``time`` (None where rows are counted at ``rate`` [Hz]), values, and labels."""

    layout: TextLayout
    time: _Field | None
    rate: float
    fields: tuple[_Field, ...]
    label: int | None
    record: Record


class Lines:
    """The rows of a stream, as `Sample`.

    Parameters
    ----------
    stream : binary file
        Lines of text, under a canonical header unless there is a map.
    where : str
        Name of the stream in errors.
    record_map : RecordMap or None
        The columns of one file. Increments need its ``[time] rate``, for the median interval of a stream is
        not known before its end.
    say : callable
        Told of rows and values that could not be read, and of stamps that are wrong, repeat or run backward: the
        first few of a kind as they come, the number of all others by `close`.

    Raises
    ------
    RecordError, MapError, QuantityError
        As in reading a file, from the first rows alone. The first row after a header may be cut, as where a
        stream is joined in the middle.
    """

    def __init__(
        self, stream: LineSource, where: str, record_map: RecordMap | None, say: Callable[[Finding], None]
    ) -> None:
        self._stream, self.where, self._say = stream, where, say
        self._number = 0
        self._flaws: Counter[tuple[str, str]] = Counter()
        self._t, self._odd = math.nan, ""
        self._first: Collection[str] = ()
        self._last: Collection[str] = ()
        self._waiting: list[tuple[str, int]] = []
        self._form, self._held = self._begin(record_map)
        self._layout = self._form.layout
        own = [*self._form.fields, *([] if self._form.time is None else [self._form.time])]
        self._columns = {field.column for field in own}

    @property
    def record(self) -> Record:
        """The columns that the samples have, without samples."""
        return self._form.record

    @property
    def stamped(self) -> bool:
        """True if the stream has a time column."""
        return self._form.time is not None

    @property
    def labelled(self) -> bool:
        """True if the rows have labels."""
        return self._form.label is not None

    @property
    def settings(self) -> Mapping[str, object]:
        """All that decides the numbers of the samples: a state that has a fingerprint."""
        form = self._form
        units = {name: column.unit.symbol for name, column in form.record.columns.items()}
        columns = [f"{field.name} [{units.get(field.name)}] {field.factors}" for field in form.fields]
        return {
            "columns": ", ".join(columns),
            "time": repr(form.time and form.time.factors),
            "rate": form.rate,
        }

    def leave_unsaid(self, first: Collection[str], last: Collection[str]) -> None:
        """Say nothing of missing values that are not needed: of channels in the first row of the record, or in the
        last."""
        self._first, self._last = first, last

    def next(self) -> StreamLine | None:
        """The next line that holds a row, None at the end; waits for it."""
        if self._held:
            return self._held.pop(0)
        while (line := self._read()) is not None:
            if self._layout.is_row(line.text):
                return line
        return None

    def sample(self, line: StreamLine, row: int) -> Sample:
        """The sample in a line, as row ``row`` of the record."""
        text, form = line.text, self._form
        for waiting in self._waiting:  # of a row that was not the last
            self._flaw("nan", *waiting)
        self._waiting = []
        self._layout = self._layout.settled([text])  # the first row may hold whole numbers alone
        fields = self._layout.fields(text)
        bad = fields is None
        t, values = math.nan, [math.nan] * len(form.fields)
        if fields is not None:
            numbers = [self._layout.number(fields[field.column]) for field in form.fields]
            for field, value in zip(form.fields, numbers, strict=True):
                if value is not None and is_rounded(fields[field.column], value):
                    self._flaw(
                        "resolution",
                        f"{field.name}: whole number beyond 2^53, rounded to 53 bits",
                        line.number,
                    )
            stamp = 0.0 if form.time is None else self._layout.number(fields[form.time.column])
            bad = stamp is None or None in numbers
            t = self._value(form.time, stamp, bad, line) if form.time is not None else t
            values = [
                self._value(field, value, bad or (row == 0 and field.name in self._first), line)
                for field, value in zip(form.fields, numbers, strict=True)
            ]
        if bad:
            self._bad_row(line)
        elif not line.whole and fields is not None and self._layout.width - 1 in self._columns:
            self._flaw("truncated", f"{UNENDED} may be cut", line.number)
        label = fields[form.label].strip() if fields is not None and form.label is not None else ""
        return Sample(row, row / form.rate if form.time is None else t, values, label)

    def say_order(self, t: float, line: int) -> None:
        """Say of a sound stamp [s] that it runs backward; of stamps that repeat the first is said."""
        if math.isnan(t):
            return
        odd = "duplicate_time" if t == self._t else "backward_time" if t < self._t else ""
        if odd == "backward_time":
            self._flaw(odd, "t: backward stamp", line)
        elif odd and odd != self._odd:
            self._flaw(odd, "t: repeated stamp", line)
        self._t, self._odd = t, odd

    def say_wrong(self, t: float, neighbours: Sequence[float], line: int) -> None:
        """Say that a stamp [s] is wrong, as the sound ones beside it show."""
        self._flaw("outlying_time", "t: wrong stamp set aside", line, f": {beside(t, neighbours)}")

    def close(self) -> None:
        """Give the number of findings that were left unsaid."""
        for (code, text), count in self._flaws.items():
            if count > _SAID:
                self._say(Finding(code, f"{text}: {count - _SAID} more"))

    def _value(self, field: _Field, value: float | None, silent: bool, line: StreamLine) -> float:
        """A value in its unit; NaN where there is none, which is said unless ``silent``."""
        if value is None or not math.isfinite(value):
            text = f"{field.name}: missing value"
            silent = silent or may_be_empty(field.name)
            if field.name in self._last and not silent:
                self._waiting.append((text, line.number))
            elif not silent:
                self._flaw("nan", text, line.number)
            return math.nan
        for factor in field.factors:
            value *= factor
        return value

    def _bad_row(self, line: StreamLine) -> None:
        """Say that a row could not be read."""
        if line.whole:
            text = f"row other than {self._layout.width} fields with numbers, left as NaN"
            self._flaw("bad_row", text, line.number)
        else:
            self._flaw("truncated", "the stream ends within a row", line.number)

    def _flaw(self, code: str, text: str, line: int, more: str = "") -> None:
        """Give a finding on the line of a number, unless it has been given too often."""
        self._flaws[code, text] += 1
        if self._flaws[code, text] <= _SAID:
            self._say(Finding(code, f"{text}{more}", f"line {line}"))

    def _read(self) -> StreamLine | None:
        """The next line of any content."""
        data = self._stream.readline(_LONGEST)
        if not data:
            return None
        self._number += 1
        if self._number == 1:
            data = data.removeprefix(_BOM)
        if len(data) == _LONGEST and not data.endswith(b"\n"):
            raise RecordError(
                self.where, f"line {self._number}: longer than {_LONGEST} bytes, expected lines of text"
            )
        return StreamLine(data.rstrip(b"\r\n"), self._number, data.endswith(b"\n"))

    def _begin(self, record_map: RecordMap | None) -> tuple[_Fields, list[StreamLine]]:
        """Fields of a row, from as few rows as show them, and the rows read for that."""
        part, path = _part(record_map), Path(self.where)
        marks, rows = comment_marks(part.options), list[StreamLine]()
        problem: InputError = RecordError(path, "ended without a row, expected a header and lines of numbers")
        while len(rows) < _PATIENCE and (line := self._read()) is not None:
            text = line.text.strip()
            if self._number <= part.options.skip or not text or text.startswith(marks):
                continue
            if b"\r" in line.data:
                raise RecordError(
                    path,
                    f"line {line.number}: found a carriage return in it, expected lines that end with a line feed",
                )
            rows.append(line)
            # the first row or header, and the newest: one between may be cut; empty lines keep the numbers right
            lines = [""] * (rows[0].number - 1) + [row.text for row in rows[:1] + rows[1:][-1:]]
            try:
                layout = find_layout(lines, part.options, path)
                form = _form(layout, locate(part.channels, layout, lines, path), path, part, record_map)
            except InputError as error:
                problem = error
            else:
                return form, rows[1:] if layout.header else rows
        raise problem


def _part(record_map: RecordMap | None) -> FileShare:
    """The part of a map that a stream is read by."""
    if record_map is None:
        return FileShare(channels=None)
    if len(record_map.parts) != 1:
        raise MapError(
            record_map.path,
            f"found columns of {len(record_map.parts)} files, expected those of one for a stream",
        )
    (part,) = record_map.parts
    if is_rewritten(part.options) or any(channel.stamps for channel in part.channels or ()):
        raise MapError(
            record_map.path,
            "found lines or stamps in words, expected rows of numbers and plain times for a stream",
        )
    if not record_map.ignore_time:
        return part
    return replace(part, channels=tuple(channel for channel in part.channels or () if channel.name != "t"))


def _form(
    layout: TextLayout,
    indices: Mapping[Channel, int],
    path: Path,
    part: FileShare,
    record_map: RecordMap | None,
) -> _Fields:
    """Fields of a row, checked as where files are joined."""
    source = Source(str(path), "")
    if record_map is not None:
        table = RawTable(tuple(indices), {}, contents(layout), 0)
        check_present([FileTable(path, source, part, table)], record_map.path)
    rate = None if record_map is None else record_map.rate
    if rate is None and any(channel.increment for channel in indices):
        where = f"{record_map.path if record_map else path}: time.rate"
        raise MapError(where, 'missing, expected a rate such as "100 Hz" for increments in a stream')
    interval = 0.0 if rate is None else 1.0 / rate
    time, label, fields, columns, t = None, None, [], {}, np.empty(0)
    for channel, index in indices.items():
        factors, unit = conversion(channel, interval)
        field = _Field(channel.name, index, tuple(factor for factor in factors if factor != 1.0))
        if channel.name == "label":
            label = index
        elif channel.name == "t":
            time = field
        else:
            fields.append(field)
            columns[channel.name] = Column(channel.name, unit, t, t, source, increment=channel.increment)
    if not columns:
        raise RecordError(path, "found a time column alone, expected a channel")
    counted_at = math.nan if time is not None else row_rate(tuple(indices), rate, path)
    return _Fields(layout, time, counted_at, tuple(fields), label, Record(columns, (), (source,)))
