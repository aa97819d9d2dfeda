"""The coefficients of a platform: names, units, order, and two forms of misalignment.

Everywhere coefficients are one array (p,) in the order of `NAMES`, in SI. p is 18, 24 with the extended model, or more
with states of the rig behind them (`inercal.systems.selfcal.platform.states`):

    kg0 (3)   gyro bias [rad/s]
    eta (3)   misalignment of accelerometers: pz, oy, oz [rad]
    ds, do    misalignments of gyros, 3 each [rad]
    ka0 (3)   accelerometer bias [m/s^2]
    ka1 (3)   accelerometer scale error [1]
    kg1 (3)   gyro scale error [1]; extended model
    beta (3)  zero of the encoders against the base [rad]: q_encoders = qexp(beta) q_bp; extended model

The platform p turns at w_Ip^p = w + M w + kg0, w the commanded (or measured) rate, with

    M = [[kg1x, dsx, -dox], [-doy, kg1y, dsy], [dsz, -doz, kg1z]].

X_p lies along the input axis of accelerometer x, Y_p in the plane of those of x and y.

In the *product form* (physical, that of results and studies) misalignments stand inside the bracket,

    ax = ka0x + (1 + ka1x) fx
    ay = ka0y + (1 + ka1y) (fy - eta_oy fx)
    az = ka0z + (1 + ka1z) (fz + eta_pz fx - eta_oz fy)

Filters work in the *linear form*, where eta' = (1 + ka1) eta stands outside of it: outputs are then linear in all
coefficients.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.instruments.terms import shown_unit
from inercal.systems.selfcal.platform.states import EXTENDED_MODEL, STATES, UNIT_OF

GROUPS: Final[dict[str, tuple[tuple[str, ...], str]]] = {
    kind: (tuple(name.removeprefix(f"{kind}_") for name in STATES[kind].parameters), STATES[kind].unit)
    for kind in EXTENDED_MODEL
}
"""Group -> endings of its names, unit; the last two belong to the extended model."""

EXTENDED: Final[tuple[str, ...]] = tuple(
    f"{group}_{end}" for group, (ends, _) in GROUPS.items() for end in ends
)
"""Names of all 24 coefficients, in order."""

NAMES: Final[tuple[str, ...]] = EXTENDED[:18]
"""Names of the 18 coefficients of the paper, in order."""

KG0, ETA, DS, DO, KA0, KA1, KG1, BETA = (slice(3 * k, 3 * k + 3) for k in range(8))
"""Slice of each group in the array."""


def names(p: int) -> tuple[str, ...]:
    """Names of the first ``p`` coefficients, 18 or 24."""
    return EXTENDED[:p]


def units(names: Sequence[str]) -> tuple[str, ...]:
    """SI units of coefficients or states of the rig, by name."""
    return tuple(UNIT_OF[name] for name in names)


def shown_units(names: Sequence[str]) -> tuple[tuple[str, ...], Array]:
    """Their units for people, and how many SI units (p,) each is."""
    shown = [shown_unit(unit) for unit in units(names)]
    return tuple(unit for unit, _ in shown), np.array([size for _, size in shown])


_ETA = np.arange(ETA.start, ETA.stop)
#: scale errors that belong to eta pz, oy, oz: those of accelerometers z, y, z
_SCALE = KA1.start + np.array([2, 1, 2])


def scale(c: Array) -> Array:
    """Factors (*batch, p) from the product form to the linear form: 1 + ka1, or 1."""
    by = np.ones_like(c)
    by[..., _ETA] += c[..., _SCALE]
    return by


def to_linear(product: Array) -> Array:
    """Coefficients (*batch, p) from the product form to the linear form."""
    return product * scale(product)


def to_product(linear: Array) -> Array:
    """Coefficients (*batch, p) from the linear form to the product form; the inverse of `to_linear`.

    Eta of an accelerometer without scale, ka1 = -1, is NaN, here and below: it may come out of a fit that diverges.
    """
    return linear / divisor(linear)


def divisor(c: Array) -> Array:
    """Divisors (*batch, p) from the linear form to the product form: `scale`, NaN for 0."""
    by = scale(c)
    by[by == 0.0] = np.nan
    return by


def product_slope(linear: Array) -> Array:
    """(p, p) derivative of `to_product` at ``linear`` (p,): covariance of the product form is ``S P S^T``."""
    by = divisor(linear)
    slope = np.diag(1.0 / by)
    slope[_ETA, _SCALE] = -linear[_ETA] / by[_ETA] ** 2
    return slope
