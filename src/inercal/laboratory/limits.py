"""Limits by which histories, fleets and certificates are judged: one table, printed in the book."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """Thresholds, in SI where nothing else is said."""

    chart_sigmas: float = 3.0
    """Limit of both charts, in standard deviations."""

    ewma_weight: float = 0.2
    """Weight L of the newest deviation in the EWMA."""

    first_calibrations: int = 2
    """Calibrations before the first that is judged: the scatter is not known from one."""

    family_risk: float = 0.05
    """Probability of a verdict on the last calibration where nothing changed, over all coefficients and both charts."""

    horizon_years: float = 20.0
    """Years in which the date of the next calibration is sought."""

    strange_risk: float = 0.05
    """Probability that a sound fleet has any unit named."""

    fewest_units: int = 10
    """Units below which none can be told to be strange."""

    core_share: float = 0.75
    """Share of the units that the scatter is of."""

    trend_risk: float = 0.01
    """Probability that a fleet without any trend has one named."""

    interval_level: float = 0.95
    """Probability of the intervals of yield and capability."""

    fewest_dof: float = 0.1
    """Degrees of freedom that are read from a factor at least."""

    whole_bytes: int = 1 << 30
    """Bytes beyond which a file is kept by reference: its path and SHA-256."""


LIMITS = Limits()
