"""Lines of a text file, plain or compressed, and their layout: delimiter, decimal mark, first row of numbers."""

from __future__ import annotations

import codecs
import csv
import gzip
import math
import os
import re
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from io import BufferedReader
from itertools import islice
from pathlib import Path

from inercal.foundation.errors import RecordError
from inercal.foundation.records.read.limits import HEADER, LINE, check_unpacked, unpacked
from inercal.foundation.records.read.table import LARGEST, FileOptions

UNENDED = "no line end follows: the last number"
"""Beginning of the finding on a last line that may have had more digits."""

_BLOCK = LINE
_GZIP = b"\x1f\x8b"
_BOM = b"\xef\xbb\xbf"
_UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


@dataclass(frozen=True)
class Block:
    """Whole lines, as bytes that end with a ``mark``; ``first`` is the number of the first line, counted from 1.

    The last block of a file is ``cut`` if it does not end with a line end, and ``early`` if the compressed
    data ends before its end mark.
    """

    data: bytes = field(repr=False)
    mark: bytes
    first: int = 1
    cut: bool = False
    early: bool = False

    @cached_property
    def lines(self) -> list[str]:
        """The lines as text: UTF-8, else Latin-1."""
        try:
            text = self.data.decode("utf-8")
        except UnicodeDecodeError:
            text = self.data.decode("latin-1")
        if "\r" in text:
            text = text.replace("\r" if self.mark == b"\r" else "\r\n", "\n")
        lines = text.split("\n")
        return lines if self.cut else lines[:-1]

    @cached_property
    def count(self) -> int:
        """The number of lines."""
        return self.data.count(self.mark) + self.cut

    def after(self, count: int) -> Block:
        """The block without its first ``count`` lines."""
        begin = 0
        for _ in range(count):
            begin = self.data.find(self.mark, begin) + 1 or len(self.data)
        return self.part(begin, len(self.data), self.first + count)

    def part(self, begin: int, end: int, first: int) -> Block:
        """The lines from one byte to another, the first of which has the number ``first``."""
        cut = self.cut and begin < end == len(self.data)
        return replace(self, data=self.data[begin:end], first=first, cut=cut)

    @property
    def last(self) -> int:
        """Number of the last line."""
        return self.first + self.count - 1


def blocks(file: BufferedReader, path: Path) -> Iterator[Block]:
    """Blocks of lines of an open file, at least one; raises `RecordError` if it can't be text.

    Lines end with a line feed, or with a carriage return where no line feed is in the first block. UTF-16 is told by
    its mark, and becomes UTF-8.
    """
    packed = file.peek(2)[:2] == _GZIP
    stream = gzip.GzipFile(fileobj=file) if packed else file
    first, early, held, read = 1, False, bytearray(), 0
    mark = b""
    try:
        wide = stream.peek(2)[:2] in _UTF_16
        decoder = codecs.getincrementaldecoder("utf-16")("replace") if wide else None
        while piece := stream.read1(_BLOCK):
            if decoder is not None:
                piece = decoder.decode(piece).encode()
            read += len(piece)
            if packed and read > unpacked(0):
                check_unpacked(path, read, os.fstat(file.fileno()).st_size)
            held += piece
            if len(held) < _BLOCK:
                continue
            mark = mark or _line_end(held)
            end = held.rfind(mark) + 1
            if end == 0:
                raise RecordError(
                    path, f"line {first}: longer than {len(held)} bytes, expected lines of text"
                )
            block = Block(_unmarked(held[:end], first), mark, first)
            yield block
            first += block.count
            del held[:end]
    except EOFError:
        early = True
    except (gzip.BadGzipFile, zlib.error) as error:
        raise RecordError(path, f"compressed data is damaged after line {first} ({error})") from error
    if not held and first == 1:
        raise RecordError(path, "is empty, expected lines of numbers")
    if held or early:
        mark = mark or _line_end(held)
        data = _unmarked(held, first)
        yield Block(data, mark, first, bool(data) and not data.endswith(mark), early)


