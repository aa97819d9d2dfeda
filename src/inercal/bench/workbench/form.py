"""A study as a form: its keys with what they mean, and what is typed as TOML."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from inercal.faces.studies.text import parsed, toml
from inercal.foundation.errors import InercalError
from inercal.systems.listed import SYSTEMS

Widget = Literal["choice", "switch", "text", "value"]
"""Kinds of typing a key: chosen, switched, a text, or any value of TOML."""

_DEEPEST = 3


@dataclass(frozen=True)
class FormKey:
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
class FormTable:
    """A table of a study with its keys, and what it is about."""

    name: str
    says: str
    keys: tuple[FormKey, ...]


def tables(kind: str, text: str) -> tuple[FormTable, ...]:
    """The tables of a study of that kind with what ``text`` says in them, those that it has first.

    Raises `InputError` where the text is no TOML.
    """
    from inercal.faces.studies.schema import json_schema

    data = parsed(text)
    definitions = json_schema()["$defs"]
    root = definitions[f"{kind.capitalize()}StudyFile"]
    found = [each for each in _tables("", root, definitions, data, 0) if each.keys]
    given = [each for each in found if _at(data, each.name)]
    return (*given, *(each for each in found if each not in given))


def problem(kind: str, text: str) -> str:
    """The fault of a study in one sentence; empty without one."""
    try:
        SYSTEMS[kind].read_study(parsed(text), "study")
    except InercalError as error:
        return str(error)
    return ""


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
) -> Iterator[FormTable]:
    """The table of a node of the schema, and those in it."""
    keys, inner = [], []
    for name, key in node.get("properties", {}).items():
        of_table = _table_of(key, definitions)
        where = f"{path}.{name}" if path else name
        if of_table is not None and depth < _DEEPEST:
            inner.append((where, {**of_table, "description": key.get("description", "")}))
        elif name != "schema":
            keys.append(_key(path, name, key, definitions, _at(data, path)))
    yield FormTable(path, str(node.get("description", "")), tuple(keys))
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
) -> FormKey:
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
    shown = "" if value is None else value if widget in ("text", "choice") else toml(value)
    examples = key.get("examples") or [""]
    example = examples[0] if isinstance(examples[0], str) else toml(examples[0])
    return FormKey(path, name, str(key.get("description", "")), widget, choices, example, str(shown))


def _at(data: Mapping[str, Any], path: str) -> Mapping[str, Any]:
    """The table at a path, empty where there is none."""
    for name in path.split(".") if path else ():
        inner = data.get(name)
        data = inner if isinstance(inner, Mapping) else {}
    return data
