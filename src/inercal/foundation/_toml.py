"""TOML files in: read, check against a pydantic model, and one clear sentence for whatever is wrong."""

from __future__ import annotations

import difflib
import re
import tomllib
from collections.abc import Mapping
from dataclasses import is_dataclass
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

from pydantic import BaseModel, ConfigDict, ValidationError

from inercal.foundation._files import input_text
from inercal.foundation.errors import InputError
from inercal.foundation.keys import in_place_of, keys_of
from inercal.foundation.units import shown


class Strict(BaseModel):
    """Base of every model read from a file: frozen, and unknown keys are errors."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


M = TypeVar("M", bound=BaseModel)


def read_toml(path: str | Path, error: type[InputError]) -> dict[str, Any]:
    """Parse a TOML file; raises ``error`` naming file, line and column."""
    text = input_text(path, "a TOML file", error)
    try:
        return tomllib.loads(text)
    except ValueError as problem:  # a TOMLDecodeError, an integer of thousands of digits
        twice = _given_twice(text, str(problem))
        raise error(path, twice or f"not valid TOML: {str(problem)[:200]}") from problem
    except RecursionError as problem:
        raise error(path, "tables or lists are nested too deeply, expected a TOML file") from problem


def _given_twice(text: str, problem: str) -> str | None:
    """A sentence for a key that occurs twice in a table, which the parser reports as an overwriting."""
    if not problem.startswith("Cannot overwrite a value"):
        return None
    lines = text.rstrip().splitlines()
    at = re.search(r"at line (\d+)", problem)
    number = int(at[1]) if at else len(lines)
    key = re.match(r"""\s*([\w."'-]{1,80})\s*=""", lines[number - 1])
    return f"line {number}: {key[1] if key else 'a key'} is given a second time, expected it once"


def check(model: type[M], data: Mapping[str, Any], where: object, error: type[InputError]) -> M:
    """Validate ``data``; raises ``error`` for the first thing wrong, naming the key and what was expected."""
    try:
        return model.model_validate(data)
    except ValidationError as problem:
        faults = problem.errors()
        # a misspelt key also shows as a missing one: the misspelling is what to say
        first = next((fault for fault in faults if fault["type"] == "extra_forbidden"), faults[0])
        cause = first.get("ctx", {}).get("error")
        if isinstance(cause, InputError):
            at = ".".join(filter(None, (_dotted(first["loc"]), cause.where)))
            raise error(where, f"{at}: {cause.message}" if at else cause.message) from problem
        raise error(where, _sentence(model, first)) from problem
    except InputError as problem:  # raised by a validator with its own words
        raise error(where, str(problem)) from problem


def _dotted(location: tuple[Any, ...]) -> str:
    """``imu.static_start`` for ("imu", "static_start"); a key that needs quotes gets them.

    Pydantic's name for the branch of a union, where a quantity or a word may stand, is left out.
    """
    keys = (text for part in location if not (text := str(part)).startswith("function-plain["))
    return ".".join(text if re.fullmatch(r"[\w-]{1,80}", text) else shown(text) for text in keys)


def _sentence(model: type[BaseModel], first: Any) -> str:
    """One sentence for one pydantic error."""
    key, value = _dotted(first["loc"]), first.get("input")
    match first["type"]:
        case "extra_forbidden" if gone := in_place_of(key, ""):
            return f"{key}: found {shown(value)}, {gone}"
        case "extra_forbidden":
            keys = _known_keys(model, first["loc"][:-1])
            near = difflib.get_close_matches(str(first["loc"][-1])[:80], keys, n=1, cutoff=0.5)
            hint = f"did you mean {near[0]}?" if near else f"known keys: {', '.join(keys)}"
            return f"{key}: unknown key, {hint}"
        case "missing":
            return f"{key}: missing, expected a value"
        case "literal_error" if isinstance(value, str) and (gone := in_place_of(key, value)):
            return f"{key}: found {shown(value)}, {gone}"
        case "literal_error":
            return f"{key}: found {shown(value)}, expected {first['ctx']['expected']}"
        case "model_type" | "dict_type":
            return f"{key}: found {shown(value)}, expected a table"
        case "list_type" | "tuple_type":
            return f"{key}: found {shown(value)}, expected a list in brackets"
        case "too_short":
            return f"{key}: found {shown(value)}, expected {first['ctx']['min_length']} or more in it"
        case "too_long":
            return f"{key}: found {shown(value)}, expected {first['ctx']['max_length']} or fewer in it"
        case "string_too_short":
            return f"{key}: found {shown(value)}, expected a text that is not empty"
        case "int_type" | "int_from_float":
            return f"{key}: found {shown(value)}, expected a whole number"
        case "bool_type":
            return f"{key}: found {shown(value)}, expected true or false"
        case "string_type":
            return f"{key}: found {shown(value)}, expected a text in quotes"
        case _:
            words = first["msg"].removeprefix("Value error, ").removeprefix("Input ").rstrip(".")
            return f"{key}: found {shown(value)}, {words.replace('should be', 'expected')}"


def _known_keys(model: type[BaseModel], path: tuple[Any, ...]) -> list[str]:
    """Keys of the (nested) table at that path."""
    table: type[Any] = model
    for part in path:
        # else a table of tables keyed by the user's own names: the model is one level up
        table = settings_in(_annotations(table).get(str(part))) or table
    return list(_annotations(table))


def _annotations(table: type[Any]) -> dict[str, Any]:
    """Keys of a model or of settings, and their types."""
    if is_dataclass(table):
        hints = get_type_hints(table)
        return {key.name or field.name: hints[field.name] for field, key in keys_of(table)}
    return {field.alias or name: field.annotation for name, field in table.model_fields.items()}


def settings_in(annotation: Any) -> type[Any] | None:
    """The model or settings inside a type such as ``Model | None`` or ``dict[str, Model]``."""
    if isinstance(annotation, type) and (issubclass(annotation, BaseModel) or is_dataclass(annotation)):
        return annotation
    return next((table for part in get_args(annotation) if (table := settings_in(part))), None)
