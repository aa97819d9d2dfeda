"""Limits by which calibrations on a turntable judge a record and a fit; the book prints them."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """Thresholds of positions and rate tests; ``LIMITS`` are the ones in force."""

    position_angle: float = math.radians(3.0 / 60.0)
    """Angle [rad] within which rows are one position: above the noise of an encoder, below any step of a plan."""

    stay_length: float = 0.5
    """Length of a stay, as a part of the usual one, below which it is left out where stays are found by angle: the
    table is on its way, or makes a stop that a finding names."""

    most_samples: int = 10_000_000
    """Samples of a simulation that fit into memory with all errors of the table."""

    runaway: float = 1e3
    """Growth of u in the last round of weights that says that they do not settle: with the terms the weights of all
    readings sink."""

    foreseen_positions: int = 200
    """Positions of a plan at most of which u is foreseen with better or worse errors of the table."""

    condition: float = 100.0
    """Condition number of the unit-length columns beyond which a combination of terms counts as weakly known."""

    misfit_probability: float = 1e-4
    """Probability of a misfit by chance below which the readings contradict the stated noise and errors."""

    second_order: float = 0.1
    """Part of u by which squares and products of the table's errors may shift or blur a coefficient before they are in
    the fit: below it they change u by half a percent."""

    residual_risk: float = 3e-3
    """Probability that any test of the residuals for a fault (trend, heading, level) names one in a sound record."""

    dwell_risk: float = 1e-3
    """Probability that drift within the dwells is named in a sound record."""

    screen: float = 0.05
    """Probability by chance of the score of a fault below which it is fitted."""

    doubtful: float = 0.03
    """Probability by chance of a fault below which it counts in u with the probability that it is there, though it is
    not significant."""

    fault_odds: float = 0.5
    """Odds, before a test, that it has one of the faults that are asked for."""

    harmful_shift: float = 0.5
    """Shift of a value by a significant fault, over u, beyond which it does harm; a smaller one counts in u."""

    blind_shift: float = 4.0
    """Shift of a value, over u, by a fault that is named in half of the tests: of a larger one so much counts in u."""

    drift_sigmas: float = 4.0
    """Standard uncertainties by which drift within the dwells may differ from that between them to be used with it."""

    straight_part: float = 0.1
    """Second-order change of a value by an uncertain latitude, over its u, below which first order does."""

    bent_part: float = 0.33
    """Second-order change of a value by an uncertain latitude, over its u, beyond which no u holds."""

    latitude_off: float = math.radians(0.1)
    """Error [rad] of a latitude that is stated without uncertainty up to which a finding says what it would do."""

    gravity_off: float = 1e-3
    """Error [m/s^2] of gravity, likewise."""

    site_ratio: float = 2.0
    """Ratio of u to its value at an exact site beyond which a finding names the site."""

    most_repeats: int = 24
    """Times that a plan is taken, at most, where a search for tolerances may repeat it."""

    same_rate: float = 1e-3
    """Relative difference below which two rates are one rate."""

    turning_cosine: float = 0.1
    """Cosine of turning axis and gyro axis below which a gyro takes no part in a rate test."""

    across_cosine: float = 1e-3
    """Cosine of turning axis and a gyro axis below which the gyro lies across: of a misalignment of 10 mrad towards a
    third axis 2 arcsec pass for one towards the turning axis."""

    small_step: float = 0.5
    """Specific force [m/s^2] along the axis of an accelerometer up to which a tilt is a small one about level."""

    fewest_steps: int = 10
    """Steps of a test of threshold and dead zone, and distinct angles among them, at least."""

    edge_at_end: float = 0.05
    """Probability that a dead zone reaches as far as the steps beyond which nothing bounds it."""

    term_sigmas: float = 3.0
    """Dead zone and hysteresis, over their standard uncertainties, from which a finding names them."""

    scatter_dof: int = 3
    """Readings beyond the terms of a cubic from which the noise beside the curve of a rate test is estimated."""

    scale_sigmas: float = 5.0
    """Scale factor, over its standard uncertainty, below which an output does not follow the rate."""

    most_faults: int = 4
    """Faults named at most, one beside the other."""

    simpler_fault: float = 0.8
    """Logarithm of a fault's chance, over that of the likeliest, with which one of fewer parameters goes first."""

    known_variance: float = 1e6
    """Degrees of freedom from which a variance counts as known."""

    fewest_degrees: float = 10.0
    """Degrees of freedom of the noise, in every channel, below which a stray reading is not told from chance: of 250
    sound tumbles with some five 3 were named."""

    least_seen: float = 0.01
    """Part of a fault's effect outside the terms below which it does not show."""

    outside_zone: int = 2
    """Distinct inputs that are to lie beyond a dead zone on either side."""


LIMITS = Limits()
"""The limits in force."""
