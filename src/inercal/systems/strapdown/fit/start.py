"""A first solution: the attitude of the first rest, carried by the gyros and set level at each rest."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.earth import EARTH_RATE
from inercal.foundation.geometry.rotations import exp, from_matrix, multiply, normalize, rotate
from inercal.foundation.units import STANDARD_GRAVITY
from inercal.systems.strapdown.fit.rests import Nodes
from inercal.systems.strapdown.limits import LIMITS
from inercal.systems.strapdown.model.coefficients import SIZE, D
from inercal.systems.strapdown.model.kernels import BodyMotion, turned
from inercal.systems.strapdown.model.samples import Samples
from inercal.systems.strapdown.settings import StrapdownSettings


class Beginning(NamedTuple):
    """Attitude ``q_nb`` (4,) of the first node, and its standard deviations ``u`` (3,) [rad] about east, north, up."""

    q_nb: Array
    u: Array


def beginning(motion: BodyMotion, nodes: Nodes, settings: StrapdownSettings) -> Beginning:
    """Attitude of the first rest: level by gravity; its heading as stated, by earth rate where the gyros are good
    enough for that or the study says so, else 0."""
    last = nodes.sample[np.flatnonzero(nodes.rest == 0)[-1]]
    force, rate = (np.mean(x[nodes.sample[0] : last], axis=0) for x in (motion.f, motion.w))
    up = force / np.linalg.norm(force)
    u, east = start_u(settings), np.cross(rate, up)
    if _by_compass(settings) and np.linalg.norm(east) > 0.0:
        east /= np.linalg.norm(east)
        return Beginning(from_matrix(np.stack([east, np.cross(up, east), up])), u)
    # the axis of b that is nearest to level points north, then turned by the heading
    axis = np.eye(3)[int(np.argmin(np.abs(up)))]
    north = axis - (axis @ up) * up
    north /= np.linalg.norm(north)
    level = from_matrix(np.stack([np.cross(north, up), north, up]))
    heading = np.array([0.0, 0.0, -settings.start.angle])
    return Beginning(multiply(exp(heading), level), u)


def _by_compass(settings: StrapdownSettings) -> bool:
    """True where the heading at the start is found from earth rate."""
    heading = settings.start.heading
    earth = EARTH_RATE * np.cos(settings.latitude)
    return bool(settings.prior.gyro_bias < earth) if heading is None else heading == "gyrocompass"


def start_u(settings: StrapdownSettings) -> Array:
    """Standard deviations (3,) [rad] of the attitude at the start about east, north, up; level is found by
    accelerometers, north by gyros whose biases are not known yet."""
    tilt = math.hypot(LIMITS.start_tilt, settings.prior.bias / STANDARD_GRAVITY)
    heading = settings.start.u
    if _by_compass(settings):  # a bias to the east turns north by its part of the level earth rate
        level = EARTH_RATE * math.cos(settings.latitude)
        heading = math.hypot(LIMITS.start_heading, min(settings.prior.gyro_bias / level, 0.5 * math.pi))
    return np.array([tilt, tilt, heading])


def first_coefficients(samples: Samples, nodes: Nodes) -> Array:
    """Coefficients (51,) to begin with: those of a perfect unit, but for biases of gyros so far beyond earth rate that
    the rate at rest is theirs."""
    c, number = np.zeros(SIZE), nodes.rest
    ends = [nodes.sample[number == each][[0, -1]] for each in np.unique(number)]
    rate = np.mean([samples.rate[first:last].mean(axis=0) for first, last in ends], axis=0)
    if np.linalg.norm(rate) > LIMITS.over_earth_rate * EARTH_RATE:
        c[D] = rate
    return c


def carried_through(motion: BodyMotion, nodes: Nodes, begin: Beginning) -> Array:
    """Attitudes (k + 1, 4) at all nodes, by the gyros alone, set level by the mean force of each rest."""
    q, by = begin.q_nb, np.empty((len(nodes.sample) - 1, 4))
    turned(motion.turn, nodes.sample, by)
    attitudes = np.empty((len(nodes.sample), 4))
    for k, here in enumerate(nodes.sample):
        if k:
            q = multiply(q, by[k - 1])
        if k and nodes.rest[k] != nodes.rest[k - 1]:
            last = nodes.sample[np.flatnonzero(nodes.rest == nodes.rest[k])[-1]]
            up = rotate(q, np.mean(motion.f[here:last], axis=0))
            up /= np.linalg.norm(up)
            axis = np.cross(up, [0.0, 0.0, 1.0])
            sine = np.linalg.norm(axis)
            if sine > 0.0:
                q = multiply(exp(axis / sine * np.arctan2(sine, up[2])), q)
        attitudes[k] = q = normalize(q)
    return attitudes
