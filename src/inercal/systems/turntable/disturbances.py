"""Disturbances of a simulated test on a table: what its errors and noise leave out, on its base, angles and outputs."""

from __future__ import annotations

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.rotations import elementary
from inercal.foundation.rigs.chain import Chain, Fixed
from inercal.systems.turntable.settings import Disturbances


def displaced(chain: Chain, other: Disturbances) -> Chain:
    """The table on a base that stands otherwise than its study says: about up, then north, then west."""
    turns = [("z", other.heading), ("x", other.tilt_north), ("y", other.tilt_west)]
    if not any(angle for _, angle in turns):
        return chain
    rotation = np.linalg.multi_dot(
        [elementary("z", turns[0][1]), elementary("x", turns[1][1]), elementary("y", turns[2][1])]
    )
    return Chain((Fixed(rotation), *chain.elements))


def true_angles(
    angles: Array, joints: tuple[str, ...], other: Disturbances, rng: np.random.Generator
) -> Array:
    """Angles (n, joints) [rad] at which a table stands for those commanded: its encoders err."""
    true = angles.copy()
    if other.angle > 0.0:
        for k in range(len(joints)):
            commanded = np.round(np.remainder(angles[:, k], 2.0 * np.pi), 9)
            each, of = np.unique(commanded, return_inverse=True)
            true[:, k] += rng.normal(0.0, other.angle, len(each))[of]
    for wave in other.harmonics:
        k = joints.index(wave.joint)
        true[:, k] += wave.amplitude * np.sin(wave.order * angles[:, k] + wave.phase)
    return true


def disturbed(y: Array, bias: Array, t: Array, other: Disturbances, rng: np.random.Generator) -> Array:
    """Outputs with what acts on them over a test.

    Parameters
    ----------
    y : (n, c)
        Outputs of the instrument without noise, in the order of time.
    bias : (c,)
        Output at no input.
    t : (n,) s
    other : Disturbances
    rng : Generator

    Returns
    -------
    (n, c)
    """
    if other.dead_zone > 0.0:
        y = np.where(np.abs(y - bias) < other.dead_zone, bias, y)
    if other.hysteresis:
        y = y + 0.5 * other.hysteresis * _directions(y)
    elapsed = t - t[0]
    length = float(elapsed[-1]) or 1.0
    part = (elapsed / length)[:, None]
    if other.scale_drift:
        y = bias + (y - bias) * (1.0 + other.scale_drift * part)
    y = y + other.ramp * part + other.warm_up * np.exp(-elapsed / other.warm_up_time)[:, None]
    if other.random_walk > 0.0:
        steps = np.sqrt(np.diff(part, axis=0, prepend=0.0)) * rng.standard_normal(y.shape)
        y = y + other.random_walk * np.cumsum(steps, axis=0)
    return np.asarray(y)


def magnetic_field(C_nb: Array, other: Disturbances) -> Array:
    """Output (*batch, 3) that a field fixed to the ground, to the north and down, makes along x, y, z."""
    field = np.array([np.cos(other.dip), 0.0, -np.sin(other.dip)])
    return np.asarray(other.magnetic * (field @ C_nb))


def _directions(y: Array) -> Array:
    """+1 (n, c) where an output was last raised, -1 where lowered; 0 before it changes."""
    sign = np.sign(np.diff(y, axis=0, prepend=y[:1]))
    for k in range(1, len(sign)):
        sign[k] = np.where(sign[k] == 0.0, sign[k - 1], sign[k])
    return np.asarray(sign)
