"""Two calibrations compared, as a result: differences in the units of the command line."""

from __future__ import annotations

from dataclasses import replace

from inercal.estimate.result import Estimate
from inercal.face.result import Result, View


def of_comparison(estimate: Estimate, command: str) -> Result:
    """The comparison of two calibrations that ``command`` made, as a result."""
    from inercal.report.comparison import page, picture, table

    shown = _of_field(estimate) if command == "selfcal" else estimate
    view = View(
        shown,
        estimate.message,
        lambda: [table(shown)],
        lambda: page(shown),
        lambda: picture(shown),
    )
    return Result(estimate, view)


def _of_field(estimate: Estimate) -> Estimate:
    """The comparison of two self-calibrations in deg/h, arcsec, ug and ppm."""
    from inercal.selfcal.display import shown_unit

    lengths = ("first", "u_first", "second", "u_second", "difference", "u", "U")
    rows = []
    for row in estimate.result["coefficients"]:
        unit, size = shown_unit(row["unit"])
        rows.append({**row, **{key: row[key] / size for key in lengths}, "unit": unit})
    of_field = estimate.in_units([shown_unit(unit) for unit in estimate.units])
    return replace(of_field, result={**estimate.result, "coefficients": rows})
