"""Two calibrations compared, shown: a table, a picture, and a page of them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from inercal.faces.report.html import Picture
from inercal.faces.report.html import page as template
from inercal.faces.report.marks import Axis, Bars, Dots, Level, Mark, Panel, Strips
from inercal.faces.report.panels import draw
from inercal.faces.report.style import ALARM, COLOURS
from inercal.foundation.findings import Status
from inercal.foundation.instruments.terms import term
from inercal.foundation.results.result import Estimate
from inercal.foundation.results.shown import aligned, rounded, temperature

_FAR = 4.0
"""Normalised error beyond which the axis of the picture becomes logarithmic."""


def table(estimate: Estimate) -> str:
    """The comparison as aligned text, in the order of the coefficients; those that moved are marked."""
    head = ("", "first", "second", "second - first", "u", "E_n", "", "unit")
    lines = [head] + [
        (row["name"], *_numbers(row), _mark(row), row["unit"]) for row in estimate.result["coefficients"]
    ]
    return "\n".join(aligned(lines, (0, 6, 7)))


def _numbers(row: Mapping[str, Any]) -> tuple[str, ...]:
    """Both values, difference, its u and E_n as texts; the values to the digits that the difference needs."""
    first, second = (rounded(row[way], min(row[f"u_{way}"], row["u"]))[0] for way in ("first", "second"))
    return first, second, *rounded(row["difference"], row["u"])[:2], f"{row['normalised_error']:.2f}"


def _words(name: str) -> str:
    """The meaning of a coefficient, in words."""
    of = term(name)
    return "" if of is None else of.name


def _mark(row: Mapping[str, Any]) -> str:
    """The mark of a coefficient that moved, or is only beyond its own limit."""
    return "moved" if row["moved"] else "> 1" if row["normalised_error"] > 1.0 else ""


def picture(estimate: Estimate) -> Picture:
    """Differences over their expanded uncertainties, with the band in which they are explained."""
    compared = estimate.result["coefficients"]
    names = [row["name"] for row in compared]
    over_U = np.array([np.copysign(row["normalised_error"], row["difference"]) for row in compared])
    over_U = np.clip(over_U, -1e6, 1e6)  # a coefficient without uncertainty
    moved = np.array([row["moved"] for row in compared])
    far = max(1.5, 1.15 * float(np.abs(over_U).max()))
    rows = np.arange(len(names))
    marks: list[Mark] = [Strips((-1.0, 1.0)), Level(0.0, upright=True)]
    for chosen, colour in ((~moved, COLOURS[0]), (moved, ALARM)):
        marks.append(Bars(rows[chosen], np.zeros(chosen.sum()), over_U[chosen], "", colour, 0.08))
        marks.append(Dots(over_U[chosen], rows[chosen], colour=colour))
    powers = (10.0 ** np.arange(1, int(np.log10(far)) + 1)).tolist()
    across = Axis(
        "difference / U",
        "symlog" if far > _FAR else "linear",
        (-far, far),
        ticks=[*(-power for power in powers[::-1]), -1.0, 0.0, 1.0, *powers] if far > _FAR else None,
        linear=2.0,
    )
    outside = " Logarithmic beyond ±2." if far > _FAR else ""
    return draw(
        "Differences over their uncertainties",
        "Second minus first over the expanded uncertainty of the difference; band: |E_n| ≤ 1. Red: moved by more than "
        f"chance explains among {len(names)} coefficients.{outside}",
        [[Panel(marks, across, Axis(names=names), grid="x")]],
        0.7 + 0.16 * len(names),
    )


def page(estimate: Estimate) -> str:
    """The page of a comparison: HTML that needs nothing but itself."""
    result, given = estimate.result, estimate.provenance["settings"]
    facts = []
    for way in ("first", "second"):
        conditions = estimate.conditions[way]
        details = (Path(given[way]).name, conditions["date"], temperature(conditions["temperature"]))
        facts.append((way, "", ", ".join(filter(None, details))))
    facts += [(name, "", text) for name, text in estimate.traceability.items() if text]
    return template(
        "comparison.html",
        estimate,
        "Two calibrations compared",
        facts,
        f"the two calibrations {'agree' if estimate.status is Status.OK else 'differ'}",
        rows=[
            (
                row["name"],
                _words(row["name"]),
                *_numbers(row),
                _mark(row),
                row,
            )
            for row in result["coefficients"]
        ],
        pictures=[picture(estimate)],
        missing=[(way, result[f"only_in_{way}"]) for way in ("first", "second") if result[f"only_in_{way}"]],
    )
