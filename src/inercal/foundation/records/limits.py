"""Limits by which a recording is judged as it is read: one table, printed in the book."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """Thresholds, in SI where nothing else is said."""

    leap_steps: float = 1.5
    """Usual steps from which on rows are missing or a stamp is wrong; up to two steps ahead it may be in order."""

    known_steps: int = 64
    """Steps that tell the usual one, those of stamps that repeat aside."""

    usual_rank: int = 3
    """The usual step is the largest but two of these: gaps are rarer, and the first of rows in a burst are not."""

    chain_stamps: int = 3
    """Stamps that go on from each other, which confirm a leap: two wrong digits in a row do not."""

    doubtful_rows: int = 8
    """Rows in doubt at most, before the time goes on from another stamp."""

    far_steps: float = 20.0
    """Usual steps from which on the first or last stamp is far from all others."""

    last_steps: int = 16
    """Steps without which the last stamp is not judged."""

    gap_deviations: float = 8.0
    """Median deviations of intervals from the median by which one is longer at least where samples are missing."""

    outlier_steps: int = 42
    """Steps about a single value far off that tell how the channel moves there."""

    fewest_samples: int = 10
    """Samples of a channel, below which neither saturation nor a steady value is looked for."""

    calm_ratio: float = 4.0
    """Variance of a window, over that of the calmest twentieth, up to which it is quiet."""

    lively_ratio: float = 20.0
    """Variance of the liveliest twentieth over that of the calmest from which a recording has rests and turns."""

    fewest_windows: int = 20
    """Windows of a recording whose rests are looked for."""

    erased_rows: int = 50
    """Equal rows in a row from which they may be no data."""

    erased_ratio: float = 20.0
    """Length of such a stretch, over what is usual elsewhere, from which they are none."""

    noisy_steps: float = 0.7
    """Second differences of an output over its first ones, from which it is noisy: of white noise 1.7."""

    fewest_runs: int = 30
    """Runs of equal values by which it is told whether each value stands for several rows."""

    short_runs: float = 0.02
    """Share of shorter runs up to which it does."""

    coarse_noise: float = 0.6
    """Standard deviation of an output at rest, over its step, below which its noise is not known."""


LIMITS = Limits()
