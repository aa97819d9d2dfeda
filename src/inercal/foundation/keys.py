"""Keys of a study, written once with the field of settings: name, unit, default, bounds and meaning.

A field of a settings dataclass is made by `quantity`, `quantities` or `option`; from it follow the reading of the key
(`inercal.faces.studies.tables`), its JSON Schema, its line in the reference and in the study that `inercal new` writes.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from inercal.foundation.units import parse_quantity


@dataclass(frozen=True)
class Bounds:
    """Which values [SI] make sense, and the same in words: "a time above zero"."""

    accept: Callable[[float], bool]
    words: str


ANYTHING = Bounds(lambda value: True, "")


def above_zero(what: str) -> Bounds:
    """Values above zero of ``what``, a noun with its article."""
    return Bounds(lambda value: value > 0.0, f"{what} above zero")


def within(low: float, high: float, words: str) -> Bounds:
    """Values from ``low`` to ``high`` [SI], both included."""
    return Bounds(lambda value: low <= value <= high, words)


TIME = above_zero("a time")
FREQUENCY = above_zero("a frequency")
RATE = above_zero("a rate")
DEVIATION = above_zero("a standard deviation")
PART = Bounds(lambda part: 0.0 <= part < 1.0, "a part from 0 to below 1")
RELATIVE_U = Bounds(lambda u: 0.0 <= u < 1.0, "0 or more, and below 1")


@dataclass(frozen=True)
class Key:
    """The key of a study that states a field.

    Attributes
    ----------
    says : str
        Its meaning, for people.
    dimension : str
        Of a quantity, as in `inercal.foundation.units.parse_quantity`; empty for a plain value, whose type is that of
        the field.
    default : str
        The text that an absent quantity stands for; empty where ``says`` tells.
    example : object
        A good value.
    bounds : Bounds
        Of a quantity.
    name : str
        The key in the study; empty where it is that of the field.
    u : str
        Field of the same settings that takes the standard uncertainty of the quantity.
    several : bool
        A list of quantities.
    least, most : float or None
        Bounds of a plain number; ``least`` of a list is its length.
    """

    says: str
    dimension: str = ""
    default: str = ""
    example: object = None
    bounds: Bounds = ANYTHING
    name: str = ""
    u: str = ""
    several: bool = False
    least: float | None = None
    most: float | None = None


REQUIRED: Any = dataclasses.MISSING
"""In place of a default: the study must state the key."""


def quantity(
    says: str,
    dimension: str,
    default: Any = None,
    *,
    example: str = "",
    bounds: Bounds = ANYTHING,
    name: str = "",
    u: str = "",
) -> Any:
    """A field that a study states as a text with a unit.

    ``default`` is such a text, or the value [SI] of an absent key where there is no text for it, or `REQUIRED`; the
    other parameters are those of `Key`.
    """
    text = default if isinstance(default, str) else ""
    value = parse_quantity(text, dimension, says).value if text else default
    key = Key(says, dimension, text, example or text, bounds, name, u)
    return dataclasses.field(default=value, metadata={"key": key})


def quantities(
    says: str, dimension: str, *, example: list[str], bounds: Bounds = ANYTHING, at_least: int = 1
) -> Any:
    """A field that a study states as a list of quantities; empty where the key is absent."""
    key = Key(says, dimension, example=example, bounds=bounds, several=True, least=at_least)
    return dataclasses.field(default=(), metadata={"key": key})


def option(
    says: str,
    default: Any = REQUIRED,
    *,
    example: object = None,
    name: str = "",
    least: float | None = None,
    most: float | None = None,
) -> Any:
    """A field that a study states as a plain value: a word, a number, true or false, or a file."""
    key = Key(says, example=example, name=name, least=least, most=most)
    return dataclasses.field(default=default, metadata={"key": key})


def keys_of(settings: type) -> Iterator[tuple[dataclasses.Field[Any], Key]]:
    """Fields of a settings dataclass that a study states, with their keys."""
    for each in dataclasses.fields(settings):
        if key := each.metadata.get("key"):
            yield each, key


GONE: Mapping[tuple[str, str], str] = {
    ("static", "difference"): "complementary, the same angle once the dual accelerometer has made both axes equal",
    ("static", "gls"): "the fusion, which weighs all axes by their errors",
}  # fmt: skip
"""Choices that versions up to 0.2.0 had, by key or option and choice: what to use in their place."""


def in_place_of(key: str, choice: str) -> str | None:
    """The end of a sentence on a ``choice`` of a key or option that is gone; None for one that never was."""
    instead = GONE.get((key.rpartition(".")[2].removeprefix("--"), choice))
    return None if instead is None else f"which is gone since 0.3.0, expected in its place {instead}"
