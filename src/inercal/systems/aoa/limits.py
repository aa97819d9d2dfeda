"""Limits by which an angle of attack is judged, from the record to the verdict: one table, printed in the book."""

from __future__ import annotations

import math
from dataclasses import dataclass

from inercal.foundation.units import STANDARD_GRAVITY


@dataclass(frozen=True)
class Limits:
    """Thresholds, in SI where nothing else is said; misfits as in `inercal.systems.aoa.diagnosis.fit_quality`."""

    judged_rows: int = 6000
    """Rows of the liveliest stretch, which is judged in the place of the whole."""

    summed_time: float = 0.02
    """Time [s] over which whitened innovations are summed for the judge: motion is slower."""

    ranged_rows: int = 5000
    """Rows by which the range of each sensor is told, at most twice as many."""

    white_log: float = 0.53
    """Mean of log(1 + v^2) of white innovations v of variance 1."""

    loud_log: float = 0.75
    """The same from which the innovations of a sensor are larger than its noise."""

    prior_sigmas: float = 3.0
    """Standard deviations of its prior by which a coefficient may be off and still be as expected."""

    gyro_scale_sigmas: float = 10.0
    """The same of the gyro's scale, which a filter that linearises also moves where a buffet is fast and small."""

    far_ratio: float = 1.5
    """Times what is expected at most, from which a coefficient contradicts its prior."""

    prior_chance: float = 1e-4
    """Chance of a sound recording by which its coefficients together may be as far from their priors as they are."""

    shown_share: float = 0.1
    """Share of the prior's variance of a combination of coefficients that a recording must have taken away."""

    lost_starts: int = 10
    """New starts of the fusion, beside one in ten rows, from which it is given up."""

    lost_share: float = 0.1
    """Share of the rows at which it may start anew beside these."""

    sound_misfit: float = 3.0
    """Misfit up to which a recording fits: 0.6 to 2.3 on sound ones, 9 and more with a gross fault."""

    explained_share: float = 0.5
    """Share of a misfit that a hypothesis must take away to be named."""

    gross_alike_misfit: float = 0.1
    """Difference of misfits of two gross faults of which neither is likelier."""

    small_alike_misfit: float = 0.5
    """Difference of misfits of two constant errors of which neither is likelier."""

    two_faults_misfit: float = 20.0
    """Misfit from which two gross faults at once are looked for."""

    first_faults: int = 3
    """Gross faults that are looked at together with a second one."""

    small_errors: int = 3
    """Constant errors that are looked for, one after the other."""

    fitted_errors: int = 8
    """Constant errors that are fitted to the end each time."""

    wild_ratio: float = 30.0
    """Innovations over their median size that are left out of a fit."""

    upside_down_cosine: float = -0.1
    """Cosine of theta below which the model lies on its back."""

    tried_orders: int = 24
    """Orders of accelerometers up to which all are tried; of more accelerometers pairs alone are exchanged."""

    still_gyro_ratio: float = 5.0
    """Times its noise by which a gyro may wander where the model does not move."""

    compared_rows: int = 100
    """Rows at least by which a gyro is held to accelerometers."""

    least_arm: float = 0.1
    """Lever arm [m] that a model has at least."""

    plain_acceleration: float = 0.02 * STANDARD_GRAVITY
    """Acceleration [m/s^2] of the lever arm from which positions show plainly."""

    shortest_arm: float = 0.01
    """Lever arm [m] that the longest of a model exceeds."""

    longest_arm: float = 3.0
    """Lever arm [m] that none of a model exceeds."""

    noise_order: int = 6
    """Order of the differences by which noise is told from motion."""

    noise_share: float = 0.5
    """Share of the mean square of the last differences that must be noise for it to count."""

    noise_differences: int = 20
    """Differences at least from which noise is told."""

    even_share: float = 0.02
    """Share of a sampling interval by which others may differ from it."""

    sparse_rows: int = 4
    """Rows of which one is taken to see whether noise that is small from row to row is so over some rows too."""

    loud_noise_ratio: float = 2.0
    """Ratio of noise to what the study states from which it is named."""

    low_noise_ratio: float = 0.5
    """The same below which it is named."""

    no_noise_ratio: float = 1e-3
    """The same below which there is none, as in numbers made up."""

    starting_rows: int = 20
    """Rows from which the filter starts; a recording has as many at least."""

    backward_rows: int = 1000
    """Successive rows without a later stamp from which the clock was set back; fewer are left out."""

    range_rounding: float = 1e-6
    """Part of a range by which a saturated sample may fall short of it, written with a few digits."""

    stuck_samples: int = 50
    """Successive equal samples of a stuck sensor; noise of the size of the steps makes them with 1e-7 or less."""

    other_clock_gap: float = 2.5
    """Intervals of another clock over which its samples are interpolated."""

    pause_window: float = 0.5
    """Window [s] in which a model rests or moves: some periods of a buffet, and short beside a pause."""

    pause_window_rows: int = 8
    """Rows of the shortest such window."""

    shortest_pause: float = 1.0
    """Shortest pause [s]."""

    resting_sigmas: float = 3.0
    """Standard deviations by which the angle may change over a window of a model at rest."""

    resting_share: float = 1.0 / 20.0
    """Largest scatter of a model at rest, over the range of the angle in the record."""

    least_resting_scatter: float = math.radians(0.1)
    """Scatter [rad] that a model at rest may have whatever that range."""

    most_resting_scatter: float = math.radians(0.5)
    """Scatter [rad] that no model at rest exceeds, but for its uncertainty."""

    zero_rows: int = 80
    """Rows at least of the stretch at rest of a wind-off zero."""

    zero_sigmas: float = 3.0
    """Standard deviations by which the angle may change in that stretch."""

    slower_clock: float = 0.95
    """Samples of a sensor on a clock of its own, over the rows, from which it has a value in every row."""

    joined_correlation: float = 0.8
    """Correlation of the angle with a column of another table from which the offset of their clocks is believed."""

    shaken_gyro: float = 2.0
    """Standard deviation of the gyro, over its stated noise, from which a model shakes in that stretch."""

    zero_buffet: float = math.radians(0.05)
    """Root mean square [rad] of a buffet in that stretch up to which it is averaged, and not refused."""

    lost_variance: float = 0.09
    """Variance of theta [rad^2] at which linearisation ends: theta is found anew from the accelerometers."""

    contradicting_rows: int = 500
    """Successive rows in which a sensor surprises by twice the gate, after which theta counts as lost."""

    memory_time: float = 60.0
    """Time [s] from the first row on in which nothing fades, and the time constant of fading after it."""

    fading_interval: float = 10.0
    """Interval [s] at which constants fade."""

    snap_time: float = 15.0
    """Time [s] of a stretch by which the snap is chosen."""

    snap_stretches: int = 4
    """Stretches, the liveliest of a recording, by which it is chosen."""

    snap_ratio: float = 1.4
    """Mean squared innovation, over that of a still model with the same noise, up to which a snap is large enough."""

    square_share: float = 4.0
    """Square of the rate that a snap leaves free from row to row, times the longest arm, over noise, at most."""

    snap_excess: float = 0.08
    """Excess of it over one from which a snap that is ten times as large is taken where it takes as much away."""

    still_rows: int = 2000
    """Rows of that still model, or as many as there are in 4 s."""

    low_pass_order: int = 4
    """Order of the low pass before the fusion."""

    notch_quality: float = 3.0
    """Frequency of a notch over its width."""

    widest_corner: float = 0.4
    """Corner of a low pass over the rate of rows, from which on it is left out."""

    fused_rate_ratio: float = 2.6
    """Rate of the rows that are fused, over the corner of the low pass: noise of more is alike from row to row."""

    rate_rows: int = 64
    """First rows, by which the rate is known that the band is made for."""

    corner_ratio: float = 2.0
    """Corner of a low pass over the highest frequency of the motion, at least: the rest is a few per cent off."""

    motion_power: float = 10.0
    """Spectral density of the gyro over its noise from which it counts as motion."""

    calm_share: float = 0.1
    """Root mean square of the flexure that is found, over what is allowed, up to which less is."""

    calm_level: float = 0.3
    """Flexure that is allowed then, over that before."""

    calm_steps: int = 2
    """Times that less may be allowed."""

    shaking_frequency: float = 4.0
    """Frequency [Hz] of flexure in a wide band."""

    shaking_damping: float = 0.9
    """Relative damping of flexure in a wide band: from one to some tens of Hz."""

    line_segment: float = 2.0
    """Length [s] of the segments of a spectrum in which lines are looked for."""

    floor_quantile: float = 0.25
    """Share of the frequencies by whose spectral density white noise is judged."""

    floor_share: float = 0.6
    """Spectral density there over the mean one of white noise, at least."""

    line_surroundings: float = 6.0
    """Width [Hz] over which a spectrum's median is that beside a line."""

    line_power: float = 30.0
    """Spectral density of a line over that beside it."""

    common_k2: float = 1e-4 / STANDARD_GRAVITY
    """Second-order coefficient [s^2/m], 100 ug/g^2, by which vibration is judged where the study states none."""

    told_offset: float = 0.25
    """Offset of the angle by it, over u, from which it is said; from 1 on it harms."""

    lowest_line: float = 20.0
    """Frequency [Hz] below which a line may be flexure of the sting, which is a state of the filter."""

    most_lines: int = 6
    """Lines that are taken out; of more they are taken for noise in a band."""

    spectral_delay_sigmas: float = 3.0
    """Standard uncertainties of the delay by the spectra within which the filter estimates it."""

    least_delay_u: float = 1e-5
    """Smallest uncertainty [s] of that delay."""

    settling_time: float = 2.0
    """Time [s] after the first row from which innovations and errors are judged."""

    roll_u: float = math.radians(0.1)
    """Standard uncertainty [rad] of a roll at the start that is stated without one, where it is estimated."""

    level_cosine: float = 0.1
    """Cosine of the roll below which gyro and axes across the body do not show pitch."""

    pair_arm: float = 1e-3
    """Lever arm [m] below which accelerometers do not show angular acceleration."""

    parallel_axes: float = 1e-3
    """Sine of the angle between axes, or error of a right angle [rad], below which they count as parallel or square."""

    reference_sigmas: float = 2.0
    """Standard uncertainties of the angle by which a late reference differs, to be named."""

    reference_off: float = 4.0
    """Root mean square of what a reference differs from the angle, over u, beyond which it is judged."""

    reference_spans: int = 50
    """Averages of 50 ms that a reference angle has at least for a fit of the sensors."""

    reference_gap: float = 3.0
    """Usual intervals that make a break of the reference angle."""

    derivative_power: float = 10.0
    """Power of a derivative of the reference over that of its noise from which it counts as motion."""

    spike_sigmas: float = 6.0
    """Standard deviations from which a row of a sensor is left out of the fit to the reference."""

    widened_prior: float = 10.0
    """Factor by which the fit to the reference widens the study's prior."""

    disagreeing_sigmas: float = 2.0
    """Standard uncertainties by which a coefficient of that fit differs from the study, to be listed."""

    fit_ratio: float = 2.0
    """Times the u of a bias by the fusion up to which the scale and the axis by a fit to a reference are used."""

    reference_creep: float = 1e-5
    """Angle [rad], some seconds of arc, by which a reference may creep in half a second and stand still."""

    same_sensor: float = 1e-6
    """Change [m, rad, parts] below which a sensor counts as unchanged since an earlier run."""

    sure_gravity: float = 1e-6
    """Relative uncertainty of gravity, 0.00006 deg of the angle at most, up to which it counts as exact."""

    budget_share: float = 1e-5
    """Share of a variance below which a source is left out of the budget."""

    listed_share: float = 1e-3
    """Share of a variance below which a source is not listed for people."""

    mean_nis: float = 2.0
    """Mean squared innovation, over its variance, above which rows contradict the model."""

    nis_chance: float = 1e-5
    """Chance of a sound recording above that limit, where few innovations scatter."""

    unseen_scale: float = 0.01
    """Standard deviation of a gyro's scale [1] that was never calibrated."""

    other_scale_sigmas: float = 2.0
    """Standard deviations by which a gyro's scale contradicts the usual prior, so that a wider one is taken."""

    flexure_ratio: float = 5.0
    """Root mean square of the sting's flexure, over the noise of a sample, from which it counts."""

    losses: int = 3
    """Losses of the angle without a gap from which a filter counts as lost."""

    blind_time: float = 0.1
    """Time [s] without accelerometers after which no filter has the angle."""

    watched_time: float = 2.0
    """Time [s] over which a stream averages its squared innovations."""

    watched_innovations: int = 50
    """Innovations in that time from which a stream judges."""

    silent_time: float = 1.0
    """Time [s] without a number after which a gyro is said to be silent on a stream."""

    impossible_arm: float = 10.0
    """Lever arm [m] that is named whatever the motion shows of it: no tunnel has room for it."""

    clipped_part: float = 0.01
    """Part of the rows of a point from which clipped ones are told."""

    points_apart: float = 0.25
    """Part of the usual step between points by which points of several runs may differ and be the same."""

    oscillations_alike: float = 0.05
    """Relative difference of amplitudes and of frequencies up to which oscillations are repeats."""

    sine_share: float = 0.9
    """Part of the variance of the angle that a sine explains where a run oscillates."""

    fewest_rests: int = 4
    """Rests from which three coefficients of an accelerometer are fitted."""

    delay_sigmas: float = 5.0
    """Standard uncertainties by which the gyro's delay differs from the study's, to be named."""


LIMITS = Limits()
