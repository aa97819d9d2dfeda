"""Limits of the ways that look at spectra: the gyro's delay, and the frequency of an oscillation."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """Thresholds of delay and frequency, in SI where nothing else is said."""

    longest_delay: float = 0.1
    """Largest delay [s] of the gyro that is looked for in the spectra."""

    delay_segments: int = 4
    """Segments of a spectrum without which there is no coherence to speak of."""

    line_periods: float = 2.25
    """Periods of the strongest line in a segment: the mean that is taken off leaks into the lowest bins."""

    delay_chance: float = 1e-6
    """Probability that a spectrum of noise alone has a frequency that counts as coherent."""

    delay_share: float = 0.5
    """Share of the likelihood that phases of a mere delay reach; those of a gyro with the wrong sign do not."""

    bridged_samples: int = 5
    """Samples in a row that straight lines may stand for in a spectrum: of more the phase is not that of the motion."""

    gyro_gap: float = 3.0
    """Interval, over the usual one, across which the gyro is not interpolated."""

    oscillation_window: float = 10.0
    """Window [s] in which the frequency and the peak rate of an oscillation are found."""

    oscillation_periods: float = 3.0
    """Periods that the window holds at least: fewer do not stand apart from a drift."""

    peak_power: float = 20.0
    """Power of an oscillation's peak over that of noise, which noise alone exceeds in one of a million windows."""

    leaked_power: float = 1e-2
    """Power of such a peak over that of a slower motion, of which a Hann window leaks a thousandth."""

    amplitude_ratio: float = 2.0
    """Ratio within which the amplitudes that accelerometers and gyro show must agree."""

    uneven_share: float = 0.05
    """Share of the usual interval by which another differs so that samples are put on an even grid for a low pass."""


LIMITS = Limits()
