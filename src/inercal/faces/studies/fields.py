"""Fields that hold quantities, or one unit over another: texts with units in the file, numbers in SI in Python."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import PydanticCustomError, core_schema

from inercal.foundation.errors import InputError, QuantityError
from inercal.foundation.units import Quantity, parse_quantity, parse_unit, shown

# What `parse_quantity` accepts, for editors; the unit itself is looked up only when the study is read.
_NUMBER = r"[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)"
_VALUE = rf"^\s*{_NUMBER}(\([0-9]+(\.[0-9]+)?\))?([eE][+-]?[0-9]+)?"
_PLUS_MINUS = rf"(\s*(±|\+/-|\+-)\s*{_NUMBER}([eE][+-]?[0-9]+)?)?"
_UNIT = r"\s*[^0-9\s(.].*"


def anything(value: float) -> bool:
    """Accept every value."""
    return True


def positive(value: float) -> bool:
    """Accept values above zero."""
    return value > 0.0


class AsTyped:
    """Base of what makes a pydantic field read a value: by `parse`, and written back as it was typed."""

    def parse(self, typed: Any) -> Any:
        """Read one value; refusals go to pydantic, which knows the key."""
        raise NotImplementedError

    def __get_pydantic_core_schema__(
        self, source: type[Any], handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        """Validate by `parse`; write back what was typed."""
        as_typed = core_schema.plain_serializer_function_ser_schema(
            lambda value: value.text if isinstance(value, Quantity) else value.typed
        )
        return core_schema.no_info_plain_validator_function(self.parse, serialization=as_typed)


@dataclass(frozen=True)
class Word:
    """A word that was typed in place of a quantity, and the ``value`` of the field that it stands for."""

    value: Any
    typed: str


@dataclass(frozen=True)
class QuantityText(AsTyped):
    """Makes a pydantic field read a quantity from its text: ``Annotated[Quantity, QuantityText("time")]``.

    ``dimension`` is a key of the unit table, ``example`` a good value for the JSON Schema, ``accepts`` true for a value
    [SI] that makes sense, and ``expected`` the same in words, for the error message: "a time above zero". ``words`` may
    stand in its place; ``uncertain``: it needs an uncertainty.
    """

    dimension: str
    example: str
    accepts: Callable[[float], bool] = anything
    expected: str = ""
    words: Mapping[str, Any] = field(default_factory=dict, hash=False)
    uncertain: bool = False

    def parse(self, text: object) -> Any:
        """Read one quantity, or `Word`; refusals go to pydantic, which knows the key."""
        if isinstance(text, str) and text in self.words:
            return Word(self.words[text], text)
        words = "".join(f", or {word}" for word in self.words)
        try:
            quantity = parse_quantity(text, self.dimension, "quantity", self.example)
        except QuantityError as error:
            raise refusal(f"{error.message}{words}") from error
        if self.uncertain and quantity.u == 0.0:
            raise refusal(
                f"found {shown(text)}, expected it with its standard uncertainty, such as {self.example!r}"
            )
        if self.accepts(quantity.value):
            return quantity
        si = "" if quantity.unit.symbol == quantity.unit.si else f", that is {_in_si(quantity)}"
        raise refusal(f"found {shown(text)}{si}, expected {self.expected}{words}")

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """A text of that shape; a bare number too where no unit is needed."""
        bare = self.dimension == "number"
        unit = rf"({_UNIT}|\s*1)?" if bare else _UNIT
        quantity = {
            "type": ["string", "number"] if bare else "string",
            "pattern": rf"{_VALUE}{_PLUS_MINUS}{unit}\s*$",
            "examples": [self.example],
        }
        words = [{"const": word, "type": "string"} for word in self.words]
        return {"anyOf": [quantity, *words]} if words else quantity


@dataclass(frozen=True)
class Several:
    """Quantities of one kind, and the text or the list of texts that was typed."""

    quantities: tuple[Quantity, ...]
    typed: object

    @property
    def values(self) -> tuple[float, ...]:
        """In SI."""
        return tuple(quantity.value for quantity in self.quantities)

    @property
    def u(self) -> tuple[float, ...]:
        """Their standard uncertainties, in SI."""
        return tuple(quantity.u for quantity in self.quantities)


@dataclass(frozen=True)
class SeveralTexts(AsTyped):
    """Makes a pydantic field read a list of quantities: ``Annotated[Several, SeveralTexts(each, "x, y, z")]``.

    As many are expected as there are names in ``of``, parted by commas; ``one``: a single text may stand for all.
    """

    each: QuantityText
    of: str
    one: bool = False

    def parse(self, typed: object) -> Several:
        """Read them all; the first thing wrong goes to pydantic, which knows the key."""
        count = len(self.of.split(","))
        if isinstance(typed, list):
            if len(typed) == count:
                return Several(tuple(self.each.parse(text) for text in typed), typed)
        elif self.one and not isinstance(typed, dict):
            return Several((self.each.parse(typed),) * count, typed)
        words = f"a list of {count}, for {self.of}{', or one for all' if self.one else ''}"
        raise refusal(f"found {shown(typed)}, expected {words}")

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """An array of so many, or one."""
        each = self.each.__get_pydantic_json_schema__(schema, handler)
        count = len(self.of.split(","))
        several = {"type": "array", "items": each, "minItems": count, "maxItems": count}
        return {"anyOf": [each, several]} if self.one else several


def refusal(message: str, key: str = "") -> PydanticCustomError:
    """An error that `inercal.foundation._toml.check` reports in just these words, after the dotted key; ``key`` is one
    of the table that is refused."""
    return PydanticCustomError("refused", "refused", {"error": InputError(key, message)})


def _in_si(quantity: Quantity) -> str:
    """The value in SI, short."""
    return f"{quantity.value:.6g} {quantity.unit.si}".removesuffix(" 1")


Temperature = Annotated[
    Quantity,
    QuantityText("temperature", "23 degC", lambda t: t > -273.15, "a temperature above absolute zero"),
]
"""A temperature."""


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

    def parse(self, text: object) -> Any:
        """Read one value."""
        quantity = super().parse(text)
        return quantity if isinstance(quantity, Word) else exact(quantity)


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
