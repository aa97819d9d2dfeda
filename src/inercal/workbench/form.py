"""A study as a form: its keys with what they mean, and a key of the text changed where it stands."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Literal

from inercal.errors import InercalError, InputError

Widget = Literal["choice", "switch", "text", "value"]
"""Kinds of typing a key: chosen, switched, a text, or any value of TOML."""

_DEEPEST = 3


@dataclass(frozen=True)
class Key:
    """A key of a study: the table it is in, its name and what it means; how it is typed, with choices and an example.

    ``value`` is what the study says, in TOML, or as a text where that is the widget; empty where the key is absent.
    """

    table: str
    name: str
    says: str
    widget: Widget
    choices: tuple[str, ...] = ()
    example: str = ""
    value: str = ""

    @property
    def path(self) -> str:
        """Table and name, with a dot between."""
        return f"{self.table}.{self.name}" if self.table else self.name


@dataclass(frozen=True)
class Table:
    """A table of a study with its keys, and what it is about."""

    name: str
    says: str
    keys: tuple[Key, ...]


def tables(kind: str, text: str) -> tuple[Table, ...]:
    """The tables of a study of that kind with what ``text`` says in them, those that it has first.

    Raises `InputError` where the text is no TOML.
    """
    from inercal.studies.schema import json_schema

    data = parsed(text)
    definitions = json_schema()["$defs"]
    root = definitions[f"{kind.capitalize()}StudyFile"]
    found = [each for each in _tables("", root, definitions, data, 0) if each.keys]
    given = [each for each in found if _at(data, each.name)]
    return (*given, *(each for each in found if each not in given))


def parsed(text: str) -> dict[str, Any]:
    """The keys of a TOML text; raises `InputError` with the line."""
    try:
        return tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise InputError("study", f"found no TOML: {error}") from error


def problem(kind: str, text: str) -> str:
    """The fault of a study in one sentence; empty without one."""
    from inercal.studies.load import reader

    try:
        reader(kind)(parsed(text), "study")
    except InercalError as error:
        return str(error)
    return ""


def changed(text: str, path: str, value: str) -> str:
    """The text with a key set to ``value``, in TOML; commented out where that is empty. All else stays as it is.

    Raises `InputError` where the value is no TOML, or the key cannot be changed in place.
    """
    wanted = _with(parsed(text), path.split("."), parsed(f"value = {value}")["value"] if value else None)
    lines = text.splitlines()
    for edited in _edits(lines, path, value, wanted):
        made = "\n".join(edited) + "\n"
        try:
            if _filled(tomllib.loads(made)) == _filled(wanted):
                return made
        except tomllib.TOMLDecodeError:
            continue
    raise InputError(path, "cannot be changed here, expected a change in the text of the study")


def as_toml(typed: str, widget: Widget) -> str:
    """A typed text as TOML; empty for nothing. A value that is no TOML is a text, as behind ``--set``."""
    typed = typed.strip()
    if not typed or widget == "switch":
        return typed
    if widget == "value":
        try:
            if list(tomllib.loads(f"value = {typed}")) == ["value"]:
                return typed
        except tomllib.TOMLDecodeError:
            pass
    return json.dumps(typed, ensure_ascii=False)


def _tables(
    path: str, node: Mapping[str, Any], definitions: Mapping[str, Any], data: Mapping[str, Any], depth: int
) -> Iterator[Table]:
    """The table of a node of the schema, and those in it."""
    keys, inner = [], []
    for name, key in node.get("properties", {}).items():
        of_table = _table_of(key, definitions)
        where = f"{path}.{name}" if path else name
        if of_table is not None and depth < _DEEPEST:
            inner.append((where, {**of_table, "description": key.get("description", "")}))
        elif name != "schema":
            keys.append(_key(path, name, key, definitions, _at(data, path)))
    yield Table(path, str(node.get("description", "")), tuple(keys))
    for where, of_table in inner:
        yield from _tables(where, of_table, definitions, data, depth + 1)


def _table_of(key: Mapping[str, Any], definitions: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """The definition of a key that is one table, None of any other."""
    options = [each for each in key.get("anyOf", [key]) if each.get("type") != "null"]
    if len(options) != 1 or "$ref" not in options[0]:
        return None
    definition: Mapping[str, Any] = definitions[options[0]["$ref"].rpartition("/")[2]]
    return definition if "properties" in definition else None


def _key(
    path: str, name: str, key: Mapping[str, Any], definitions: Mapping[str, Any], table: Mapping[str, Any]
) -> Key:
    """A key of a table of the schema, and what the study says of it."""
    options = [each for each in key.get("anyOf", [key]) if each.get("type") != "null"]
    one = options[0] if len(options) == 1 else {}
    if "$ref" in one:
        one = definitions[one["$ref"].rpartition("/")[2]]
    choices = tuple(one["enum"]) if all(isinstance(each, str) for each in one.get("enum", [0])) else ()
    widget: Widget = "value"
    if choices:
        widget = "choice"
    elif one.get("type") == "boolean":
        widget = "switch"
    elif one.get("type") == "string":
        widget = "text"
    elif any(each.get("type") == "string" for each in options):
        widget = "text" if isinstance(table.get(name, ""), str) else "value"
    value = table.get(name)
    shown = "" if value is None else value if widget in ("text", "choice") else _toml(value)
    examples = key.get("examples") or [""]
    example = examples[0] if isinstance(examples[0], str) else _toml(examples[0])
    return Key(path, name, str(key.get("description", "")), widget, choices, example, str(shown))


def _at(data: Mapping[str, Any], path: str) -> Mapping[str, Any]:
    """The table at a path, empty where there is none."""
    for name in path.split(".") if path else ():
        inner = data.get(name)
        data = inner if isinstance(inner, Mapping) else {}
    return data


def _with(data: Mapping[str, Any], path: list[str], value: Any) -> dict[str, Any]:
    """Keys with one set, or taken out for None."""
    copy = dict(data)
    if len(path) > 1:
        copy[path[0]] = _with(copy.get(path[0], {}), path[1:], value)
    elif value is None:
        copy.pop(path[0], None)
    else:
        copy[path[0]] = value
    return copy


def _filled(data: Mapping[str, Any]) -> dict[str, Any]:
    """Keys without the tables that hold nothing."""
    whole = {key: _filled(each) if isinstance(each, Mapping) else each for key, each in data.items()}
    return {key: each for key, each in whole.items() if each != {}}


def _edits(lines: list[str], path: str, value: str, wanted: Mapping[str, Any]) -> Iterator[list[str]]:
    """Ways to change a key: in place, in the table within a line that it stands in, or at the end of its table."""
    names = path.split(".")
    for depth in range(len(names) - 1, -1, -1):
        table, name = ".".join(names[:depth]), names[depth]
        inner = _at(wanted, ".".join(names[: depth + 1]))
        new = value if depth == len(names) - 1 else _toml(inner) if inner else ""
        if (edited := _in_place(lines, table, name, new)) is not None:
            yield edited
    if value:
        yield _at_end(lines, ".".join(names[:-1]), names[-1], value)
    elif (span := _span(lines, path)) is not None:  # a whole table, with its head
        begin, end = span[0] - 1, span[1]
        gone = [
            f"# {line}" if line.strip() and not line.startswith("#") else line for line in lines[begin:end]
        ]
        yield [*lines[:begin], *gone, *lines[end:]]


def _in_place(lines: list[str], table: str, name: str, value: str) -> list[str] | None:
    """The lines with the key changed where it stands, or where it is commented out."""
    span = _span(lines, table)
    if span is None:
        return None
    own = re.compile(rf"(\s*)(#\s*)?{re.escape(name)}\s*=(.*)")
    found = [(k, match) for k in range(*span) if (match := own.fullmatch(lines[k]))]
    found.sort(key=lambda each: bool(each[1][2]))  # a key in force before its example
    if not found:
        return None
    k, match = found[0]
    end = k + 1 if match[2] else _end(lines, k, match[3])
    if not value:
        return [*lines[:k], *(f"# {line}" for line in lines[k:end]), *lines[end:]]
    head = f"{name} = {value}"
    remark = "" if "\n" in value else _remark(match[3])
    return [*_in_force(lines[:k], table), f"{head:35s} {remark}".rstrip(), *lines[end:]]


def _end(lines: list[str], k: int, begun: str) -> int:
    """The line after the value that begins on line ``k``: a list may go over several."""
    whole = begun
    for end in range(k + 1, len(lines) + 1):
        if end == k + 1 or "]" in lines[end - 1]:
            with suppress(tomllib.TOMLDecodeError):
                tomllib.loads(f"value = {whole}")
                return end
        whole += "\n" + lines[min(end, len(lines) - 1)]
    return k + 1


def _at_end(lines: list[str], table: str, name: str, value: str) -> list[str]:
    """The lines with the key at the end of its table, which is made where it is not there."""
    span = _span(lines, table)
    if span is None:
        return [*lines, "", f"[{table}]", f"{name} = {value}"]
    end = span[1]
    while end > span[0] and (not lines[end - 1].strip() or lines[end - 1].startswith("#")):
        end -= 1
    return [*_in_force(lines[:end], table), f"{name} = {value}", *lines[end:]]


def _in_force(lines: list[str], table: str) -> list[str]:
    """The lines with the head of a table no longer commented out."""
    head = re.compile(rf"#\s*(\[{re.escape(table)}\].*)")
    return [match[1] if (match := head.fullmatch(line)) else line for line in lines]


def _span(lines: list[str], table: str) -> tuple[int, int] | None:
    """First and last line of a table, its head left out; one that is commented out counts too."""
    heads = [k for k, line in enumerate(lines) if re.match(r"(#\s*)?\[[\w.\"-]+\]\s*(#.*)?$", line)]
    if not table:
        return 0, heads[0] if heads else len(lines)
    own = re.compile(rf"(#\s*)?\[{re.escape(table)}\]")
    for k, following in zip(heads, [*heads[1:], len(lines)], strict=True):
        if own.match(lines[k]):
            return k + 1, following
    return None


def _remark(rest: str) -> str:
    """The comment behind a value: from the first # before which the value is whole."""
    for match in re.finditer("#", rest):
        try:
            tomllib.loads(f"value = {rest[: match.start()]}")
        except tomllib.TOMLDecodeError:
            continue
        return rest[match.start() :]
    return ""


def _toml(value: Any) -> str:
    """A parsed value as TOML again."""
    match value:
        case bool():
            return str(value).lower()
        case Mapping():
            return "{ " + ", ".join(f"{key} = {_toml(each)}" for key, each in value.items()) + " }"
        case list():
            return "[" + ", ".join(map(_toml, value)) + "]"
        case str():
            return json.dumps(value, ensure_ascii=False)
        case _:
            return str(value)
