"""What the book takes from the code: commands, keys of files, channels, codes and terms, as Markdown.

A page asks for a part by a comment on a line of its own, ``<!-- generated: commands -->``; the text takes its place
whenever the book is built, so it cannot fall behind the code. As an extension of Sphinx, this module also finds the
page of a short name in a docstring, such as `Estimate`.
"""

from __future__ import annotations

import ast
import inspect
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import fields, replace
from importlib import import_module
from itertools import groupby, pairwise
from pathlib import Path
from typing import Any

from docutils import nodes
from pygments.lexers.special import TextLexer
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment

import inercal

Schema = Mapping[str, Any]

#: stands for a colon while napoleon, which would take a type for what is before it, looks at a property
COLON = "\0"


def table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A Markdown table; what would end a cell is escaped."""
    head = list(head)
    lines = [head, ["---"] * len(head), *map(list, rows)]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


def code(text: object) -> str:
    """Text set as code."""
    return f"`{text}`"


# commands -------------------------------------------------------------------------------------------------------------


def commands() -> str:
    """Every command with what it does, its arguments and options, and an example."""
    from inercal.cli.tree import COMMANDS, app, usage

    root = app()
    parts = []
    for (verb, kind), (_, text, example) in COMMANDS.items():
        command = root[verb][kind] if kind else root[verb]
        arguments = [each for each in command.assemble_argument_collection() if each.show]
        rows = [(_flag(each), _meaning(each)) for each in arguments]
        called = usage(command, verb, kind)
        parts += [f"## {verb} {kind}".rstrip(), options_as_code(text), f"```text\n{called}\n```"]
        parts += [table(("argument or option", "meaning"), rows), f"Example:\n\n```text\n{example}\n```"]
    return "\n\n".join(parts)


def options_as_code(text: str) -> str:
    """Names of options and of variables of a shell set as code, where they are not yet."""
    return re.sub(r"(?<![\w`-])(--[a-z][a-z-]*|\$\w+)", r"`\1`", text)


def _flag(argument: Any) -> str:
    """An argument as it is typed: ``FILES``, ``--json``, ``--every STR``, as `--help` has it."""
    hint = inspect.formatannotation(argument.hint)
    if not argument.name.startswith("-"):
        return code(argument.name)
    kinds = (("bool", ""), ("Literal", "CHOICE"), ("Path", "PATH"), ("int", "INT"))
    kind = next((shown for word, shown in kinds if word in hint), "STR")
    return code(f"{argument.name} {kind}".strip())


def _meaning(argument: Any) -> str:
    """Help, choices, and whether it must be there."""
    choices = argument.get_choices() or ()
    found = options_as_code(argument.parameter.help or "")
    if choices:
        found += " One of " + ", ".join(map(code, choices)) + "."
    return f"{found} Required." if argument.required else found


# keys of files --------------------------------------------------------------------------------------------------------


def study(kind: str) -> str:
    """Every key of one kind of study (``imu``, ``strapdown``, ``turntable``, ``selfcal``, ``aoa``), table by table."""
    from inercal.faces.studies.schema import json_schema

    whole = json_schema()
    return _tables(whole["$defs"][f"{kind.capitalize()}StudyFile"], whole["$defs"])


def lab() -> str:
    """Every key of a ``lab.toml``, table by table."""
    from inercal.faces.studies.schema import TomlSchema
    from inercal.laboratory.certificate.lab import LabFile

    whole = LabFile.model_json_schema(schema_generator=TomlSchema)
    return _tables(whole, whole["$defs"])


def maps() -> str:
    """Every key of a column map, table by table."""
    from inercal.faces.studies.schema import TomlSchema
    from inercal.foundation.records.maps import MapEntry, NamedFileEntry

    whole, named = (
        model.model_json_schema(schema_generator=TomlSchema) for model in (MapEntry, NamedFileEntry)
    )
    definitions = whole.get("$defs", {}) | named.get("$defs", {})
    return _tables(whole, definitions) + "\n\n" + _table("file.NAME", named, definitions)


def _tables(top: Schema, definitions: Mapping[str, Schema]) -> str:
    """The keys outside all tables, then each table below a heading."""
    found = [_table("", top, definitions)]
    found += [_table(path, inner, definitions, names) for path, inner, names in _inner("", top, definitions)]
    return "\n\n".join(found)


def _inner(path: str, schema: Schema, definitions: Mapping[str, Schema]) -> Iterator[tuple[str, Schema, str]]:
    """The tables below one: dotted name, schema, and the keys that it is for where several are alike."""
    alike: dict[str, tuple[Schema, list[str]]] = {}
    for keys, value in _numbered(schema.get("properties", {})):
        for name, found in _objects(keys[0], value, definitions):
            alike.setdefault(str(found), (found, []))[1].append(name.replace(keys[0], _span(keys), 1))
    for found, names in alike.values():
        several = len(names) > 1 or " .. " in names[0]
        below = f"{path}.{'NAME' if several else names[0]}".lstrip(".")
        yield below, found, ", ".join(map(code, names)) if several else ""
        yield from _inner(below, found, definitions)


def _objects(key: str, schema: Schema, definitions: Mapping[str, Schema]) -> Iterator[tuple[str, Schema]]:
    """The tables that a value may be: itself, one of several, or one for each NAME."""
    found = _resolved(schema, definitions)
    if "properties" in found:
        yield key, found
    if isinstance(found.get("additionalProperties"), Mapping):
        yield from _objects(f"{key}.NAME", found["additionalProperties"], definitions)
    for one in found.get("anyOf", ()):
        yield from _objects(key, one, definitions)


def _table(path: str, schema: Schema, definitions: Mapping[str, Schema], names: str = "") -> str:
    """One table of keys: type with an example, default, meaning."""
    required = schema.get("required", ())
    rows = []
    for keys, value in _numbered(schema["properties"]):
        found = {**_resolved(value, definitions), **value}
        default = "required" if keys[0] in required else _default(found)
        rows.append((code(_span(keys)), _type(value, definitions), default, found.get("description", "")))
    about = re.sub(r"^``\[\S+\]``: ", "", schema.get("description", ""))
    about = about[:1].upper() + about[1:] + (f" NAME is one of {names}." if names else "")
    head = f"### `[{path}]`\n\n{about}\n\n" if path else ""
    return head + table(("key", "type", "default", "meaning"), rows)


def _numbered(properties: Mapping[str, Schema]) -> Iterator[tuple[list[str], Schema]]:
    """The keys with their schemas; those that are numbered and tables of one kind together."""

    def kind(item: tuple[str, Schema]) -> tuple[str, object]:
        key, value = item
        numbered = re.fullmatch(r"([a-z]+)\d+", key) if "$ref" in value else None
        return (numbered[1], value["$ref"]) if numbered else (key, None)

    for _, group in groupby(properties.items(), kind):
        items = list(group)
        yield [key for key, _ in items], items[0][1]


def _span(keys: list[str]) -> str:
    """One key, or the first and the last."""
    return keys[0] if len(keys) == 1 else f"{keys[0]} .. {keys[-1]}"


def _resolved(schema: Schema, definitions: Mapping[str, Schema]) -> Schema:
    """The schema that a reference stands for."""
    return definitions[schema["$ref"].rsplit("/", 1)[-1]] if "$ref" in schema else schema


def _default(schema: Schema) -> str:
    """The value taken where the key is absent, if the schema states it."""
    value = schema.get("default")
    if value in (None, "") or isinstance(value, Mapping):
        return ""
    return code(
        str(value).lower() if isinstance(value, bool) else f'"{value}"' if isinstance(value, str) else value
    )


def _type(schema: Schema, definitions: Mapping[str, Schema]) -> str:
    """The type of a value in words."""
    found = _resolved(schema, definitions)
    if "anyOf" in found:
        return " or ".join(dict.fromkeys(_type(one, definitions) for one in found["anyOf"]))
    if "const" in found:
        return _literal(found["const"])
    if "enum" in found:
        return ", ".join(map(_literal, found["enum"]))
    if "properties" in found or isinstance(found.get("additionalProperties"), Mapping):
        return "table"
    examples = found.get("examples", ())
    if examples and found.get("type") in ("array", "integer"):
        return f"{_plain_type(found, definitions)}, such as {_literal(examples[0])}"
    if examples:
        return ("quantity, such as " if "pattern" in found else "such as ") + ", ".join(
            map(_literal, examples)
        )
    return _plain_type(found, definitions)


def _plain_type(found: Schema, definitions: Mapping[str, Schema]) -> str:
    """A list, number, truth value or text."""
    if found.get("type") == "array":
        items = found.get("prefixItems") or [found.get("items", {})]
        few = found.get("minItems")
        count = f" of {few}" if few is not None and few == found.get("maxItems") else ""
        return f"list{count} ({', '.join(dict.fromkeys(_type(one, definitions) for one in items))})"
    names = {"boolean": "`true` or `false`", "integer": "integer", "number": "number", "string": "text"}
    name = names.get(str(found.get("type")), "value")
    low, high = (found.get(key) for key in ("minimum", "maximum"))
    bounds = [f"from {low}" if low is not None else "", f"to {high}" if high is not None else ""]
    return " ".join(filter(None, (name, *bounds)))


def _literal(value: object) -> str:
    """A value as TOML writes it."""
    from inercal.faces.studies.schema import toml

    return code(toml(value))


# codes and terms ------------------------------------------------------------------------------------------------------


def status() -> str:
    """Codes of the verdict."""
    from inercal.foundation.findings import Status

    return table(("code", "meaning"), ((code(each.value), each.meaning) for each in Status))


def findings() -> str:
    """Codes of the findings."""
    from inercal.foundation.findings import CODES

    return table(
        ("code", "meaning", "shifts values"),
        ((code(name), each.meaning, each.harm.value) for name, each in sorted(CODES.items())),
    )


def terms() -> str:
    """The table of terms: symbol, name, unit, in the order of results."""
    from inercal.foundation.instruments.terms import TERMS

    return _terms(TERMS.values())


def noise_terms() -> str:
    """The terms of noise."""
    from inercal.foundation.instruments.terms import NOISE_TERMS

    return _terms(NOISE_TERMS.values())


def model_terms() -> str:
    """The terms of a model that pitches; those of its accelerometers are numbered."""
    from inercal.foundation.instruments.terms import MODEL_TERMS, NUMBERED_TERMS

    numbered = (
        replace(each, symbol=f"{each.symbol}_1, ..", name=each.name.format("1, .."))
        for each in NUMBERED_TERMS.values()
    )
    return _terms([*MODEL_TERMS.values(), *numbered])


def _terms(found: Iterable[Any]) -> str:
    """Rows of terms."""
    return table(
        ("symbol", "name", "unit"), ((code(each.symbol), each.name, code(each.unit)) for each in found)
    )


def reference_types() -> str:
    """The reference types of certificates."""
    from inercal.foundation.instruments.dsi import OTHERS
    from inercal.foundation.instruments.dsi import reference_types as types

    rows = [(code(kind), meaning, code(unit)) for kind, (meaning, unit) in types().items()]
    return table(
        ("type", "meaning", "unit"), [*rows, *((code(kind), said, "") for kind, said in OTHERS.items())]
    )


# limits ---------------------------------------------------------------------------------------------------------------


def section_columns() -> str:
    """Columns of a ``sections.csv``, by the texts of the fields of a row."""
    from inercal.systems.imu.sections.cutting import table as of_sections

    meanings = _meanings(inspect.getsource(of_sections), "SectionRow")
    rows = [(code(name), meanings[name]) for name in of_sections.COLUMNS]
    return table(("column", "what it says"), rows)


def limits() -> str:
    """The limits of every room that has some, a table for each; those of the systems first."""
    package, parts = Path(inercal.__file__).parent, []
    paths = [
        path for path in package.rglob("limits.py") if "class Limits" in path.read_text(encoding="utf-8")
    ]
    for path in sorted(paths, key=lambda path: (path.parts[len(package.parts)] != "systems", path)):
        rooms = path.parent.relative_to(package).parts
        room = ".".join(rooms[1:] or rooms)
        module = import_module(f"inercal.{'.'.join(rooms)}.limits")
        meanings = _meanings(path.read_text(encoding="utf-8"), type(module.LIMITS).__name__)
        rows = [(code(name), *_value(value, meanings[name])) for name, value in vars(module.LIMITS).items()]
        parts.append(f"## {room}\n\n" + table(("limit", "value", "meaning"), rows))
    return "\n\n".join(parts)


def _meanings(source: str, name: str) -> dict[str, str]:
    """The docstring below each field of a class."""
    body = next(each.body for each in ast.parse(source).body if getattr(each, "name", "") == name)
    return {
        field.target.id: inspect.cleandoc(text.value.value).replace("\n", " ")
        for field, text in pairwise(body)
        if isinstance(field, ast.AnnAssign) and isinstance(text, ast.Expr)
    }


def _value(value: float, meaning: str) -> tuple[str, str]:
    """A limit with its unit, taken from the brackets of its meaning; angles in degrees if these are round."""
    unit = re.search(r" \[(.+?)\]", meaning)
    if unit is None:
        return f"{value:g}", meaning
    degrees = math.degrees(value)
    whole = unit[1].startswith("rad") and abs(degrees - round(degrees, 2)) < 1e-9
    shown = f"{degrees:.6g} {unit[1].replace('rad', 'deg')}" if whole else f"{value:g} {unit[1]}"
    return shown, meaning.replace(unit[0], "", 1)


# systems --------------------------------------------------------------------------------------------------------------


def offers() -> str:
    """What a system may offer, from the fields of its record, and which of the systems do."""
    from inercal.systems import contract
    from inercal.systems.listed import SYSTEMS

    meanings = _meanings(inspect.getsource(contract), "System")
    default = {field.name: field.default for field in fields(contract.System)}
    given = {
        name: [
            code(kind)
            for kind, system in SYSTEMS.items()
            if getattr(system, name) and getattr(system, name) is not default[name]
        ]
        for name in meanings
    }
    rows = [
        (code(name), meaning, "all" if len(given[name]) == len(SYSTEMS) else ", ".join(given[name]))
        for name, meaning in meanings.items()
    ]
    return table(("of a system", "what it is", "offered by"), rows)


# Python ---------------------------------------------------------------------------------------------------------------


def public() -> str:
    """The names of `inercal` itself, each with its first sentence and where it is defined."""
    import inercal

    rows = []
    for name in inercal.__all__:
        found = getattr(inercal, name)
        where = f"{found.__module__}.{found.__qualname__}"
        rows.append((code(name), f"{{py:obj}}`{where}`", (inspect.getdoc(found) or "").split("\n\n")[0]))
    return table(("name", "defined as", "what it is"), rows)


def words() -> str:
    """The page of words, as `help(inercal)` prints it."""
    import inercal

    return f"```text\n{inspect.getdoc(inercal)}\n```"


PARTS: dict[str, Callable[..., str]] = {
    each.__name__: each
    for each in (
        commands,
        study,
        lab,
        maps,
        status,
        findings,
        terms,
        model_terms,
        noise_terms,
        reference_types,
        limits,
        section_columns,
        offers,
        public,
        words,
    )
}


def put_in(app: Sphinx, page: str, source: list[str]) -> None:
    """Put the generated parts of a page in the place of its comments; links to files outside the book become text."""
    folder = (app.srcdir / page).parent

    def kept(found: re.Match[str]) -> str:
        return found[0] if (folder / found[2]).resolve().is_relative_to(app.srcdir) else found[1]

    def made(found: re.Match[str]) -> str:
        return PARTS[found[1]](*found[2].split())

    source[0] = re.sub(r"(?<!!)\[([^\]]+)\]\(((?:\.\./)+[^)#:]+)(?:#[^)]*)?\)", kept, source[0])
    source[0] = re.sub(r"^<!-- generated: (\w+)(.*) -->$", made, source[0], flags=re.MULTILINE)


def docstring(app: Sphinx, what: str, name: str, found: object, options: object, lines: list[str]) -> None:
    """Docstrings as the house writes them, made ready for napoleon.

    They are plain text with names in backticks: stars, bars and underscores stand for themselves. Below ``Returns``
    and ``Raises`` an entry is ``what : meaning`` on one line, and a property may have a colon in its sentence.
    """
    if what in ("property", "attribute", "data"):
        lines[:] = [plain(line).replace(":", COLON) for line in lines]
        return
    section = ""
    made: list[str] = []
    for line in map(plain, lines):
        if re.fullmatch("-{3,}", line) and made:
            section = made[-1]
        entry = re.match(r"(\S.*?) : (.+)", line) if section in ("Returns", "Raises") else None
        made += [entry[1], f"    {entry[2]}"] if entry else [line]
    lines[:] = made


def colons(app: Sphinx, what: str, name: str, found: object, options: object, lines: list[str]) -> None:
    """Put back the colons that napoleon was not to see."""
    lines[:] = [line.replace(COLON, ":") for line in lines]


def signature(
    app: Sphinx, what: str, name: str, found: object, options: object, shown: str | None, returned: str | None
) -> tuple[str | None, str | None]:
    """A signature with the short names of its types."""
    return (None if shown is None else short(shown)), (None if returned is None else short(returned))


def short(text: str) -> str:
    """Types without their modules, and defaults made by a factory left open."""
    text = re.sub(r"TypeAliasForwardRef\('(\w+)'\)", r"\1", text)
    return re.sub(r"~?\b(?:[a-z_]\w*\.)+(?=[A-Z_a-z])", "", text.replace("<factory>", "..."))


def plain(line: str) -> str:
    """A line in which only backticks mean something."""
    parts = re.split(r"(``.*?``|`.*?`)", line)
    parts[::2] = [re.sub(r"[*|]|_(?=\W|$)", r"\\\g<0>", part) for part in parts[::2]]
    return "".join(parts)


def found_by_short_name(
    app: Sphinx, env: BuildEnvironment, node: pending_xref, content: nodes.TextElement
) -> nodes.reference | None:
    """Where a name in a docstring has no module before it: the one object of that name, if there is one."""
    if node.get("refdomain") != "py":
        return None
    objects = env.domains.python_domain.objects
    target = node["reftarget"].lstrip(".")
    alike = [name for name in objects if name == target or name.endswith("." + target)]
    if len(alike) != 1 or app.builder is None:
        return None
    page = objects[alike[0]].docname
    uri = app.builder.get_relative_uri(node["refdoc"], page) + "#" + objects[alike[0]].node_id
    return nodes.reference("", "", content, internal=True, refuri=uri, reftitle=alike[0])


def setup(app: Sphinx) -> dict[str, bool]:
    """Register with Sphinx."""
    app.add_lexer("csv", TextLexer)
    app.connect("source-read", put_in)
    app.connect("autodoc-process-docstring", docstring, priority=400)
    app.connect("autodoc-process-docstring", colons, priority=600)
    app.connect("autodoc-process-signature", signature)
    app.connect("missing-reference", found_by_short_name)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
