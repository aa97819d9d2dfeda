"""The text of a study or map, and a key set in it: comments and all else stay as they are."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from inercal.foundation.errors import InputError, StudyError
from inercal.foundation.units import shown

if TYPE_CHECKING:
    from typing import TypeAlias

    from tomlkit import TOMLDocument
    from tomlkit.items import Item, Key

    Body: TypeAlias = list[tuple[Key | None, Item]]


def parsed(text: str) -> dict[str, Any]:
    """The keys of a TOML text; raises `InputError` with the line."""
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError("study", f"found no TOML: {error}") from error


def changed(text: str, path: str, value: str) -> str:
    """The text with a key set to ``value``, in TOML; commented out where that is empty.

    A key that stands there as an example, ``# key = ...``, comes into force in that place, and so does the head of its
    table. Raises `InputError` where the value is no TOML, or the key cannot be changed in place.
    """
    from tomlkit.exceptions import TOMLKitError

    names, before = path.split("."), parsed(text)
    after = parsed(f"value = {value}")["value"] if value else None
    with suppress(TOMLKitError, ValueError, TypeError, AttributeError, RecursionError):
        wanted = _filled(_with(before, names, after))
        made = _set(text, names, value) if value else _taken_out(text, names)
        if _filled(tomllib.loads(made)) == wanted:
            return made
    raise InputError(path, "cannot be changed here, expected a change in the text of the study")


def with_keys(text: str, keys: Mapping[str, str]) -> str:
    """The text with keys set to their TOML, or commented out where that is empty; raises `InputError`."""
    for path, value in keys.items():
        if value or _is_given(parsed(text), path.split(".")):
            text = changed(text, path, value)
    return text


def toml(value: object) -> str:
    """A value as TOML, on one line; raises `StudyError` where it has none."""
    import tomlkit

    match value:
        case Mapping():
            items = [f"{tomlkit.key(str(key)).as_string()} = {toml(each)}" for key, each in value.items()]
            return f"{{ {', '.join(items)} }}" if items else "{}"
        case list() | tuple():
            return f"[{', '.join(map(toml, value))}]"
        case Path():
            return toml(str(value))
        case _ if hasattr(value, "tolist"):  # of NumPy
            return toml(value.tolist())
    try:
        return tomlkit.item(value).as_string()
    except ValueError as error:
        raise StudyError(
            "study", f"found {shown(value)}, expected a text, a number, a list or a table"
        ) from error


def _set(text: str, names: list[str], value: str) -> str:
    """The text with a key set: where it stands, where its example stands, or below the other keys of its table."""
    import tomlkit

    *tables, name = names
    document = tomlkit.parse(_with_head(text, ".".join(tables)))
    table: Any = document
    for depth, each in enumerate(tables, start=1):
        if each not in table:
            table[each] = tomlkit.table(is_super_table=depth < len(tables))
        table = table[each]
    body = _body(table)
    if name in table or body is None:
        _put(table, name, value)
        return document.as_string()
    place, line = _example(body, name)
    _put(line, name, value)
    body[place] = line.body
    return document.as_string()


def _put(table: Any, name: str, value: str) -> None:
    """Set a key of a table; the comment beside it stays in its column where the value leaves room."""
    import tomlkit

    before = {key.key: item for key, item in _body(table) or () if key is not None}.get(name)
    table[name] = item = tomlkit.value(value)
    if before is not None and item.trivia.comment:
        was, now = (len(each.as_string().rpartition("\n")[2]) for each in (before, item))
        item.trivia.comment_ws = " " * max(2, len(before.trivia.comment_ws) + was - now)


def _example(body: Body, name: str) -> tuple[slice, TOMLDocument]:
    """The place of a key in the body of its table, and the line of its example; below the other keys without one."""
    import tomlkit
    from tomlkit.exceptions import TOMLKitError
    from tomlkit.items import AoT, Table

    for k, (_, each) in enumerate(body):
        line = each.as_string().strip()
        if re.match(rf"#\s*{re.escape(name)}\s*=", line):
            with suppress(TOMLKitError):
                bare = line.lstrip("# ")
                found = tomlkit.parse(f"{bare}\n")
                if (beside := found.body[0][1].trivia).comment:
                    beside.comment_ws += " " * (len(line) - len(bare))
                return slice(k, k + 1), found
    keys = [k for k, (key, each) in enumerate(body) if key is not None and not isinstance(each, Table | AoT)]
    end = keys[-1] + 1 if keys else 0
    return slice(end, end), tomlkit.document()


def _taken_out(text: str, names: list[str]) -> str:
    """The text with a key, or a table with its head, behind a #."""
    import tomlkit
    from tomlkit.items import Table

    document = tomlkit.parse(text)
    table: Any = document
    for each in names[:-1]:
        table = table[each]
    body = _body(table)
    if body is None:
        del table[names[-1]]
        return document.as_string()
    place = next(k for k, (key, _) in enumerate(body) if key is not None and key.key == names[-1])
    item = body[place][1]
    if isinstance(item, Table):
        written = f"[{'.'.join(names)}]\n{item.as_string()}"
    else:
        if len(item.trivia.comment_ws) > 3:  # the comment beside it stays in its column
            item.trivia.comment_ws = item.trivia.comment_ws[2:]
        alone = tomlkit.document()
        alone.body.append(body[place])
        written = alone.as_string()
    lines = [line if line.lstrip()[:1] in ("", "#") else f"# {line}" for line in written.splitlines(True)]
    body[place : place + 1] = tomlkit.parse("".join(lines)).body
    return document.as_string()


def _with_head(text: str, table: str) -> str:
    """The text with the head of a table in force that stood behind a #, where that takes no key of another."""
    text = text if text.endswith("\n") else f"{text}\n"
    made = re.sub(rf"(?m)^#\s*(\[{re.escape(table)}\].*)", r"\1", text, count=1)
    with suppress(tomllib.TOMLDecodeError):
        if _filled(tomllib.loads(made)) == _filled(tomllib.loads(text)):
            return made
    return text


def _body(table: Any) -> Body | None:
    """Keys, comments and blank lines of a table; None of one within a line, or in several places."""
    from tomlkit.container import Container
    from tomlkit.items import Table

    if isinstance(table, Table):
        table = table.value
    return table.body if isinstance(table, Container) else None


def _is_given(data: Any, names: list[str]) -> bool:
    """True for a key that a study gives."""
    for name in names:
        if not isinstance(data, Mapping) or name not in data:
            return False
        data = data[name]
    return True


def _with(data: Mapping[str, Any], names: list[str], value: Any) -> dict[str, Any]:
    """Keys with one set, or taken out for None."""
    first, *others = names
    if others:
        return {**data, first: _with(data.get(first, {}), others, value)}
    left = {key: each for key, each in data.items() if key != first}
    return left if value is None else {**left, first: value}


def _filled(data: Mapping[str, Any]) -> dict[str, Any]:
    """Keys without the tables that hold nothing."""
    whole = {key: _filled(each) if isinstance(each, Mapping) else each for key, each in data.items()}
    return {key: each for key, each in whole.items() if each != {}}
