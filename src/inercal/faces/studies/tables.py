"""Tables of a study that are made from settings: their keys are those of the fields (`inercal.foundation.keys`)."""

from __future__ import annotations

import dataclasses
import datetime
import functools
import json
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, is_dataclass
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, TypeVar, cast, get_args, get_origin, get_type_hints

from pydantic import Field, GetCoreSchemaHandler, GetJsonSchemaHandler, create_model
from pydantic_core import core_schema

from inercal.faces.studies.fields import ExactText, QuantityText, Several, SeveralTexts, Word, refusal
from inercal.foundation._toml import Strict, settings_in
from inercal.foundation.errors import InputError
from inercal.foundation.keys import OUTPUT, Key, Reading, keys_of, unheeded
from inercal.foundation.units import Quantity, shown

T = TypeVar("T")


@functools.cache
def table_of(settings: type, tables: bool | None = None, needed: bool = True) -> Any:
    """The pydantic model of a table whose keys are those of ``settings``; a base class for tables with more keys.

    ``tables``: of those keys the tables, or all but the tables; ``needed``: keys without a default must be there.
    """
    hints = _hints(settings)
    system = settings.__module__.split(".")[:3][-1].capitalize()
    fields: dict[str, Any] = {
        key.name or field.name: (
            _type(key, hints[field.name], field.default),
            _described(key, field, hints[field.name], needed),
        )
        for field, key in keys_of(settings)
        if tables in (None, key.table)
    }
    says = (settings.__doc__ or "").partition("\n\n")[0]
    return create_model(f"{system}{settings.__name__}", __base__=Strict, __doc__=says, **fields)


@functools.cache
def _hints(settings: type) -> dict[str, Any]:
    """Types of the fields of settings."""
    return get_type_hints(settings)


def settings_of(settings: type[T], *tables: Any, **more: Any) -> T:
    """The settings that tables state, and ``more`` of their fields; those of absent keys are as usual."""
    return settings(**_stated(settings, tables) | more)


def replaced(usual: T, *tables: Any) -> T:
    """The ``usual`` settings with what tables state."""
    made: T = dataclasses.replace(cast(Any, usual), **_stated(type(usual), tables))
    return made


def _stated(settings: type, tables: Sequence[Any]) -> dict[str, Any]:
    """Fields of settings whose keys stand in a table, and their values."""
    hints = _hints(settings)
    values: dict[str, Any] = {}
    for field, key in keys_of(settings):
        name = key.name or field.name
        typed = next((getattr(table, name) for table in tables if name in table.model_fields_set), None)
        if typed is not None:
            values[field.name] = _value(typed, str(hints[field.name]))
            if key.u and isinstance(typed, Quantity | Several):
                values[key.u] = typed.u
    return values


def check_kind(settings: type, table: Strict, kind: str, word: str = "kind", at: str = "") -> None:
    """Refuse keys of a table that a ``kind`` does not heed, and miss those that it needs; ``word`` is its key and
    ``at`` begins the keys of the table, for errors."""
    for name, kinds in unheeded(settings, kind).items():
        if name in table.model_fields_set:
            words = f"found with {word} = {kind!r}, expected it with {' or '.join(kinds)} only"
            raise refusal(words, f"{at}{name}")
    for field, key in keys_of(settings):
        name = key.name or field.name
        if kind in key.needed and name not in table.model_fields_set:
            raise refusal(f"missing, expected it with {word} = {kind!r}", f"{at}{name}")


@dataclass(frozen=True, eq=False)
class _Reader:
    """Lets a pydantic field hold settings: read as their table, built by `settings_of`, with absent keys as ``usual``.

    Keys of one kind alone are checked by the key ``kind`` beside them. ``words`` may stand in place of the table, for
    what they are; ``such`` is a good one.
    """

    usual: Any = None
    words: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    such: object = None

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        """Validate the table, then build."""

        def built(table: Any) -> Any:
            if "kind" in type(table).model_fields:
                check_kind(source, table, table.kind)
            try:
                return settings_of(source, table) if self.usual is None else replaced(self.usual, table)
            except InputError as error:
                raise refusal(error.message, error.where) from error

        def worded(typed: Any, read: core_schema.ValidatorFunctionWrapHandler) -> Any:
            if not isinstance(typed, str):
                return read(typed)
            if typed in self.words:
                return Word(self.words[typed], typed)
            words = " or ".join(f'"{word}"' for word in self.words)
            raise refusal(
                f"found {shown(typed)}, expected {words} or a table such as {_in_braces(self.such)}"
            )

        table = handler.generate_schema(table_of(source, needed=self.usual is None))
        made = core_schema.no_info_after_validator_function(built, table)
        return core_schema.no_info_wrap_validator_function(worded, made) if self.words else made

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """That of the table, or a word."""
        made = handler(schema)
        return {"anyOf": [made, *({"const": word} for word in self.words)]} if self.words else made


def _in_braces(example: Any) -> str:
    """A table of texts as TOML has it on one line."""
    return f"{{ {', '.join(f'{key} = {json.dumps(text)}' for key, text in example.items())} }}"


