"""The little of YAML that calibration files of numbers use: nested keys, lists, numbers and plain words.

Keys and lists by indentation, lists in brackets on one line, comments. Anchors, texts over several lines, braces
and tags are errors. A package for the whole of YAML would be one more dependency for one kind of file.
"""

from __future__ import annotations

import re
from collections import deque
from typing import Any

from inercal.errors import InputError

_KEY = re.compile(r"""(?:"(?P<quoted>[^"]*)"|(?P<plain>[^\s\[\]{}"'#&*!|>%@`-][^\s:\[\]{}]*))\s*:(?:\s+|$)""")
_COMMENT = re.compile(r"(?:^|(?<=\s))#.*$")
_DEEPEST = 50
_LONGEST = 1 << 20

Line = tuple[int, int, str]
"""Number, indent and content of a line."""

Lines = deque[Line]
"""The lines that are not read yet."""


def parse(text: str, where: object) -> Any:
    """Dicts, lists, floats and texts; raises `InputError` naming ``where`` and the line of anything else."""
    if len(text) > _LONGEST:
        raise InputError(where, f"found {len(text)} characters, expected at most {_LONGEST} (YAML)")
    lines: Lines = deque()
    for number, raw in enumerate(text.splitlines(), 1):
        line = _COMMENT.sub("", raw).rstrip()
        if line.strip() in ("", "---", "...") or line.startswith("%"):
            continue
        lines.append((number, len(line) - len(line.lstrip(" ")), line.strip()))
    if not lines:
        raise InputError(where, "found nothing in it, expected keys and numbers (YAML)")
    value = _block(lines, where, 0)
    if lines:
        raise _bad(lines[0], where)
    return value


def _bad(line: Line, where: object) -> InputError:
    """The error for a line."""
    return InputError(
        f"{where}, line {line[0]}", f"found {line[2][:40]!r}, expected keys and numbers (simple YAML)"
    )


def _block(lines: Lines, where: object, depth: int) -> Any:
    """The value that begins with the first line; its lines are taken."""
    if depth > _DEEPEST:
        raise _bad(lines[0], where)
    if _item(lines[0]) is not None:
        return _list(lines, where, depth)
    if _KEY.match(lines[0][2]):
        return _dict(lines, where, depth)
    return _scalar(lines.popleft(), where)


def _item(line: Line) -> Line | None:
    """The text after the dash of an item of a list, indented as deep as it stands; None for anything else."""
    number, indent, content = line
    if content != "-" and not content.startswith("- "):
        return None
    rest = content[1:].lstrip()
    return number, indent + len(content) - len(rest), rest


def _list(lines: Lines, where: object, depth: int) -> list[Any]:
    """A list of items that stand below each other."""
    indent, items = lines[0][1], []
    while lines and lines[0][1] == indent and (item := _item(lines[0])) is not None:
        if not item[2]:
            raise _bad(lines[0], where)
        lines[0] = item
        items.append(_block(lines, where, depth + 1))
    return items


def _dict(lines: Lines, where: object, depth: int) -> dict[str, Any]:
    """Keys that stand below each other, each with a value beside or below it."""
    indent, entries = lines[0][1], {}
    while lines and lines[0][1] == indent and (match := _KEY.match(lines[0][2])):
        number, _, content = lines.popleft()
        rest = content[match.end() :]
        below = lines and (lines[0][1] > indent or (lines[0][1] == indent and _item(lines[0]) is not None))
        if rest:
            value = _scalar((number, indent, rest), where)
        elif below:
            value = _block(lines, where, depth + 1)
        else:
            value = None
        entries[match["quoted"] or match["plain"]] = value
    return entries


def _scalar(line: Line, where: object) -> Any:
    """A number, a bracketed list of values, or a word."""
    text = line[2]
    if text.startswith("["):
        value, end = _flow(line, 0, where, 0)
        if text[end:].strip():
            raise _bad(line, where)
        return value
    if text[0] in "{&*!|>%@`":
        raise _bad(line, where)
    try:
        return float(text)
    except ValueError:
        return text.strip("\"'")


_VALUE = re.compile(r"[^\[\],]+")
_BLANKS = re.compile(r"\s*")


def _flow(line: Line, begin: int, where: object, depth: int) -> tuple[list[Any], int]:
    """A list in brackets that begins at a place in the text of a line, and the place after it."""
    number, indent, text = line

    def after_blanks(place: int) -> int:
        match = _BLANKS.match(text, place)
        return place if match is None else match.end()

    items: list[Any] = []
    place = after_blanks(begin + 1)
    while not text.startswith("]", place):
        if text.startswith("[", place) and depth < _DEEPEST:
            value, place = _flow(line, place, where, depth + 1)
            items.append(value)
        elif match := _VALUE.match(text, place):
            items.append(_scalar((number, indent, match[0].strip() or "{"), where))
            place = match.end()
        else:
            raise _bad(line, where)
        place = after_blanks(place)
        if text.startswith(",", place):
            place = after_blanks(place + 1)
        elif not text.startswith("]", place):
            raise _bad(line, where)
    return items, place + 1
