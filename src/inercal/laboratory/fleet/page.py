"""A fleet, shown: a sentence, a table, histograms and courses, the page, and the plain objects of its result."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from inercal.faces.report.html import Picture
from inercal.faces.report.html import page as template
from inercal.faces.report.marks import Axis, Bars, Dots, Level, Line, Mark, Panel
from inercal.faces.report.panels import draw
from inercal.faces.report.style import ALARM, COLOURS, QUIET
from inercal.foundation.records.places import counted
from inercal.foundation.results.result import Estimate
from inercal.foundation.results.shown import aligned, rounded
from inercal.laboratory.fleet.fleet import Fleet, Index, Spread, Trend
from inercal.laboratory.limits import LIMITS
from inercal.laboratory.specification import group_of

_FIRST = 50
"""Units that the page names to be looked at first; the table of all is beside it."""


def summary(fleet: Fleet) -> str:
    """The fleet in a sentence."""
    good, every = fleet.good.good, fleet.good.all
    text = f"{good} of {counted(every, 'unit')} {'is' if good == 1 else 'are'} good"
    others = [f"{many} {status}" for status, many in fleet.counts.items() if status != "ok"]
    sound = [row for row in fleet.rows if row.status == "ok"]
    for words, many in (
        ("outside limits", sum(bool(row.outside) for row in sound)),
        ("without a value that has limits", sum(bool(row.without_value) for row in sound)),
        ("with the recordings of another", len(fleet.twins)),
    ):
        others += [f"{many} {words}"] if many else []
    others += [f"{len(fleet.strange)} unlike the others"] if fleet.strange else []
    others += [f"a trend of {', '.join(each.name for each in fleet.trends[:4])}"] if fleet.trends else []
    return "; ".join([text, *others])


HEAD = ("", "units", "mean", "scatter", "u", "lower", "upper", "Cp", "Cpk", "unit", "outside")


def rows(fleet: Fleet) -> list[tuple[str, ...]]:
    """The table of coefficients, a row each, as texts."""
    found = []
    for spread in fleet.spreads:
        scatter = spread.scatter
        mean, shown = rounded(spread.mean, scatter)[:2] if scatter > 0.0 else (f"{spread.mean:.6g}", "–")
        limits = ("", "") if spread.limits is None else tuple(f"{each:.6g}" for each in spread.limits)
        outside = str(len(spread.not_conform)) if spread.limits is not None else ""
        u = rounded(spread.u, spread.u)[1] if spread.u > 0.0 else "0"
        found.append(
            (
                *(spread.name, str(len(spread.values)), mean, shown, u, *limits),
                *(_index(spread.Cp), _index(spread.Cpk), spread.unit, outside),
            )
        )
    return found


def _index(index: Index | None) -> str:
    """An index with its interval."""
    return "" if index is None else f"{index.value:.2f} ({index.low:.2f} to {index.high:.2f})"


def table(fleet: Fleet) -> str:
    """The table of coefficients, and the units to look at first, as aligned text."""
    lines = [HEAD, *rows(fleet)]
    kept = [i for i in range(len(HEAD)) if any(line[i] for line in lines[1:])]
    words = {place for place, i in enumerate(kept) if not 0 < i < 9}
    text = aligned([[line[i] for i in kept] for line in lines], words) if fleet.spreads else []
    named = [f"{fleet.rows[place].serial}  {words}" for place, words in fleet.first[:10]]
    more = len(fleet.first) - len(named)
    named += [f"and {more} more, in units.csv and fleet.html"] if more > 0 else []
    return "\n".join([*text, *(["", "look first at", *named] if named else [])])


def result_of(fleet: Fleet) -> dict[str, Any]:
    """The fleet as plain objects, in the units of measurement of its table."""
    low, high = fleet.good.interval
    return {
        "units": len(fleet.rows),
        "status": fleet.counts,
        "yield": {
            "good": fleet.good.good,
            "share": fleet.good.good / fleet.good.all,
            "low": low,
            "high": high,
        },
        "coverage_probability": LIMITS.interval_level,
        "coefficients": [
            {
                "name": each.name,
                "unit": each.unit,
                "units": len(each.values),
                "mean": each.mean,
                "scatter": each.scatter,
                "u": each.u,
                "limits": None if each.limits is None else list(each.limits),
                "Cp": None if each.Cp is None else vars(each.Cp),
                "Cpk": None if each.Cpk is None else vars(each.Cpk),
                "not_conform": [fleet.rows[place].serial for place in each.not_conform],
            }
            for each in fleet.spreads
        ],
        "trends": [{**vars(each), "per": fleet.per} for each in fleet.trends],
        "unlike": [
            {
                "serial": fleet.rows[each.place].serial,
                "distance": each.distance,
                "limit": fleet.farthest,
                "name": each.name,
                "sigmas": each.sigmas,
            }
            for each in fleet.strange
        ],
        "first": [{"serial": fleet.rows[place].serial, "why": words} for place, words in fleet.first],
    }


def pictures(fleet: Fleet) -> list[Picture]:
    """A picture of each group of coefficients, those with a unit outside or a trend first; of none, the verdicts."""
    groups: dict[str, list[Spread]] = {}
    for spread in fleet.spreads:
        groups.setdefault(group_of(spread.name), []).append(spread)
    moving = {each.name for each in fleet.trends}

    def quiet(item: tuple[str, list[Spread]]) -> bool:
        return not any(each.not_conform or each.name in moving for each in item[1])

    found = [_group(name, some, fleet) for name, some in sorted(groups.items(), key=quiet)]
    return found or [_verdicts(fleet)]


def _verdicts(fleet: Fleet) -> Picture:
    """Numbers of units by verdict."""
    names, many = list(fleet.counts), list(fleet.counts.values())
    at = np.arange(len(names))
    bars = Bars(at, np.zeros(len(names)), np.array(many))
    panel = Panel([bars], Axis("units", whole=True), Axis(names=names), grid="x")
    return draw("Verdicts", "Number of units by their verdict.", [[panel]], 0.8 + 0.3 * len(names))


def _group(name: str, some: Sequence[Spread], fleet: Fleet) -> Picture:
    """Coefficients of a group: histogram at the left, values in the order of the fleet at the right."""
    trends = {each.name: each for each in fleet.trends}
    x = "day" if fleet.per == "day" else "unit, in the order of the manifest"
    panels = []
    for k, spread in enumerate(some):
        last = k == len(some) - 1
        histogram = Panel(
            _histogram(spread), Axis(spread.unit, few=True), Axis("units", whole=True), title=spread.name
        )
        course = Panel(
            _course(spread, fleet, trends.get(spread.name)),
            Axis(x if last else ""),
            Axis(spread.unit),
            grid="y",
        )
        panels.append([histogram, course])
    return draw(
        name,
        "Left: how many units have which value. Right: the values with U in their order; red: units that do not "
        "conform or are unlike the others; dashed: a trend. Dotted: the limits of the specification.",
        panels,
        0.35 + 1.45 * len(some),
        share_x=False,
    )


def _near(spread: Spread) -> list[float]:
    """Limits that are near enough to the values to be shown."""
    if spread.limits is None:
        return []
    room = 2.0 * max(float(np.ptp(spread.values)), spread.u) or math.inf
    low, high = float(spread.values.min()) - room, float(spread.values.max()) + room
    return [each for each in spread.limits if low < each < high]


def _histogram(spread: Spread) -> list[Mark]:
    """Marks of the histogram."""
    counts, edges = np.histogram(spread.values, bins="auto" if np.ptp(spread.values) > 0.0 else 1)
    middle, width = 0.5 * (edges[1:] + edges[:-1]), float(edges[1] - edges[0])
    marks: list[Mark] = [
        Bars(middle, np.zeros(len(counts)), counts, "", COLOURS[0], 0.94 * width, upright=True, alpha=0.8)
    ]
    return [*marks, *(Level(each, "", ALARM, style=":", upright=True) for each in _near(spread))]


def _course(spread: Spread, fleet: Fleet, trend: Trend | None) -> list[Mark]:
    """Marks of the values in the order of the fleet."""
    at, places = fleet.at[list(spread.places)], np.array(spread.places)
    U = np.array([_U(fleet, place, spread.name) for place in spread.places])
    odd = np.isin(places, [*spread.not_conform, *(each.place for each in fleet.strange)])
    marks: list[Mark] = [
        Dots(at[chosen], spread.values[chosen], "", colour, size=3.0, up=U[chosen])
        for chosen, colour in ((~odd, COLOURS[0]), (odd, ALARM))
        if chosen.any()
    ]
    if trend is not None:
        ends = np.array([at.min(), at.max()])
        middle = float(np.median(spread.values - trend.slope * at))
        marks.append(Line(ends, middle + trend.slope * ends, "", QUIET, style="--"))
    return [*marks, *(Level(each, "", ALARM, style=":") for each in _near(spread))]


def _U(fleet: Fleet, place: int, name: str) -> float:
    """Expanded uncertainty of a coefficient of a unit."""
    return next(each.U for each in fleet.rows[place].coefficients if each.name == name)


def page(fleet: Fleet, estimate: Estimate) -> str:
    """The page of a fleet: HTML that needs nothing but itself."""
    low, high = fleet.good.interval
    facts = [
        ("units", "", str(len(fleet.rows))),
        (
            "yield",
            "%",
            f"{100.0 * fleet.good.good / fleet.good.all:.1f} ({100.0 * low:.1f} to {100.0 * high:.1f})",
        ),
    ]
    return template(
        "fleet.html",
        estimate,
        "Calibration of a fleet",
        facts,
        pictures=pictures(fleet),
        counts=list(fleet.counts.items()),
        head=HEAD[1:],
        rows=rows(fleet),
        trends=[(each.name, f"{each.slope:.3g}", each.unit, f"{each.p:.1g}") for each in fleet.trends],
        per=fleet.per,
        look=[(fleet.rows[place].serial, words) for place, words in fleet.first[:_FIRST]],
        more=max(len(fleet.first) - _FIRST, 0),
        level=f"{100.0 * LIMITS.interval_level:.0f} %",
    )