Stated = Annotated[T, _Reader()]
"""Settings as a field of a model: ``noise: Stated[Noise]``."""


def as_typed(data: Mapping[str, Any]) -> dict[str, Any]:
    """The keys of a study, ready for JSON: values as typed, dates as texts."""

    def plain(value: Any) -> Any:
        if isinstance(value, Mapping):
            return as_typed(value)
        if isinstance(value, list):
            return [plain(each) for each in value]
        return value.isoformat() if isinstance(value, datetime.date) else value

    return {key: plain(value) for key, value in data.items()}


@dataclass(frozen=True, eq=False)
class _Parsed:
    """Lets a pydantic field read an entry by its `Reading`."""

    reading: Reading

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        """Parse; refusals go to pydantic, which knows the key."""

        def parsed(typed: Any) -> Any:
            try:
                return self.reading.parse(typed)
            except InputError as error:
                raise refusal(error.message) from error

        return core_schema.no_info_plain_validator_function(parsed)

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """That of the reading."""
        return dict(self.reading.schema)


def _value(typed: Any, hint: str) -> Any:
    """The value of a field that was typed: quantities in SI, lists as tuples, files as paths."""
    match typed:
        case Word():
            return typed.value
        case Several():
            return typed.quantities if "Quantity" in hint else typed.values
        case Quantity():
            return typed if "Quantity" in hint else typed.value
        case list():
            return tuple(_value(entry, hint) for entry in typed)
        case dict():
            return {name: _value(entry, hint) for name, entry in typed.items()}
    return Path(typed) if "Path" in hint and isinstance(typed, str) else typed


def _type(key: Key, hint: Any, default: Any) -> Any:
    """The pydantic type of a key by that of its field: a list for a tuple, a table of one's own names for a mapping."""
    one: Any
    if key.table and not key.reads:
        usual = default if is_dataclass(default) else None
        one = Annotated[settings_in(hint), _Reader(usual, key.words, key.example)]
    elif key.dimension == OUTPUT:
        one = str
    elif key.dimension:
        text = ExactText if key.exact else QuantityText
        example = key.example
        while isinstance(example, list | dict):
            example = example[0] if isinstance(example, list) else next(iter(example.values()))
        bounds = key.bounds
        read = text(key.dimension, str(example), bounds.accept, bounds.words, key.words, key.uncertain)
        one = Annotated[Quantity, read]
        if key.of:
            one = Annotated[Several, SeveralTexts(read, key.of, one=key.one)]
    elif key.reads:
        one = Annotated[Any, _Parsed(key.reads)]
    else:
        return _plain(hint)
    return _shaped(hint, one, bool(key.of))


def _shaped(hint: Any, one: Any, row: bool) -> Any:
    """The type of entries as the hint has them: lists for tuples, tables of one's own names for mappings; ``row``: a
    tuple of plain values is one entry."""
    shape, inside = get_origin(hint), get_args(hint)
    if shape is Mapping:
        return dict[str, one]
    if shape is not tuple or inside[-1] is not Ellipsis or (row and get_origin(inside[0]) is not tuple):
        return one
    return list[_shaped(inside[0], one, row)]  # type: ignore[misc]


def _plain(hint: Any) -> Any:
    """The type of a plain value as TOML has it: a file is a text, a tuple of any length a list; nothing is none."""
    hint = _given(hint)
    if "Path" in str(hint):
        return Annotated[str, Field(min_length=1)]
    if hint in (int, float, bool):
        return Annotated[hint, Field(strict=True)]
    if get_origin(hint) is tuple and get_args(hint)[-1] is Ellipsis:
        return list[_plain(get_args(hint)[0])]  # type: ignore[misc]
    return hint


def _given(hint: Any) -> Any:
    """The hint without None, which TOML does not have."""
    kinds = [kind for kind in get_args(hint) if kind is not NoneType]
    return kinds[0] if len(kinds) == 1 and len(get_args(hint)) == 2 else hint


def _described(key: Key, field: dataclasses.Field[Any], hint: Any, needed: bool) -> Any:
    """Meaning, default and bounds of a field; an absent quantity is None, the settings know what it stands for."""
    default: Any = field.default if field.default_factory is MISSING else {}
    if default is MISSING and not needed:
        default = None
    plain = not (key.dimension or key.table)
    hint = _given(hint)
    listed = get_origin(hint) is tuple
    long = listed or hint is str
    absent = (
        ...
        if default is MISSING
        else None
        if key.dimension
        else list(default)
        if default and listed
        else default
    )
    quantity = key.dimension not in ("", OUTPUT) and not (
        listed or key.words or key.of or isinstance(default, dict)
    )
    title = (key.name or field.name).replace("_", " ").capitalize() if key.table and not listed else None
    return Field(
        default=absent,
        title=title,
        description=key.says,
        ge=key.least if plain and not long else None,
        le=key.most if plain and not long else None,
        min_length=int(key.least or 0) or None if long else None,
        max_length=int(key.most or 0) or None if long else None,
        examples=None if key.example is None or quantity else [key.example],
        json_schema_extra={"default": key.default} if key.default else None,
    )
