"""Limits by which the noise of an instrument at rest is judged: one table, printed in the book."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """Thresholds, in SI where nothing else is said."""

    present_share: float = 0.9
    """Share of its samples that a mean needs."""

    kind_means: int = 30
    """Means by which the kind of noise can be told; at longer averaging times the last kind told is kept."""

    spacing_ratio: float = 1.7
    """Ratio, at least, of the averaging times that are fitted: those between tell nothing new."""

    fewest_times: int = 3
    """Averaging times that a fit needs."""

    fewest_kept: int = 6
    """Averaging times that are kept of those whose noise at short times is not of the kinds fitted."""

    term_sigmas: float = 2.5
    """Standard deviations by which a fit without a term asks for it, for the term to be reported."""

    misfit_chance: float = 1e-3
    """Probability of the sum of squared residuals below which the noise is not of the kinds fitted."""

    fewest_samples: int = 16
    """Samples of a channel, below which there is no curve worth the name."""

    all_kinds_samples: int = 300
    """Samples below which only white noise is looked for: in fewer, chance too often looks like the other kinds."""

    in_order_share: float = 0.9
    """Share of the rows whose time stamps go forward, from which the others are left out."""

    calm_share: float = 0.05
    """Share of the pieces, the calmest, that tells what noise alone looks like."""

    restless_ratio: float = 30.0
    """Variance within a piece over that of calm pieces, from which it is not noise alone."""

    jump_sigmas: float = 7.0
    """Difference of adjacent means, in standard deviations (by the median), from which it is not noise alone."""

    moving_share: float = 0.25
    """Share of restless pieces from which the channel counts as moving."""

    moving_ratio: float = 30.0
    """Factor on the Allan deviation by restless pieces from which the channel counts as moving."""


LIMITS = Limits()
