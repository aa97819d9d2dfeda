"""Unknowns of a calibration from sections: their places in one vector, and rotations by small unknown angles.

A vector of unknowns (..., p) holds the coefficients, a few errors that all sections share, those of groups of
sections, and then eight of each section: two tilts of its vertical, two of its axis, the error of its rate, and three
components of what it sees of earth rate beyond its vertical part.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array

Values = NDArray[Any]
"""Real numbers, or complex ones where derivatives are taken by complex steps."""

OFF: Final = ((0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1))
"""Places of the six misalignments in their matrix."""

_PAIRS = [f"{'xyz'[i]}{'xyz'[j]}" for i, j in OFF]
COEFFICIENTS: Final = (
    *(f"K0_{i}" for i in "xyz"),
    *(f"K1_{i}" for i in "xyz"),
    *(f"M_{pair}" for pair in _PAIRS),
    *(f"K2_{i}" for i in "xyz"),
    *(f"D_F_{i}" for i in "xyz"),
    *(f"S_{i}" for i in "xyz"),
    *(f"T_{pair}" for pair in _PAIRS),
    *(f"G_{i}{j}" for i in "xyz" for j in "xyz"),
)
"""Names of the coefficients in their order."""

K0, K1, M, K2 = slice(0, 3), slice(3, 6), slice(6, 12), slice(12, 15)
D_F, S, T, G = slice(15, 18), slice(18, 21), slice(21, 27), slice(27, 36)
"""G is carried as a rate, (rad/s)/(m/s^2): what outputs see of it is S times as large."""

GRAVITY, CLOCK, EARTH_UP, EARTH_ALONG = 36, 37, 38, 39
"""Gravity; the relative error of the clock; the upward part of earth rate; its part along axes that are not known."""

MOUNTING: Final = slice(40, 43)
"""Rotation of all directions and axes from where they are said to be."""

COMMON: Final = 43
"""Number of the unknowns so far."""

SOURCES: Final = ("gravity", "time base", "earth rate", "earth rate", "mounting", "mounting", "mounting")
"""Names in budgets of the errors that all sections share."""

TILT, SWIVEL, RATE, EARTH = slice(0, 2), slice(2, 4), 4, slice(5, 8)
LOCAL: Final = 8
"""Unknowns of a section."""


def cross(a: Values, b: Values) -> Values:
    """Vector products in the last axis; several times faster than NumPy's for small arrays."""
    x, y, z, u, v, w = a[..., 0], a[..., 1], a[..., 2], b[..., 0], b[..., 1], b[..., 2]
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-1)


def turned(v: Values, x: Values) -> Values:
    """Vectors x turned by rotation vectors v of less than some 1 rad; analytic in v, so that complex steps pass."""
    once = cross(v, x)
    s = np.sum(v * v, axis=-1, keepdims=True)
    a = 1 - s / 6 * (1 - s / 20 * (1 - s / 42 * (1 - s / 72)))
    b = 0.5 - s / 24 * (1 - s / 30 * (1 - s / 56 * (1 - s / 90)))
    return np.asarray(x + a * once + b * cross(v, once))


def matrix(off: Values) -> Values:
    """Matrices (..., 3, 3) of unit diagonal from their six other elements (..., 6)."""
    out = np.zeros((*off.shape[:-1], 3, 3), dtype=off.dtype) + np.eye(3)
    out[..., [i for i, _ in OFF], [j for _, j in OFF]] = off
    return out


def across(u: Array) -> Array:
    """Two unit vectors (n, 3, 2) across each direction u (n, 3), and across its opposite; rotations about them tilt
    it."""
    largest = np.take_along_axis(u, np.argmax(np.abs(u), axis=1)[:, None], axis=1)
    u = u * np.sign(largest)
    first = cross(u, np.eye(3)[np.argmin(np.abs(u), axis=1)])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, cross(u, first)], axis=2)


def level_axes(up: Array) -> Array:
    """Axes of earth rate (n, 3, 3) in columns: two across the vertical ``up`` (n, 3), and that. All are right-handed,
    so that the level part of earth rate can be carried from one to the next."""
    first = across(up)[:, :, 0]
    return np.stack([first, cross(up, first), up], axis=2)
