"""Rows out: a line, its values, and these as quantities with unit and uncertainty."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from typing import NamedTuple

from inercal.foundation.records.titles import name_and_unit


class Row(NamedTuple):
    """A row of an estimator: its line, its values (NaN and texts as they are), and when its sample came [s]."""

    text: str
    values: Sequence[float | str]
    at: float


def payload(columns: Sequence[str], values: Sequence[float | str]) -> bytes:
    """A row as JSON: by name its value, its standard uncertainty u where a column has it, and their unit."""
    quantities = quantities_of(columns, values)
    return json.dumps(quantities, separators=(",", ":"), ensure_ascii=False).encode()


def quantities_of(
    columns: Sequence[str], values: Sequence[float | str]
) -> dict[str, dict[str, float | str | None]]:
    """Value, u and unit of each quantity of a row, by name; None for a value that is not known."""
    named = {
        name: (value if isinstance(value, str) or math.isfinite(value) else None, unit or "1")
        for (name, unit), value in zip(map(name_and_unit, columns), values, strict=True)
    }
    quantities: dict[str, dict[str, float | str | None]] = {}
    for name, (value, unit) in named.items():
        if name.startswith("u_") and name[2:] in named:
            continue
        quantity: dict[str, float | str | None] = {"value": value}
        if f"u_{name}" in named:
            quantity["u"] = named[f"u_{name}"][0]
        quantities[name] = quantity | {"unit": unit}
    return quantities
