"""Rows of a known input and the output there: a rate test, or a tilt test, of an instrument of one axis or more."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import QuantityError
from inercal.foundation.records.channels import measures_motion
from inercal.foundation.records.read.table import FirstLook
from inercal.foundation.records.recognise.units import Guess, quoted
from inercal.foundation.records.recognise.words import said, words_of
from inercal.foundation.units import parse_unit

_INPUTS = {"rate": "rate", "angle": "angle", "acceleration": "acceleration"}
_OUTPUT = r"out\w*|ausgang\w*|v?out|reading\w*|signal|spannung|voltage|volts?|ua|sortie|salida|uscita|response|anzeige"
_ANGLE = r"angles?|tilt\w*|inclin\w*|winkel\w*|neigung\w*|pitch|roll|phi|theta|angulo|incl"
_KNOWN = r"ref\w*|true|applied|input|table|set|soll|known|nominal|command\w*|cmd|stated|target"
_MOST = 3  # outputs
_RAW = ("voltage", "count", "current")


@dataclass(frozen=True)
class _KnownInput:
    """The column of the known ``input``, its ``quantity`` (rate, angle or acceleration) and unit, the columns of
    ``outputs`` and their units, None where nothing says one."""

    input: int
    quantity: str
    unit: str
    outputs: tuple[int, ...]
    units: tuple[str | None, ...]


def of_known_input(sample: FirstLook, guesses: list[Guess]) -> list[Guess]:
    """The rate of a rate test, or the angle of a tilt test, and the outputs there; none where there is no such input.

    A table turns about the axis z of the instrument, or tilts it about y, so that x, level at angle zero, rises as the
    angle grows, and z falls: which it is, the outputs tell.
    """
    found = _known_input(sample.names, sample.units, sample.values)
    if found is None or found.quantity == "acceleration":
        return []
    tilt = found.quantity == "angle"
    channel, sensor = ("phi1", "acc") if tilt else ("rate", "gyro")
    angle = sample.values[:, found.input] * (parse_unit(found.unit).factor if tilt else 0.0)
    places = {sample.origin(index): index for index in (found.input, *found.outputs)}
    named = {guess.origin: guess.name for guess in guesses}
    kept = [guess for guess in guesses if guess.origin not in places]
    title = quoted(sample.names[found.input].strip())
    made = [
        Guess(
            channel,
            sample.origin(found.input),
            sample.values[:, found.input],
            found.unit,
            f"the known input is {title}",
            "certain" if said(sample.names[found.input]).unit else "likely",
            factor=-1.0 if tilt else 1.0,
        )
    ]
    for index, unit in zip(found.outputs, found.units, strict=True):
        origin, name = sample.origin(index), sample.names[index]
        axis = _axis_tilted(angle, sample.values[:, index]) if tilt else said(name).axis or "z"
        output = named.get(origin, "")
        output = output if measures_motion(output) else f"{sensor}_{axis}"
        reason = f"the output at each known input is {quoted(name.strip())}"
        reason += "" if unit else ", whose unit nothing says"
        kept.append(Guess(output, origin, sample.values[:, index], unit or "count", reason, "likely"))
    return [*made, *kept] if len({guess.name for guess in kept}) == len(kept) else []


def not_taken(sample: FirstLook, on_table: bool) -> str:
    """Words on the known input of a test that is not taken for a channel; empty where there is none."""
    found = _known_input(sample.names, sample.units, sample.values) if any(sample.names) else None
    if found is None:
        return ""
    title = quoted(sample.names[found.input].strip())
    if found.quantity == "acceleration":
        return (
            f"{title} is a known acceleration, and no channel: state the angle of the tilt instead, as phi1"
        )
    return "" if on_table else f"{title} is the known input of a test: `inercal new turntable` takes it so"


def _known_input(names: Sequence[str], units: Sequence[str | None], values: Array) -> _KnownInput | None:
    """The known input and the outputs among named columns (k,) with ``units`` beside them and ``values`` (n, k).

    The input is the only column with a unit of rate, angle or acceleration that no word calls an output; of several,
    the one that a word calls known. Outputs are in volts, a current or counts, or called so. None where no such
    columns, or a time, are there.
    """
    inputs: list[tuple[int, str, str, bool]] = []
    outputs: list[tuple[int, str | None]] = []
    for index, name in enumerate(names):
        if not np.isfinite(values[:, index]).any():
            continue
        spoken = said(name, units[index] if units else None)
        words = [word for word in words_of(re.sub(r"[\[(].*", "", name)) if word not in "xyz"]
        unit = _unit(name, units[index] if units else None) or spoken.unit
        dimension = _dimension(unit)
        if dimension == "time" or spoken.sensor == "t":
            return None
        called_output = any(re.fullmatch(_OUTPUT, word) for word in words)
        known = any(re.fullmatch(_KNOWN, word) for word in words)
        angular = any(re.fullmatch(_ANGLE, word) for word in words)
        if dimension in _RAW or (called_output and (dimension == "" or dimension in _INPUTS)):
            outputs.append((index, unit or None))
        elif dimension in _INPUTS:
            inputs.append((index, _INPUTS[dimension], unit, known))
        elif not unit and angular:
            inputs.append((index, "angle", "", known))
    if len(inputs) > 1 and sum(known for *_, known in inputs) == 1:
        outputs += [(index, unit) for index, _, unit, known in inputs if not known and not outputs]
        inputs = [each for each in inputs if each[3]]
    if len(inputs) != 1 or not 1 <= len(outputs) <= _MOST:
        return None
    index, quantity, unit, _ = inputs[0]
    if not unit:
        unit = "deg" if np.nanmax(np.abs(values[:, index])) > 2.2 * np.pi else "rad"
    return _KnownInput(
        index, quantity, unit, tuple(place for place, _ in outputs), tuple(each for _, each in outputs)
    )


def _axis_tilted(angle: Array, output: Array) -> str:
    """The axis whose ``output`` (n,) goes as gravity at tilts ``angle`` (n,) [rad]: x goes as a sine, z as a cosine."""
    sound = np.isfinite(angle) & np.isfinite(output)
    left = {}
    for axis, wave in (("x", np.sin(angle[sound])), ("z", np.cos(angle[sound]))):
        design = np.column_stack([np.ones_like(wave), wave])
        fit = np.linalg.lstsq(design, output[sound], rcond=None)[0]
        left[axis] = float(np.sum((output[sound] - design @ fit) ** 2))
    return "z" if left["z"] < left["x"] else "x"


def _unit(name: str, beside: str | None) -> str:
    """The unit in brackets, beside a name, or behind its last ``_`` or blank; empty if there is none."""
    brackets = re.findall(r"[\[(]([^\[\]()]+)[\])]", name)
    tail = re.split(r"[_\s]+", name.strip())
    texts = [beside or "", *brackets, *("/".join(tail[-2:]), tail[-1])[len(tail) < 3 :]]
    if not brackets and not beside and len(tail) < 2:
        return name.strip() if _dimension(name.strip().lower()) == "voltage" and len(name.strip()) > 1 else ""
    able = {*_INPUTS, *_RAW, "time", "temperature"}
    return next((text.strip() for text in texts if text and _dimension(text.strip()) in able), "")


def _dimension(unit: str) -> str:
    """The dimension of a unit, empty if it is none."""
    try:
        return parse_unit(unit).dimension if unit else ""
    except QuantityError:
        return ""
