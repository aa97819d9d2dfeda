"""What a Ferraris calibration is told beside the settings that every calibration of an IMU has."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class FerrarisSettings:
    """Options of a Ferraris calibration, in SI.

    Attributes
    ----------
    turn : float
        Angle of each of the three turns [rad], positive about the positive axis by the right-hand rule.
    turn_u : float
        Its standard uncertainty [rad], independent from turn to turn.
    alignment : float or None
        Standard uncertainty [rad] of the direction of each position and of the axis of each turn, in either of the
        two directions across it and independent from one to the next; None: taken from the scatter of the positions.
    sections : mapping
        Where the sections are, by name: (start, end) in seconds of the record's time axis as floats, or in samples
        (from 0, the end not included) as integers, or the label of its rows. Empty: from the labels of the record
        that are names of sections, or detected.
    """

    turn: float = 2.0 * math.pi
    turn_u: float = 0.0
    alignment: float | None = None
    sections: Mapping[str, tuple[float, float] | str] = field(default_factory=dict)
