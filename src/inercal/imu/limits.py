"""Limits by which the diagnosis of an IMU on a table judges: one table, printed in the book."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """Thresholds, in SI where nothing else is said; shares of an output are of its variation over the test."""

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

    short_share: float = 0.01
    """Share of the largest input by which an output has to fall short to be called saturated."""

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
