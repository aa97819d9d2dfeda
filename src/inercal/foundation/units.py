"""Units and quantities at the edge: texts people type, SI and radians inside.

The everyday units of the field are a small table, so that reading a study costs no import; anything else
(``mdeg/s``, ``inch``) is looked up in pint. The unit g is 9.80665 m/s² everywhere.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from inercal.foundation.addresses import shown_address
from inercal.foundation.errors import QuantityError

STANDARD_GRAVITY = 9.80665
"""The unit g [m/s²], by definition; the gravity of a site is another quantity."""

_DEG = math.pi / 180.0
_G = STANDARD_GRAVITY

#: dimension -> (SI unit, {unit: factor to SI})
_TABLE: dict[str, tuple[str, dict[str, float]]] = {
    "number": ("1", {"1": 1.0, "%": 1e-2, "ppm": 1e-6, "ppb": 1e-9}),
    "count": ("count", {"count": 1.0}),
    "time": ("s", {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0}),
    "frequency": ("Hz", {"Hz": 1.0, "kHz": 1e3, "mHz": 1e-3}),
    "length": ("m", {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "um": 1e-6, "km": 1e3}),
    "angle": (
        "rad",
        {"rad": 1.0, "mrad": 1e-3, "urad": 1e-6, "deg": _DEG, "arcmin": _DEG / 60, "arcsec": _DEG / 3600},
    ),
    "rate": (
        "rad/s",
        {
            "rad/s": 1.0,
            "mrad/s": 1e-3,
            "urad/s": 1e-6,
            "deg/s": _DEG,
            "mdeg/s": 1e-3 * _DEG,
            "deg/min": _DEG / 60,
            "deg/h": _DEG / 3600,
            "arcsec/s": _DEG / 3600,
            "rpm": math.pi / 30,
        },
    ),
    "acceleration": ("m/s^2", {"m/s^2": 1.0, "cm/s^2": 1e-2, "g": _G, "mg": 1e-3 * _G, "ug": 1e-6 * _G}),
    "velocity": ("m/s", {"m/s": 1.0, "mm/s": 1e-3, "cm/s": 1e-2, "ug*s": 1e-6 * _G, "mg*s": 1e-3 * _G}),
    "temperature": ("degC", {"degC": 1.0, "K": 1.0, "degF": 5.0 / 9.0}),
    "voltage": ("V", {"V": 1.0, "mV": 1e-3, "uV": 1e-6}),
    "current": ("A", {"A": 1.0, "mA": 1e-3, "uA": 1e-6, "nA": 1e-9}),
    "torque": ("N*m", {"N*m": 1.0, "mN*m": 1e-3, "uN*m": 1e-6, "nN*m": 1e-9}),
    "angle random walk": (
        "rad/sqrt(s)",
        {"rad/sqrt(s)": 1.0, "deg/sqrt(s)": _DEG, "deg/sqrt(h)": _DEG / 60, "deg/s/sqrt(Hz)": _DEG,
         "deg/h/sqrt(Hz)": _DEG / 3600, "rad/s/sqrt(Hz)": 1.0},
    ),
    "velocity random walk": (
        "m/s/sqrt(s)",
        {"m/s/sqrt(s)": 1.0, "m/s^2/sqrt(Hz)": 1.0, "m/s/sqrt(h)": 1 / 60, "ug/sqrt(Hz)": 1e-6 * _G,
         "mg/sqrt(Hz)": 1e-3 * _G},
    ),
    "rate random walk": (
        "rad/s/sqrt(s)",
        {"rad/s/sqrt(s)": 1.0, "deg/s/sqrt(s)": _DEG, "deg/h/sqrt(s)": _DEG / 3600,
         "deg/h/sqrt(h)": _DEG / 3600 / 60},
    ),
    "rate ramp": (
        "rad/s^2",
        {"rad/s^2": 1.0, "deg/s^2": _DEG, "deg/h/s": _DEG / 3600, "deg/h/h": _DEG / 3600**2,
         "deg/h^2": _DEG / 3600**2},
    ),
    "acceleration random walk": (
        "m/s^2/sqrt(s)",
        {"m/s^2/sqrt(s)": 1.0, "m/s^2/sqrt(h)": 1 / 60, "ug/sqrt(s)": 1e-6 * _G, "ug/sqrt(h)": 1e-6 * _G / 60,
         "mg/sqrt(h)": 1e-3 * _G / 60},
    ),
    "snap density": ("rad^2/s^7", {"rad^2/s^7": 1.0}),
    "quadratic": ("s^2/m", {"s^2/m": 1.0, "ug/g^2": 1e-6 / _G, "mg/g^2": 1e-3 / _G}),
    "rate by force": (
        "rad*s/m",
        {"rad*s/m": 1.0, "deg/h/g": _DEG / 3600 / _G, "deg/s/g": _DEG / _G},
    ),
    "angle by force": (
        "rad*s^2/m", {"rad*s^2/m": 1.0, "arcsec/g": _DEG / 3600 / _G, "arcmin/g": _DEG / 60 / _G},
    ),
    "rate by temperature": ("rad/s/K", {"rad/s/K": 1.0, "deg/h/K": _DEG / 3600, "deg/s/K": _DEG}),
    "acceleration by temperature": ("m/s^2/K", {"m/s^2/K": 1.0, "ug/K": 1e-6 * _G, "mg/K": 1e-3 * _G}),
    "number by temperature": ("1/K", {"ppm/K": 1e-6, "ppb/K": 1e-9}),
    "acceleration ramp": (
        "m/s^3",
        {"m/s^3": 1.0, "ug/s": 1e-6 * _G, "ug/h": 1e-6 * _G / 3600, "mg/h": 1e-3 * _G / 3600},
    ),
}  # fmt: skip

RAW = ("count", "voltage", "current", "torque")
"""Dimensions of outputs that tell nothing of the input without a scale factor."""

#: zero of the temperature scales [degC]
_ZERO = {"K": -273.15, "degF": -32.0 * 5.0 / 9.0}

_ALIASES = {
    "": "1",
    "counts": "count",
    "lsb": "count",
    "LSB": "count",
    "raw": "count",
    "sec": "s",
    "seconds": "s",
    "hz": "Hz",
    "degrees": "deg",
    '"': "arcsec",
    "'": "arcmin",
    "mGrad": "mdeg",
    "Grad": "deg",  # the German degree, to pint a billion rad
    "dps": "deg/s",
    "mdps": "mdeg/s",
    "Grad/s": "deg/s",
    "Grad/h": "deg/h",
    "mGrad/s": "mdeg/s",
    "deg/hr": "deg/h",
    "deg/rt(h)": "deg/sqrt(h)",
    "C": "degC",
    "rads": "rad/s",
    "G": "g",
    "g0": "g",
    "m/s/s": "m/s^2",
}

_PINT_DIMENSIONS = {
    "second": "time", "1 / second": "frequency", "meter": "length", "radian": "angle",
    "radian / second": "rate", "meter / second ** 2": "acceleration", "meter / second": "velocity",
    "radian / second ** 2": "rate ramp", "meter / second ** 3": "acceleration ramp",
    "kilogram * meter ** 2 / ampere / second ** 3": "voltage", "ampere": "current",
    "kilogram * meter ** 2 / second ** 2": "torque", "dimensionless": "number",
}  # fmt: skip

_SUPERSCRIPT = re.compile("⁻?[¹²³⁴-⁹]")
_DIGITS = str.maketrans("⁻¹²³⁴⁵⁶⁷⁸⁹", "-123456789")
#: micro and Greek mu, the ordinal of European keyboards for the degree, and points for products
_SIGNS = str.maketrans("µμº·⋅", "uu°**")

#: names with one-digit powers, joined by * and /: pint would compute 9^9^9^9 for as long as it takes
_FOR_PINT = re.compile(r"(?:1/)?[^\W\d]+(?:\^-?\d)?(?:[*/][^\W\d]+(?:\^-?\d)?)*")


@dataclass(frozen=True)
class Unit:
    """A unit: its normal spelling, its dimension, and ``SI value = factor * value + zero``."""

    symbol: str
    dimension: str
    factor: float
    zero: float = 0.0

    @property
    def si(self) -> str:
        """Spelling of the SI unit of the same dimension."""
        return _TABLE[self.dimension][0]


@dataclass(frozen=True)
class Quantity:
    """A number with a unit as typed, in SI: ``value`` and standard uncertainty ``u`` (0 if not given)."""

    value: float
    u: float
    unit: Unit
    text: str


def parse_unit(text: str, where: object = "unit", dimension: str | None = None) -> Unit:
    """Look a unit up by its text.

    Parameters
    ----------
    text : str
        For example ``m/s^2``, ``m/s²``, ``m·s⁻²``, ``deg/h``, ``ug``, ``count``.
    where : object
        Named in the error: a file and column, or a key.
    dimension : str, optional
        What is measured: the error then names units of it. Units of another dimension are found all the same.

    Raises
    ------
    QuantityError
        The text is no unit known here or to pint.
    """
    if len(text) > _LONGEST:
        raise QuantityError(where, f"found the unit {shown(text)}, expected {_everyday(dimension)}")
    plain = _SUPERSCRIPT.sub(lambda match: "^" + match[0].translate(_DIGITS), text.strip())
    plain = plain.translate(_SIGNS).replace("°", "deg").replace("**", "^").replace("s2", "s^2")
    plain = re.sub(r"√\s*\(?\s*([^\W\d]+)\s*\)?", r"sqrt(\1)", plain)
    plain = re.sub(r"\s*([*/^()])\s*", r"\1", plain)
    plain = re.sub(r"\s+", "*", plain)
    plain = re.sub(r"\*([^\W\d]+)\^-(\d)\b", r"/\1^\2", plain)
    plain = re.sub(r"\^1\b", "", plain)
    plain = _ALIASES.get(plain, plain)
    for measured, (_, factors) in _TABLE.items():
        if plain in factors:
            return Unit(plain, measured, factors[plain], _ZERO.get(plain, 0.0))
    return _from_pint(plain, text, where, _meant(plain) or f"expected {_everyday(dimension)}")


def _meant(plain: str) -> str | None:
    """A question whether a unit of the table was meant, written in other letters: ``MG``, ``milli-g``."""
    short = re.sub("^milli[-*]?", "m", re.sub("^micro[-*]?", "u", plain.lower()))
    units = {unit.lower(): unit for _, factors in reversed(_TABLE.values()) for unit in factors}
    return f"did you mean {units[short]}?" if short in units else None


def _everyday(dimension: str | None) -> str:
    """Units of a dimension, or of several, for error messages."""
    if dimension is None:
        return "one such as m/s^2, g, ug, rad/s, deg/h, deg, s, count"
    return f"a unit of {dimension}: {', '.join(_TABLE[dimension][1])}"


def _from_pint(plain: str, text: str, where: object, expected: str) -> Unit:
    """Ask pint, loaded only now, for a unit outside the table; what is ``expected`` is for the error."""
    if len(plain) > 40 or not _FOR_PINT.fullmatch(plain):
        raise QuantityError(where, f"found the unit {shown(text)}, {expected}")
    import pint

    try:
        registry = pint.application_registry
        zero, one = (registry.Quantity(value, plain).to_base_units() for value in (0.0, 1.0))
        if zero.magnitude != 0.0:
            raise ValueError("a scale with another zero, or a logarithm")
        return Unit(plain, _PINT_DIMENSIONS[f"{one.units:D}"], float(one.magnitude))
    except Exception as error:  # pint raises its own, tokenizer and attribute errors for junk
        raise QuantityError(where, f"found the unit {shown(text)}, {expected}") from error


_NUMBER = r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)"
_QUANTITY = re.compile(
    rf"^\s*(?P<number>{_NUMBER})"
    r"(?:\((?P<digits>[0-9]+(?:\.[0-9]+)?)\))?"
    r"(?P<power>[eE][+-]?[0-9]+)?"
    rf"(?:\s*(?:±|\+/-|\+-)\s*(?P<plusminus>{_NUMBER}(?:[eE][+-]?[0-9]+)?))?"
    r"\s*(?P<unit>[^\d\s(.,].*|1)?\s*$"
)


#: characters of a quantity or a unit
_LONGEST = 200

#: a quantity that is larger, or smaller than its inverse, is a slip, and its square might be lost in rounding
_LARGEST = 1e60


def parse_quantity(text: object, dimension: str, where: object, example: str = "") -> Quantity:
    """Read ``"9.81744(2) m/s^2"``: a number, perhaps its standard uncertainty, and a unit.

    The uncertainty is written in the last digits (``9.81744(2)``) or after ``±`` (or ``+/-``). A bare
    number is accepted only where a dimensionless one is expected.

    Parameters
    ----------
    text : object
        What the user typed.
    dimension : str
        What it must measure: ``"acceleration"``, ``"angle"``, ``"time"``, ... (a key of the unit table).
    where : object
        Named in the error: usually the study key.
    example : str
        A good text for it, for the error; one of the dimension if absent.

    Raises
    ------
    QuantityError
        Not a quantity, or one of another dimension.
    """
    kind = "a number" if dimension == "number" else f"a quantity with a unit of {dimension}"
    expected = f"{kind}, such as {_example(dimension, example)}"
    if isinstance(text, int | float) and not isinstance(text, bool) and abs(text) < _LARGEST:
        text = repr(text)
    match = _QUANTITY.match(text) if isinstance(text, str) and len(text) <= _LONGEST else None
    if match is None or (match["digits"] and match["plusminus"]):
        if isinstance(text, str) and re.search("[0-9],[0-9]", text):
            expected += ", with a decimal point"
        raise QuantityError(where, f"found {shown(text)}, expected {expected}")
    assert isinstance(text, str)
    if match["unit"] is None and dimension != "number":
        raise QuantityError(where, f"found {shown(text)} without a unit, expected {expected}")
    unit = parse_unit(match["unit"] or "1", where, dimension)
    if unit.dimension != dimension:
        raise QuantityError(where, f"found {shown(text)}, which is of {unit.dimension}, expected {expected}")
    value = float(match["number"] + (match["power"] or "")) * unit.factor + unit.zero
    u = _typed_u(match) * unit.factor
    if any(size != 0.0 and not 1.0 / _LARGEST < size < _LARGEST for size in (abs(value), u)):
        raise QuantityError(where, f"found {shown(text)}, which is out of range, expected {expected}")
    return Quantity(value, u, unit, text.strip())


def shown(value: object) -> str:
    """Text of a value for a message: its repr without secrets, at most 80 characters."""
    try:
        text = repr(shown_address(value)) if isinstance(value, str) else shown_address(repr(value))
    except (ValueError, RecursionError):  # an integer of thousands of digits, tables in tables without end
        return f"a {type(value).__name__} too large to print"
    return text if len(text) <= 80 else text[:77] + "..."


def _typed_u(match: re.Match[str]) -> float:
    """Standard uncertainty as typed, in the typed unit."""
    if match["plusminus"]:
        return abs(float(match["plusminus"]))
    if not match["digits"]:
        return 0.0
    decimals = len(match["number"].partition(".")[2])
    last = float(f"1e{-decimals}") if "." not in match["digits"] else 1.0
    return float(match["digits"]) * last * float("1" + (match["power"] or ""))


def _example(dimension: str, example: str) -> str:
    """A quantity of that dimension, for error messages: the example if there is one."""
    return f'"{example or _EXAMPLES.get(dimension, "1.5 " + _TABLE[dimension][0])}"'


_EXAMPLES = {
    "acceleration": "9.81744(2) m/s^2",
    "angle": "40 deg",
    "rate": "5 deg/h",
    "time": "50 s",
    "frequency": "100 Hz",
    "number": "10 ppm",
    "length": "120 m",
    "number by temperature": "10 ppm/K",
}
