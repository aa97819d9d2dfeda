"""What a Ferraris calibration is told beside the settings that every calibration of an IMU has."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from inercal.keys import Bounds, quantity, within

_TURN = Bounds(
    lambda angle: math.radians(10.0) <= abs(angle) <= math.radians(36000.0),
    "an angle of 10 deg to 36000 deg, negative for turns against the right-hand rule",
)


@dataclass(frozen=True)
class FerrarisSettings:
    """Options of the Ferraris calibration: six positions, each axis up and down, and a turn about each axis.

    Attributes
    ----------
    turn, alignment
        As their keys say [rad]; independent from turn to turn, and from position to position in either of the two
        directions across it.
    turn_u : float
        Standard uncertainty of ``turn`` [rad].
    sections : mapping
        Where the sections are, by name: (start, end) in seconds of the record's time axis as floats, or in samples
        (from 0, the end not included) as integers, or the label of its rows. Empty: from the labels of the record
        that are names of sections, or detected.
    """

    turn: float = quantity(
        "angle of the turns, positive about the positive axis by the right-hand rule, perhaps with its standard "
        "uncertainty", "angle", "360 deg", example="360(0.5) deg", bounds=_TURN, u="turn_u",
    )  # fmt: skip
    turn_u: float = 0.0
    alignment: float | None = quantity(
        "standard uncertainty of the direction of each position and of the axis of each turn; from the scatter of the "
        "positions if absent", "angle", example="0.5 deg",
        bounds=within(0.0, math.radians(20.0), "a standard uncertainty up to 20 deg"),
    )  # fmt: skip
    sections: Mapping[str, tuple[float, float] | str] = field(default_factory=dict)
