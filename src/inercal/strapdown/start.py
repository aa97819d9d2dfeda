"""A first solution: the attitude of the first rest, carried by the gyros and set level at each rest."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from inercal.arrays import Array
from inercal.geometry.earth import EARTH_RATE
from inercal.geometry.rotations import exp, from_matrix, multiply, normalize, rotate
from inercal.strapdown.kernels import Motion, turned
from inercal.strapdown.limits import LIMITS
from inercal.strapdown.rests import Nodes
from inercal.strapdown.settings import StrapdownSettings


class Beginning(NamedTuple):
    """Attitude ``q_nb`` (4,) of the first node, and its standard deviations ``u`` (3,) [rad] about east, north, up."""

    q_nb: Array
    u: Array


def beginning(motion: Motion, nodes: Nodes, settings: StrapdownSettings) -> Beginning:
    """Attitude of the first rest: level by gravity; its heading as stated, by earth rate where the gyros are good
    enough for that or the study says so, else 0."""
    last = nodes.sample[np.flatnonzero(nodes.rest == 0)[-1]]
    force, rate = (np.mean(x[nodes.sample[0] : last], axis=0) for x in (motion.f, motion.w))
    up = force / np.linalg.norm(force)
    start = settings.start
    compass = start.compass
    if compass is None:
        compass = start.heading is None and settings.prior.gyro_bias < EARTH_RATE * np.cos(settings.latitude)
    tilt = LIMITS.start_tilt
    east = np.cross(rate, up)
    if compass and np.linalg.norm(east) > 0.0:
        east /= np.linalg.norm(east)
        u = np.array([tilt, tilt, LIMITS.start_heading])
        return Beginning(from_matrix(np.stack([east, np.cross(up, east), up])), u)
    # the axis of b that is nearest to level points north, then turned by the heading
    axis = np.eye(3)[int(np.argmin(np.abs(up)))]
    north = axis - (axis @ up) * up
    north /= np.linalg.norm(north)
    level = from_matrix(np.stack([np.cross(north, up), north, up]))
    heading = np.array([0.0, 0.0, -(start.heading or 0.0)])
    return Beginning(multiply(exp(heading), level), np.array([tilt, tilt, start.heading_u]))


def carried_through(motion: Motion, nodes: Nodes, begin: Beginning) -> Array:
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
