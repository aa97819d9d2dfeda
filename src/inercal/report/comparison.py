"""What ``inercal compare`` shows of two calibrations: a table, a picture, and a page of them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from inercal.estimate.result import Estimate
from inercal.estimate.rounding import rounded
from inercal.estimate.shown import temperature
from inercal.findings import Status
from inercal.instruments.terms import term
from inercal.report.html import Picture
from inercal.report.html import page as template
from inercal.report.style import ALARM, COLOURS, QUIET, WIDTH, figure, svg

_FAR = 4.0
"""Normalised error beyond which the axis of the picture becomes logarithmic."""


def table(estimate: Estimate) -> str:
    """The comparison as aligned text, in the order of the coefficients; those that moved are marked."""
    head = ("", "first", "second", "second - first", "u", "E_n", "", "unit")
    lines = [head] + [
        (row["name"], *_numbers(row), _mark(row), row["unit"]) for row in estimate.result["coefficients"]
    ]
    widths = [max(len(line[i]) for line in lines) for i in range(len(head))]
    return "\n".join(
        "  ".join(
            cell.ljust(width) if i in (0, 6, 7) else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in lines
    )


def _numbers(row: Mapping[str, Any]) -> tuple[str, ...]:
    """Both values, difference, its u and E_n as texts; the values to the digits that the difference needs."""
    first, second = (rounded(row[way], min(row[f"u_{way}"], row["u"]))[0] for way in ("first", "second"))
    return first, second, *rounded(row["difference"], row["u"])[:2], f"{row['normalised_error']:.2f}"


def _words(name: str) -> str:
    """What a coefficient is."""
    of = term(name)
    return "" if of is None else of.name


def _mark(row: Mapping[str, Any]) -> str:
    """Whether a coefficient moved, or is only beyond its own limit."""
    return "moved" if row["moved"] else "> 1" if row["normalised_error"] > 1.0 else ""


def picture(estimate: Estimate) -> Picture:
    """Differences over their expanded uncertainties, with the band in which they are explained."""
    rows = estimate.result["coefficients"]
    names = [row["name"] for row in rows]
    over_U = np.array([np.copysign(row["normalised_error"], row["difference"]) for row in rows])
    over_U = np.clip(over_U, -1e6, 1e6)  # a coefficient without uncertainty
    moved = np.array([row["moved"] for row in rows])
    far = max(1.5, 1.15 * float(np.abs(over_U).max()))
    with figure(WIDTH, 0.7 + 0.16 * len(names)) as page:
        axes = page.subplots()
        axes.axvspan(-1.0, 1.0, color=COLOURS[0], alpha=0.15, lw=0)
        axes.axvline(0.0, color=QUIET, lw=0.6)
        places = np.arange(len(names))
        for chosen, colour in ((~moved, COLOURS[0]), (moved, ALARM)):
            axes.hlines(places[chosen], 0.0, over_U[chosen], color=colour, lw=1.0)
            axes.plot(over_U[chosen], places[chosen], "o", color=colour)
        if far > _FAR:
            axes.set_xscale("symlog", linthresh=2.0, linscale=1.5)
            powers = 10 ** np.arange(1, int(np.log10(far)) + 1)
            ticks = np.concatenate([-powers[::-1], [-1, 0, 1], powers])
            axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks], minor=False)
            axes.set_xticks([], minor=True)
        axes.set_xlim(-far, far)
        axes.set_ylim(len(names) - 0.4, -0.6)
        axes.set_yticks(places, names, fontsize=7)
        axes.tick_params(axis="y", length=0)
        axes.set_xlabel("difference / U")
        axes.grid(axis="x")
        drawn = svg(page)
    outside = " Logarithmic beyond ±2." if far > _FAR else ""
    return Picture(
        "Differences over their uncertainties",
        "Second minus first over the expanded uncertainty of the difference; band: |E_n| ≤ 1. Red: moved by more than "
        f"chance explains among {len(names)} coefficients.{outside}",
        drawn,
    )


def page(estimate: Estimate) -> str:
    """The page of a comparison: HTML that needs nothing but itself."""
    result, given = estimate.result, estimate.provenance["settings"]
    facts = []
    for way in ("first", "second"):
        conditions = estimate.conditions[way]
        known = (Path(given[way]).name, conditions["date"], temperature(conditions["temperature"]))
        facts.append((way, "", ", ".join(filter(None, known))))
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
