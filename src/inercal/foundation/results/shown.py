"""An estimate in the units and words that people use; everything behind it stays in SI.

Numbers become texts that are rounded to their uncertainty, or short where they have none. A `Table` of texts is
printed by a command, and shown on a page.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from typing import Any

import numpy as np

from inercal.foundation.instruments.terms import shown_unit, sized, sized_ratio
from inercal.foundation.results.budget import BudgetItem


@dataclass(frozen=True)
class Table:
    """Rows of texts under named columns.

    ``columns`` are names and units, empty where a column has none; the first ``words`` of them are text and begin at
    the left, the others are numbers. ``rows`` have a cell for each column; ``caption`` says what they are.
    """

    title: str
    caption: str
    columns: tuple[tuple[str, str], ...]
    rows: tuple[tuple[str, ...], ...]
    words: int = 1

    def text(self) -> str:
        """The table as aligned lines, without title and caption; empty without rows."""
        if not self.rows:
            return ""
        head = tuple(f"{name} [{unit}]" if unit else name for name, unit in self.columns)
        return "\n".join(aligned([head, *self.rows], range(self.words)))


def aligned(rows: Sequence[Sequence[str]], words: Container[int] = (0,), between: str = "  ") -> list[str]:
    """Rows of cells as lines of aligned columns; those of ``words`` begin at the left, the others end at the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        between.join(
            cell.ljust(width) if i in words else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]


def csv_text(rows: Iterable[Iterable[object]]) -> str:
    """Rows as CSV: numbers with all their digits, an empty cell for None and NaN."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    for row in rows:
        cells = (float(cell) if isinstance(cell, np.floating) else cell for cell in row)
        writer.writerow(["" if cell is None or cell != cell else cell for cell in cells])
    return text.getvalue()


def heads(*texts: str) -> tuple[tuple[str, str], ...]:
    """Columns of a table from texts such as ``time [s]``: names with their units."""
    parts = (text.partition(" [") for text in texts)
    return tuple((name, unit.removesuffix("]")) for name, _, unit in parts)


_DIGITS = 16
"""Digits after the first that tell every number from its neighbours."""


def rounded(value: float, u: float, *others: float) -> tuple[str, ...]:
    """Texts of a value, its u and further uncertainties, to two significant digits of u (GUM 7.2.6).

    A dash stands for NaN, an unknown number.
    """
    if not (math.isfinite(value) and math.isfinite(u)) or u <= 0:
        return tuple("–" if math.isnan(x) else f"{x:.6g}" for x in (value, u, *others))
    first = Decimal(f"{u:.1e}").adjusted()  # power of ten of the first digit; 0.0996 rounds to 0.10
    if first >= -4 and max(abs(value), u) < 1e7:
        places = max(0, 1 - first)
        # + 0.0 takes the sign off a zero
        return tuple(f"{round(x, 1 - first) + 0.0:.{places}f}" for x in (value, u, *others))
    if -11 <= first < -4 and 1e-3 <= abs(value) < 1e7:  # 0.99999047, but 2.2e-07
        return (f"{round(value, 1 - first):.{1 - first}f}", *(f"{x:.1e}" for x in (u, *others)))
    if abs(value) < 1e308:  # one above may not be there when it is rounded
        value = round(value, 1 - first) + 0.0  # no digits below the last of u, also of a value smaller than u
    digits = min(max(0, Decimal(str(value)).adjusted() - first + 1), _DIGITS) if value else 0
    return (f"{value:.{digits}e}", *(f"{x:.1e}" for x in (u, *others)))


def concise(value: float, u: float) -> str:
    """A value with its u in brackets, in units of the last digits: ``0.1667(12)``, ``3.0(21)e-09``."""
    power = Decimal(f"{max(abs(value), u):.1e}").adjusted()
    if power < -5:
        return f"{concise(value / 10.0**power, u / 10.0**power)}e{power:03d}"
    first = Decimal(f"{u:.1e}").adjusted()
    places = max(0, 1 - first)
    return f"{round(value, 1 - first) + 0.0:.{places}f}({round(u * 10**places)})"


def short(value: float | None, digits: int = 2) -> str:
    """A number without an uncertainty, to so many digits after the first; a dash where there is none."""
    if value is None or not math.isfinite(value):
        return "–"
    if value and not 1e-4 <= abs(value) < 1e5:
        return f"{value:.1e}"
    return f"{value:.{digits + 1}g}" if abs(value) < 10 ** (digits + 1) else f"{value:.0f}"


#: key of the statistics of a filter -> in words
_STATISTICS = {
    "residual_rms": "root-mean-square normalised innovation, expected 1",
    "chi2": "normalised innovations squared, summed",
    "nis_mean": "normalised innovation squared (NIS), mean",
    "nis_expected": "NIS, expected",
    "nis_limit": "NIS, largest mean of a recording that fits the model",
    "steps": "steps from row to row",
    "samples": "rows",
    "angles": "rows with an angle",
    "starts": "starts of the filter",
}

_IN_SI = ("selfcal", "aoa", "calibrate strapdown")
"""Commands whose coefficients, or most of them, are in SI whatever the units of the recording."""


def units_shown(command: str, units: Sequence[str]) -> list[tuple[str, float]]:
    """Units of coefficients for people, and how many of the old each is."""
    return [(shown_unit if command in _IN_SI else sized_ratio)(unit) for unit in units]


def budget_shown(command: str, budget: tuple[BudgetItem, ...]) -> tuple[BudgetItem, ...]:
    """A budget with the uncertainties of its sources in units of the field."""
    if command not in _IN_SI:
        return budget
    return tuple(replace(item, u=u, unit=unit) for item in budget for u, unit in [sized(item.u, item.unit)])


def statistics_in_words(
    statistics: Mapping[str, float], result: Mapping[str, Any], timing: Mapping[str, float]
) -> dict[str, float]:
    """Statistics of a filter under keys for people, and what a row cost; those of a fit keep their keys."""
    words = dict(statistics)
    if "nis_mean" in words:
        words = {_STATISTICS.get(key, key): value for key, value in words.items()}
    if "step" in timing and "sample_interval" in result:
        words["time of a row_us"] = 1e6 * timing["step"]
        words["time of a row, of the sample interval_percent"] = (
            100.0 * timing["step"] / result["sample_interval"]
        )
    return words


def in_words(conditions: Mapping[str, Any]) -> dict[str, Any]:
    """Nested conditions for people: a temperature as text, angles and rates in degrees, which their keys then say."""
    words: dict[str, Any] = {}
    for key, value in conditions.items():
        if key == "temperature":
            words[key] = temperature(value)
        elif isinstance(value, Mapping):
            words[key] = in_words(value)
        elif key.endswith(("_rad", "_rad_s")) and value is not None:
            words[key.replace("_rad", "_deg")] = np.degrees(value).tolist()
        else:
            words[key] = value
    return words


def temperature(value: Mapping[str, Any] | str | None) -> str | None:
    """A temperature of the conditions as text: ``23.00(50) degC``, the standard uncertainty in the last digits."""
    if not isinstance(value, Mapping):
        return value
    number, u = rounded(value["value"], value["u"])
    return f"{number} {value['unit']}" if not value["u"] else f"{number} ± {u} {value['unit']}"
