"""Drift on the unit sphere: the orthonormal basis of the constant, linear and quadratic functions.

In it a change of the coefficients has the size of the change of drift, so that condition numbers and
efficiencies say something of the plan and nothing of the way the model is written.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from inercal.foundation.arrays import Array

#: the functions of `basis`, in their order
NAMES = ("1", "x", "y", "z", "xy", "xz", "yz", "xx-yy", "zz")


def basis(a: ArrayLike) -> Array:
    """The nine functions 1, √3 a, √15 axay, √15 axaz, √15 ayaz, √15/2 (ax²-ay²), √5/2 (3az²-1).

    Parameters
    ----------
    a : (*batch, 3)
        Unit vectors, for example gravity on the instrument's axes in units of the site's.

    Returns
    -------
    (*batch, 9) orthonormal over the sphere: the mean of f_i f_k is one for i = k and zero otherwise
    """
    x, y, z = np.moveaxis(np.asarray(a, dtype=float), -1, 0)
    r3, r5, r15 = math.sqrt(3.0), math.sqrt(5.0), math.sqrt(15.0)
    linear = [np.ones_like(x), r3 * x, r3 * y, r3 * z]
    mixed = [r15 * x * y, r15 * x * z, r15 * y * z]
    return np.stack([*linear, *mixed, 0.5 * r15 * (x * x - y * y), 0.5 * r5 * (3.0 * z * z - 1.0)], axis=-1)
