"""Limits by which sections are found in recordings, and by which their names are checked; the book prints them."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """Thresholds of the finding of sections; ``LIMITS`` are the ones in force."""

    still_window: float = 0.4
    """Length [s] of the windows whose variance tells rest from motion."""

    blocks_of_window: int = 4
    """Blocks of a window: windows begin at every block."""

    still_for_both: float = 0.8
    """Part of a hold of the accelerometers in which the gyro rests too, from which it is cut to that."""

    shortest_hold: float = 0.65
    """Shortest hold [s] that is read."""

    valley_depth: float = 0.6
    """Height of a valley between two humps of the variances, over that of the lower hump, up to which it is one."""

    valley_reach: float = 0.5
    """Distance [powers of ten of variance] from the hump of rest at which the threshold lies at most."""

    kept_time: float = 0.7
    """Part of the time at rest that the calmer of two sets of holds with the same poses keeps at least."""

    gap_of_joint: float = 1.0
    """Time [s] in the place of a step backward, where two logs were joined."""

    worse_holds: float = 1.05
    """Standard deviations of the coefficients (geometric mean) by a set of holds, over those by the best, up to which
    a calmer set is taken."""

    usual_error: float = 0.05
    """Standard deviation of biases, as a part of gravity, scale factors and misalignments of accelerometers before the
    data, by which sets of holds are compared."""

    usual_pose_scatter: float = 3e-4
    """Scatter of poses, as a part of gravity, that counts there as one degree of freedom."""

    hump_windows: float = 4.0
    """Windows that the peak of a hump holds at least, within half a power of ten of variance."""

    restless_hold: float = 0.1
    """Standard deviation of specific force in a window, as a part of gravity, from which nothing is held still."""

    drift_in_hold: float = 0.02
    """Change of the vertical [rad] from the first to the last third of a hold, beyond its noise, from which it is none:
    the mean of a fan of directions is shorter than gravity by a 24th of its square."""

    drift_sigmas: float = 5.0
    """Change within a hold, over the u of that change by noise, that is put down to chance."""

    hold_edge: float = 4.0
    """Change of short means, over their scatter inside a hold, from which the hold is over."""

    hold_edge_power: float = 4.0
    """Mean square of short stretches about the mean of a hold, over that inside it, from which the hold is over."""

    same_pose: float = 0.05
    """Change of specific force, as a part of gravity, below which two holds in a row are one pose."""

    harmless_rate: float = 0.05
    """Rate [rad/s] up to which turning does no harm to the mean of accelerometers: 1e-3 m/s^2 over an arm of 0.4 m."""

    slowest_telling: float = 0.2
    """Rate of the vertical [rad/s] from which it tells the scale of a gyro in counts."""

    fastest_telling: float = 3.0
    """Rate of the vertical [rad/s] up to which it does: beyond, the accelerometers feel more than gravity."""

    turning_hold: float = 10.0
    """Distance of the gyro's mean in a hold from that of the others, over their scatter, from which it turns."""

    turning_rest: float = 30.0
    """The same of a rest that a name or a row states."""

    holds_to_compare: int = 5
    """Holds without which the means of the gyro are not compared."""

    sides_to_compare: int = 4
    """Rests of known direction without which where they stand is not judged."""

    rate_miss: float = 0.2
    """Part by which the gyro's reading of a rate or turn may differ from what is stated."""

    shortest_rate: float = 1.0
    """Shortest stretch [s] at a steady rate that is found in a log."""

    steady_rate: float = 0.02
    """Change of a rate from the first to the last third of a stretch, as a part of it, up to which it is steady."""

    one_rate: float = 0.05
    """Difference of two rates, as a part of them, below which they are one."""

    turn_about_axis: float = 0.95
    """Part of a rotation that is about one axis of the case, from which it may be a turn about it."""

    turned_vertical: float = 0.35
    """Change of specific force over a rotation, as a part of gravity, up to which it may be a turn about an axis."""

    turned_in_place: float = math.radians(0.1)
    """Angle [rad] between two rests on a side, up to which the case was turned in place and not set down anew."""

    least_turn: float = 0.2
    """Rotation, as a part of the largest between two holds, from which it may be a turn."""

    faint_turn: float = 0.05
    """Mean rate in the stretch of a turn, as a part of the largest, below which nothing turns in it."""

    whole_turn: float = 0.1
    """Part by which the gyro's reading may miss whole turns that are taken for granted."""

    cut_of_rest: float = 0.02
    """Part of a file of one rest that may be moving without its times being written down."""

    largest_bias: float = math.radians(20.0)
    """Output of a gyro [rad/s] up to which it may be its bias; a steady one beyond is a rate."""

    known_gravity: float = 0.01
    """Difference of a stated size from that of gravity, as a part of it, up to which it is a direction alone."""

    noise_dof: float = 8.0
    """Degrees of freedom without which means of a length do not tell the noise."""

    noise_change: float = 2.5
    """Change of the noise from short to long means, over its u by chance, from which short ones say nothing of long
    ones."""

    heading_u: float = math.radians(2.0)
    """Standard uncertainty [rad] of the north of a section that states none."""

    side: float = math.radians(20.0)
    """Angle [rad] from an axis within which a rest may be a side; and two sides within it are one taken twice."""


LIMITS = Limits()
"""The limits in force."""
