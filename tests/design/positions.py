"""Positions of a two-axis table as design problems, for the tests of this folder."""

import math

import numpy as np

from inercal.foundation.designs import criteria as ca
from inercal.foundation.designs.criteria import NAMES, basis
from inercal.foundation.rigs.outputs import gravity_reference, rate_reference
from inercal.foundation.rigs.tables import turntable

TERMS = ("F", "X", "Y", "Z", "XX", "YY", "XY", "XZ", "YZ")
RATES = ("k_x", "k_y", "k_z")


def attitude(plan, **kwargs):
    return turntable("two_axis_turntable", default=None, **kwargs).attitude(plan.angles)


def gravity(plan, **kwargs):
    """Gravity on the instrument's axes (n, 3), in units of the site's."""
    return gravity_reference() @ attitude(plan, **kwargs)


def monomials(a):
    x, y, z = np.moveaxis(a, -1, 0)
    return np.stack([np.ones_like(x), x, y, z, x * x, y * y, x * y, x * z, y * z], axis=-1)


def from_monomials():
    """T (9, 9): coefficients beta of 1, ax, ay, az, ax², ay², axay, axaz, ayaz are T beta in the basis.

    Exact where a.a = 1. The rms of the drift over all attitudes is ``|T beta|``.
    """
    r3, r5, r15 = math.sqrt(3.0), math.sqrt(5.0), math.sqrt(15.0)
    T = np.zeros((9, 9))
    T[0, 0] = 1.0
    T[[1, 2, 3], [1, 2, 3]] = 1.0 / r3
    T[[4, 5, 6], [6, 7, 8]] = 1.0 / r15
    # ax², ay² = 1/3 ± (ax² - ay²)/2 - (3az² - 1)/6
    T[0, 4:6] = 1.0 / 3.0
    T[7, 4:6] = 1.0 / r15, -1.0 / r15
    T[8, 4:6] = -1.0 / (3.0 * r5)
    return T


def drift(plan, **kwargs):
    """The nine drift functions in the spherical basis, readings of unit variance."""
    return ca.plain(NAMES, basis(gravity(plan, **kwargs)))


def with_rates(plan, latitude):
    """Nine drift terms as the field writes them and three earth-rate terms."""
    rows = np.hstack([monomials(gravity(plan)), rate_reference(latitude) @ attitude(plan)])
    return ca.plain((*TERMS, *RATES), rows)


def efficiency(plan):
    """D-efficiency of a plan in the spherical basis, from its definition."""
    X = plan.rows[:, 0]
    return np.linalg.det(X.T @ X / len(X)) ** (1.0 / X.shape[1])
