"""Studies explained: one JSON Schema for all kinds, made from the models that read them, and a study as commented TOML,
its keys in force and every other key behind a "# "."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

from pydantic.json_schema import GenerateJsonSchema, models_json_schema
from pydantic_core import core_schema

from inercal.faces.studies.text import toml
from inercal.systems.listed import SYSTEMS


class TomlSchema(GenerateJsonSchema):
    """TOML has no null: a key is there or absent."""

    def nullable_schema(self, schema: core_schema.NullableSchema) -> dict[str, Any]:
        """The schema of the value, where there is one."""
        return self.generate_inner(schema["schema"])

    def default_schema(self, schema: core_schema.WithDefaultSchema) -> dict[str, Any]:
        """A default only where it is a plain value."""
        if isinstance(schema.get("default"), str | int | float):
            return super().default_schema(schema)
        return self.generate_inner(schema["schema"])


@cache
def json_schema() -> Mapping[str, Any]:
    """JSON Schema (draft 2020-12) of study files, for editors and for checks by other programs.

    Returns
    -------
    mapping
        Made once, the same object for all who ask.
        Unknown keys are rejected. Whether a unit exists and a value makes sense is checked on reading.
    """
    references, definitions = models_json_schema(
        [(system.study_file(), "validation") for system in SYSTEMS.values()], schema_generator=TomlSchema
    )
    return {
        "$schema": GenerateJsonSchema.schema_dialect,
        "title": "inercal study",
        "description": "A study file of inercal, in TOML. Quantities are texts with a unit.",
        "anyOf": list(references.values()),
        **definitions,
    }


Schema = Mapping[str, Any]

WIDTH = 110
"""Columns of a line, where a value leaves room for that."""

COLUMN = 36
"""Column at which comments begin."""


def commented(
    schema: Schema, definitions: Mapping[str, Schema], study: Mapping[str, Any], hidden: str = "(?!)"
) -> str:
    """A study with all its keys, by the schema of its kind and the definitions of
    `inercal.faces.studies.schema.json_schema`.

    The keys of ``study`` are in force; a table there has its heading, too, where it is empty. ``hidden`` is a regular
    expression of dotted keys and tables that are left out unless they are in force.
    """
    return "\n".join(_table("", schema, definitions, study, hidden)) + "\n"


def _table(
    path: str, schema: Schema, definitions: Mapping[str, Schema], given: Mapping[str, Any] | None, hidden: str
) -> Iterator[str]:
    """The lines of a table: its values, those in force first, then the tables in it.

    ``given`` None: it is not in force.
    """
    inside = given or {}
    for key, field in sorted(schema["properties"].items(), key=lambda item: item[0] not in inside):
        dotted = f"{path}.{key}".lstrip(".")
        there = key in inside
        if not there and re.fullmatch(hidden, dotted):
            continue
        inner = _resolved(field, definitions)
        if "properties" in inner and "examples" not in field:
            continue
        value = inside[key] if there else example(field, definitions)
        yield from line(key, value, _comment(field, definitions, value, there), there)
    shown: dict[str, str] = {}
    for key, field in schema["properties"].items():
        dotted, inner = f"{path}.{key}".lstrip("."), _resolved(field, definitions)
        left_out = key not in inside and re.fullmatch(hidden, dotted)
        if left_out or "properties" not in inner or "examples" in field:
            continue
        content = inside.get(key)
        first = shown.setdefault(str(field.get("$ref")), dotted)
        note = "" if first == dotted else f"; keys as of [{first}]"
        yield ""
        yield from _explained(
            f"[{dotted}]" if content is not None else f"# [{dotted}]", field.get("description", "") + note
        )
        if first == dotted:
            yield from _table(dotted, inner, definitions, content, hidden)
        else:
            kept = {name: one for name, one in inner["properties"].items() if name in (content or ())}
            yield from _table(dotted, {"properties": kept}, definitions, content, hidden)


def line(key: str, value: object, comment: str, in_force: bool) -> Iterator[str]:
    """A key with its value and comment."""
    yield from _explained(f"{'' if in_force else '# '}{key} = {toml(value)}", comment)


def _explained(text: str, comment: str) -> Iterator[str]:
    """A text with a comment beside it, and below where that is long."""
    start = max(COLUMN, len(text) + 2)
    words = textwrap.wrap(comment, max(24, WIDTH - start - 2)) or [""]
    yield f"{text:{start}s}# {words[0]}".rstrip()
    for more in textwrap.wrap(" ".join(words[1:]), WIDTH - COLUMN - 2):
        yield f"{'':{COLUMN}s}# {more}"


def _comment(field: Schema, definitions: Mapping[str, Schema], value: object, there: bool) -> str:
    """The comment of a key: its meaning, other choices, and default."""
    schema = {**_resolved(field, definitions), **field}
    says = str(schema.get("description", ""))
    others = [] if isinstance(value, Mapping) else [one for one in _choices(schema) if one != value]
    if others and not all(str(one) in says for one in others):
        says += f"; or {', '.join(map(toml, others))}"
    default = schema.get("default", "")
    if not there and default not in ("", value) and not isinstance(default, bool):
        says += f"; {default if isinstance(default, str) else toml(default)} if absent"
    return says


def _choices(schema: Schema) -> list[Any]:
    """Words that a key may hold."""
    if "enum" in schema:
        return list(schema["enum"])
    if "const" in schema and isinstance(schema["const"], str):
        return [schema["const"]]
    return [word for one in schema.get("anyOf", ()) for word in _choices(one)]


def example(field: Schema, definitions: Mapping[str, Schema]) -> Any:
    """A good value of a key: an example, the default, one that its type allows."""
    schema = {**_resolved(field, definitions), **field}
    match schema:
        case {"examples": [first, *_]}:
            return first
        case {"type": "boolean"}:
            return not schema.get("default", False)
        case {"default": str() | int() | float() as default}:
            return default
        case {"const": const}:
            return const
        case {"enum": [first, *_]}:
            return first
        case {"anyOf": [first, *_]}:
            return example(first, definitions)
        case {"type": "array", "prefixItems": items}:
            return [example(each, definitions) for each in items]
        case {"type": "array", "items": each}:
            return [example(each, definitions)] * schema.get("minItems", 1)
        case {"properties": keys}:
            return {key: example(keys[key], definitions) for key in schema.get("required", ())}
    return schema.get("minimum", 1)


def _resolved(field: Schema, definitions: Mapping[str, Schema]) -> Schema:
    """The schema that a reference stands for."""
    return definitions[field["$ref"].rpartition("/")[2]] if "$ref" in field else field
