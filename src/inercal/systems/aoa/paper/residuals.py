"""Errors left by the paper's ways of freeing readings from lever-arm terms: in closed form, and as a covariance.

The model oscillates, theta = theta_0 + theta_m sin Om t, with the peak rate X = theta_m Om; dA [m/s^2] and dw [rad/s]
are the errors of an accelerometer and of the gyro, L = r_3 - r_1 the arm of the dual accelerometer. Source: Tan et al.
2021, worked out; accelerations in m/s^2, angles in rad.

The covariance (`error_terms`) is of noise and biases of accelerometers and gyro, of the prior of positions and gyro
scale, and of lever-arm terms that were left in, by the reading A - q w^2 + p al of `inercal.systems.aoa.layout`: an
error of r enters as -(w^2 cos lambda + c al sin lambda), one of z as c^2 w^2 sin lambda - c al cos lambda, and an error
e of the rate through compensation as 2 q w e.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from inercal.foundation.arrays import Array
from inercal.systems.aoa.estimators import Tangential
from inercal.systems.aoa.layout import Layout, all_weights, centrifugal_arms, tangential_arms
from inercal.systems.aoa.paper.static import Errors
from inercal.systems.aoa.settings import AoaSettings, Noise, Prior

DECISION = 2.0 + math.sqrt(6.0)
"""X/dw at which low pass and mechanical compensation leave the same error: X^2/2 = 2 X dw + dw^2."""

_LARGEST = 20.0
"""Standard deviations that no sample exceeds."""


def low_pass(r: float, peak_rate: float) -> float:
    """r X^2/2 [m/s^2]: the rest of the centrifugal term where a low pass removes its cosine."""
    return 0.5 * r * peak_rate**2


def mechanical(r: float, peak_rate: float, gyro_error: float) -> float:
    """r (2 X dw + dw^2) [m/s^2]: the rest, at the peak of the rate, where the gyro's square is added."""
    return r * (2.0 * peak_rate * gyro_error + gyro_error**2)


def peak_rate_at(ratio: float, gyro_error: float) -> float:
    """The peak rate [rad/s] at which the low pass leaves ``ratio`` times what mechanical compensation leaves.

    (X/dw)^2/2 = ratio (2 X/dw + 1), hence X/dw = 2 ratio + sqrt(4 ratio^2 + 2 ratio); 2 + sqrt 6 for 1.
    """
    return gyro_error * (2.0 * ratio + math.sqrt(4.0 * ratio**2 + 2.0 * ratio))


def decision_frequency(amplitude: float, gyro_error: float) -> float:
    """f0 [Hz] = (2 + sqrt 6) dw / (2 pi theta_m), above which an oscillation is to be compensated mechanically."""
    return DECISION * gyro_error / (2.0 * math.pi * amplitude)


def untreated(peak_rate: float, frequency: float) -> float:
    """theta_m Om^2: the angular acceleration [rad/s^2] in a tangential term that is not compensated."""
    return 2.0 * math.pi * frequency * peak_rate


def differentiated(gyro_error: float, sample_rate: float, cutoff: float = math.inf) -> float:
    """Standard deviation [rad/s^2] of the angular acceleration from a gyro with white noise of dw a sample.

    Of the unfiltered first difference sqrt(2) dw fs; where an ideal low pass goes before, its ``cutoff`` fc [Hz] below
    fs/2, 2 pi fc sqrt(2 fc / (3 fs)) dw as of the derivative (exactly: 2 fs dw times the root of the mean of
    sin^2(pi f/fs) over the band, times that of 2 fc/fs).
    """
    if math.isinf(cutoff):
        return math.sqrt(2.0) * gyro_error * sample_rate
    share = 2.0 * cutoff / sample_rate
    mean = 0.5 - math.sin(math.pi * share) / (2.0 * math.pi * share)
    return 2.0 * sample_rate * gyro_error * math.sqrt(share * mean)


def dual(error: float, arm: float, alike: bool) -> float:
    """Error [rad/s^2] of (A1 + A3)/L: sqrt(2) dA/L of independent errors, 2 dA/L of equal ones; so L is to be large."""
    return (2.0 if alike else math.sqrt(2.0)) * error / abs(arm)


def dual_gain(r1: float, r3: float) -> float:
    """sqrt(r1^2 + r3^2)/|r3 - r1|: noise of A1 + r1 al over that of a reading; 1/sqrt 2 with the pivot midway."""
    return math.hypot(r1, r3) / abs(r3 - r1)


def may_be_left(error: float, arm: float) -> float:
    """theta_m Om^2 [rad/s^2] below which the tangential term is better left alone: 2 dA/L, a rule of its own."""
    return dual(error, arm, alike=True)


