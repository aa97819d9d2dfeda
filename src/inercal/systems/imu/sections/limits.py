"""Limits by which swings and moves of an IMU are judged; the book prints them."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """Thresholds of swings and moves; ``LIMITS`` are the ones in force."""

    # swings

    swing_window: float = 0.05
    """Longest window [s] of a swing: within 0.25 s a hand turns so far that K1 is 0.2 to 1 % off."""

    swing_turn: float = math.radians(5.0)
    """Turning within a window [rad] at most."""

    fewest_windows: int = 10
    """Windows, or rows, that the nine coefficients of a swing need."""

    hand_arm: float = 0.05
    """Distance [m] from the pivot of a hand to the sensor, standard deviation of each component beforehand."""

    alike: float = 0.05
    """Differences between the scale factors of one triad, as a part of them, standard deviation beforehand."""

    wrong_unit: float = 0.05
    """Median distance from the sphere of gravity, as a part of its radius, beyond which the unit may be another one."""

    better_sphere: float = 0.3
    """Distance from a sphere of any size, as a part of that, below which it is."""

    swing_scatter: float = 0.1
    """Scatter of specific force, as a part of gravity, beyond which what happens is no swing."""

    swing_contradiction: float = 1e-3
    """Probability of K1 and M by their priors below which a swing contradicts these."""

    outlying_window_risk: float = 0.05
    """Accepted probability that any sound window of a swing is named as outlying."""

    outlying_windows: float = 0.05
    """Share of the windows up to which outlying ones are named one by one."""

    outlying_rows: int = 12
    """Windows that are so in any case."""

    calm_share: float = 0.1
    """Difference between specific force and gravity, as a part of it, at the ends of a turn of gravity at most."""

    told_column: float = 0.08
    """Standard uncertainty of what a gyro's channel measures, as a part of it, up to which it counts as told."""

    told_axis: float = 0.9
    """Share of it along one axis from which that is its axis."""

    alike_columns: float = 0.2
    """Difference of it between windows of two lengths, as a part of it, at most."""

    swing_gyro_u: float = 0.01
    """Relative standard uncertainty of a gyro by the turns of gravity in a swing at least; the same in rad of its
    axes."""


LIMITS = Limits()
"""The limits in force."""
