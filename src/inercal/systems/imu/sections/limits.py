"""Limits by which a calibration from sections judges them and itself; the book prints them."""

from __future__ import annotations

import math
from dataclasses import dataclass

from inercal.foundation.units import STANDARD_GRAVITY


@dataclass(frozen=True)
class Limits:
    """Thresholds of calibrations from sections; ``LIMITS`` are the ones in force."""

    ordinary_g_sensitivity: float = math.radians(0.1) / STANDARD_GRAVITY
    """Standard deviation [(rad/s)/(m/s^2)] of the g-sensitivity of micromachined gyros, 0.1 deg/s per g."""

    fine_g_sensitivity: float = math.radians(0.1 / 3600.0) / STANDARD_GRAVITY
    """The same of gyros for navigation, 0.1 deg/h per g."""

    fine_gyro_scatter: float = math.radians(0.2 / 3600.0)
    """Scatter [rad/s] of the means of a gyro, 0.2 deg/h, up to which it is as good as those for navigation."""

    contradiction: float = 1e-3
    """Probability of the residuals below which sections contradict what is said of them."""

    beyond_scatter: float = 3.0
    """Logarithm of a scatter over its median beforehand, in standard deviations, beyond which no instrument has it."""

    fewest_scatter_dof: float = 3.0
    """Degrees of freedom of a scatter below which it is rather what was known of it than found."""

    fewest_dof: float = 4.0
    """Degrees of freedom by which u is told from U at least: of four U is 1.96 times the standard deviation."""

    suspect_section: float = 0.05
    """Probability of a section's distance from all others below which scatter is found without it."""

    large_placing: float = math.radians(10.0)
    """Placing [rad] that is named."""

    open_share: float = 0.3
    """Standard uncertainty of a bias, as a part of the largest output, from which the sections leave it open."""

    led_tilt: float = 0.02
    """Standard deviation [rad] of a vertical by the accelerometers of a unit that turns slowly."""

    lever_arm: float = 0.1
    """Distance [m] of accelerometers from the axis of a unit that turns."""


LIMITS = Limits()
"""The limits in force."""
