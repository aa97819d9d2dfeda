"""Units of guessed channels: as a header says, or by the size of gravity, of the fastest rate and of the interval."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import InputError
from inercal.foundation.records.channels import Origin, TimeForm, misfit, of_a_table, sensor_and_axis
from inercal.foundation.records.titles import fits
from inercal.foundation.units import parse_unit

EVERYDAY = ("s", "m/s^2", "deg/s", "deg", "degC", "1")
"""Units that an example takes."""

_POSITIONS = 1000
_FASTEST = 35.0  # rad/s: 2000 deg/s


@dataclass(frozen=True)
class Guess:
    """A channel thought to be in a column: where that is, its values, a unit if it was said, and why.

    ``grade`` is that of a channel recognised with its unit (certain, likely or guess), empty of others; of a guess
    there is a ``question``. Of the time there may be ``stamps`` other than plain numbers.
    """

    name: str
    origin: Origin
    values: Array
    unit: str | None
    reason: str
    grade: str = ""
    question: str = ""
    stamps: TimeForm | None = None


def median(values: Array) -> float:
    """Median of the numbers there are, 0 if there are none."""
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if finite.size else 0.0


@dataclass(frozen=True)
class UnitFound:
    """Unit of a channel, its ``grade`` (certain, likely, guess), the reason, and what a guess asks."""

    unit: str
    grade: str
    reason: str
    question: str = ""


_CHOICES = (("rad/s", "deg/s", "mdeg/s"), ("deg", "rad"), ("s", "ms", "us", "ns"))


def choices(unit: str) -> tuple[str, ...]:
    """The units among which that of a guess is chosen."""
    return next((units for units in _CHOICES if unit in units), (unit,))


def units_of(guesses: Mapping[str, Guess], answers: Mapping[str, str] | None = None) -> dict[str, UnitFound]:
    """Unit of each channel; ``answers`` are those of channels or sensors that were asked for."""
    acc_unit = guesses["acc_x"].unit if "acc_x" in guesses else None
    acc = (
        UnitFound(acc_unit, "certain", "as x") if acc_unit and fits("acc_x", acc_unit) else _acc_unit(guesses)
    )
    units = {}
    for name, guess in guesses.items():
        answer = (answers or {}).get(name, (answers or {}).get(sensor_and_axis(name)[0]))
        if answer is not None:
            if problem := misfit(name, parse_unit(answer, "--answer")):
                raise InputError("--answer", f"{name}: {problem}")
            units[name] = UnitFound(answer, "certain", "as answered")
        elif guess.grade and guess.unit is not None:
            units[name] = UnitFound(guess.unit, guess.grade, "", guess.question)
        elif guess.unit is not None and fits(name, guess.unit):
            units[name] = UnitFound(guess.unit, "certain", "with this unit")
        else:
            found = acc if name.startswith("acc_") else _by_size(name, guesses, acc.unit)
            if guess.unit is not None and name not in ("label", "position"):
                found = replace(found, reason=f"{quoted(guess.unit)} is no unit known here; {found.reason}")
            units[name] = found
    return units


def _by_size(name: str, guesses: Mapping[str, Guess], acc_unit: str) -> UnitFound:
    """Unit of a channel by its numbers."""
    values = guesses[name].values
    if name == "t":
        if of_a_table(guesses) and len(values) < _POSITIONS:
            return UnitFound("s", "likely", "a row for each position")
        return _time_unit(values)
    if name[1:].isdigit():
        return _axes_unit(guesses)
    if name.startswith("gyro"):
        return _gyro_unit(guesses, acc_unit)
    if fits(name, "1"):
        return UnitFound("1", "certain", "a number without a unit")
    if name == "temperature":
        return UnitFound("degC", "likely", "the size is that of a temperature")
    unit = "deg" if fits(name, "deg") else "deg/s"
    finite = values[np.isfinite(values)]
    reach = float(np.abs(finite).max(initial=0.0))
    if reach > (2.2 * np.pi if unit == "deg" else _FASTEST):
        return UnitFound(
            unit, "likely", f"the largest is {reach:.4g}, which is none in {unit.replace('deg', 'rad')}"
        )
    words = f"Is {name} in {unit} or {unit.replace('deg', 'rad')}? Its largest is {reach:.4g}."
    return UnitFound(unit, "guess", f"the largest is {reach:.4g}", words)


def _acc_unit(guesses: Mapping[str, Guess]) -> UnitFound:
    """Unit of the accelerometers by the size of gravity."""
    axes = [guesses[name].values for name in ("acc_x", "acc_y", "acc_z") if name in guesses]
    if len(axes) < 3:
        return UnitFound("count", "likely", "no triad to tell the unit by")
    norm = median(np.linalg.norm(axes, axis=0))
    for unit, low, high in (("m/s^2", 8.5, 11.0), ("g", 0.85, 1.15), ("mg", 850, 1150)):
        if low < norm < high and not (unit == "mg" and _whole(axes)):
            return UnitFound(unit, "likely", f"the median norm is {norm:.4g}, gravity in {unit}")
    reason = f"the median norm is {norm:.5g}, gravity in neither m/s^2 nor g"
    return UnitFound("count", "likely", reason)


def _axes_unit(guesses: Mapping[str, Guess]) -> UnitFound:
    """Unit of accelerometers around a model: of axes at right angles one always reads 0.7 of gravity or more."""
    axes = [np.abs(guess.values) for name, guess in guesses.items() if name[1:].isdigit()]
    largest = median(np.max(axes, axis=0))
    words = f"the largest of all is {largest:.4g} in the median, gravity in"
    for unit, low, high in (("m/s^2", 6.0, 11.0), ("g", 0.6, 1.1), ("mg", 600.0, 1100.0)):
        if low < largest < high and not _whole(axes):
            return UnitFound(unit, "likely", f"{words} {unit}")
    return UnitFound("count", "likely", f"{words} neither m/s^2 nor g")


def _gyro_unit(guesses: Mapping[str, Guess], acc_unit: str) -> UnitFound:
    """Unit of the gyros: counts if they are whole numbers, else by the largest rate."""
    axes = [guess.values for name, guess in guesses.items() if name.startswith("gyro")]
    if _whole(axes):
        return UnitFound("count", "likely", "all are whole numbers")
    if acc_unit == "count" and "acc_x" in guesses:
        return UnitFound("count", "likely", "as the accelerometers")
    largest = max(np.abs(axis[np.isfinite(axis)]).max(initial=0.0) for axis in axes)
    reason = f"the largest is {largest:.4g}"
    if largest > _FASTEST:
        unit = "mdeg/s" if largest > 5700.0 else "deg/s"
        return UnitFound(
            unit, "likely", f"{reason}, too fast for one in {'deg/s' if unit[0] == 'm' else 'rad/s'}"
        )
    return UnitFound(
        "rad/s", "guess", reason, f"Is the gyro in rad/s or deg/s? Its largest is {largest:.4g}."
    )


def _whole(axes: Iterable[Array]) -> bool:
    """True if all numbers are whole ones, as those of a converter are."""
    return all((axis[np.isfinite(axis)] % 1.0 == 0.0).all() for axis in axes)


def _time_unit(t: Array) -> UnitFound:
    """Unit of the time by its interval: inertial instruments are read some 1 to 10 000 times a second."""
    steps = np.diff(t)
    interval = median(steps[steps > 0])
    unit = next(
        unit for unit, limit in (("s", 2.0), ("ms", 500.0), ("us", 5e5), ("ns", np.inf)) if interval < limit
    )
    return UnitFound(unit, "likely", f"the interval is {interval:.6g}")


def quoted(value: object) -> str:
    """A number, text or list as TOML writes it; bytes in file names that no encoding knew as far as possible."""
    text = json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return text.encode("utf-8", "surrogateescape").decode("utf-8", "replace")
