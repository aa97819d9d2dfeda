"""Limits beyond which the angle of a live measurement is told."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import InputError
from inercal.foundation.keys import quantity, within

_ANY_ANGLE = within(-math.pi, math.pi, "an angle from -180 deg to 180 deg")


@dataclass(frozen=True)
class AlarmLimits:
    """Limits of the angle of attack, or of pitch where the study does not state how the model lies in the stream."""

    lowest: float | None = quantity(
        "angle below which a row has an alarm; none if absent", "angle", example="-5 deg", bounds=_ANY_ANGLE
    )
    highest: float | None = quantity(
        "angle above which a row has an alarm; none if absent", "angle", example="25 deg", bounds=_ANY_ANGLE
    )

    def __post_init__(self) -> None:
        """Refuse limits between which there is nothing."""
        if self.lowest is not None and self.highest is not None and not self.lowest < self.highest:
            found = f"{math.degrees(self.lowest):g} deg with highest {math.degrees(self.highest):g} deg"
            raise InputError("lowest", f"found {found}, expected it below")

    @property
    def stated(self) -> bool:
        """True where there is a limit."""
        return self.lowest is not None or self.highest is not None

    def beyond(self, angle: Array) -> Array:
        """(n,) 1 where an angle (n,) [rad] is above the limits, -1 below, 0 within, NaN without one."""
        above = 0.0 if self.highest is None else 1.0 * (angle > self.highest)
        below = 0.0 if self.lowest is None else 1.0 * (angle < self.lowest)
        return np.asarray(np.where(np.isnan(angle), np.nan, above - below))
