"""Digital calibration certificates of inertial instruments: units as D-SI writes them, and types of coefficients.

A unit is written ``\\metre\\second\\tothe{-2}`` for m/s^2. No official reference types exist: one is ``inertial_`` and
the symbol of `inercal.foundation.instruments.terms` without axes, numbers of sensors and channels, which the label of
each value has.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache

from inercal.foundation.errors import QuantityError
from inercal.foundation.instruments.terms import (
    MODEL_TERMS,
    NOISE_TERMS,
    NUMBERED_TERMS,
    TERMS,
    Term,
    term,
)
from inercal.foundation.units import parse_unit

#: unit -> its name in D-SI; a count is a pure number there
_NAMES = {
    "m": "metre",
    "s": "second",
    "rad": "radian",
    "K": "kelvin",
    "V": "volt",
    "A": "ampere",
    "N": "newton",
    "Hz": "hertz",
    "kg": "kilogram",
    "Pa": "pascal",
    "1": "one",
    "count": "one",
    "degC": "degreecelsius",
}
_PREFIXES = {"nano": "n", "micro": "u", "milli": "m", "centi": "c", "kilo": "k"}
_BACK = {name: unit for unit, name in reversed(_NAMES.items())} | {
    "degree": "deg",
    "hour": "h",
    "minute": "min",
}

_TOKEN = re.compile(r"sqrt\(|[()*/]|\^-?[0-9]+(?:\.[0-9]+)?|1|[^\W\d]+|%")

_Powers = dict[str, float]


def dsi(unit: str) -> tuple[str, float]:
    """The coherent SI unit of a ``unit`` in D-SI, and how many of it that is.

    ``unit`` is one of a result: SI or not, with products, quotients, powers, brackets and ``sqrt``.

    Raises `QuantityError` where it is no unit.

    Examples
    --------
    >>> dsi("(rad/s)/(m/s^2)")
    ('\\\\radian\\\\second\\\\metre\\\\tothe{-1}', 1.0)
    >>> dsi("count")
    ('\\\\one', 1.0)
    """
    if unit == "degC":
        return "\\degreecelsius", 1.0
    tokens = _TOKEN.findall(unit)
    if "".join(tokens) != unit.replace(" ", "") or not tokens:
        raise QuantityError("unit", f"found {unit!r}, expected one such as count/(m/s^2)")
    left = iter([*tokens, ")"])
    powers, factor = _product(left, unit)
    if next(left, None) is not None:
        raise QuantityError("unit", f"found {unit!r} with a bracket too many")
    return "".join(_written(name, power) for name, power in powers.items() if power) or "\\one", factor


def stated(unit: str) -> str | None:
    """The ``unit`` itself in D-SI, a count as a pure number; None of one that is no coherent SI unit, as deg/s or g."""
    try:
        text, size = dsi(unit)
    except QuantityError:
        return None
    return text if size == 1.0 else None


def is_coherent(unit: str) -> bool:
    """True where the text is that of an SI unit, which D-SI can write without loss: not for counts, degrees or g."""
    return "count" not in unit and dsi(unit)[1] == 1.0


def as_written(unit: str) -> str:
    """The text of a ``unit`` in a certificate: D-SI of an SI unit, any other as it is."""
    return dsi(unit)[0] if is_coherent(unit) else unit


def _written(name: str, power: float) -> str:
    """A unit with its power."""
    return f"\\{name}" if power == 1.0 else f"\\{name}\\tothe{{{power:g}}}"


def _product(tokens: Iterator[str], unit: str) -> tuple[_Powers, float]:
    """Powers of named units and the factor of a product, up to its closing bracket."""
    powers: _Powers = {}
    factor, sign = 1.0, 1.0
    last: tuple[_Powers, float] | None = None
    for token in tokens:
        if (last is None) == (token[0] in ")^*/"):
            break
        if last is None:
            last = _factor(token, tokens, unit)
        elif token[0] == "^":
            power = float(token[1:])
            last = ({name: p * power for name, p in last[0].items()}, last[1] ** power)
        else:
            powers, factor = _times(powers, last[0], sign), factor * last[1] ** sign
            last, sign = None, -1.0 if token == "/" else 1.0
            if token == ")":
                return powers, factor
    raise QuantityError("unit", f"found {unit!r}, expected a product such as count/(m/s^2)")


def _factor(token: str, tokens: Iterator[str], unit: str) -> tuple[_Powers, float]:
    """One factor of a product: a unit, or what stands in brackets or below a root."""
    if token == "(":
        return _product(tokens, unit)
    if token == "sqrt(":
        powers, factor = _product(tokens, unit)
        return {name: 0.5 * power for name, power in powers.items()}, factor**0.5
    if token in _NAMES:
        return ({} if _NAMES[token] == "one" else {_NAMES[token]: 1.0}), 1.0
    found = parse_unit(token)
    inside, more = _product(iter([*_TOKEN.findall(found.si), ")"]), found.si)
    return inside, found.factor * more


def _times(one: _Powers, other: _Powers, sign: float) -> _Powers:
    """The product of two units, the second to the power ``sign``."""
    product = dict(one)
    for name, power in other.items():
        product[name] = product.get(name, 0.0) + sign * power
    return product


def from_dsi(text: str) -> str:
    """A unit of D-SI as inercal writes units; the text itself where it is not known.

    Examples
    --------
    >>> from_dsi("\\\\metre\\\\second\\\\tothe{-2}")
    'm/s^2'
    """
    if not re.fullmatch(r"(\\(tothe\{-?[0-9.]+\}|[a-z]+))+", text):
        return text
    above: list[str] = []
    below: list[str] = []
    prefix, per = "", False
    for name, power in re.findall(r"\\(?!tothe)([a-z]+)(?:\\tothe\{(-?[0-9.]+)\})?", text):
        if name == "per":
            per = True
            continue
        if name in _PREFIXES:
            prefix = _PREFIXES[name]
            continue
        if name not in _BACK:
            return text
        exponent = float(power or 1.0) * (-1.0 if per else 1.0)
        if exponent and name != "one":
            side = above if exponent > 0.0 else below
            side.append(_powered(prefix + _BACK[name], abs(exponent)))
        prefix, per = "", False
    return "/".join(["*".join(above) or "1", *below])


def _powered(unit: str, power: float) -> str:
    """A unit to a power above 0."""
    return unit if power == 1.0 else f"sqrt({unit})" if power == 0.5 else f"{unit}^{power:g}"


PREFIX = "inertial_"

OTHERS = {
    "inertial_coefficients": "coefficients of an instrument, a quantity each; its label is the name in inercal",
    "inertial_files": "files that belong to a result",
    "inertial_covariance": "covariance of the coefficients of a result, as a rectangular region of D-SI",
    "inertial_model": "equation of the model whose coefficients these are",
    "inertial_result": "a result as inercal wrote it, in JSON; the certificate states the same numbers",
    "inertial_report": "report of a result, as a page",
    "inertial_gravity": "gravity at the place of the calibration",
    "inertial_latitude": "latitude of the place of the calibration",
}
"""Types of parts of a certificate that are no coefficients."""

_POWER = re.compile(r"_(T[123]|hyst)$")
_AXES = re.compile(r"_(?:[xyz]{1,3}|[po][xyz])$")

#: symbols whose terms are worded differently from axis to axis
_WORDS = {
    "G": "g-sensitive drift: gyro i output per force along j",
    "r": "lever arm: place of accelerometer i along j from the origin of b",
    "G2": "drift of gyro i per square or product of force along j and k",
    "eta": "misalignment of accelerometers of a platform: response to specific force across the axis",
    "ds": "misalignment of gyro i of a platform: rate about i per rate about the next axis",
    "do": "misalignment of gyro i of a platform: rate about i per rate about the axis after the next, reversed",
}


def reference_type(name: str) -> str | None:
    """The reference type of a coefficient by its name in a result; None of one that the terms do not know.

    Examples
    --------
    >>> reference_type("M_xy"), reference_type("N_gyro_x"), reference_type("b_2"), reference_type("K0_x_T1")
    ('inertial_M', 'inertial_N', 'inertial_b', 'inertial_K0_T1')
    """
    if term(name) is None:
        return None
    begun = _POWER.sub("", name)
    power = name.removeprefix(begun) if begun not in TERMS or name not in TERMS else ""
    return PREFIX + _symbol(begun if power else name) + power


def _symbol(name: str) -> str:
    """The symbol without axes, number or channel."""
    if name in TERMS:
        if name.startswith("harmonic_"):
            return re.sub(r"_\d+_", "_", name)
        short = _AXES.sub("", name)
        return "G2" if short == "G" and len(name) == 5 else short
    if name in MODEL_TERMS:
        return name
    begun, _, rest = name.partition("_")
    if begun in NUMBERED_TERMS and rest.isdigit():
        return "S_number" if begun == "S" else begun
    return begun if begun in NOISE_TERMS else "output"


@cache
def reference_types() -> dict[str, tuple[str, str]]:
    """Every reference type of a coefficient at one temperature -> its meaning, and its unit as in the terms.

    A further ending ``_T1``, ``_T2`` or ``_T3`` is of a coefficient's change per power of the temperature, ``_hyst`` of
    its difference between rising and falling temperature.
    """
    found: dict[str, tuple[str, str]] = {}
    numbered = {f"{symbol}_1": each for symbol, each in NUMBERED_TERMS.items()}
    noise = {f"{symbol}_gyro_x": each for symbol, each in NOISE_TERMS.items()}
    for name, each in {**TERMS, **MODEL_TERMS, **numbered, **noise}.items():
        kind = reference_type(name)
        assert kind is not None
        found.setdefault(kind, (_meaning(kind, each), each.unit))
    return found | {f"{PREFIX}output": ("output of a channel at rest", "output")}


def _meaning(kind: str, each: Term) -> str:
    """The name of a term with i, j and k in the place of its axes."""
    words = _WORDS.get(kind.removeprefix(PREFIX))
    if words is not None:
        return words
    letters: dict[str, str] = {}

    def letter(axis: re.Match[str]) -> str:
        return letters.setdefault(axis[0], "ijk"[min(len(letters), 2)])

    plain = re.sub(r"item \d+", "item i", each.name.replace("{}", "i"))
    return plain if kind.endswith(("enc", "_sin", "_cos")) else re.sub(r"\b[xyz]\b", letter, plain)
