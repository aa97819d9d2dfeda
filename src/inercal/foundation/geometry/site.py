"""A place with known gravity, and what that value is uncertain by."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from inercal.foundation.geometry.earth import EARTH_RATE


class GravityInput(NamedTuple):
    """One source of uncertainty of gravity, type B.

    ``u`` its standard uncertainty in ``unit`` (SI), ``sensitivity`` dg/dinput [m/s^2 per that unit].
    """

    source: str
    u: float
    unit: str
    sensitivity: float


@dataclass(frozen=True)
class Site:
    """A place with known gravity.

    ``gravity`` [m/s^2] with its type B ``inputs``; ``latitude`` [rad], None if not known, with its standard
    uncertainty ``latitude_u`` [rad].
    """

    gravity: float
    inputs: tuple[GravityInput, ...] = ()
    latitude: float | None = None
    latitude_u: float = 0.0

    @property
    def vertical_rate(self) -> float:
        """Upward part of earth rate [rad/s]; 0 where the latitude is not known."""
        return 0.0 if self.latitude is None else EARTH_RATE * math.sin(self.latitude)

    @property
    def vertical_rate_u(self) -> float:
        """Standard uncertainty of `vertical_rate` [rad/s]; that of any latitude where it is not known.

        Over the whole sphere the sine of the latitude is uniform from -1 to 1.
        """
        if self.latitude is None:
            return EARTH_RATE / math.sqrt(3.0)
        return EARTH_RATE * min(math.cos(self.latitude) * self.latitude_u, 1.0 / math.sqrt(3.0))

    @property
    def horizontal_rate_u(self) -> float:
        """Standard deviation of either horizontal component of earth rate [rad/s] at an unknown heading.

        The square of the cosine of the latitude is 2/3 on average over the sphere.
        """
        if self.latitude is None:
            return EARTH_RATE / math.sqrt(3.0)
        return EARTH_RATE * math.cos(self.latitude) / math.sqrt(2.0)
