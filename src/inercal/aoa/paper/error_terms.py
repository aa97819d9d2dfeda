"""Errors of the readings that the paper's methods are given, as a covariance at each row.

From noise and biases of accelerometers and gyro, from the prior of positions and gyro scale, and from lever-arm terms
that were left in, by the reading
A - q w^2 + p al of `inercal.aoa.arms`: an error of r enters as -(w^2 cos lambda + c al sin lambda), one of z as
c^2 w^2 sin lambda - c al cos lambda, and an error e of the rate through compensation as 2 q w e.
"""

from __future__ import annotations

import numpy as np

from inercal.aoa.arms import all_weights, centrifugal_arms, tangential_arms
from inercal.aoa.layout import Layout
from inercal.aoa.paper.static import Errors
from inercal.aoa.settings import AoaSettings, Noise, Tangential
from inercal.arrays import Array


def at_rest(noise: Noise, count: int) -> Array:
    """(N, N) (m/s^2)^2 of noise and biases of the accelerometers, half the variance of the biases common."""
    half = 0.5 * noise.accelerometer_bias**2
    return np.asarray((noise.accelerometer**2 + half) * np.eye(count) + half)


def in_motion(
    settings: AoaSettings,
    tangential: Tangential,
    layout: Layout,
    level: float,
    rate: Array,
    acceleration: Array,
    compensated: Array,
    step: float,
) -> Errors:
    """All terms; first that which is the same in all rows.

    Parameters
    ----------
    settings : AoaSettings
        Its noise and prior.
    tangential : "none", "differentiated" or "dual"
        How p al was taken off.
    layout : Layout
        Of the N accelerometers that are used.
    level : float
        Cosine of the roll.
    rate, acceleration : (n,) rad/s, rad/s^2
        0 where not known.
    compensated : (n,) 0 or 1
        Where q w^2 was added to the readings, w that of the gyro; elsewhere it counts as an error of its own size, as
        p al does where it was left in.
    step : float
        Interval [s] of the gyro's samples, for their differences.
    """
    prior, noise, n = settings.prior, settings.noise, len(layout.names)
    q, p = centrifugal_arms(layout, level), tangential_arms(layout, level)
    cosine, sine = np.cos(layout.angle), np.sin(layout.angle)
    of_r = prior.lever_common**2 + prior.lever**2 * np.eye(n)
    of_z = prior.height**2 * np.eye(n)
    r_w, r_al = np.diag(-cosine), np.diag(-level * sine)
    z_w, z_al = np.diag(level**2 * sine), np.diag(-level * cosine)
    ww, wa, aa = (
        first @ of_r @ second + third @ of_z @ fourth
        for first, second, third, fourth in (
            (r_w, r_w, z_w, z_w),
            (r_w, r_al, z_w, z_al),
            (r_al, r_al, z_al, z_al),
        )
    )
    w2, gyro = rate**2, noise.gyro**2 / level**2
    both = gyro + noise.gyro_bias**2 / level**2
    qq = np.outer(q, q)
    always, doubt = at_rest(noise, n), 0.0
    if tangential == "differentiated":
        doubt = 2.0 * gyro / step**2
        always = always + doubt * np.outer(p, p)
    errors: list[tuple[Array | float, Array]] = [
        (1.0, always),
        (w2 * compensated, 4.0 * both * qq),
        (w2 * w2 * compensated, 4.0 * prior.gyro_scale**2 * qq),
        (w2 * w2 * (1.0 - compensated), qq),
        (w2 * w2, ww),
        (w2 * acceleration, wa + wa.T),
        (acceleration**2 + doubt, aa),
    ]
    if tangential == "none" and (weights := all_weights(layout)) is not None:
        of_noise = (noise.accelerometer / level) ** 2 * float(weights @ weights)
        errors.append((np.maximum(acceleration**2 - of_noise, 0.0), np.outer(p, p)))
    if tangential == "differentiated":
        cross = np.outer(q, p)
        errors.append((rate * compensated, -2.0 * gyro / step * (cross + cross.T)))
    return [(weight, matrix) for weight, matrix in errors if matrix.any()]