def _line_end(data: bytearray) -> bytes:
    """The mark at which lines end."""
    return b"\r" if b"\r" in data and b"\n" not in data else b"\n"


def _unmarked(data: bytearray, first: int) -> bytes:
    """The bytes without the mark with which a file may begin."""
    return bytes(data[len(_BOM) :] if first == 1 and data.startswith(_BOM) else data)


_SAMPLE = 100
_ENOUGH = 5
_DELIMITERS = ("\t", ";", ",", None)
_DECIMAL_COMMA = re.compile(r"\s*[+-]?\d+,\d+(?:[eE][+-]?\d+)?\s*")
_WHOLE = re.compile(r"\s*[+-]?0*(\d+)\s*")
_MISSING = frozenset({"", "nan", "na", "n/a", "null", "none"})


@dataclass(frozen=True)
class TextLayout:
    """Layout of the lines of a text file.

    ``delimiter`` None is any run of blanks; ``decimal`` is empty as long as no number has told; ``width`` is the
    number of fields of a row; ``header`` is empty where there is none and stands in line ``header_line``; ``first``
    is the index of the first line after it.
    """

    delimiter: str | None
    decimal: str
    comments: tuple[str, ...]
    width: int
    header: tuple[str, ...]
    header_line: int
    first: int

    def is_row(self, line: str) -> bool:
        """False for blank lines and comments."""
        text = line.strip()
        return bool(text) and not text.startswith(self.comments)

    def fields(self, line: str) -> list[str] | None:
        """The fields of a line, quotes taken off; None if they are more or fewer than those of a row."""
        fields = _split(line, self.delimiter)
        if len(fields) == self.width + 1 and not fields[-1].strip():
            fields.pop()
        return fields if len(fields) == self.width else None

    def number(self, text: str) -> float | None:
        """The number a field holds, NaN where it is empty; None if it is no number.

        A point among decimal commas may part thousands: ``1.000`` is no number there.
        """
        if self.decimal != ",":
            return parse_number(text)
        return None if "." in text else parse_number(text.replace(",", "."))

    def is_whole(self, text: str, before: Sequence[str]) -> bool:
        """True if the last number of a file, which no line end follows, is written to as many places as those before.

        Where these have no decimals, or not equally many, nothing tells, and the number may be cut.
        """
        mark = self.decimal or "."
        places = {len(each.strip().partition(mark)[2]) for each in before}
        return len(before) >= _ENOUGH and places == {len(text.strip().partition(mark)[2])} != {0}

    def settled(self, lines: Iterable[str]) -> TextLayout:
        """The layout with the decimal mark of the first of more lines that tells it, where none has told so far."""
        if self.decimal:
            return self
        for line in lines:
            if ("," in line or "." in line) and self.is_row(line):
                decimal = sniff_decimal([line], self.delimiter)
                if decimal:
                    return replace(self, decimal=decimal)
        return self


def parse_number(text: str) -> float | None:
    """The number of a text, NaN where it is empty, says so or is beyond `LARGEST`; None if it is no number."""
    text = text.strip()
    try:
        value = float(text) if text.isascii() and "_" not in text else None
    except ValueError:
        value = math.nan if text.lower() in _MISSING else None
    return value if value is None or abs(value) < LARGEST else math.nan


def is_rounded(text: str, value: float) -> bool:
    """True for a whole number, read as ``value``, that float64 cannot hold."""
    whole = _WHOLE.fullmatch(text) if 2.0**53 <= abs(value) < math.inf else None
    return whole is not None and int(whole[1]) != abs(value)


