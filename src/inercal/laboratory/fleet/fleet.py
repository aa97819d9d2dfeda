"""A fleet as a whole: yield, capability, trends, and the units to look at first."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import date

import numpy as np

from inercal.foundation.arrays import Array
from inercal.laboratory.fleet.capability import Share, Spread, spreads
from inercal.laboratory.fleet.outliers import FEWEST, distances, limit, standardised
from inercal.laboratory.fleet.unit import FAILED, REFUSED, Row
from inercal.laboratory.specification import Specification

TREND_RISK = 0.01
"""Probability that a fleet without any trend has one named."""


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

    rows: tuple[Row, ...]
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


def fleet_of(rows: Sequence[Row], specification: Specification) -> Fleet:
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


def _twins(rows: Sequence[Row]) -> tuple[tuple[int, str], ...]:
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


def _times(rows: Sequence[Row]) -> tuple[Array, str]:
    """Times at which the units were measured [days], where all say so on more than one day; else their numbers."""
    try:
        days = np.array([float(date.fromisoformat(row.measured).toordinal()) for row in rows])
        if np.ptp(days) > 0.0:
            return days - days.min(), "day"
    except ValueError:
        pass
    return np.arange(float(len(rows))), "unit"


def _trends(found: Sequence[Spread], at: Array) -> tuple[Trend, ...]:
    """Coefficients with a trend, at a risk over all of `TREND_RISK`."""
    trends = []
    for spread in found:
        trend = spread.trend(at)
        if trend is not None and trend[1] < TREND_RISK / len(found):
            trends.append(Trend(spread.name, trend[0], spread.unit, trend[1]))
    return tuple(sorted(trends, key=lambda each: each.p))


def _strange(found: Sequence[Spread]) -> tuple[tuple[Strange, ...], float]:
    """Units that are unlike the others, the farthest first, among those that have all of the usual coefficients."""
    if not found:
        return (), math.nan
    most = max(len(spread.places) for spread in found)
    usual = [spread for spread in found if 2 * len(spread.places) > most]
    places = sorted(set.intersection(*(set(spread.places) for spread in usual)))
    if len(places) < FEWEST:
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
