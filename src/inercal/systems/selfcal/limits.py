"""Limits of the diagnosis of a platform: one table, printed in the book."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """Thresholds, in SI where nothing else is said."""

    risk: float = 1e-3
    """Accepted probability of a false finding, of each kind."""

    place_turn: float = math.radians(10.0)
    """Turn [rad] of a joint from which readings are asked whether they depend on its angle."""

    second_order: float = 0.05
    """Part of the sum of squares that an error explains below which what is left beside it is of second order."""

    free_prior: float = 1e4
    """Sizes of an error, and of its u, that make the prior of one that is fitted freely."""

    gross_faults: int = 4
    """Gross faults that are looked for, one after the other."""

    plain_misfit_ratio: float = 0.1
    """Ratio of sums of NIS, after to before, below which a gross fault is taken though the rest is not sound."""

    explained_ratio: float = 0.5
    """The same ratio from which a gross fault is not what happened."""

    least_rows: int = 10
    """Rows at least of a recording."""

    late_rows: int = 10
    """Successive rows without a later stamp from which time stands still or was set back; fewer are left out."""

    most_rows: int = 5_000_000
    """Rows of a plan that fit into memory with all that is computed from them."""

    gap_ratio: float = 1.5
    """Ratio to the usual interval beyond which an interval is a gap: the rate was not meant for so long."""

    recent_intervals: int = 9
    """Intervals, with the one in question, of which the middle one is the usual one."""

    held_sigmas: float = 5.0
    """Standard deviations about an axis beyond which the encoders contradict a turn that was held: by chance once in a
    million gaps, while a turn that ended a hundredth of a second before the gap did is off by more."""

    encoder_floor: float = 0.05
    """Part of the encoder noise that is taken for isotropic, against infinite information at gimbal lock."""

    stiff_share: float = 1e-3
    """Variance of an attitude about a joint that is fixed, over that of the gyros' random walk from row to row: no
    more, for that joint does not move, so that innovations would be correlated; no less than rounding bears."""

    axes_known: float = math.radians(1.0 / 60.0)
    """Angle [rad] within which the axis of a joint is known: noise of its angle is noise about others by so much."""

    singular_cosine: float = 0.01
    """Cosine of the inner gimbal's angle below which the gimbal angles of a model cannot be used."""

    path_cosine: float = 0.2
    """Cosine of the inner gimbal's angle that a designed path keeps to where its limits are not stated: nearer to lock
    two joints are almost one."""

    path_starts: int = 24
    """Random starts of the search for a path; on the 540 s of the paper ten times as many gain less than 1 %."""

    path_angles: int = 5000
    """Angles within the time that the search can go through: it tries one change for each, again and again."""

    search_turn: float = math.radians(3.0)
    """Turn [rad] between two rows, at most, while a path is searched for."""

    last_step: float = 0.02
    """Part of u that the last step of a fit of several records may be; beyond it the fit has not converged."""

    second_prior: float = 10.0
    """Standard uncertainties of the first pass of a filter that make the prior of its second one: so far from where it
    is linearised it may go."""

    estimators_apart: float = 0.3
    """Part of u by which the batch estimator may differ from a filter: what linearising costs it."""

    kept_rows: int = 8192
    """Rows that a stream keeps to go through them again, linearised anew, each time that they have doubled."""

    base_sigma: float = math.radians(2.0 / 60.0)
    """Standard deviation [rad] of beta up to which filters find it from the base as stated: linearising neglects its
    square, 0.07 arcsec, less than what is averaged of the best encoders and accelerometers."""

    heading_sigma: float = math.radians(60.0)
    """Standard deviation [rad] of a first guess of the heading: the batch estimator finds it from so far away."""

    heading_u: float = math.radians(1.0)
    """Standard uncertainty [rad] of a heading up to which it counts as found."""

    base_prior_ratio: float = 10.0
    """Prior of beta about the base found, in its standard uncertainties: a hundredth of what the recording tells."""

    walk_time: float = 60.0
    """Time [s] over which a bias that walks is correlated: within it a random walk, beyond it as far from its mean as
    before. A walk of 0.35 ug/sqrt(s) is then like 1/f noise whose Allan deviation has its floor at 1 ug."""

    considered_part: float = 0.5
    """Part of u that errors of one kind which are not fitted must make to be told, over the u without any."""

    slow_time: float = 5.0
    """Time [s] over which innovations of accelerometers are correlated where their biases wander and no state of the
    model follows: slower wandering is taken up by coefficients."""

    still_joint: float = math.radians(1.0 / 60.0)
    """Range [rad] of a joint's angle below which it stands still: non-orthogonality of 20 arcsec then turns the
    platform by less than 0.01 arcsec otherwise than gamma and beta."""

    turning_ratio: float = 2.0
    """Rate, over earth rate, from which the platform turns."""

    gated_part: float = 0.5
    """U without near-level gating over that with it, up to which gating is named as the cause of a lack."""

    turned_angle: float = math.radians(45.0)
    """Angle [rad] about an axis of p below which the platform hardly turned about it."""

    moving_share: float = 0.3
    """Part of the largest turn of a stretch from which units of rates and angles are compared."""

    unit_window: float = 1.25
    """Factor within which a ratio of rates to angles is that of two units."""

    missing_steps: float = 1.5
    """Steps by which a recording may be shorter than its path."""

    single_rows: int = 60
    """Rows that are left out before they no longer count as single."""

    single_rounds: int = 5
    """Rounds in which they are looked for."""

    single_apart: int = 100
    """Rows within which one reading that is far off spoils those after it."""

    single_sigmas: float = 4.0
    """Innovation over its standard deviation from which a reading of a surprising row is left out."""

    nis_sigmas: float = 5.0
    """Standard errors by which a mean NIS, or a mean square, may be off in a sound recording."""

    longest_shift: int = 3
    """Rows by which a log of commands or accelerometers may be shifted."""

    stuck_rows: int = 3
    """Rows for which a sensor must stand still to be called stuck."""

    repeated_rows: int = 20
    """Rows for which an encoder must repeat one reading to the last digit where its joint is not told to turn."""

    noise_sigmas: float = 10.0
    """Standard deviations of a difference of encoder readings beyond which it is motion."""

    jump_share: float = 0.5
    """Share of a commanded turn by which the encoders must turn otherwise to jump."""

    still_share: float = 0.1
    """Share of a commanded turn up to which an encoder stands still."""

    leap_share: float = 0.1
    """Share of a leap by which it may differ from a multiple of the commanded turn."""

    widened_prior: float = 10.0
    """Multiple of a coefficient, or of its prior, to which a contradicted prior is widened."""

    harmonic_orders: int = 64
    """Largest number of periods a turn at which an error of an encoder is looked for."""

    small_errors: int = 5
    """Constant errors that are looked for, one after the other."""

    wandering: int = 5
    """Cosines of time, from half a period of the recording on, by which biases may wander that count in u."""

    small_delay: float = 0.1
    """Time [s] up to which encoders or accelerometers are believed to be late."""

    nearly_white: float = 1e-6
    """Probability of innovations as correlated, by chance, from which states of the rig explain them."""

    left_over: float = 0.25
    """Part of what innovations are off, in mean square or correlation, that a walk may leave of 1/f noise."""

    summed_turn: float = math.radians(2.0)
    """Turn [rad] over which whitened innovations are summed for the judge: no course changes by more than 2 %."""

    summed_time: float = 60.0
    """Time [s] over which they are summed at rest."""

    sway_bands: int = 100
    """Bands of frequency, in one of which the sway of a base lies."""

    lock_cosine: float = 0.2
    """Cosine of the inner gimbal's angle below which innovations are left out: encoder noise is overstated there."""

    shown_sigmas: float = 3.0
    """Standard uncertainties of a parameter from which it is named with its value."""

    low_noise_ratio: float = 1.1
    """Ratio of stated noise to scatter from which it is reported: 10 % in every u."""

    walk_square: float = 0.5
    """Mean square of the encoders' innovations that a larger walk must leave, as half an octave too much does."""

    even_parts: int = 10
    """Parts of a recording over which noise must be the same to be called even."""

    scatter_scalars: int = 100
    """Least number of innovations of a sensor from which its scatter is reported."""

    compared_stretches: int = 100
    """Stretches of a recording that are compared roughly, so long that the noise of encoders does not matter."""

    rough_misfit: float = 0.1
    """Part of the motion, or of gravity, by which two sensors may differ: coefficients are far less."""

    rough_fit: float = 0.03
    """Part by which they may differ under another order or sign, for that to be named."""

    clipped_share: float = 0.01
    """Part of a reading at an extreme by which the encoders must say more for its sensor to be saturated."""

    unit_ratio: float = 5.0
    """Ratio of rates to angles, or its reciprocal, from which a unit is wrong."""

    gravity_share: float = 0.1
    """Share by which the median norm of the accelerometers may differ from gravity."""

    off_the_path: float = math.radians(5.0)
    """Angle [rad] from the study's path that is reported: earth rate moves a platform less that does not follow it."""


LIMITS = Limits()
