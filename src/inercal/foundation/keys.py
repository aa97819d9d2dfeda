"""Keys of a study, written once with the field of settings: name, unit, default, bounds and meaning.

A field of a settings dataclass is made by `quantity`, `quantities`, `option` or `table`; from it follow the reading of
the key (`inercal.faces.studies.tables`), its JSON Schema, its line in the reference and in the study that `inercal new`
writes. Settings refuse in ``__post_init__``, by an `InputError` that names the key, what cannot stand together.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypedDict, Unpack

from inercal.foundation.errors import InputError
from inercal.foundation.units import parse_quantity, shown


@dataclass(frozen=True)
class Bounds:
    """Which values [SI] make sense, and the same in words: "a time above zero"."""

    accept: Callable[[float], bool]
    words: str


OUTPUT = "output"
"""Dimension of a quantity in the unit of an instrument's outputs: it stays a text until that is known."""

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
class Reading:
    """The reading of an entry that is no plain value: ``parse`` raises `InputError` for what it is not, and
    ``schema`` is its JSON Schema."""

    parse: Callable[[Any], Any]
    schema: Mapping[str, Any]


def _typed(typed: Any) -> Any:
    """A text or a number as it is."""
    if not isinstance(typed, str | int | float):
        raise InputError("", f'found {shown(typed)}, expected a quantity with its unit, such as "50 deg/h"')
    return typed


