"""An estimate of a turntable for people: in units of the field, readings in that of the record, angles in arcsec."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from inercal.foundation.instruments.terms import shown_unit
from inercal.foundation.results.result import Estimate
from inercal.foundation.results.shown import aligned, in_words
from inercal.foundation.units import STANDARD_GRAVITY, Unit

_ARCSEC = np.radians(1.0 / 3600.0)


def displayed(estimate: Estimate, unit: Unit) -> Estimate:
    """The estimate with coefficients, budget, noise and residuals in the ``unit`` of the record.

    Drift per gravity is per unit g, as a study states it, and not per gravity of the site. Scopes and the like in
    ``result`` stay in SI; keys of statistics and ranges then name their unit.
    """
    gravity = float(estimate.conditions.get("site", {}).get("gravity_m_s2", STANDARD_GRAVITY))
    shown = [
        per_g(name, *_shown(text, unit), gravity)
        for name, text in zip(estimate.names, estimate.units, strict=True)
    ]
    return replace(
        estimate.in_units(shown),
        budget=tuple(
            replace(item, u=item.u / size, unit=text)
            for item in estimate.budget
            for text, size in [shown_unit(item.unit, unit)]
        ),
        statistics=_with_unit(estimate.statistics, "residual_rms", unit),
        conditions=_conditions(estimate.conditions, unit),
        result=_result(estimate.result, unit),
    )


def _shown(text: str, unit: Unit) -> tuple[str, float]:
    """Unit of a coefficient for people; inputs (a dead zone) are in ug whatever the output is in."""
    return shown_unit(text) if text == "m/s^2" != unit.si else shown_unit(text, unit)


def per_g(name: str, text: str, size: float, gravity: float) -> tuple[str, float]:
    """Unit and size of a term whose value is per power of the site's ``gravity`` [m/s^2], per power of g instead."""
    match = re.fullmatch("D[XY]_([XYZ]+)", name)
    if match is None:
        return text, size
    order = len(match[1])
    return f"{text}/g" + (f"^{order}" if order > 1 else ""), size * (gravity / STANDARD_GRAVITY) ** order


def _with_unit(values: Mapping[str, float], key: str, unit: Unit) -> dict[str, float]:
    """Numbers with that one in the unit of the record, which its key then names."""
    return {
        (f"{name} [{unit.symbol}]" if name == key else name): value / (unit.factor if name == key else 1.0)
        for name, value in values.items()
    }


def _conditions(conditions: Mapping[str, Any], unit: Unit) -> dict[str, Any]:
    """Conditions in words, with the ranges of readings in the unit of the record."""
    changed = in_words(conditions)
    if "ranges" in changed:
        changed["ranges"] = {
            (f"{name} [{unit.symbol}]" if name.startswith("reading_of_") else name): (
                [end / unit.factor for end in ends] if name.startswith("reading_of_") else ends
            )
            for name, ends in changed["ranges"].items()
        }
    return changed


def _result(result: Mapping[str, Any], unit: Unit) -> dict[str, Any]:
    """The result with noise and drift in the unit of the record and errors of the table in arcsec."""
    changed = dict(result)
    if "noise" in changed:
        changed["noise"] = [
            row
            | {
                key: None if row[key] is None else row[key] / unit.factor
                for key in ("noise", "within_dwells")
            }
            | {"unit": unit.symbol}
            for row in changed["noise"]  # of a file None where it was not known
        ]
    if "nuisances" in changed:
        changed["nuisances"] = [
            row | {"value": row["value"] / size, "u": row["u"] / size, "unit": text}
            for row in changed["nuisances"]
            for text, size in [shown_unit(row["unit"], unit)]
        ]
    if "table_errors" in changed:
        changed["table_errors"] = [
            {
                (f"{name.removesuffix('_rad')}_arcsec" if name.endswith("_rad") else name): (
                    value / _ARCSEC if name.endswith("_rad") else value
                )
                for name, value in row.items()
            }
            for row in changed["table_errors"]
        ]
    return changed


def tolerances(estimate: Estimate) -> str:
    """The largest error of the table for each coefficient, and the effect of halving it, as text.

    Empty where the table has no errors or nothing was fitted.
    """
    shares, halved = estimate.result.get("tolerance_shares", {}), estimate.result.get("halved", {})
    rows = []
    for name, of_table in shares.items():
        if of_table and halved:
            factor = max(of_table, key=lambda each: float(of_table[each]))
            rows.append((name, factor, f"{100.0 * of_table[factor]:.0f} %", f"{halved[factor][name]:.2f}"))
    if not rows:
        return ""
    head = ("", "largest error of the table", "of its part", "u x, if halved")
    return "\n".join(aligned([head, *rows], (0, 1)))
