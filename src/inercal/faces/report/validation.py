"""A validation, shown: a line for each case, and a page for a laboratory's file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from inercal.faces.report.html import page as template
from inercal.foundation.results.result import Estimate
from inercal.foundation.results.shown import aligned

_HEAD = ("", "case", "found", "expected", "", "unit", "source")
_WORDS = (0, 1, 4, 5, 6)


def table(estimate: Estimate) -> str:
    """The cases as aligned text, one a line; of each the number that is furthest off in terms of its limit."""
    rows = estimate.result["cases"]
    lines = [_HEAD] + [
        (
            "pass" if row["passed"] else "FAIL",
            row["name"],
            *_numbers(row)[:2],
            f"± {_numbers(row)[2]}",
            "" if row["unit"] == "1" else row["unit"],
            row["source"],
        )
        for row in rows
    ]
    texts = aligned(lines, _WORDS, " ")
    reasons = ["", *(f"  {row['error']}" if row["error"] else "" for row in rows)]
    return "\n".join(text + reason for text, reason in zip(texts, reasons, strict=True))


def _numbers(row: Mapping[str, Any]) -> tuple[str, str, str]:
    """Found, expected and limit as texts, the first two to the first digit of the limit."""
    figure, expected, limit = row["figure"], row["expected"], row["limit"]
    return _shown(figure, expected, limit), _shown(expected, expected, limit), f"{limit:.2g}"


def _shown(value: float, expected: float, limit: float) -> str:
    """A number to the first digit of the limit; an error, where 0 is expected, to two digits of its own."""
    if not math.isfinite(value):
        return "–"
    if expected == 0.0 or limit == 0.0:
        return f"{value:.2g}"
    places = -math.floor(math.log10(limit))
    if places > 10 and abs(value) < 1e-3:
        return f"{value:.{max(0, places + math.floor(math.log10(abs(value) or limit)))}e}"
    return f"{value:.{max(0, places)}f}"


def page(estimate: Estimate) -> str:
    """The page of a validation: HTML that needs nothing but itself, with places to sign."""
    result, made = estimate.result, estimate.provenance
    rows = result["cases"]
    return template(
        "validation.html",
        estimate,
        "Validation of inercal",
        [
            ("date", "", estimate.traceability["date"]),
            ("software", "", ", ".join(f"{name} {text}" for name, text in made["versions"].items())),
            ("sources, SHA-256", "", made["sources_sha256"]),
            ("machine", "", made["machine"]["system"]),
        ],
        systems=[
            (words, [(row, *_numbers(row)) for row in rows if row["system"] == system])
            for system, words in result["systems"].items()
        ],
    )
