"""Units of guessed channels: as a header says, or by the size of gravity, of the fastest rate and of the interval."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.records.channels import Origin, of_a_table
from inercal.foundation.records.titles import fits

EVERYDAY = ("s", "m/s^2", "deg/s", "deg", "degC", "1")
"""Units that an example takes."""

_POSITIONS = 1000


@dataclass(frozen=True)
class Guess:
    """A channel thought to be in a column: where that is, its values, a unit if it was said, and why.

    ``grade`` is that of a channel recognised with its unit (certain, likely or guess), empty of others; of a guess
    there is a ``question``.
    """

    name: str
    origin: Origin
    values: Array
    unit: str | None
    reason: str
    grade: str = ""
    question: str = ""


def median(values: Array) -> float:
    """Median of the numbers there are, 0 if there are none."""
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if finite.size else 0.0


def units_of(guesses: Mapping[str, Guess]) -> dict[str, tuple[str, str]]:
    """Unit of each channel, and why."""
    acc_unit = guesses["acc_x"].unit if "acc_x" in guesses else None
    acc = (acc_unit, "as x") if acc_unit and fits("acc_x", acc_unit) else _acc_unit(guesses)
    units = {}
    for name, guess in guesses.items():
        if guess.grade and guess.unit is not None:
            units[name] = (guess.unit, guess.grade)
            continue
        if guess.unit is not None and fits(name, guess.unit):
            units[name] = (guess.unit, "with this unit")
            continue
        if name == "t":
            by_position = of_a_table(guesses) and len(guess.values) < _POSITIONS
            units[name] = ("s", "a row for each position") if by_position else _time_unit(guess.values)
        elif name.startswith("acc_"):
            units[name] = acc
        elif name[1:].isdigit():
            units[name] = _axes_unit(guesses)
        elif name.startswith("gyro"):
            units[name] = _gyro_unit(guesses, acc[0])
        elif fits(name, "1"):
            units[name] = ("1", "a number without a unit")
        else:
            units[name] = (next(unit for unit in EVERYDAY if fits(name, unit)), "the unit is an example")
        if guess.unit is not None and name not in ("label", "position"):
            units[name] = (units[name][0], f"{quoted(guess.unit)} is no unit known here; {units[name][1]}")
    return units


def _acc_unit(guesses: Mapping[str, Guess]) -> tuple[str, str]:
    """Unit of the accelerometers by the size of gravity."""
    axes = [guesses[name].values for name in ("acc_x", "acc_y", "acc_z") if name in guesses]
    if len(axes) < 3:
        return "count", "no triad to tell the unit by"
    norm = median(np.linalg.norm(axes, axis=0))
    for unit, low, high in (("m/s^2", 8.5, 11.0), ("g", 0.85, 1.15), ("mg", 850, 1150)):
        if low < norm < high and not (unit == "mg" and _whole(axes)):
            return unit, f"the median norm is {norm:.4g}, gravity in {unit}"
    return "count", f"the median norm is {norm:.5g}, gravity in neither m/s^2 nor g"


def _axes_unit(guesses: Mapping[str, Guess]) -> tuple[str, str]:
    """Unit of accelerometers around a model: of axes at right angles one always reads 0.7 of gravity or more."""
    axes = [np.abs(guess.values) for name, guess in guesses.items() if name[1:].isdigit()]
    largest = median(np.max(axes, axis=0))
    for unit, low, high in (("m/s^2", 6.0, 11.0), ("g", 0.6, 1.1), ("mg", 600.0, 1100.0)):
        if low < largest < high and not _whole(axes):
            return unit, f"the largest of all is {largest:.4g} in the median, gravity in {unit}"
    return "count", f"the largest of all is {largest:.4g} in the median, gravity in neither m/s^2 nor g"


def _gyro_unit(guesses: Mapping[str, Guess], acc_unit: str) -> tuple[str, str]:
    """Unit of the gyros: counts if they are whole numbers, else by the largest rate."""
    axes = [guess.values for name, guess in guesses.items() if name.startswith("gyro")]
    if _whole(axes):
        return "count", "all are whole numbers"
    if acc_unit == "count" and "acc_x" in guesses:
        return "count", "as the accelerometers"
    largest = max(np.abs(axis[np.isfinite(axis)]).max(initial=0.0) for axis in axes)
    unit = "mdeg/s" if largest > 5700.0 else "deg/s" if largest > 35.0 else "rad/s"
    return unit, f"the largest is {largest:.4g}; check whether mdeg/s, deg/s or rad/s"


def _whole(axes: Iterable[Array]) -> bool:
    """True if all numbers are whole ones, as those of a converter are."""
    return all((axis[np.isfinite(axis)] % 1.0 == 0.0).all() for axis in axes)


def _time_unit(t: Array) -> tuple[str, str]:
    """Unit of the time by its interval: inertial instruments are read some 1 to 10 000 times a second."""
    steps = np.diff(t)
    interval = median(steps[steps > 0])
    unit = next(
        unit for unit, limit in (("s", 2.0), ("ms", 500.0), ("us", 5e5), ("ns", np.inf)) if interval < limit
    )
    return unit, f"the interval is {interval:.6g}"


def quoted(value: object) -> str:
    """A number, text or list as TOML writes it; bytes in file names that no encoding knew as far as possible."""
    text = json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return text.encode("utf-8", "surrogateescape").decode("utf-8", "replace")
