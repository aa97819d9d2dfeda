"""Lever arms of the accelerometers of a model, and which of them together show its angular acceleration.

At a fixed roll of cosine c an accelerometer at angle lambda and position (r, 0, z) reads, with w the rate of pitch and
al its acceleration (`inercal.aoa.fusion.model`),

    A = g (sin theta cos lambda - c cos theta sin lambda) - q w^2 + p al
    q = r cos lambda - c^2 z sin lambda,    p = -c (z cos lambda + r sin lambda)
"""

from __future__ import annotations

import math

import numpy as np

from inercal.aoa.layout import Layout
from inercal.aoa.limits import LIMITS
from inercal.aoa.settings import Attitude
from inercal.arrays import Array
from inercal.errors import StudyError

_ROUNDING = 1e-12


def level_of(attitude: Attitude) -> float:
    """Cosine of the stated roll; raises `StudyError` for a model on its side, whose pitch no sensor shows."""
    if attitude.roll is not None and abs(attitude.level) < LIMITS.level_cosine:
        degrees = math.degrees(attitude.roll.value)
        text = f"found {degrees:.6g} deg, expected one further from +-90 deg, at which pitch shows"
        raise StudyError("model.roll", text)
    return attitude.level


def axes(layout: Layout, level: float = 1.0) -> Array:
    """(N, 2): coefficients by which each axis reads (sin theta, cos theta) at rest, over g."""
    return np.stack([np.cos(layout.angle), -level * np.sin(layout.angle)], axis=-1)


def centrifugal_arms(layout: Layout, level: float = 1.0) -> Array:
    """(N,) q [m]: each axis reads -q w^2."""
    return _arms(layout.r * np.cos(layout.angle) - level**2 * layout.z * np.sin(layout.angle))


def tangential_arms(layout: Layout, level: float = 1.0) -> Array:
    """(N,) p [m]: each axis reads p al."""
    return _arms(-level * (layout.z * np.cos(layout.angle) + layout.r * np.sin(layout.angle)))


def _arms(length: Array) -> Array:
    """Arms, 0 where they are only rounding: such an axis needs no gyro."""
    return np.where(np.abs(length) < _ROUNDING, 0.0, length)


def pair_weights(layout: Layout, level: float = 1.0) -> Array | None:
    """(N,) d [1/m] for the paper's dual accelerometer, al = d . A with A free of w^2; None without such a pair.

    Of all pairs of antiparallel or parallel axes, in which gravity cancels, that with the longest arm L: (A_i + A_j)/L,
    L = p_i + p_j, for antiparallel axes, (A_i - A_j)/L, L = p_i - p_j, for parallel ones. For the three axes -z, +x, +z
    L = r_3 - r_1. Calibrated axes are not quite parallel: a third axis, the one nearest to square with them, takes off
    the rest of gravity.
    """
    p, h = tangential_arms(layout, level), axes(layout, level)
    pairs = [(p[i] + p[j], i, j, 1.0) for i, j in layout.opposed()]
    pairs += [(p[i] - p[j], i, j, -1.0) for i, j in layout.aligned()]
    arm, i, j, sign = max(pairs, key=lambda pair: abs(pair[0]), default=(0.0, 0, 0, 1.0))
    if abs(arm) < LIMITS.pair_arm:
        return None
    weights = np.zeros(len(p))
    weights[i], weights[j] = 1.0, sign
    k = int(np.argmax(np.abs(np.sin(layout.turned[i]))))
    if layout.spans:
        three = [i, j, k]
        weights[three] = np.cross(h[three, 0], h[three, 1])
        weights = np.where(np.abs(weights) < _ROUNDING * np.abs(weights).max(), 0.0, weights)
    return np.asarray(weights / (weights @ p))


def all_weights(layout: Layout) -> Array | None:
    """(N,) d [1/m] for the angular acceleration d . A by least squares from all axes; None where they do not show it.

    Gravity cancels for all axes: d is the part of the arms p outside of the plane in which gravity moves the readings.
    At a roll of cosine c the sum is c al, as the gyro reads c w.
    """
    p, of_gravity = tangential_arms(layout), axes(layout)
    beside = p - of_gravity @ np.linalg.lstsq(of_gravity, p, rcond=None)[0]
    power = float(beside @ beside)
    return beside / power if power > LIMITS.pair_arm**2 else None