def sampled(
    r2: float, peak_rate: float, gyro_error: float, gravity: float, samples: float, mean: float = 0.0
) -> float:
    """Largest error [rad] of the angle over ``samples`` of mechanical compensation by a gyro with white noise, no bias.

    2 r2 |w| dw n cos theta_0 / g about the ``mean`` theta_0, where the rate w of the sine is largest; n is the noise of
    one sample over its deviation. The level returned is exceeded once on average.
    """
    from scipy.optimize import brentq
    from scipy.special import ndtr

    speed = np.abs(np.cos(np.linspace(0.0, 2.0 * math.pi, 4000, endpoint=False)))
    unit = 2.0 * r2 * peak_rate * gyro_error * math.cos(mean) / gravity

    def exceeding(level: float) -> float:
        each = 2.0 * ndtr(-level / np.maximum(speed, 1e-12))
        return float(samples * each.mean()) - 1.0

    return unit * float(brentq(exceeding, 0.0, _LARGEST))


def error_terms(
    settings: AoaSettings,
    tangential: Tangential,
    layout: Layout,
    level: float,
    rate: Array,
    acceleration: Array,
    compensated: Array,
    step: float,
) -> Errors:
    """Error covariances of the readings of a ``layout`` of N accelerometers; first that which all rows share.

    ``tangential`` is the way in which p al was taken off, ``level`` the cosine of the roll; ``rate`` (n,) [rad/s] and
    ``acceleration`` (n,) [rad/s^2] are 0 where not known. ``compensated`` (n,) is 1 where q w^2 of the gyro was added
    to the readings; elsewhere, 0, the term counts as an error of its own size, as does p al where it was left in.
    ``step`` [s] is the interval of the gyro's samples, for their differences.
    """
    noise = settings.noise
    qq, pp, cross, ww, wa, aa, always, doubt = _matrices(
        settings.prior, noise, layout, level, step if tangential == "differentiated" else math.inf
    )
    w2, gyro = rate**2, noise.gyro**2 / level**2
    both = gyro + noise.gyro_bias**2 / level**2
    prior = settings.prior
    errors: list[tuple[Array | float, Array]] = [
        (1.0, always),
        (w2 * compensated, 4.0 * both * qq),
        (w2 * w2 * compensated, 4.0 * prior.gyro_scale**2 * qq),
        (w2 * w2 * (1.0 - compensated), qq),
        (w2 * w2, ww),
        (w2 * acceleration, wa),
        (acceleration**2 + doubt, aa),
    ]
    if tangential == "none" and (weights := all_weights(layout)) is not None:
        of_noise = (noise.accelerometer / level) ** 2 * float(weights @ weights)
        errors.append((np.maximum(acceleration**2 - of_noise, 0.0), pp))
    if tangential == "differentiated":
        errors.append((rate * compensated, -2.0 * gyro / step * cross))
    return [(weight, matrix) for weight, matrix in errors if matrix.any()]


@lru_cache(maxsize=64)
def _matrices(
    prior: Prior, noise: Noise, layout: Layout, level: float, step: float
) -> tuple[Array, Array, Array, Array, Array, Array, Array, float]:
    """Parts of the terms of `error_terms`, which rows share: outer products of the arms q and p with themselves
    and each other, of errors of places with the squares and the product of rate and acceleration, and that which is
    always there, with the doubt of a rate that is differentiated over the ``step`` [s], infinite where none is."""
    n = len(layout.names)
    q, p = centrifugal_arms(layout, level), tangential_arms(layout, level)
    cosine, sine = np.cos(layout.angle), np.sin(layout.angle)
    of_r = prior.lever_common**2 + prior.lever**2 * np.eye(n)
    of_z = prior.height**2 * np.eye(n)
    r_w, r_al = np.diag(-cosine), np.diag(-level * sine)
    z_w, z_al = np.diag(level**2 * sine), np.diag(-level * cosine)
    ww = r_w @ of_r @ r_w + z_w @ of_z @ z_w
    wa = r_w @ of_r @ r_al + z_w @ of_z @ z_al
    aa = r_al @ of_r @ r_al + z_al @ of_z @ z_al
    half = 0.5 * noise.accelerometer_bias**2  # of the biases is common
    always, doubt = (noise.accelerometer**2 + half) * np.eye(n) + half, 0.0
    pp, cross = np.outer(p, p), np.outer(q, p)
    if math.isfinite(step):
        doubt = 2.0 * (noise.gyro**2 / level**2) / step**2
        always = always + doubt * pp
    return np.outer(q, q), pp, cross + cross.T, ww, wa + wa.T, aa, always, doubt
