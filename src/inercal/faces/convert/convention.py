"""Conventions of other tools for the coefficients of an instrument: the parts that each of them has.

A convention names its matrices (its *terms*), makes them of an `ImuModel` and an `ImuModel` of them, and writes
and reads its tool's own files. Vectors are (3,), matrices (3, 3), rows the sensor axes x, y, z.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from inercal.faces.convert.correct import ImuModel
from inercal.foundation.arrays import Array
from inercal.foundation.errors import InputError
from inercal.foundation.findings import Finding
from inercal.foundation.instruments.triad import TriadModel
from inercal.foundation.units import RAW, parse_unit

Terms = dict[str, Array]
Units = dict[str, str]

FORCE, RATE = "m/s^2", "rad/s"

_MEASURED = {"acc": ("acceleration", *RAW), "gyro": ("rate", *RAW)}


@dataclass(frozen=True)
class Convention:
    """The convention of another tool: its correction, files and units.

    ``equation`` is its correction in plain text, ``suffixes`` are those of its files, the first the usual one.
    ``si`` is true where its samples are in SI units; outputs in another physical unit are then converted, counts
    are not. The functions:

    terms : model -> terms; raises `InputError` where the convention has no place for a term.
    model : terms, output units by sensor -> model; the inverse of ``terms``.
    term_units : output units -> unit of each term.
    render : terms, output units -> text by the ending of its file's name ("" where there is one file).
    parse : [(path, text), ...] -> terms, output units as far as the files state them; raises `InputError`.
    notes : terms -> findings on this conversion.
    """

    name: str
    equation: str
    suffixes: tuple[str, ...]
    si: bool
    terms: Callable[[ImuModel], Terms]
    model: Callable[[Terms, Units], ImuModel]
    term_units: Callable[[Units], Units]
    render: Callable[[Terms, Units], dict[str, str]]
    parse: Callable[[Sequence[tuple[object, str]]], tuple[Terms, Units]]
    notes: Callable[[Terms], tuple[Finding, ...]] = lambda _: ()


def per(output: str, given: str) -> str:
    """The unit of a ratio, such as ``count/(m/s^2)``."""
    return "/".join(f"({unit})" if "/" in unit else unit for unit in (output, given))


def output_unit(sensor: str, text: str, where: object) -> str:
    """A unit of the outputs of ``acc`` or ``gyro`` in its normal spelling; raises `InputError` for any other."""
    unit = parse_unit(text, where)
    if unit.dimension not in _MEASURED[sensor]:
        kinds = " or ".join(_MEASURED[sensor])
        raise InputError(where, f"found {text} as the unit of {sensor} outputs, expected one of {kinds}")
    return unit.symbol


def with_gyro(model: ImuModel, name: str) -> TriadModel:
    """The gyro's triad; raises `InputError` where there is none, as ``name`` corrects only whole IMUs."""
    if model.gyro is None:
        raise InputError(name, "found a calibration of accelerometers alone, expected one with a gyro")
    return model.gyro


def triad_of_gain(gain: Array, bias: Array, name: str) -> TriadModel:
    """The triad of a gain S M (3, 3) [output per SI unit] and the output at zero (3,).

    Raises `InputError` where it has no inverse, or a sensor does not answer to the axis it is named for.
    """
    scale = np.diag(gain)
    if not (np.isfinite(gain).all() and np.isfinite(bias).all()):
        raise InputError(name, "found coefficients that are not finite numbers, expected finite ones")
    if not scale.all() or np.linalg.matrix_rank(gain) < 3:
        raise InputError(name, "found sensor axes that are exchanged or not independent, expected x, y, z")
    return TriadModel(scale, gain / scale[:, None], bias)


def inverse(gain: Array, name: str) -> Array:
    """The inverse of a matrix (3, 3) read from a file; raises `InputError` where there is none."""
    if not np.isfinite(gain).all() or np.linalg.matrix_rank(gain) < 3:
        raise InputError(name, "found a matrix without inverse, expected three independent axes")
    return np.asarray(np.linalg.inv(gain), dtype=np.float64)


def in_si_outputs(model: ImuModel) -> ImuModel:
    """The same instrument with outputs in m/s^2 and rad/s where they are in another unit of these; counts stay."""
    units = dict(model.units)
    factors = {"acc": 1.0, "gyro": 1.0}
    for sensor, si in (("acc", FORCE), ("gyro", RATE)):
        unit = parse_unit(units[sensor]) if sensor in units else None
        if unit is not None and unit.dimension == parse_unit(si).dimension:
            factors[sensor], units[sensor] = unit.factor, si
    return replace(
        model,
        accelerometer=_scaled(model.accelerometer, factors["acc"]),
        gyro=None if model.gyro is None else _scaled(model.gyro, factors["gyro"]),
        g_sensitivity=model.g_sensitivity * factors["gyro"],
        units=units,
    )


def _scaled(triad: TriadModel, factor: float) -> TriadModel:
    """The triad with outputs times a factor."""
    return replace(triad, scale=triad.scale * factor, bias=triad.bias * factor)


def units_line(units: Units) -> str:
    """A line for a comment: the unit of the outputs, which most formats have no place for."""
    return "outputs: " + ", ".join(f"{sensor} [{unit}]" for sensor, unit in units.items())


def units_in(text: str) -> Units:
    """Output units by sensor from a `units_line` anywhere in a text; empty where there is none."""
    line = re.search(r"outputs: (.*)", text)
    return dict(re.findall(r"(acc|gyro) \[([^\]]*)\]", line[1])) if line else {}


def one_text(texts: Sequence[tuple[object, str]], name: str) -> tuple[object, str]:
    """The path and the text of the one file; raises `InputError` where there are more."""
    if len(texts) > 1:
        raise InputError(name, f"found {len(texts)} files, expected one")
    return texts[0]


def digits(row: Array) -> list[str]:
    """Numbers as texts that read back exactly."""
    return [repr(float(value) + 0.0) for value in row]  # + 0.0 takes the sign off a zero


def flat(terms: Terms) -> tuple[list[str], Array]:
    """Names (``K_a_xy``, ``b_a_x``) and values of all entries of all terms."""
    names: list[str] = []
    for term, array in terms.items():
        axes = ["xyz"[i] for i in range(3)]
        if array.ndim == 0:
            names.append(term)
        else:
            names += [f"{term}_{i}{j}" for i in axes for j in (axes if array.ndim == 2 else ("",))]
    return names, np.concatenate([array.ravel() for array in terms.values()])
