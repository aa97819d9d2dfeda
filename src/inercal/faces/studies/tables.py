"""Tables of a study that are made from settings: their keys are those of the fields (`inercal.foundation.keys`)."""

from __future__ import annotations

import datetime
import functools
from collections.abc import Mapping
from dataclasses import MISSING, dataclass
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_type_hints

from pydantic import Field, GetCoreSchemaHandler, create_model
from pydantic_core import core_schema

from inercal.faces.studies.fields import QuantityText
from inercal.foundation._toml import Strict
from inercal.foundation.keys import Key, keys_of
from inercal.foundation.units import Quantity

T = TypeVar("T")


@functools.cache
def table_of(settings: type) -> Any:
    """The pydantic model of a table whose keys are those of ``settings``; a base class for tables with more keys."""
    hints = get_type_hints(settings)
    system = settings.__module__.split(".")[:2][-1].capitalize()
    fields: dict[str, Any] = {
        key.name or field.name: (
            _quantity(key) if key.dimension else _plain(hints[field.name]),
            _described(key, field.default),
        )
        for field, key in keys_of(settings)
    }
    says = (settings.__doc__ or "").partition("\n\n")[0]
    return create_model(f"{system}{settings.__name__}", __base__=Strict, __doc__=says, **fields)


def settings_of(settings: type[T], table: Any, **more: Any) -> T:
    """The settings that a table states, and ``more`` of their fields; those of absent keys are as usual."""
    hints = get_type_hints(settings)
    values: dict[str, Any] = {}
    for field, key in keys_of(settings):
        typed = getattr(table, key.name or field.name)
        if key.several:
            values[field.name] = tuple(each.value for each in typed or ())
        elif isinstance(typed, Quantity) and "Quantity" not in str(hints[field.name]):
            values[field.name] = typed.value
            if key.u:
                values[key.u] = typed.u
        elif typed is not None:
            values[field.name] = Path(typed) if "Path" in str(hints[field.name]) else typed
    return settings(**values | more)


@dataclass(frozen=True)
class _Reader:
    """Lets a pydantic field hold settings: read as their table, built by `settings_of`."""

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        """Validate the table, then build."""
        table = handler.generate_schema(table_of(source))
        return core_schema.no_info_after_validator_function(functools.partial(settings_of, source), table)


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


def _quantity(key: Key) -> Any:
    """The type of a quantity, or of a list of them."""
    example = key.example[0] if isinstance(key.example, list) else key.example
    one = Annotated[Quantity, QuantityText(key.dimension, str(example), key.bounds.accept, key.bounds.words)]
    return list[one] if key.several else one


def _plain(hint: Any) -> Any:
    """The type of a plain value as TOML has it: a file is a text."""
    if "Path" in str(hint):
        return Annotated[str, Field(min_length=1)]
    if hint in (int, float, bool):
        return Annotated[hint, Field(strict=True)]
    return hint


def _described(key: Key, default: Any) -> Any:
    """Meaning, default and bounds of a field; an absent quantity is None, the settings know what it stands for."""
    absent = ... if default is MISSING else None if key.dimension else default
    examples = None if key.example is None or (key.dimension and not key.several) else [key.example]
    return Field(
        default=absent,
        description=key.says,
        ge=None if key.several else key.least,
        le=key.most,
        min_length=int(key.least or 0) or None if key.several else None,
        examples=examples,
        json_schema_extra={"default": key.default} if key.default else None,
    )
