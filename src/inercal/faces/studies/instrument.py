"""The instrument of a study: its terms with their values, each in the units people state it in."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

from pydantic import WithJsonSchema

from inercal.faces.studies.tables import settings_of
from inercal.foundation.errors import QuantityError, StudyError
from inercal.foundation.instruments.by_angle import CHANNELS, channel_model
from inercal.foundation.instruments.terms import TERMS
from inercal.foundation.records.channels import misfit
from inercal.foundation.units import Quantity, Unit, parse_quantity, parse_unit, shown
from inercal.systems.turntable.settings import Instrument

Typed = Annotated[
    Any, WithJsonSchema({"type": ["string", "number"], "examples": ["50 deg/h", "2 deg/h/g^2", "1.00(2)"]})
]
"""A quantity whose unit depends on the term and on the instrument."""

MOST_SAMPLES = 1_000_000_000
"""Samples in a dwell that somebody may wait for."""

#: terms of a gyro that only a rate test has
RATE_TERMS = tuple(f"{symbol}_{axis}" for axis in "xyz" for symbol in ("S_asym", "S2", "S3", "S_hyst"))

#: kind of instrument -> unit of its outputs where none is given
_USUAL_UNIT = {"gyrowheel": "rad/s", "gyro": "rad/s", "accelerometer": "m/s^2"}


@dataclass(frozen=True)
class _Form:
    """Unit of a term as a fraction: dimension above the bar, power and dimension below it."""

    above: str
    below: str = ""
    power: int = 0


def instrument_of(table: Any, gravity: float, where: object) -> Instrument:
    """The instrument in SI: a term in units of the output is in the SI unit of its dimension.

    ``gravity`` [m/s^2] of the site is the unit of a in the terms of a gyrowheel. Raises `StudyError`, naming the file
    ``where``, for a unit the kind cannot have, an unknown term, or a value in a unit its term cannot have.
    """
    unit = _unit(table, where)
    symbols = tuple(s for channel in CHANNELS[table.kind] for s in channel_model(table.kind, channel).symbols)
    for k, symbol in enumerate(table.terms or ()):
        check_symbol(symbol, symbols, f"instrument.terms.{k}", where)
        if symbol in (table.terms or ())[:k]:
            raise StudyError(where, f"instrument.terms: found {symbol} twice, expected each term once")
    values, uncertainties = {}, {}
    for symbol, text in table.coefficients.items():
        key = f"instrument.coefficients.{symbol}"
        check_symbol(symbol, (*symbols, *RATE_TERMS) if table.kind == "gyro" else symbols, key, where)
        value, u = coefficient_of(text, symbol, table.kind, unit, gravity, key, where)
        values[symbol] = value
        if u > 0.0:
            uncertainties[symbol] = u
    instrument = settings_of(
        Instrument,
        table,
        unit=unit,
        terms=None if table.terms is None else tuple(table.terms),
        coefficients=values,
        coefficients_u=uncertainties,
    )
    if instrument.sample_rate is not None and instrument.sample_rate * instrument.dwell > MOST_SAMPLES:
        raise StudyError(
            where,
            f"instrument.sample_rate: found {instrument.sample_rate * instrument.dwell:.4g} samples in a dwell, "
            f"expected at most {MOST_SAMPLES:.0e}",
        )
    if table.noise is None:
        return instrument
    return replace(instrument, noise=_noise(table.noise, unit, instrument.dwell, where))


def _unit(table: Any, where: object) -> Unit:
    """Unit of the outputs: one that the channels of a record may have."""
    if table.unit is None:
        return _unit_of_noise(table)
    try:
        unit = parse_unit(table.unit)
    except QuantityError as error:
        raise StudyError(where, f"instrument.unit: {error.message}") from error
    wrong = misfit(CHANNELS[table.kind][0], unit)
    if wrong is not None:
        raise StudyError(where, f"instrument.unit: {wrong}")
    return unit


def check_symbol(symbol: str, symbols: Sequence[str], key: str, where: object) -> None:
    """Refuse a term the instrument does not have."""
    if symbol not in symbols:
        near = difflib.get_close_matches(symbol[:80], symbols, n=1, cutoff=0.5)
        hint = f"did you mean {near[0]}?" if near else f"expected one such as {', '.join(symbols[:6])}"
        raise StudyError(where, f"{key}: unknown term {shown(symbol)}, {hint}")


def coefficient_of(
    text: object, symbol: str, kind: str, unit: Unit, gravity: float, key: str, where: object
) -> tuple[float, float]:
    """Value and standard uncertainty of a term, in SI.

    A term of order n in a of a gyrowheel counts a in units of the site's gravity: per g^n it is converted by
    (site gravity / 9.80665 m/s^2)^n, and a term in the output's unit alone is taken as it is.
    """
    forms, example = _forms(symbol, kind, unit)
    for form in sorted(forms, key=lambda each: not each.below):  # a unit with a bar is none that pint knows
        parsed = _parse(text, form)
        if parsed is None:
            continue
        quantity, below = parsed
        if kind == "gyrowheel" and form.below == "acceleration":
            below /= gravity
        factor = below ** (-form.power)
        value, u = quantity.value * factor, quantity.u * factor
        if math.isfinite(value) and math.isfinite(u):
            return value, u
    raise StudyError(where, f"{key}: found {shown(text)}, expected a quantity such as {example}")


def _forms(symbol: str, kind: str, unit: Unit) -> tuple[list[_Form], str]:
    """The ways to state a term, and an example."""
    own, out = unit.dimension, unit.symbol
    match TERMS[symbol].unit:
        case "output":
            order = sum(letter in "XYZ" for letter in symbol.partition("_")[2]) if kind == "gyrowheel" else 0
            if order:
                power = "" if order == 1 else f"^{order}"
                example = f'"1.5 {out}" (at the gravity of the site) or "1.5 {out}/g{power}"'
                return [_Form(own), _Form(own, "acceleration", order)], example
            return [_Form(own)], f'"1.5 {out}"'
        case "output/(rad/s)":
            pure = [_Form("number")] if own == "rate" else []
            return [*pure, _Form(own, "rate", 1)], '"1.00(2)"' if pure else f'"1.5 {out}/(deg/s)"'
        case "output/(m/s^2)":
            pure = [_Form("number")] if own == "acceleration" else []
            return [*pure, _Form(own, "acceleration", 1)], '"1.00(2)"' if pure else f'"1.5 {out}/g"'
        case "output/(m/s^2)^2":
            return [_Form(own, "acceleration", 2)], f'"1.5 {out}/g^2"'
        case "rad":
            return [_Form("angle")], '"20 arcsec"'
        case "1":
            return [_Form("number")], '"50 ppm"'
        case "m":
            return [_Form("length")], '"2 cm"'
        case "s":
            return [_Form("time")], '"1 ms"'
        case "1/(rad/s)":
            return [_Form("number", "rate", 1)], '"5 ppm/(deg/s)"'
        case "1/(rad/s)^2":
            return [_Form("number", "rate", 2)], '"5 ppm/(deg/s)^2"'
        case "1/(m/s^2)":
            forms = [_Form("acceleration", "acceleration", 2), _Form("number", "acceleration", 1)]
            return forms, '"5 ug/g^2"'
        case _:
            forms = [_Form("acceleration", "acceleration", 3), _Form("number", "acceleration", 2)]
            return forms, '"5 ug/g^3"'


_BAR = re.compile(r"(?P<above>.*?)\s*/\s*(?:(?P<g>g)|\((?P<below>[^()]+)\))(?:\^(?P<power>[1-9]))?\s*")


def _parse(text: object, form: _Form) -> tuple[Quantity, float] | None:
    """The part above the bar, and the factor to SI of the unit below it; None if the text has another form."""
    above, below, power = text, "", 0
    if form.below:
        plain = text.replace("²", "^2").replace("³", "^3") if isinstance(text, str) else ""
        match = _BAR.fullmatch(plain)
        if match is None:
            return None
        above, below, power = match["above"], match["g"] or match["below"], int(match["power"] or 1)
    try:
        unit = parse_unit(below) if below else None
        if power != form.power or (unit is not None and unit.dimension != form.below):
            return None
        return parse_quantity(above, form.above, "above"), 1.0 if unit is None else unit.factor
    except QuantityError:
        return None


def _unit_of_noise(table: Any) -> Unit:
    """The unit in which the noise of a reading is stated, or the SI unit of rate or acceleration."""
    usual = parse_unit(_USUAL_UNIT[table.kind])
    try:
        return usual if table.noise is None else parse_quantity(table.noise, usual.dimension, "noise").unit
    except QuantityError:  # a random walk, or something that is refused where the noise is read
        return usual


def _noise(text: str, unit: Unit, dwell: float, where: object) -> float:
    """Standard deviation of a reading, the mean over a dwell, in the SI unit of the outputs."""
    walks = {"rate": "angle random walk", "acceleration": "velocity random walk"}
    walk = walks.get(unit.dimension)
    try:
        value = parse_quantity(text, unit.dimension, "noise").value
    except QuantityError as error:
        try:
            value = parse_quantity(text, walk or "", "noise").value / math.sqrt(dwell)
        except (QuantityError, KeyError):
            raise StudyError(where, f"instrument.noise: {error.message}") from error
    if not value > 0.0:
        raise StudyError(where, f"instrument.noise: found {shown(text)}, expected a value above zero")
    return value
