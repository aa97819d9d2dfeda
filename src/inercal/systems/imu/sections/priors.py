"""Priors: means and standard deviations of all that the sections share."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

from inercal.foundation.geometry.earth import Site
from inercal.foundation.units import STANDARD_GRAVITY


class Size(NamedTuple):
    """A standard deviation that nobody states: its ``median`` beforehand, and the standard deviation ``spread`` of its
    logarithm."""

    median: float
    spread: float


@dataclass(frozen=True)
class Priors:
    """Means and standard deviations of what is known before the data. 0 is exact, inf is nothing."""

    site: Site
    """Gravity and latitude with their u."""
    clock_u: float = 0.0
    """Relative standard uncertainty of the clock."""
    mounting_u: float = 0.0
    """Standard uncertainty [rad] of the rotation between the case and all that is said of directions and axes."""
    frame: str = ""
    """Frame of the coefficients: ``case``, ``accelerometers``; empty: the case where a direction or axis is known."""
    acc_scale: Size | None = field(default=Size(1.0, 0.05))
    """K1 beforehand and its relative standard deviation; None: outputs in counts of unknown scale."""
    gyro_scale: Size | None = field(default=Size(1.0, 0.05))
    """S beforehand, the same."""
    misalignment: float = 0.05
    """Standard deviation [rad] of M and T about 0. 20 mrad would pull values that occur."""
    k2: float | None = None
    """Standard deviation [1/(m/s^2)] of K2 about 0; None: by the class of the accelerometers."""
    g_sensitivity: float | None = None
    """Standard deviation [(rad/s)/(m/s^2)] of G over S about 0; None: by the class of the gyro."""
    placing: Size = field(default=Size(math.radians(0.3), 0.9))
    """Placing errors [rad] that nobody states."""
    acc_scatter: Size = field(default=Size(0.3e-3 * STANDARD_GRAVITY, 2.0))
    """Scatter of means of the accelerometers [m/s^2] that nobody states."""
    gyro_scatter: Size = field(default=Size(math.radians(0.01), 2.5))
    """The same of the gyro [rad/s]."""
    acc_session: Size = field(default=Size(0.5e-3 * STANDARD_GRAVITY, 2.0))
    """Change of the bias of accelerometers from session to session [m/s^2]."""
    gyro_session: Size = field(default=Size(math.radians(0.02), 2.0))
    """The same of the gyro [rad/s]."""
    excess: frozenset[str] = frozenset()
    """Sensors, ``acc`` and ``gyro``, whose means scatter beyond their stated noise."""
