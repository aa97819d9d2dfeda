"""Fields that hold one unit over another: a sensor's scale (``0.5 g/V``, ``16384 count/g``), what changes with
temperature (``10 ug/K``)."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from pydantic import GetJsonSchemaHandler
from pydantic_core import core_schema

from inercal.errors import QuantityError
from inercal.studies.fields import AsTyped, QuantityText, refusal
from inercal.units import Quantity, parse_quantity, parse_unit, shown

ELECTRIC = {"voltage": "V", "count": "count"}
"""Dimension of a column that is no physical quantity -> the unit it is counted in."""


@dataclass(frozen=True)
class Ratio:
    """``value`` in SI ``per`` unit of the record's column ("1" where that is in physical units) or per kelvin."""

    value: float
    per: str
    typed: object


@dataclass(frozen=True)
class ScaleText(AsTyped):
    """A scale to a ``dimension``: a number, or so much per volt or count, or volts or counts per so much.

    The two units are parted by a slash: the last one before V or count, the first one behind it, so that ``deg/s``
    may stand on either side, in brackets or not. ``examples`` are shown where the text is none, and in the schema.
    """

    dimension: str
    examples: tuple[str, ...]

    def parse(self, typed: object) -> Ratio:
        """Read one scale."""
        ratio = next(self._readings(typed), None)
        if ratio is None:
            others = ", ".join(f'"{text}"' for text in self.examples[1:])
            raise refusal(
                f"found {shown(typed)}, expected a number other than 0, or one such as {others}; without an uncertainty"
            )
        return ratio

    def _readings(self, typed: object) -> Iterator[Ratio]:
        """Readings of the text that are finite, not zero, and exact."""
        for quantity, up, electric in self._ratios(typed):
            value = quantity.value if up else 1.0 / quantity.value if quantity.value else math.inf
            if quantity.u == 0.0 and value != 0.0 and math.isfinite(value):
                yield Ratio(value, electric, typed)

    def _ratios(self, typed: object) -> Iterator[tuple[Quantity, bool, str]]:
        """A quantity in SI, whether it is the scale rather than its inverse, and what the column holds."""
        try:
            yield parse_quantity(typed, "number", "scale"), True, "1"
            return
        except QuantityError:
            match = _SPLIT.fullmatch(typed) if isinstance(typed, str) else None
        if match is None:
            return
        above, _, below = match["unit"].rpartition("/")
        first, _, rest = match["unit"].partition("/")
        for physical, electric, up in ((above, below, True), (rest, first, False)):
            dimension = _dimension(electric)
            if dimension in ELECTRIC and _dimension(_bare(physical)) == self.dimension:
                over = parse_unit(_bare(physical)).factor / parse_unit(electric).factor
                number = parse_quantity(match["number"], "number", "scale")
                factor = over if up else 1.0 / over
                scaled = Quantity(number.value * factor, number.u * factor, number.unit, number.text)
                yield scaled, up, ELECTRIC[dimension]

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """A text or a bare number."""
        return {"type": ["string", "number"], "examples": list(self.examples)}


@dataclass(frozen=True)
class SlopeText(AsTyped):
    """A change with temperature: ``10 ug/K``; ``dimension`` above the bar, ``example`` a good value."""

    dimension: str
    example: str

    def parse(self, typed: object) -> Ratio:
        """Read one slope [SI/K]."""
        above, bar, below = typed.rpartition("/") if isinstance(typed, str) else ("", "", "")
        try:
            if not bar or below.strip() not in ("K", "degC", "°C"):
                raise refusal(f"found {shown(typed)}, expected one per kelvin such as {self.example!r}")
            quantity = parse_quantity(above, self.dimension, "slope")
        except QuantityError as error:
            raise refusal(f"found {shown(typed)}, expected one such as {self.example!r}") from error
        return Ratio(exact(quantity).value, "K", typed)

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """A text."""
        return {"type": "string", "examples": [self.example]}


@dataclass(frozen=True)
class ExactText(QuantityText):
    """A quantity whose uncertainty is stated elsewhere: one beside it is refused."""

    def parse(self, text: object) -> Quantity:
        """Read one value."""
        return exact(super().parse(text))


def exact(quantity: Quantity) -> Quantity:
    """The quantity; refused where it has an uncertainty, which nobody would heed."""
    if quantity.u != 0.0:
        raise refusal(
            f"found {shown(quantity.text)} with an uncertainty, expected it without: what is not known of sensors "
            "stands under [prior] and [noise]"
        )
    return quantity


_SPLIT = re.compile(
    r"\s*(?P<number>[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:\([0-9.]+\))?(?:[eE][+-]?[0-9]+)?)\s*"
    r"(?P<unit>[^\d\s.,/][^/]*/.*\S)\s*"
)


def _bare(text: str) -> str:
    """A unit without brackets around it."""
    plain = text.strip()
    return plain[1:-1] if plain.startswith("(") and plain.endswith(")") else plain


def _dimension(text: str) -> str:
    """Dimension of a unit; empty for a text that is none."""
    try:
        return parse_unit(text).dimension if text.strip() else ""
    except QuantityError:
        return ""
