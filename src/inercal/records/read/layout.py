"""The layout of a text file: what parts its fields, how decimals are marked, where the numbers begin."""

from __future__ import annotations

import csv
import math
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

from inercal.errors import RecordError
from inercal.records.read.table import LARGEST, FileOptions

_SAMPLE = 100
_DELIMITERS = ("\t", ";", ",", None)
_DECIMAL_COMMA = re.compile(r"\s*[+-]?\d+,\d+(?:[eE][+-]?\d+)?\s*")
_WHOLE = re.compile(r"\s*[+-]?\d+\s*")
_MISSING = frozenset({"", "nan", "na", "n/a", "null", "none"})


@dataclass(frozen=True)
class Layout:
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
        """The number a field holds, NaN where it is empty; None if it is no number."""
        return parse_number(text.replace(",", ".") if self.decimal == "," else text)

    def settled(self, lines: Iterable[str]) -> Layout:
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
        value = None if "_" in text else float(text)
    except ValueError:
        value = math.nan if text.lower() in _MISSING else None
    return value if value is None or abs(value) < LARGEST else math.nan


def is_rounded(text: str, value: float) -> bool:
    """True for a whole number, read as ``value``, that float64 cannot hold."""
    return 2.0**53 <= abs(value) < math.inf and _WHOLE.fullmatch(text) is not None and int(text) != value


def find_layout(lines: Sequence[str], options: FileOptions, path: Path) -> Layout:
    """Find out from the first lines of a file what ``options`` leave open.

    Raises
    ------
    RecordError
        There are no rows, or the header does not fit them.
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
    layout = Layout(delimiter, decimal, comments, width, (), 0, index)
    names = _names(line, delimiter)
    if not is_header(layout, names):
        return layout
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
    return Layout(delimiter, decimal, comments, width, names, index + 1, index + 1)


def comment_marks(options: FileOptions) -> tuple[str, ...]:
    """The text with which a line begins that the reader passes over."""
    if options.comment is None:
        return ("#", "%")
    return (options.comment,) if options.comment else ()


def is_header(layout: Layout, fields: Sequence[str]) -> bool:
    """True if most of the fields are words rather than numbers."""
    words = sum(layout.number(field) is None for field in fields)
    return 2 * words > len(fields)


def _names(line: str, delimiter: str | None) -> tuple[str, ...]:
    """The names of a header line; blanks within ``t [s]`` part nothing."""
    if delimiter is None:
        return tuple(re.findall(r"[^\s\[]+(?:\s*\[[^\]]*\])?", line))
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
