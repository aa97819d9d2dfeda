"""Limits of the judge of a fit; the book prints them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """Limits by which a fit is judged; ``LIMITS`` are the ones in force."""

    question_risk: float = 5e-3
    """Probability that any question names something in a sound fit: with all else that is asked one percent."""

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

    rounding: float = 1e-8
    """Residuals, over readings, up to which a record is a simulation without noise: no table is as exact."""

    tied: float = 2.8
    """Difference of predictions, in standard deviations of a reading, beyond which equal readings at an end are not one
    reading."""

    most_steps: int = 60
    """Rows at most from which the order of all later ones is tried."""


LIMITS = Limits()
"""The limits in force."""
