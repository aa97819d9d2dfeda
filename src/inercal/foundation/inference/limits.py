"""Limits of the judge of a fit; the book prints them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """Limits by which a fit is judged; ``LIMITS`` are the ones in force."""

    question_risk: float = 5e-3
    """Probability that any question names something in a sound fit: with all else that is asked one percent."""

    filter_risk: float = 1e-2
    """The same where a filter asks, whose real risk is near it; of all that is asked of a recording."""

    order_risk: float = 1e-3
    """Probability that another order of the rows is named in a sound fit."""

    harm: float = 2.0
    """Shift of a value, in u, beyond which an error does harm."""

    as_likely: float = 0.8
    """Logarithm of a chance, over that of the likeliest question, with which another counts as likely."""

    compared: int = 8
    """Likeliest questions of which that one speaks beside which least is left."""

    gross: float = 3.0
    """Residuals, over what stated noise and errors explain, from which nothing can be used."""

    most_readings: int = 1000
    """Readings up to which a fit is asked: the covariance is that of every pair."""

    fewest_degrees: int = 3
    """Degrees of freedom from which a fit is asked."""

    noiseless: float = 0.1
    """Residuals, over the stated noise, up to which a filter's record is a simulation without noise."""

    rounding: float = 1e-8
    """Residuals, over readings, up to which a record is a simulation without noise: no table is as exact."""

    least_range: float = 20.0
    """Range of the predictions of a channel, over the standard deviation of a reading, from which it is asked by its
    readings."""

    uneven: float = 3.0
    """Scatter of one part of a test, over that of the others, from which it is named."""

    part_risk: float = 1e-3
    """Probability that any part of a sound test is."""

    near_zero: float = 0.05
    """Size of a mean rate or force, as a part of the largest, below which its sign is that of noise."""

    tied: float = 2.8
    """Difference of predictions, in standard deviations of a reading, beyond which equal readings at an end are not one
    reading."""

    most_steps: int = 60
    """Rows at most from which the order of all later ones is tried."""

    # values

    scale_off: float = 0.1
    """Part by which a scale factor whose two sides have one unit may differ from 1, and by u of its uncertainty from
    what it can be."""

    angle_off: float = 0.1
    """Misalignment [rad] beyond which axes are exchanged, or the mounting is another one."""

    range_off: float = 0.05
    """Part by which a scale factor may differ from a power of two to be that of another range."""

    bias_of_gravity: float = 0.01
    """Distance of a bias from once or twice gravity, as a part of gravity, at which it is that."""

    value_risk: float = 1e-3
    """Probability that any value of a sound result is named as far from what is stated of it."""

    least_freedom: float = 0.1
    """Standard deviation of a value about its prior at least, over that of the prior."""

    # clocks of two triads

    clock_blocks: int = 12
    """Blocks of a record in which the lag of one triad behind the other is found."""

    fewest_clock_blocks: int = 5
    """Blocks that have to tell it."""

    clock_window: float = 0.05
    """Half length [s] of the means by which outputs are smoothed for it."""

    clock_reach: float = 2.0
    """Change [s] of the lag from one block to the next at most."""

    clock_likeness: float = 0.3
    """Correlation of what both triads tell of the motion, below which a block says nothing."""

    clock_drift: float = 2.5
    """Drift of the lag over a record [samples] from which it is named: the swing of a hand moves lags by 35 ms."""

    clock_risk: float = 1e-6
    """Probability of a drift by the scatter of the blocks, from which it is named."""


LIMITS = Limits()
"""The limits in force."""
