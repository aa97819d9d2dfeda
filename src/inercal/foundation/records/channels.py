"""Channels: what the columns of a record may be called, and what each may measure."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable
from dataclasses import dataclass

from inercal.foundation.units import RAW, Unit

#: names (a regular expression) -> dimensions of the unit, and of increments where the channel may be one
_CHANNELS: tuple[tuple[str, tuple[str, ...], str | None], ...] = (
    (r"t", ("time",), None),
    (r"acc_[xyz]", ("acceleration", *RAW), "velocity"),
    (r"a[1-9]\d*", ("acceleration", "count", "voltage"), "velocity"),
    (r"gyro_[xyz]", ("rate", *RAW), "angle"),
    (r"gyro|gyro_roll|gyro_yaw", ("rate", "count", "voltage"), "angle"),
    (r"wc_[xyz]", ("rate", "count"), "angle"),
    (r"th_rate_[xyz]", ("rate", "count"), None),
    (r"th_acc_[xyz]", ("rate ramp", "count"), None),
    (r"y_[xy]", ("rate", "number", *RAW), None),
    (r"phi[123]|th_[xyz]|theta_ref", ("angle", "count", "voltage"), None),
    (r"q_ref_[0-3]", ("number",), None),
    (r"rate|(?:u_)?rate_[xyz]", ("rate",), None),
    (r"u_acc_[xyz]", ("acceleration", *RAW), None),
    (r"u_(?:gyro|wc)_[xyz]", ("rate", *RAW), None),
    (r"u_y_[xy]", ("rate", "number", *RAW), None),
    (r"temperature", ("temperature", "count", "voltage"), None),
    (r"trigger", ("number", "count", "voltage"), None),
    (r"position|point|label|joint", ("number", "count"), None),
)

_EXAMPLES = (
    *(f"{sensor}_{axis}" for sensor in ("acc", "gyro", "wc", "th", "th_rate", "th_acc") for axis in "xyz"),
    *("t", "temperature", "label", "position", "phi1", "phi2", "phi3", "rate", "joint", "y_x", "y_y"),
    *("a1", "a2", "a3", "a4", "gyro", "gyro_roll", "gyro_yaw", "point", "trigger", "theta_ref", "q_ref_0"),
)

#: Where a channel is found in a file: column number, header or variable name, or variable and column.
Origin = int | str | tuple[str, int]


@dataclass(frozen=True)
class TimeForm:
    """Stamps other than plain numbers: the ``order`` of dates and times in words, empty of numbers, the column of the
    rest ``beside`` (time of day, or fraction of a second in units of ``rest`` [s]), and the number at which a counter
    falls to zero (``wrap``, 0 for none)."""

    order: str = ""
    beside: Origin | None = None
    rest: float = 0.0
    wrap: float = 0.0


@dataclass(frozen=True)
class Channel:
    """A channel wanted from a file: its name, where it is found and how it is to be understood.

    ``factor`` is sign times scale; ``increment`` marks angles or velocities gained since the last row. One that was
    recognised has a ``grade`` (certain, likely, guess), the reason (``because``), and a guess its ``question``. The
    time may have ``stamps``.
    """

    name: str
    origin: Origin
    unit: Unit
    factor: float = 1.0
    increment: bool = False
    grade: str = ""
    because: str = ""
    question: str = ""
    stamps: TimeForm | None = None

    @property
    def sensor(self) -> str:
        """``acc`` of ``acc_x``; the name itself where there is no axis."""
        return sensor_and_axis(self.name)[0]

    @property
    def axis(self) -> str:
        """``x`` of ``acc_x``; empty where there is no axis."""
        return sensor_and_axis(self.name)[1]


def is_channel(name: str) -> bool:
    """True for the names a record knows."""
    return any(re.fullmatch(names, name) for names, _, _ in _CHANNELS)


def of_a_table(names: Iterable[str]) -> bool:
    """True for the columns of a test on a table: it may have a row for each position or stay, and no time."""
    return any(re.fullmatch(r"position|phi[123]|rate", name) for name in names)


def nearest(name: str) -> str:
    """Advice for an unknown name: the nearest known one, or all of them."""
    near = difflib.get_close_matches(name[:80], _EXAMPLES, n=1, cutoff=0.5)
    return f"did you mean {near[0]}?" if near else f"known channels: {', '.join(_EXAMPLES)}"


def may_be_empty(name: str) -> bool:
    """True for what some rows alone have: numbers of points and triggers."""
    return name in ("point", "trigger")


def needs_unit(name: str) -> bool:
    """False for indices, labels and the like, which are plain numbers or text."""
    return "number" not in _dimensions(name)[0]


def misfit(name: str, unit: Unit, increment: bool = False) -> str | None:
    """The misfit of a unit and a channel, as "found ..., expected ..."; None if the unit fits."""
    dimensions, gained = _dimensions(name)
    allowed = dimensions if not increment else () if gained is None else (gained,)
    if unit.dimension in allowed:
        return None
    as_given = f'found "{unit.symbol}" ({unit.dimension})'
    if increment and gained is None:
        return f'{as_given} and kind = "increment", expected kind = "rate" for {name}'
    hint = ' or kind = "increment"' if not increment and unit.dimension == gained else ""
    return f"{as_given}, expected a unit of {' or '.join(allowed)}{hint}"


def _dimensions(name: str) -> tuple[tuple[str, ...], str | None]:
    """Dimensions a known channel may have, and that of its increments."""
    return next((dimensions, gained) for names, dimensions, gained in _CHANNELS if re.fullmatch(names, name))


def sensor_and_axis(name: str) -> tuple[str, str]:
    """("acc", "x") for acc_x, ("gyro", "roll") for gyro_roll, ("theta_ref", "") for theta_ref."""
    match = re.fullmatch(r"(\w+)_(x|y|z|roll|yaw)", name)
    return (match[1], match[2]) if match else (name, "")
