"""A fleet as a whole: yield, capability, trends, and the units to look at first.

A unit is strange by its robust distance in the space of all coefficients. Middle and scatter of the fleet are those of
its three quarters that lie closest together (minimum covariance determinant, found by the steps of Rousseeuw and Van
Driessen 1999 from two starts of Hubert, Rousseeuw and Verdonck 2012), so that a quarter of strange units does not move
them. Where there are few units for the number of coefficients, the distance is that of the coefficient that is farthest
off, in robust standard deviations. The largest distance of a sound unit is found by simulated fleets of the same size.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import date
from functools import cache

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.laboratory.fleet.unit import FAILED, REFUSED, UnitRow
from inercal.laboratory.limits import LIMITS
from inercal.laboratory.specification import Specification


@dataclass(frozen=True)
class Share:
    """A share of ``good`` units among ``all``, with its interval (Clopper and Pearson 1934)."""

    good: int
    all: int

    @property
    def interval(self) -> tuple[float, float]:
        """Ends of the interval of `Limits.interval_level`."""
        from scipy.special import betaincinv

        tail = 0.5 * (1.0 - LIMITS.interval_level)
        k, n = self.good, self.all
        low = 0.0 if k == 0 else float(betaincinv(k, n - k + 1, tail))
        high = 1.0 if k == n else float(betaincinv(k + 1, n - k, 1.0 - tail))
        return low, high


@dataclass(frozen=True)
class Index:
    """An index of capability with the ends of its interval of `Limits.interval_level`."""

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
        dof, tail = len(self.values) - 1, 0.5 * (1.0 - LIMITS.interval_level)
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
        half = float(ndtri(0.5 * (1.0 + LIMITS.interval_level))) * math.sqrt(
            1.0 / (9.0 * n) + value**2 / (2.0 * (n - 1))
        )
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


_FLEETS = 200
_MANY = 200
"""Units from which on the simulated fleets are no larger."""


def distances(values: Array) -> Array:
    """Robust distances (n,) of units from the middle of the fleet, by ``values`` (n units, p coefficients).

    A coefficient in which more than half of the units are equal tells nothing and is left out.
    """
    z = standardised(values)
    z = z[:, np.isfinite(z).all(axis=0)]
    if z.shape[1] == 0:
        return np.zeros(len(values))
    if not _joint(*z.shape):
        farthest: Array = np.abs(z).max(axis=1)
        return farthest
    size = int(LIMITS.core_share * len(z))
    norm = np.linalg.norm(z, axis=1, keepdims=True)
    signs = z / np.where(norm > 0.0, norm, 1.0)
    turned = z @ np.linalg.eigh(signs.T @ signs)[1]
    starts = (z**2, standardised(turned) ** 2)
    cores = [_concentrated(z, np.argsort(np.nansum(each, axis=1))[:size]) for each in starts]
    return min(cores, key=lambda found: found[1])[0]


def standardised(values: Array) -> Array:
    """Values (n, p) less their median, over 1.4826 times the median absolute deviation; NaN where that is zero."""
    from_middle = values - np.median(values, axis=0)
    scale = 1.4826022 * np.median(np.abs(from_middle), axis=0)
    return from_middle / np.where(scale > 0.0, scale, np.nan)


def _joint(units: int, coefficients: int) -> bool:
    """True if the units are enough for the covariance of the coefficients."""
    return units >= max(LIMITS.fewest_units, 3 * coefficients)


def _concentrated(z: Array, core: NDArray[np.intp]) -> tuple[Array, float]:
    """Distances (n,) from the core after steps that draw it together, and the logarithm of its determinant."""
    for _ in range(30):
        middle, factor = z[core].mean(axis=0), np.cov(z[core], rowvar=False).reshape(z.shape[1], -1)
        values, axes = np.linalg.eigh(factor)
        values = np.maximum(values, 1e-12 * values[-1])
        found = np.sqrt(np.sum(((z - middle) @ axes) ** 2 / values, axis=1))
        closer = np.argsort(found)[: len(core)]
        if set(closer) == set(core):
            break
        core = closer
    return found, float(np.log(values).sum())


def limit(units: int, coefficients: int) -> float:
    """The distance that the farthest of so many sound units exceeds with the probability `Limits.strange_risk`."""
    from scipy.special import chdtri

    found = _limit(min(units, _MANY), coefficients)
    if units <= _MANY:
        return found
    # the distribution of many units is that of chi-square: its quantiles say how much farther the farthest of more lies
    p = coefficients if _joint(units, coefficients) else 1
    far = [float(chdtri(p, -np.expm1(np.log1p(-LIMITS.strange_risk) / n))) for n in (units, _MANY)]
    return found * float(np.sqrt(far[0] / far[1]))


@cache
def _limit(units: int, coefficients: int) -> float:
    """The limit, by simulated fleets."""
    rng = np.random.default_rng(20261123)
    farthest = [distances(rng.standard_normal((units, coefficients))).max() for _ in range(_FLEETS)]
    return float(np.quantile(farthest, 1.0 - LIMITS.strange_risk))


@dataclass(frozen=True)
class Trend:
    """A coefficient that moves through the fleet: ``slope`` a day (or a unit, in their order) and its probability by
    chance, ``p``."""

    name: str
    slope: float
    unit: str
    p: float


@dataclass(frozen=True)
class Strange:
    """A unit far from the others: its place in the fleet, its distance, and the coefficient that is farthest off with
    its robust standard deviations."""

    place: int
    distance: float
    name: str
    sigmas: float


@dataclass(frozen=True)
class Fleet:
    """Rows of all units in the order of the manifest, and what is said of them.

    ``good`` counts units that are `ok`, with a value within its limits for each that the study states, and recordings
    of their own; ``twins`` are places of units with the recordings of another, and its serial number. ``at`` (n,) is
    the time of each in days, else its number, as ``per`` says. ``farthest`` is the distance that no sound unit should
    have, NaN of too few units.
    """

    rows: tuple[UnitRow, ...]
    good: Share
    twins: tuple[tuple[int, str], ...]
    spreads: tuple[Spread, ...]
    at: Array
    per: str
    trends: tuple[Trend, ...]
    strange: tuple[Strange, ...]
    farthest: float

    @property
    def counts(self) -> dict[str, int]:
        """Number of units of each status, the most frequent first."""
        every = [row.status for row in self.rows]
        return {s: every.count(s) for s in sorted(set(every), key=lambda s: (-every.count(s), s))}

    @property
    def first(self) -> tuple[tuple[int, str], ...]:
        """Places of units to look at first, each with the reason: broken ones, doubtful ones, outside, strange."""
        reasons: dict[int, list[str]] = {}
        for group in (self._without_values(), self._doubtful(), self._twins(), self._outside(), self._far()):
            for place, words in group:
                reasons.setdefault(place, []).append(words)
        return tuple((place, "; ".join(words)) for place, words in reasons.items())

    def _without_values(self) -> Iterator[tuple[int, str]]:
        for i, row in enumerate(self.rows):
            if row.status in (REFUSED, FAILED):
                yield i, f"{row.status}: {row.message}"

    def _doubtful(self) -> Iterator[tuple[int, str]]:
        for i, row in enumerate(self.rows):
            if row.status not in (REFUSED, FAILED, "ok"):
                yield i, f"{row.status}: {row.message}"

    def _outside(self) -> Iterator[tuple[int, str]]:
        for i, row in enumerate(self.rows):
            if row.status == "ok":
                yield from ((i, f"{name} does not conform") for name in row.outside)
                yield from ((i, f"has no {key}, of which there are limits") for key in row.without_value)

    def _twins(self) -> Iterator[tuple[int, str]]:
        for place, serial in self.twins:
            yield place, f"has the recordings of {serial}"

    def _far(self) -> Iterator[tuple[int, str]]:
        for each in self.strange:
            what = f"{each.name} {abs(each.sigmas):.1f} standard deviations off" if each.name else ""
            yield (
                each.place,
                f"unlike the others, distance {each.distance:.1f} of {self.farthest:.1f}; {what}".strip("; "),
            )


def fleet_of(rows: Sequence[UnitRow], specification: Specification) -> Fleet:
    """The fleet of rows in the order of the manifest."""
    found = spreads(rows, specification)
    twins = _twins(rows)
    doubled = {place for place, _ in twins}
    good = sum(
        row.status == "ok" and not row.outside and not row.without_value and i not in doubled
        for i, row in enumerate(rows)
    )
    at, per = _times(rows)
    strange, farthest = _strange(found)
    share = Share(good, len(rows))
    return Fleet(tuple(rows), share, twins, found, at, per, _trends(found, at), strange, farthest)


def _twins(rows: Sequence[UnitRow]) -> tuple[tuple[int, str], ...]:
    """Places of units with the same recordings as another, and the serial number of that one."""
    same: dict[tuple[str, ...], list[int]] = {}
    for i, row in enumerate(rows):
        if row.inputs:
            same.setdefault(tuple(sorted(row.inputs.values())), []).append(i)
    pairs = (
        (place, rows[places[0] if place != places[0] else places[1]].serial)
        for places in same.values()
        if len(places) > 1
        for place in places
    )
    return tuple(sorted(pairs))


def _times(rows: Sequence[UnitRow]) -> tuple[Array, str]:
    """Times at which the units were measured [days], where all say so on more than one day; else their numbers."""
    try:
        days = np.array([float(date.fromisoformat(row.measured).toordinal()) for row in rows])
        if np.ptp(days) > 0.0:
            return days - days.min(), "day"
    except ValueError:
        pass
    return np.arange(float(len(rows))), "unit"


def _trends(found: Sequence[Spread], at: Array) -> tuple[Trend, ...]:
    """Coefficients with a trend, at a risk over all of `Limits.trend_risk`."""
    trends = []
    for spread in found:
        trend = spread.trend(at)
        if trend is not None and trend[1] < LIMITS.trend_risk / len(found):
            trends.append(Trend(spread.name, trend[0], spread.unit, trend[1]))
    return tuple(sorted(trends, key=lambda each: each.p))


def _strange(found: Sequence[Spread]) -> tuple[tuple[Strange, ...], float]:
    """Units that are unlike the others, the farthest first, among those that have all of the usual coefficients."""
    if not found:
        return (), math.nan
    most = max(len(spread.places) for spread in found)
    usual = [spread for spread in found if 2 * len(spread.places) > most]
    places = sorted(set.intersection(*(set(spread.places) for spread in usual)))
    if len(places) < LIMITS.fewest_units:
        return (), math.nan
    by_place = [dict(zip(spread.places, spread.values, strict=True)) for spread in usual]
    values = np.array([[own[place] for own in by_place] for place in places])
    z = standardised(values)
    told = np.isfinite(z).all(axis=0)
    if not told.any():
        return (), math.nan
    far, farthest = distances(values), limit(len(places), int(told.sum()))
    strange = []
    for k in np.argsort(-far):
        if far[k] > farthest:
            j = int(np.argmax(np.where(told, np.abs(z[k]), -1.0)))
            strange.append(Strange(places[k], float(far[k]), usual[j].name, float(z[k, j])))
    return tuple(strange), farthest
