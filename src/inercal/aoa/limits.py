"""Limits by which the diagnosis of an angle of attack judges: one table, printed in the book."""

from __future__ import annotations

from dataclasses import dataclass

from inercal.units import STANDARD_GRAVITY


@dataclass(frozen=True)
class Limits:
    """Thresholds, in SI where nothing else is said; misfits are those of `inercal.aoa.diagnosis.fit_quality`."""

    judged_rows: int = 6000
    """Rows of the liveliest stretch, which is judged in the place of the whole."""

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

    delay_sigmas: float = 5.0
    """Standard uncertainties by which the gyro's delay differs from the study's, to be named."""

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


LIMITS = Limits()
