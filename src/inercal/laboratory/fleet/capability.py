"""Yield and capability: how many units are good, and how the coefficients of the fleet lie within their limits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.laboratory.fleet.unit import UnitRow
from inercal.laboratory.specification import Specification

LEVEL = 0.95
"""Probability of the intervals of yield and capability."""


@dataclass(frozen=True)
class Share:
    """A share of ``good`` units among ``all``, with its interval (Clopper and Pearson 1934)."""

    good: int
    all: int

    @property
    def interval(self) -> tuple[float, float]:
        """Ends of the interval of `LEVEL`."""
        from scipy.special import betaincinv

        tail = 0.5 * (1.0 - LEVEL)
        k, n = self.good, self.all
        low = 0.0 if k == 0 else float(betaincinv(k, n - k + 1, tail))
        high = 1.0 if k == n else float(betaincinv(k + 1, n - k, 1.0 - tail))
        return low, high


@dataclass(frozen=True)
class Index:
    """An index of capability with the ends of its interval of `LEVEL`."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Spread:
    """A coefficient over the fleet, in ``unit``: values (n,) of the units that have one, their places in the fleet.

    ``mean``, ``scatter`` (standard deviation), ``u`` (root mean square of the standard uncertainties), ``limits``
    where the study states some, and the places of the units that do ``not_conform``.
    """

    name: str
    unit: str
    places: tuple[int, ...]
    values: Array
    u: float
    limits: tuple[float, float] | None
    not_conform: tuple[int, ...]

    @property
    def mean(self) -> float:
        """Mean of the values."""
        return float(self.values.mean())

    @property
    def scatter(self) -> float:
        """Standard deviation of the values, NaN of one."""
        return float(self.values.std(ddof=1)) if len(self.values) > 1 else math.nan

    @property
    def Cp(self) -> Index | None:
        """Width of the limits over six standard deviations, its interval by chi-square (ISO 22514-2)."""
        from scipy.special import chdtri

        if self.limits is None or not self.scatter > 0.0:
            return None
        value = (self.limits[1] - self.limits[0]) / (6.0 * self.scatter)
        dof, tail = len(self.values) - 1, 0.5 * (1.0 - LEVEL)
        low, high = (math.sqrt(float(chdtri(dof, upper)) / dof) for upper in (1.0 - tail, tail))
        return Index(value, value * low, value * high)

    @property
    def Cpk(self) -> Index | None:
        """Distance of the mean from the nearer limit over three standard deviations, its interval by Bissell (1990)."""
        from scipy.special import ndtri

        if self.limits is None or not self.scatter > 0.0:
            return None
        low, high = self.limits
        value = min(high - self.mean, self.mean - low) / (3.0 * self.scatter)
        n = len(self.values)
        half = float(ndtri(0.5 * (1.0 + LEVEL))) * math.sqrt(1.0 / (9.0 * n) + value**2 / (2.0 * (n - 1)))
        return Index(value, value - half, value + half)

    def trend(self, at: Array) -> tuple[float, float] | None:
        """Slope over ``at`` (n of the fleet,) by Theil and Sen, and the p of Kendall's tau; None of under 8 units."""
        from scipy.stats import kendalltau, theilslopes

        x = at[list(self.places)]
        if len(x) < 8 or not np.ptp(x) > 0.0 or not np.ptp(self.values) > 0.0:
            return None
        return float(theilslopes(self.values, x)[0]), float(kendalltau(x, self.values).pvalue)


def spreads(rows: Sequence[UnitRow], specification: Specification) -> tuple[Spread, ...]:
    """Every coefficient of the units that ended `ok`, in the unit of measurement of the first unit that has it."""
    found: dict[str, list[tuple[int, int]]] = {}
    for i, row in enumerate(rows):
        for j, each in enumerate(row.coefficients if row.status == "ok" else ()):
            if math.isfinite(each.value) and math.isfinite(each.u):
                found.setdefault(each.name, []).append((i, j))
    return tuple(_spread(name, places, rows, specification) for name, places in found.items())


def _spread(
    name: str, places: Sequence[tuple[int, int]], rows: Sequence[UnitRow], specification: Specification
) -> Spread:
    """The spread of one coefficient over the fleet."""
    every = [rows[i].coefficients[j] for i, j in places]
    unit = every[0].unit
    same = [k for k, each in enumerate(every) if each.unit == unit]
    return Spread(
        name,
        unit,
        tuple(places[k][0] for k in same),
        np.array([every[k].value for k in same]),
        float(np.sqrt(np.mean([every[k].u ** 2 for k in same]))),
        specification.of(name, unit),
        tuple(i for i, _ in places if name in rows[i].outside),
    )
