"""An estimate in the units and words that people use; everything behind it stays in SI."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from inercal.foundation.instruments.terms import shown_unit, sized, sized_ratio
from inercal.foundation.results.budget import BudgetItem
from inercal.foundation.results.rounding import rounded

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
