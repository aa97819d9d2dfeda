"""A section of a recording: what was read in it, and what is known of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Kind = Literal["rest", "rate", "turn"]

SENSED: Final[Mapping[Kind, tuple[str, ...]]] = {
    "rest": ("acc", "gyro"),
    "rate": ("gyro",),
    "turn": ("acc", "gyro"),
}
"""Sensors whose means count in a section of each kind: at a rate a lever arm adds to the accelerometers."""


@dataclass(frozen=True, eq=False)
class Section:
    """Readings of a section, and what is known of it.

    A section is a stretch of a recording, a file, or a row of means. SI: angles in rad, rates in rad/s, times in s;
    outputs in the unit of the instrument. Directions are unit vectors on the axes of the case.
    """

    kind: Kind
    """``rest``: stands still. ``rate``: turns steadily. ``turn``: goes from rest to rest by an angle about an axis."""
    name: str = ""
    """As findings and tables call it."""
    where: str = ""
    """Its file and times, in words; empty for a row of means."""
    why: str = ""
    """Source of what is known: name, label, row, or how it was detected."""
    acc: Array | None = None
    """Mean outputs (3,) of the accelerometers, NaN for a channel that is not there; of a turn those before it."""
    acc_var: Array | None = None
    """Variances (3,) of ``acc`` by noise; None: not known."""
    acc_after: Array | None = None
    """Mean outputs (3,) after a turn."""
    gyro: Array | None = None
    """Mean outputs (3,) of the gyros, of a turn over the motion alone."""
    gyro_var: Array | None = None
    """Variances (3,) of ``gyro`` by noise; None: not known."""
    up: Array | None = None
    """Direction (3,) of specific force (up at rest); None: not known."""
    up_u: float | None = None
    """Standard uncertainty of ``up`` in either direction across [rad]; None: not stated."""
    force: Array | None = None
    """Specific force (3,) itself, where another instrument measured it [m/s^2]; ``up`` is then not used."""
    axis: Array | None = None
    """Axis (3,) of the rotation, by the right-hand rule; None: not known."""
    axis_u: float | None = None
    """Standard uncertainty of ``axis`` in either direction across [rad]; None: not stated."""
    level_u: float | None = None
    """The axis is vertical within so much [rad]; ``up`` then only tells which end is up. None: not known."""
    rate: float = 0.0
    """Rate of a ``rate`` section about ``axis`` [rad/s]."""
    rate_u: float = 0.0
    """Standard uncertainty of ``rate`` [rad/s]."""
    rate_group: str = ""
    """Sections of one group share one relative error of the rate."""
    angle: float = 0.0
    """Angle of a turn [rad]."""
    angle_u: float = 0.0
    """Standard uncertainty of ``angle`` [rad]."""
    duration: float = 1.0
    """Duration of a section, of a turn that of its motion [s]."""
    cosine_sine: tuple[float, float] | None = None
    """Mean cosine and sine of the angle over a turn; None: those of a steady turn."""
    setup: str = ""
    """Sections of one setup share one placing: not touched between them."""
    north: Array | None = None
    """Direction (3,) of north on the axes of the case at the beginning; None: the heading is not known."""
    north_u: float = 0.0
    """Standard uncertainty of the heading [rad]."""
    session: str = ""
    """Sections of one session share the biases of one turn-on."""
    scatter: str = ""
    """Sections of one group share one variance of means that nobody states."""
    temperature: float | None = None
    """Temperature [K], where it is known."""
