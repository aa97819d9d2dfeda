"""Limits of the diagnosis of a platform: one table, printed in the book."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """Thresholds, in SI where nothing else is said."""

    risk: float = 1e-3
    """Accepted probability of a false finding, of each kind."""

    gross_faults: int = 4
    """Gross faults that are looked for, one after the other."""

    plain_misfit_ratio: float = 0.1
    """Ratio of sums of NIS, after to before, below which a gross fault is taken though the rest is not sound."""

    explained_ratio: float = 0.5
    """The same ratio from which a gross fault is not what happened."""

    single_rows: int = 60
    """Rows that are left out one after the other before they no longer count as single."""

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

    lock_cosine: float = 0.2
    """Cosine of the inner gimbal's angle below which innovations are left out: they are smaller than stated there."""

    shown_sigmas: float = 3.0
    """Standard uncertainties of a parameter from which it is named with its value."""

    low_noise_ratio: float = 1.1
    """Ratio of stated noise to scatter from which it is reported: 10 % in every u."""

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