def find_layout(lines: Sequence[str], options: FileOptions, path: Path) -> TextLayout:
    """Find out from the first lines of a file what ``options`` leave open.

    Raises `RecordError` where there are no rows, or the header does not fit them.
    """
    comments = comment_marks(options)
    written = (
        (index, line)
        for index, line in enumerate(lines)
        if index >= options.skip and line.strip() and not line.strip().startswith(comments)
    )
    rows = list(islice(written, 3 * _SAMPLE))
    if not rows:
        raise RecordError(path, f"found no rows in {len(lines)} lines, expected lines of numbers")
    if binary := [index + 1 for index, line in rows if "\0" in line]:
        raise RecordError(path, f"line {binary[0]}: found a zero byte, expected text")
    sample = [line for _, line in rows[1:][-_SAMPLE:]] or [rows[0][1]]
    delimiter = _sniff_delimiter(sample, rows[0][1]) if options.delimiter is None else options.delimiter
    delimiter = None if delimiter == " " else delimiter
    decimal = options.decimal or sniff_decimal(sample, delimiter)
    width = Counter(len(_split(line, delimiter)) for line in sample).most_common(1)[0][0]

    index, line = rows[0]
    layout = TextLayout(delimiter, decimal, comments, width, (), 0, index)
    names = _names(line, delimiter)
    if not is_header(layout, names):
        return layout
    if len(line) > HEADER:
        raise RecordError(
            path, f"line {index + 1}: found a header of {len(line)} characters, expected at most {HEADER}"
        )
    if len(rows) == 1:
        raise RecordError(path, f"line {index + 1}: found a header and no row after it, expected numbers")
    if len(names) != width and not (
        len(names) == width - 1 and sample[-1].rstrip(" ").endswith(delimiter or " ")
    ):
        raise RecordError(
            path,
            f"line {index + 1}: found {len(names)} names over rows of {width} fields, expected as many "
            "(`skip` under [file] passes over lines before the header)",
        )
    return TextLayout(delimiter, decimal, comments, width, names, index + 1, index + 1)


def comment_marks(options: FileOptions) -> tuple[str, ...]:
    """The text with which a line begins that the reader passes over."""
    if options.comment is None:
        return ("#", "%")
    return (options.comment,) if options.comment else ()


def is_header(layout: TextLayout, fields: Sequence[str]) -> bool:
    """True if most of the fields are words rather than numbers."""
    words = sum(layout.number(field) is None for field in fields)
    return 2 * words > len(fields)


def _names(line: str, delimiter: str | None) -> tuple[str, ...]:
    """The names of a header line; blanks within ``t [s]`` part nothing."""
    if delimiter is None:
        return tuple(re.findall(r"[^\s\[]++(?:\s*+\[[^\[\]]*+\])?", line))
    return tuple(name.strip() for name in _split(line, delimiter))


def _split(line: str, delimiter: str | None) -> list[str]:
    """The fields of a line; quotes are taken off."""
    if '"' in line:
        try:
            return next(csv.reader([line.rstrip("\r")], delimiter=delimiter or " ", skipinitialspace=True))
        except csv.Error:
            return []
    return line.split(delimiter)


def _sniff_delimiter(sample: Sequence[str], first: str) -> str | None:
    """The first delimiter that parts most lines into the same number of fields, at least two.

    Those in the ``first`` line, which may be the header, go before others, which may stand in labels.
    """
    for delimiter in sorted(_DELIMITERS, key=lambda mark: mark is None or mark not in first):
        counts = Counter(len(_split(line, delimiter)) for line in sample)
        width, lines = counts.most_common(1)[0]
        if width > 1 and 2 * lines > len(sample):
            return delimiter
    return None


def sniff_decimal(sample: Sequence[str], delimiter: str | None) -> str:
    """A point if numbers such as 1.5 are there, else a comma if such as 1,5; nothing if whole numbers alone."""
    if delimiter == ",":
        return "."
    fields = [field for line in sample for field in _split(line, delimiter)]
    if any("." in field and parse_number(field) is not None for field in fields):
        return "."
    return "," if any(_DECIMAL_COMMA.fullmatch(field) for field in fields) else ""
