"""Lines that are no rows of cells, as such: objects of JSON, documents, messages, and words before numbers.

Each line becomes a line of cells parted by commas, or an empty one, so that numbers of lines stay what they are.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import chain
from typing import Any

from inercal.foundation.records.read.layout import Block, TextLayout
from inercal.foundation.records.read.table import FileOptions

NUMBER = r"(?<![\w.^])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
"""A number, as a regular expression, that is no part of a word or a power."""

STAMP = (
    r"(?:\d{1,4}[-/.](?:\d{1,2}|[A-Za-z]{3})[-/.]\d{2,4}[ T_,]+)?\d{1,2}:\d{2}:\d{2}(?:[.,:]\d{1,9})?"
    r"(?:\s?[AaPp][Mm])?(?:Z|[+-]\d\d:?\d\d)?"
)
"""A time of day, perhaps with its date and zone, as a regular expression."""

PLACE = "{}"
"""The place of a number, or of a stamp, in a pattern."""

_BAD = "?"  # a line that begins as a row and is none
_CHECKSUM = re.compile(r"\*[0-9A-Fa-f]{2,8}$")

Rewrite = Callable[[str], list[str] | None]
"""The cells that a line completes, None where it completes no row."""


def is_rewritten(options: FileOptions) -> bool:
    """True for a file whose lines are no rows of cells."""
    return bool(options.lines or options.message or options.pattern)


def rewritten(stream: Iterable[Block], options: FileOptions, names: Sequence[str]) -> Iterator[Block]:
    """Blocks of lines as rows of cells; those of objects and documents have the columns of these ``names``."""
    rewrite = _rewrite(options, names)
    for block in stream:
        lines = [_line(rewrite(line)) for line in block.lines]
        data = "\n".join(lines) + ("" if block.cut else "\n")
        yield Block(data.encode(), b"\n", block.first, block.cut, block.early)


def layout_of(block: Block, names: Sequence[str]) -> TextLayout:
    """The layout of rewritten lines."""
    widths = Counter(line.count(",") + 1 for line in block.lines if line and line != _BAD)
    width = len(names) or (widths.most_common(1)[0][0] if widths else 1)
    return TextLayout(",", ".", (), width, tuple(names), 0, 0)


def with_layout(
    stream: Iterator[Block], options: FileOptions, names: Sequence[str]
) -> tuple[Block, Iterator[Block], TextLayout]:
    """The first block of rewritten lines, all others, and their layout."""
    blocks = rewritten(stream, options, names)
    head = next(blocks)
    return head, chain(blocks), layout_of(head, names)


def flat(value: object, name: str = "") -> dict[str, str]:
    """A nested object as one, its names joined by points and its lists numbered."""
    pairs: Iterable[tuple[str, object]]
    if isinstance(value, Mapping):
        pairs = [(f"{name}.{key}" if name else str(key), each) for key, each in value.items()]
    elif isinstance(value, list):
        pairs = [(f"{name}[{index}]", each) for index, each in enumerate(value)]
    else:
        return {name: "" if value is None else str(value)}
    return {key: text for inner, each in pairs for key, text in flat(each, inner).items()}


def json_object(line: str) -> Any:
    """The object of JSON in a line, perhaps of an array of them; None where there is none, or it is damaged."""
    text = line.strip()
    if not text.startswith(("{", "[{")):
        return None
    try:
        return json.loads(
            text.removeprefix("[").rstrip(",").removesuffix("]") if text[0] == "[" else text.rstrip(",]")
        )
    except (ValueError, RecursionError):
        return None


def documents() -> Callable[[str], dict[str, str] | None]:
    """A function of lines in order that gives each document, of keys indented by two blanks a level, as it ends."""
    held: dict[str, str] = {}
    path: list[str] = []

    def of(line: str) -> dict[str, str] | None:
        if line.strip() == "---":
            done = dict(held)
            held.clear()
            path.clear()
            return done or None
        if match := re.match(r"(\s*)(?:- )?([\w/]+):\s*(.*)", line):
            path[len(match[1]) // 2 :] = [match[2]]
            if match[3]:
                held[".".join(path)] = match[3].strip()
        return None

    return of


def fields_of(line: str) -> list[str]:
    """The fields of a message: its word, without marks, and what follows; a long header and a checksum left off."""
    body = _CHECKSUM.sub("", line.strip())
    head, _, data = body.rpartition(";")
    body = f"{head.split(',')[0]},{data}" if head and re.match(r"[%$#<]?[A-Z]+,", head) else body
    fields = [field.strip() for field in re.split(r"[,\t]" if "," in body or "\t" in body else r"\s+", body)]
    return [fields[0].lstrip("%$#").rstrip(":"), *fields[1:]]


def shape_of(line: str) -> str:
    """The pattern of a line: its words, with a place for each number."""
    return re.sub(r"\s+", " ", re.sub(rf"(?<![\w.]){STAMP}|{NUMBER}|\bnan\b", PLACE, line.strip()))


def _rewrite(options: FileOptions, names: Sequence[str]) -> Rewrite:
    """The function for the lines of a file."""
    if options.lines == "json":
        return lambda line: _of_object(line, names)
    if options.lines == "documents":
        document = documents()
        return lambda line: _named(document(line), names)
    if options.message:
        return lambda line: _of_message(line, options.message)
    return _of_pattern(options.pattern)


def _of_object(line: str, names: Sequence[str]) -> list[str] | None:
    """The cells of an object of JSON."""
    if not line.strip().startswith(("{", "[{")):
        return None
    found = json_object(line)
    return [_BAD] if found is None else _named(flat(found), names)


def _named(found: Mapping[str, str] | None, names: Sequence[str]) -> list[str] | None:
    """The cells of these names."""
    return None if found is None else [found.get(name, "") for name in names]


def _of_message(line: str, message: str) -> list[str] | None:
    """The cells of a message, its word the first."""
    if message not in line:
        return None
    fields = fields_of(line)
    rows = fields[0] == message and any(re.fullmatch(NUMBER, field) for field in fields[1:])
    return fields if rows else None


def _of_pattern(patterns: Sequence[str]) -> Rewrite:
    """The cells of lines with words before numbers; of several patterns a row has a line of each, in any order."""
    forms = [_compiled(pattern) for pattern in patterns]
    held: dict[int, list[str]] = {}

    def of(line: str) -> list[str] | None:
        text = line.strip()
        for place, form in enumerate(forms):
            if match := form.fullmatch(text):
                if place in held:
                    held.clear()
                held[place] = list(match.groups())
                if len(held) < len(forms):
                    return None
                cells = [cell for k in range(len(forms)) for cell in held[k]]
                held.clear()
                return cells
        return None

    return of


def _compiled(pattern: str) -> re.Pattern[str]:
    """A pattern as a regular expression, in which blanks do not matter."""
    words = [r"\s*".join(map(re.escape, part.split())) for part in pattern.split(PLACE)]
    return re.compile(rf"\s*({STAMP}|[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|nan)\s*".join(words))


def _line(cells: list[str] | None) -> str:
    """Cells as a line, without commas of their own; empty where there are none."""
    return "" if cells is None else ",".join(cell.replace(",", ".").replace("\n", " ") for cell in cells)
