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

    flat_scatter: float = 5.0
    """Standard deviation of the logarithm of a scatter, in counts that nothing tells the unit of, about 1 count."""

    fewest_scatter_dof: float = 3.0
    """Degrees of freedom of a scatter below which it is rather what was known of it than found."""

    fewest_dof: float = 4.0
    """Degrees of freedom by which u is told from U at least: of four U is 1.96 times the standard deviation."""

    suspect_section: float = 0.05
    """Probability of a section's distance from all others below which scatter is found without it."""

    told_rate: float = 1e-3
    """Share of the variance of a rate that the other sections take away, from which they tell its error."""

    large_placing: float = math.radians(10.0)
    """Placing [rad] that is named."""

    open_share: float = 0.3
    """Standard uncertainty of a bias, as a part of the largest output, from which the sections leave it open."""

    led_tilt: float = 0.02
    """Standard deviation [rad] of a vertical by the accelerometers of a unit that turns slowly."""

    lever_arm: float = 0.1
    """Distance [m] of accelerometers from the axis of a unit that turns."""

    visible_bend: float = 0.1
    """Curvature along a combination of coefficients, in standard deviations of the means, from which it counts."""

    most_bends: int = 12
    """Combinations whose curvature counts at most."""

    least_help: float = 0.95
    """Factor on u by a planned section, from which on it helps a term."""

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

    # moves

    move_walk: float = math.radians(0.03)
    """Scatter of moves [rad/sqrt(s)], median beforehand."""

    move_walk_spread: float = 2.0
    """Standard deviation of its logarithm."""

    integrated_anew: float = 2e-3
    """Change of a rotation [rad] from which it is integrated anew; smaller ones by derivatives are 2e-6 off."""

    level_axis: float = 0.1
    """Length of a carried level axis across the vertical below which it tells no heading."""

    least_sweep: float = 0.1
    """Angle [rad] that a move of median size sweeps at least."""

    largest_sweep: float = 12.0
    """Angle [rad] that it sweeps at most."""

    open_scale: float = 0.5
    """Relative standard deviation of a scale of the gyro that nothing but moves tells."""

    harmless_wander: float = 0.3
    """Angle by which a bias off its mean turns moves, over their scatter, up to which it is left to that."""
    turned_vertical: float = math.radians(10.0)
    """Angle [rad] between the verticals of two rests from which a gyro has to see a motion between them."""

    raised_u: float = 1.2
    """Growth of u of the accelerometers by moves, from which these have no say in them."""

    raised_scatter: float = 2.0
    """Growth of the logarithm of their scatter, in standard deviations, from which they have none."""

    held_scatter: float = 0.05
    """Standard deviation of the logarithm of a scatter that moves must not change."""

    outlying_risk: float = 3e-3
    """Accepted probability that any sound section or move of a recording is named as off the others."""


LIMITS = Limits()
"""The limits in force."""
