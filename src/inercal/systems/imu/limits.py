"""Limits by which calibrations of an IMU judge a recording and a fit; the book prints them."""

from __future__ import annotations

import math
from dataclasses import dataclass

from inercal.foundation.units import STANDARD_GRAVITY


@dataclass(frozen=True)
class Limits:
    """Thresholds of all methods; ``LIMITS`` are the ones in force."""

    # every method

    initial_rest: float = 5.0
    """Shortest period of rest [s] at the start of a recording by which its noise is judged."""

    moving_variance: float = 30.0
    """Variance of an output, over that at rest, from which the instrument certainly moves."""

    motion_gap: float = 3.5
    """Longest step of time in a motion [sample intervals]: two lost samples hardly matter to its integral."""

    vertical_miss: float = 0.2
    """Rms angle [rad] between carried and measured verticals beyond which gyro and accelerometers contradict each
    other."""

    outlier_risk: float = 5e-4
    """Accepted probability that a sound pose of a recording is named as outlying."""

    outlier_share: float = 0.2
    """Share of the poses, or turns, that outliers may be."""

    outlier_dof: int = 3
    """Degrees of freedom that have to be left without the outliers."""

    ordinary_clock: float = 50e-6
    """Relative error that the clock of a recorder has as a rule."""

    # second-order coefficients, poses and moves

    ordinary_k2: float = 150e-6 / STANDARD_GRAVITY
    """Standard deviation [1/(m/s^2)] of second-order coefficients that are neither fitted nor stated, 150 ug/g^2, as
    consumer-grade sensors have them."""

    fine_k2: float = 30e-6 / STANDARD_GRAVITY
    """The same of sensors for navigation, 30 ug/g^2."""

    fine_scatter: float = 20e-6 * STANDARD_GRAVITY
    """Scatter [m/s^2] of the mean specific force of a pose, 20 ug, up to which sensors are as good as those for
    navigation."""

    same_pose: float = 5e-3
    """Change of specific force, as a part of gravity, below which a short disturbance leaves the pose the same."""

    clipped_part: float = 0.1
    """Part of the samples of a pose at the end of an accelerometer's range from which its mean counts as short."""

    fewest_turns: int = 7
    """Turns that a fit of the gyro needs: each gives two equations for twelve parameters."""

    driver_probability: float = 1e-3
    """Probability below which a drift of biases or scale factors, or a dependence of the gyro's bias on the pose, is
    not put down to chance."""

    # rows of means, known rates and turns

    most_poses: int = 100
    """Rows from which most being like the one before are samples of a recording, not means of poses."""

    turn_margin: float = 0.1
    """Time [s] by which a turn is taken longer at either end than its rate shows."""

    turn_noise: float = 4.0
    """Size of a gyro's smoothed output, over that at rest (rms), from which it turns."""

    # Ferraris: sections

    upright_cosine: float = 0.9
    """Cosine of the largest angle from upright (26 deg) in a hold that counts as a position."""

    axis_share: float = 0.9
    """Least part of the integrated rotation of a turn that is about its axis."""

    pause_rate: float = 0.03
    """Rate in a pause, as a part of the largest rate of the motion around it."""

    rest_rate: float = 0.005
    """Rate in the rests between which a pause may hold a small motion, as a part of that largest rate."""

    shortest_pause: float = 0.2
    """Shortest pause [s] within a motion."""

    rate_window: float = 0.1
    """Length [s] of the moving mean by which a rate is judged slow."""

    motions_in_a_row: int = 40
    """Motions in a row of which runs are candidates for a turn; more are shaking."""

    position_variance: float = 30.0
    """Variance in a position, over the median of all positions, from which the instrument moves in it."""

    cut_rate: float = 0.03
    """Rate at an end of a turn, as a part of its largest rate, from which the turn was under way there."""

    lost_rate: float = 0.3
    """Rate at an end of a turn, as a part of its largest rate, from which the angle of the turn is not known at all."""

    # Ferraris: choice of the turns

    turn_deviation: float = 0.25
    """Largest deviation of a turn of physical outputs from the stated angle, as a part of it."""

    turn_size: float = 0.7
    """Least size of the largest motion about an axis, over that of the other axes, that can be its turn of counts."""

    turn_scale_u: float = 1e-3
    """Relative standard uncertainty of a scale factor by a turn that stands for everything but the angle."""

    turn_sigmas: float = 5.0
    """Deviation, over its standard uncertainty, beyond which a motion was not the turn."""

    turn_chi2: float = 16.0
    """Difference of the squared deviations from which the motion with the larger one is not chosen."""

    slight_turn_difference: float = 1e-3
    """Difference of two motions, as a part of the turn, that needs no finding."""

    grave_turn_difference: float = 1e-2
    """Difference of two motions, as a part of the turn, from which the result should not be used."""

    transfer_scale_u: float = 0.05
    """Relative standard uncertainty of a scale factor by transfer of gravity from which the transfer tells nothing."""

    transfer_tilt: float = 0.3
    """Least change of the vertical [rad] in a transfer that tells something of the scale factors."""

    fewest_transfers: int = 3
    """Transfers that a fit of the scale factors needs."""

    shortest_transfer: float = 0.25
    """Shortest transfer [s]: a recording cut down to its sections has none left between them."""

    longest_transfer: float = 60.0
    """Longest transfer [s] whose gyro output is integrated."""

    fewest_transitions: int = 2
    """Transfers between positions that a check of the sense of the turns needs."""

    # aided by a table: its motion

    rest_speed: float = math.radians(0.1)
    """Speed of an axis [rad/s] below which the table rests."""

    speed_window: float = 0.5
    """Time [s] over which that speed is taken, so that the noise of encoders does not show as speed."""

    shortest_rest: float = 1.0
    """Shortest rest [s] of the table."""

    table_speed: float = math.radians(3000.0)
    """Speed [rad/s] that no table has: the angle jumps."""

    table_travel: float = math.radians(10.0)
    """Travel of the table's axes [rad] below which nothing is calibrated."""

    glitch_angle: float = math.radians(0.3)
    """Distance [rad] of an angle from its neighbours below which the angle is kept."""

    glitch_ratio: float = 15.0
    """Distance of an angle from its neighbours, over the median distance of the forty around, that is a glitch."""

    stray_stamps: int = 5
    """Time stamps in a row that run backward and are left out; more are a clock that was set back."""

    # aided by a table: blocks and noise

    block: float = 0.25
    """Length of a block [s]: far shorter than turns and the wander of a bias, longer than the memory of filters."""

    most_blocks: int = 4000
    """Blocks of a record at most; a long record has longer ones."""

    fewest_blocks: int = 20
    """Blocks that a fit needs."""

    turning_walk_gain: float = 10.0
    """Twice the gain of the log likelihood beyond which an output shifts more in turns than at rest (chi-square of 1,
    p = 2e-3)."""

    turning_walk_gain_of_triad: float = 13.0
    """The same gain of the three outputs of a triad together (chi-square of 3, p = 5e-3)."""

    counted_gain: float = 2.0
    """Gain of one output below which it does not count in the gain of its triad."""

    prior_share: float = 1e-6
    """Share of a variance below which a prior that only keeps the fit regular is left out of the budget."""

    # aided by a table: verdict

    unknown_coefficient_u: float = 0.1
    """Relative standard uncertainty of a scale factor, or standard uncertainty of a misalignment in rad, beyond which
    the data say next to nothing of it."""

    fault_shift: float = 5.0
    """Shift of a coefficient by a fault, in its standard uncertainties, beyond which nothing can be used."""

    fault_part: float = 1e-3
    """Least part of the outputs' variation that such a fault makes: below it the uncertainties allow for the fault."""

    turning_shift: float = 0.01
    """Shift of an output by one turn, over the variation of its triad, beyond which nothing can be used."""

    turning_residual: float = 0.1
    """Residuals in turns, over the variation of the triad, beyond which nothing can be used."""

    wander_gain: float = 10.8
    """Twice the gain of the log likelihood beyond which a bias wanders for certain (chi-square of 1, p = 1e-3)."""

    # temperature

    temperature_span: float = 5.0
    """Range of temperature [K] below which nothing is fitted."""

    fewest_calibrations: int = 3
    """Calibrations that a curve over temperature needs."""

    flat_temperature: float = 0.05
    """Slope of temperature, as a part of the largest, below which it neither rises nor falls."""

    kink_gain: float = 30.0
    """Gain of the log likelihood beyond which an output jumps or bends at a temperature; noise that wanders through a
    sweep reaches 20 in one of 300."""

    hysteresis_probability: float = 0.01
    """Probability at which chance alone makes passes of any of the channels differ."""

    judged_rows: int = 1000
    """Rows of each sensor that are judged at most: those of longer records are summed."""

    quaternion_norm: float = 0.01
    """Largest departure from 1 of the norm of a quaternion."""

    noise_of_rest: float = 6.0
    """Turn between two recorded attitudes, over the standard deviation of their noise, that is none."""

    noise_of_reference: float = 2.0
    """Noise of a recorded attitude, over that of the gyro, beyond which residuals tell nothing of the gyro."""

    block_of_attitudes: float = 1.0
    """Shortest block [s] of the gyro beside a recorded attitude."""

    reference_window: float = 0.1
    """Time [s] over which a recorded attitude is smoothed by cubics."""

    left_at_prior: float = 0.5
    """u of a value over that of its prior below which the turns about one axis tell it; of a bias the largest share of
    its variance by priors of gains."""

    usual_gain_u: float = 0.05
    """Standard uncertainty of a scale factor over its unit, and of a misalignment [rad], where one axis leaves it
    open."""

    # aided by a table: its diagnosis; shares of an output are of its variation over the test

    misfit_risk: float = 2.5e-5
    """Accepted probability of a false fault in the residuals: 1e-6 for each of some 25 that are looked for."""

    misfits: int = 3
    """Faults named at most."""

    excess_left: float = 0.3
    """Share of the likelihood's gain by outputs that shift in turns, which a fault may leave if it explains them."""

    faint_share: float = 1e-6
    """Share of the outputs up to which an effect is left to rounding."""

    told_share: float = 1e-3
    """Share of a pattern that the other unknowns have to leave for it to be told from them."""

    smoothing_step: float = 0.05
    """Step [s] of the second derivatives with time by which a slow filter is seen."""

    knock_sigmas: float = 12.0
    """Distance of a block from its neighbours, over its robust standard deviation, that is a knock."""

    knock_output_share: float = 0.02
    """Share of an output below which no block is left out."""

    knock_largest_share: float = 0.2
    """Share of the largest distance below which no block is left out."""

    knocked_share: float = 0.01
    """Share of the blocks that knocks may be; more are no knocks."""

    knocked_blocks: int = 3
    """Blocks that knocks may be in any case."""

    agreement_miss: float = 0.35
    """Share of an output that a sound table leaves unexplained at most; misalignments leave some 0.05."""

    slowest_turn: float = math.radians(0.5)
    """Fastest turn [rad/s] below which the gyro says nothing about the angles."""

    least_force_change: float = 0.3
    """Change of the specific force, over gravity, below which the accelerometers say nothing about the angles."""

    longest_lag: float = 60.0
    """Time [s] by which the clocks of table and instrument are searched for a shift."""

    lag_correlation: float = 0.1
    """Gain of the correlation by which a shift of the clocks is clearly better than none."""


LIMITS = Limits()
"""The limits in force."""
