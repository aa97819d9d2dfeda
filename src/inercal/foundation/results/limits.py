"""Limits by which runs and calibrations are compared: one table, printed in the book."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """Thresholds, in SI where nothing else is said."""

    moved_risk: float = 0.05
    """Probability of the verdict "inconsistent" where nothing moved; half for each coefficient alone, half for all."""

    common_share: float = 0.02
    """Share of a source in the variance of any coefficient, up to which it matters little whether it is common."""

    felt_share: float = 1e-4
    """Share of a source in the variance of a coefficient, below which it is taken to have no part in it."""

    proportion: float = 1e-3
    """Relative difference of two effects in proportion to coefficients, up to which they are by one source."""

    untold_share: float = 0.01
    """The same of their squares, over what other sources leave of the variance: shares of it are known no better."""

    repeat_chance: float = 1e-3
    """Probability, over all coefficients, below which chance is ruled out as the cause of differences between runs."""

    same_scale: float = 2e-3
    """Relative standard deviation of scale factors between runs beyond that of one instrument."""

    same_angle: float = 1e-3
    """Standard deviation of misalignments between runs beyond that of one instrument [rad]."""


LIMITS = Limits()
