"""A study as a form: its keys with their meaning, its plan in lines of text, and advice of findings as changes."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from inercal.faces.python.study import Study
from inercal.faces.studies.text import changed, parsed, toml, with_keys
from inercal.foundation.errors import InercalError, InputError
from inercal.foundation.findings import Finding
from inercal.systems.contract import OfferedPlan
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
        worded = isinstance(table.get(name, ""), str) and not any(
            each.get("type") == "boolean" for each in options
        )
        widget = "text" if worded else "value"  # true is no text
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


_SET = re.compile(r"\b[Ss]et ([a-z_]\w*(?:\.\w+)+) = (true|false|\"[^\"]*\"|[-+.\de]+\d)")
_UNDER = re.compile(
    r"\b(?:[Ww]rite|[Ss]tate|[Tt]ake) (\w+) = (\"[^\"]*\"|true|false|[-+.\de]*\d)[^;\[]{0,60}? under \[([\w.]+)\]"
)
_STATES = re.compile(r"\b[Nn]ame (?!them\b)([\w, ]+?) in states under \[model\]")
"""The words in which findings say what to write: a key and its value, or kinds of states of a platform."""


@dataclass(frozen=True)
class Advice:
    """A change of the study: the key at ``path``, its ``value`` in TOML, and in words."""

    path: str
    value: str

    @property
    def words(self) -> str:
        """The change as a line of the study."""
        return f"{self.path} = {self.value}"


def advice_of(finding: Finding, study: str, kind: str) -> tuple[Advice, ...]:
    """Changes of the text of a study of that kind that a finding advises, without those that it has already, and
    without those that would make a good study one that cannot be used."""
    found = [Advice(match[1], match[2]) for match in _SET.finditer(finding.message)]
    found += [Advice(f"{match[3]}.{match[1]}", match[2]) for match in _UNDER.finditer(finding.message)]
    for match in _STATES.finditer(finding.message):
        kinds = [kind for kind in re.split(r", | or | and ", match[1]) if re.fullmatch(r"\w+", kind)]
        found += [each for each in [_with_states(kinds[:1], study)] if each is not None]
    return tuple(dict.fromkeys(each for each in found if _changes(each, study, kind)))


def _with_states(kinds: list[str], study: str) -> Advice | None:
    """Kinds of states beside those that a study names; None where it has them."""
    try:
        model = parsed(study).get("model", {})
    except InputError:
        return None
    given: Any = model.get("states", "rig")
    listed = [given] if isinstance(given, str) else list(given)
    added = [kind for kind in kinds if kind not in listed]
    return Advice("model.states", str([*listed, *added]).replace("'", '"')) if added else None


def _changes(advice: Advice, study: str, kind: str) -> bool:
    """True for a change that can be made, and is one."""
    try:
        made = changed(study, advice.path, advice.value)
        differs = parsed(made) != parsed(study)
    except InputError:
        return False
    return differs and (not problem(kind, made) or bool(problem(kind, study)))


def lines_of(study: Study) -> str:
    """The plan of a study, a line for each of its parts; empty without one."""
    plan = study.system.plan
    return "" if plan is None else "\n".join(", ".join(row) for row in plan.rows(study.settings))


def named(plan: OfferedPlan) -> Mapping[str, Mapping[str, str]]:
    """Plans by their name, each as keys with their TOML; empty ones are taken out."""
    return {name: {key: _toml(value) for key, value in keys.items()} for name, keys in plan.named().items()}


def with_lines(plan: OfferedPlan, text: str, lines: str) -> str:
    """The text of a study with the plan of these lines; raises `InputError` for lines that are none."""
    rows = [[word.strip() for word in line.split(",")] for line in lines.splitlines() if line.strip()]
    if not rows:
        raise InputError("plan", f"found no line, expected some like: {plan.says}")
    if plan.key:
        stated = [[_with_unit(word) for word in row] for row in rows]
        keys: Mapping[str, Any] = {**dict.fromkeys(plan.others), plan.key: stated}
    else:
        keys = plan.keys(rows, parsed(text))
    return with_keys(text, {key: _toml(value) for key, value in keys.items()})


def with_found(plan: OfferedPlan, text: str, found: str) -> str:
    """The text of a study with the plan that its command wrote: TOML, or CSV with a line of joints."""
    if plan.ending == ".csv":
        return with_lines(plan, text, "\n".join(found.splitlines()[1:]))
    keys = {f"plan.{key}": value for key, value in tomllib.loads(found)["plan"].items()}
    return with_keys(text, {key: _toml(value) for key, value in (dict.fromkeys(plan.others) | keys).items()})


def _toml(value: object) -> str:
    """A value as TOML, rows a line each; empty for None."""
    match value:
        case None:
            return ""
        case [[*_], *_]:
            rows: Sequence[object] = value
            return "[\n" + "".join(f"    {toml(row)},\n" for row in rows) + "]"
    return toml(value)


def _with_unit(word: str) -> str:
    """A number as an angle in degrees; anything else as it is."""
    try:
        return f"{float(word):.10g} deg"
    except ValueError:
        return word
