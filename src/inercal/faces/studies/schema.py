"""One JSON Schema for all kinds of study, made from the models that read them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

from pydantic.json_schema import GenerateJsonSchema, models_json_schema
from pydantic_core import core_schema

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
