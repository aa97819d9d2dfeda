"""Sources of uncertainty that act alike in two calibrations, and cancel in their difference.

A saved budget holds the size of each effect on a coefficient but not its sign. So a source is taken as common only
where the sign is known too: type B, of the same name and u in both, being gravity at the same site or the time base
of the same instrument, and in proportion to every coefficient it acts on. (Gravity and time base set the scale: the
effect has the sign of the coefficient, or the opposite one throughout.) All other sources count as independent;
where they are not, as with errors of one table, the difference is less uncertain than its u says.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.results.budget import BudgetItem
from inercal.foundation.results.limits import LIMITS
from inercal.foundation.results.result import Estimate

_OF_THE_SITE = frozenset({"gravity", "gravity anomaly", "latitude", "height"})
_OF_THE_INSTRUMENT = frozenset({"time base"})


@dataclass(frozen=True, eq=False)
class Taken:
    """The common coefficients of one calibration, in common units: ``values``, ``dof`` (p,), ``covariance`` (p, p)."""

    names: list[str]
    values: Array
    covariance: Array
    dof: Array

    @property
    def u(self) -> Array:
        """Standard uncertainties (p,)."""
        return np.sqrt(np.diag(self.covariance))

    def effect(self, item: BudgetItem) -> Array:
        """(p,) size of what one u of a source does to the coefficients, with the sign of each coefficient; 0 where it
        is too small to be felt."""
        share = np.array([float(item.share.get(name, 0.0)) for name in self.names])
        share[share < LIMITS.felt_share] = 0.0
        return np.asarray(np.sqrt(share) * self.u * np.sign(self.values))


def common_sources(
    first: Estimate, second: Estimate, a: Taken, b: Taken
) -> Mapping[str, tuple[Array, Array]]:
    """Sources that act alike in both, each with what it does to the coefficients of either (p,), (p,)."""
    alike = frozenset[str]()
    if _same_site(first, second):
        alike |= _OF_THE_SITE
    if not other_instrument(first, second):
        alike |= _OF_THE_INSTRUMENT
    others = {(item.source, item.unit): item for item in second.budget if item.type == "B"}
    shared = {}
    for item in first.budget:
        twin = others.get((item.source, item.unit))
        if item.type != "B" or item.source not in alike or twin is None:
            continue
        effects = a.effect(item), b.effect(twin)
        if math.isclose(item.u, twin.u, rel_tol=1e-9) and _in_proportion(a, b, *effects):
            shared[item.source] = effects
    return shared


def _in_proportion(a: Taken, b: Taken, by_a: Array, by_b: Array) -> bool:
    """True if a source acts on the coefficients of both calibrations by the same fractions of their values, as closely
    as the rest of their variance lets anybody tell."""
    off = np.abs((by_a * b.values) ** 2 - (by_b * a.values) ** 2)
    rest = (a.u**2 - by_a**2) * b.values**2
    near = 2.0 * LIMITS.proportion * (by_a * b.values) ** 2 + LIMITS.untold_share * np.maximum(rest, 0.0)
    return bool(np.any(by_a) and np.all(off <= near))


def _same_site(first: Estimate, second: Estimate) -> bool:
    """True if both name the same gravity and latitude."""
    sites = [estimate.conditions.get("site") for estimate in (first, second)]
    return isinstance(sites[0], Mapping) and "gravity_m_s2" in sites[0] and sites[0] == sites[1]


def other_instrument(first: Estimate, second: Estimate) -> bool:
    """True if both name their instrument, and not the same one."""
    named = [estimate.traceability.get("instrument", "") for estimate in (first, second)]
    return all(named) and named[0] != named[1]
