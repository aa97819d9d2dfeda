"""The little of YAML that calibration files of numbers use: nested keys, lists, numbers and plain words.

Keys and lists by indentation, lists in brackets on one line, comments. Anchors, texts over several lines, braces
and tags are errors. A package for the whole of YAML would be one more dependency for one kind of file.
"""

from __future__ import annotations

import re
from typing import Any

from inercal.errors import InputError

_KEY = re.compile(r"""(?:"(?P<quoted>[^"]*)"|(?P<plain>[^\s\[\]{}"'#&*!|>%@`-][^\s:\[\]{}]*))\s*:(?:\s+|$)""")
_DEEPEST = 50

Line = tuple[int, int, str]
"""Number, indent and content of a line."""


def parse(text: str, where: object) -> Any:
    """Dicts, lists, floats and texts; raises `InputError` naming ``where`` and the line of anything else."""
    lines: list[Line] = []
    for number, raw in enumerate(text.splitlines(), 1):
        line = re.sub(r"(?:^|\s)#.*$", "", raw).rstrip()
        if line.strip() in ("", "---", "...") or line.startswith("%"):
            continue
        lines.append((number, len(line) - len(line.lstrip(" ")), line.strip()))
    if not lines:
        raise InputError(where, "found nothing in it, expected keys and numbers (YAML)")
    value, rest = _block(lines, where, 0)
    if rest:
        raise _bad(rest[0], where)
    return value


def _bad(line: Line, where: object) -> InputError:
    """The error for a line."""
    return InputError(
        f"{where}, line {line[0]}", f"found {line[2][:40]!r}, expected keys and numbers (simple YAML)"
    )


def _block(lines: list[Line], where: object, depth: int) -> tuple[Any, list[Line]]:
    """The value that begins with the first line, and the lines after it."""
    if depth > _DEEPEST:
        raise _bad(lines[0], where)
    if _item(lines[0]) is not None:
        return _list(lines, where, depth)
    if _KEY.match(lines[0][2]):
        return _dict(lines, where, depth)
    return _scalar(lines[0], where), lines[1:]


def _item(line: Line) -> Line | None:
    """The text after the dash of an item of a list, indented as deep as it stands; None for anything else."""
    number, indent, content = line
    if content != "-" and not content.startswith("- "):
        return None
    rest = content[1:].lstrip()
    return number, indent + len(content) - len(rest), rest


def _list(lines: list[Line], where: object, depth: int) -> tuple[list[Any], list[Line]]:
    """A list of items that stand below each other."""
    indent, items = lines[0][1], []
    while lines and lines[0][1] == indent and (item := _item(lines[0])) is not None:
        if not item[2]:
            raise _bad(lines[0], where)
        value, lines = _block([item, *lines[1:]], where, depth + 1)
        items.append(value)
    return items, lines


def _dict(lines: list[Line], where: object, depth: int) -> tuple[dict[str, Any], list[Line]]:
    """Keys that stand below each other, each with a value beside or below it."""
    indent, entries = lines[0][1], {}
    while lines and lines[0][1] == indent and (match := _KEY.match(lines[0][2])):
        (number, _, content), lines = lines[0], lines[1:]
        rest = content[match.end() :]
        below = lines and (lines[0][1] > indent or (lines[0][1] == indent and _item(lines[0]) is not None))
        if rest:
            value = _scalar((number, indent, rest), where)
        elif below:
            value, lines = _block(lines, where, depth + 1)
        else:
            value = None
        entries[match["quoted"] or match["plain"]] = value
    return entries, lines


def _scalar(line: Line, where: object) -> Any:
    """A number, a bracketed list of values, or a word."""
    text = line[2]
    if text.startswith("["):
        value, rest = _flow(line, text, where, 0)
        if rest.strip():
            raise _bad(line, where)
        return value
    if text[0] in "{&*!|>%@`":
        raise _bad(line, where)
    try:
        return float(text)
    except ValueError:
        return text.strip("\"'")


def _flow(line: Line, text: str, where: object, depth: int) -> tuple[list[Any], str]:
    """A list in brackets at the start of ``text``, and what follows it."""
    items: list[Any] = []
    text = text[1:].lstrip()
    while not text.startswith("]"):
        if text.startswith("[") and depth < _DEEPEST:
            value, text = _flow(line, text, where, depth + 1)
            items.append(value)
        elif match := re.match(r"[^\[\],]+", text):
            items.append(_scalar((line[0], line[1], match[0].strip() or "{"), where))
            text = text[match.end() :]
        else:
            raise _bad(line, where)
        text = text.lstrip()
        if text.startswith(","):
            text = text[1:].lstrip()
        elif not text.startswith("]"):
            raise _bad(line, where)
    return items, text[1:]
