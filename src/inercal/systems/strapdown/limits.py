"""Thresholds of the judgement of a strapdown unit, in SI."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """Thresholds, in SI where nothing else is said."""

    uneven: float = 0.5
    """Part of the sample interval by which a step of time may differ from it."""

    fewest_stamps: int = 8
    """Stamps that tell the sample interval, without which none is put right."""

    window: float = 0.5
    """Window [s] in which rate and force must be still at a rest."""

    quiet_share: float = 0.1
    """Share of the windows, the quietest, that tells the noise at rest."""

    restless_ratio: float = 4.0
    """Standard deviation in a window, over that of the quietest, from which the unit moves."""

    least_scatter: float = math.radians(0.02)
    """Standard deviation of the rate [rad/s] that is no motion, however quiet the rest is."""

    least_shake: float = 0.02
    """The same of the force [m/s^2]."""

    resting_rate: float = math.radians(0.5)
    """Rate [rad/s], less that of the quietest windows, from which the unit turns: g-sensitivity of cheap gyros stays
    below."""

    shortest_rest: float = 1.2
    """Shortest rest [s], without margins."""

    fewest_rests: int = 5
    """Rests at least."""

    off_gravity: float = 0.5
    """Part of gravity by which the size of the force at rest may differ from it: beyond, units are wrong."""

    block_samples: int = 10
    """Samples at most in a block over which sensitivities are taken at once."""

    block_angle: float = math.radians(2.0)
    """Angle [rad] at most by which the unit turns in such a block."""

    start_tilt: float = math.radians(1.0)
    """Standard deviation [rad] of the first attitude about level axes, without what biases do to it."""

    start_heading: float = math.radians(5.0)
    """The same about the vertical where it was found from earth rate, without what biases do to it."""

    over_earth_rate: float = 10.0
    """Mean rate at rest, over earth rate, from which on it is the bias that the fit begins with."""

    start_speed: float = 1.0
    """Standard deviation [m/s] of the first velocity, of which the first node tells."""

    unknown_heading: float = math.radians(10.0)
    """Standard deviation [rad] of the first heading, beyond which the filter tries several, each as if it were known
    to that."""

    headings: int = 16
    """Headings around the circle that it tries."""

    filter_passes: int = 8
    """Passes of the error-state filter at most."""

    step: float = 0.005
    """Largest step, over the standard uncertainties of the coefficients, at which the iteration ends."""

    near: float = 30.0
    """Length of a step, over the standard uncertainties, from which on steps that follow each other are summed."""

    iterations: int = 30
    """Steps at most."""

    patience: int = 10
    """Steps after which a larger one ends the iteration, too: of a model that lacks much no more is to be had."""

    late_step: float = 0.02
    """That step, over the standard uncertainties."""

    last_step: float = 0.2
    """Largest step, over the standard uncertainties, of the last of all, at which the fit still counts."""

    noise_rounds: int = 6
    """Fits at most while noise is estimated."""

    noise_gain: float = 0.01
    """Fall of -2 ln L by a round of them, below which they end."""

    least_noise: float = 0.01
    """Part of the noise that estimation begins with, below which it counts as this."""

    noise_sizes: int = 12
    """Sizes of noise that was found that are averaged over."""

    unlikely: float = 10.0
    """Fall of 2 ln L from which on a size of noise does not count."""

    walk_start: float = 30.0
    """Time [s] in which a walk that is estimated begins as large as white noise."""

    turn_excess: float = 1.5
    """Residuals over turns, rms over the noise, from which on the noise of turns is estimated."""

    wildest_turn: float = math.radians(15.0)
    """Attitude [rad] by which turns may fail to close: beyond, signs or units are wrong."""

    risk: float = 1e-4
    """Probability by chance of the largest chi-square that still agrees with the model."""

    naming_risk: float = 0.01
    """Probability that an effect outside the model is named by chance in a sound record."""

    far_from_prior: float = 4.0
    """Distance of a value from what is expected, over the standard deviation of its prior, at which that is doubted."""

    usual_drift: float = 1.0 / 30.0
    """Usual drift of gyros by one g, over the standard deviation of their biases: cheap ones have 3 deg/s and 0.1 deg/s
    for each g, those of tactical grade 30 deg/h and 1 deg/h."""

    considered_part: float = 0.5
    """Part of u that an effect which is not fitted must make to be told, over the u without it."""

    largest_part: float = 0.3
    """Part of the largest ratio of u to its goal in the criterion of a path, beside their geometric mean."""

    path_starts: int = 5
    """Random paths that the search for a path begins with."""

    level_axis: float = 20.0
    """Angle [deg] from level, or from vertical, up to which the axis of a turn is called so."""

    told: float = 1.1
    """Factor by which a turn lowers the u of a coefficient that it is said to tell."""


LIMITS = Limits()