AS_TYPED = Reading(
    _typed,
    {"type": ["string", "number"], "examples": ["50 deg/h", "2 deg/h/g^2", "1.00(2)"]},
)
"""A quantity whose unit depends on a term and an instrument: it stays as typed until these are known."""


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
    exact, uncertain : bool
        A quantity that is refused with an uncertainty, and one that is refused without.
    least, most : float or None
        Bounds of a plain number; of a list or a text those of its length.
    words : mapping
        Words that may stand in place of a quantity or a table, and the value of the field that each is.
    of : str
        What the quantities of a list are for, parted by commas, where it has so many: "x, y, z".
    one : bool
        A single quantity may stand for all of such a list.
    table : bool
        The field is settings itself, a tuple of them, or a mapping of them, or of entries by ``reads``, by names of
        one's own.
    kinds : tuple of str
        Kinds, or methods, that heed the key; all where it is empty.
    needed : tuple of str
        Those of them that cannot do without it.
    reads : Reading or None
        Of an entry that is neither a quantity nor a plain value.
    """

    says: str
    dimension: str = ""
    default: str = ""
    example: object = None
    bounds: Bounds = ANYTHING
    name: str = ""
    u: str = ""
    several: bool = False
    exact: bool = False
    uncertain: bool = False
    least: float | None = None
    most: float | None = None
    words: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    of: str = ""
    one: bool = False
    table: bool = False
    kinds: tuple[str, ...] = ()
    needed: tuple[str, ...] = ()
    reads: Reading | None = None

    @property
    def default_value(self) -> Any:
        """The value of the field [SI] that ``default`` stands for."""
        if self.default in self.words:
            return self.words[self.default]
        return parse_quantity(self.default, self.dimension, self.says).value


class More(TypedDict, total=False):
    """Further attributes of a `Key`."""

    bounds: Bounds
    name: str
    u: str
    exact: bool
    uncertain: bool
    least: float | None
    most: float | None
    words: Mapping[str, Any]
    of: str
    one: bool
    kinds: tuple[str, ...]
    needed: tuple[str, ...]
    reads: Reading


REQUIRED: Any = dataclasses.MISSING
"""In place of a default: the study must state the key."""


def quantity(
    says: str, dimension: str, default: Any = None, *, example: object = None, **more: Unpack[More]
) -> Any:
    """A field that a study states as a text with a unit; as several by their names, where it is a mapping.

    ``default`` is such a text or word, or the value [SI] of an absent key where there is no text for it, or `REQUIRED`;
    ``example`` and ``more`` are those of `Key`.
    """
    text = default if isinstance(default, str) else ""
    key = Key(says, dimension, text, example or text, **more)
    value = key.default_value if text else default
    if isinstance(value, Mapping):
        return dataclasses.field(default_factory=dict, metadata={"key": key})
    return dataclasses.field(default=value, metadata={"key": key})


def quantities(
    says: str, dimension: str, *, example: list[str], bounds: Bounds = ANYTHING, at_least: int = 1
) -> Any:
    """A field that a study states as a list of quantities; empty where the key is absent."""
    key = Key(says, dimension, example=example, bounds=bounds, several=True, least=at_least)
    return dataclasses.field(default=(), metadata={"key": key})


def option(says: str, default: Any = REQUIRED, *, example: object = None, **more: Unpack[More]) -> Any:
    """A field that a study states as a plain value: a word, a number, true or false, a file, or a list of these."""
    key = Key(says, example=example, **more)
    if isinstance(default, Mapping):
        return dataclasses.field(default_factory=dict, metadata={"key": key})
    return dataclasses.field(default=default, metadata={"key": key})


def table(says: str, default: Any = REQUIRED, *, example: object = None, **more: Unpack[More]) -> Any:
    """A field that a study states as a table, or as a list or table of tables: its type is a settings dataclass,
    ``Settings | None``, ``tuple[Settings, ...]`` or ``Mapping[str, Settings]``.

    Keys that are absent there are those of the ``default``; ``example`` and ``more`` are those of `Key`.
    """
    key = Key(says, example=example, table=True, **more)
    if isinstance(default, Mapping):
        return dataclasses.field(default_factory=dict, metadata={"key": key})
    return dataclasses.field(default=default, metadata={"key": key})


def keyed(name: str, fields: Mapping[str, tuple[Any, Any]]) -> Any:
    """A base for settings whose keys are names of a table: name of the field -> its type, and the field."""
    return dataclasses.make_dataclass(
        name, [(key, hint, field) for key, (hint, field) in fields.items()], frozen=True
    )


def keys_of(settings: type) -> Iterator[tuple[dataclasses.Field[Any], Key]]:
    """Fields of a settings dataclass that a study states, with their keys."""
    for each in dataclasses.fields(settings):
        if key := each.metadata.get("key"):
            yield each, key


def unheeded(settings: type, kind: str) -> dict[str, tuple[str, ...]]:
    """Keys of a table that some ``kind`` does not heed, each with the kinds that do."""
    limited = {key.name or field.name: key.kinds for field, key in keys_of(settings) if key.kinds}
    return {name: kinds for name, kinds in limited.items() if kind not in kinds}


GONE: Mapping[tuple[str, str], str] = {
    ("static", "difference"): "complementary, the same angle once the dual accelerometer has made both axes equal",
    ("static", "gls"): "the fusion, which weighs all axes by their errors",
    **dict.fromkeys([("filter.kind", "mukf"), ("filter", "mukf")], "error-state"),
    **dict.fromkeys([("filter.kind", "linear"), ("filter", "linear")], "error-state"),
    **dict.fromkeys([("filter.kind", "lm"), ("filter", "lm")], "map"),
    ("imu.bias_drift", ""): "nothing: moves have the bias of the rests beside them, and a drift is named",
    ("budget", "turn angle"): "angles and rates",
    ("budget", "alignment"): "placing or axes",
    ("budget", "horizontal earth rate"): "earth rate, level part",
    ("budget", "vertical earth rate"): "earth rate",
}  # fmt: skip
"""Choices that versions up to 0.2.0 had, by key, its last word or option, and choice, empty for the key itself: what to
use in their place."""


def in_place_of(key: str, choice: str) -> str | None:
    """The end of a sentence on a ``choice`` of a key or option that is gone; None for one that never was."""
    names = (key, key.rpartition(".")[2].removeprefix("--"))
    instead = next((GONE[name, choice] for name in names if (name, choice) in GONE), None)
    return None if instead is None else f"which is gone since 0.3.0, expected in its place {instead}"
