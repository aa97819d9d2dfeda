"""Two calibrations compared, as a result: differences in the units of the command line."""

from __future__ import annotations

from dataclasses import replace

from inercal.estimate.result import Estimate
from inercal.face.result import Result, View


def of_comparison(estimate: Estimate, first: Estimate) -> Result:
    """The comparison of a calibration with the ``first`` as a result, in the units in which that is shown."""
    from inercal.report.comparison import page, picture, table

    shown = _shown(estimate, first)
    view = View(
        shown,
        estimate.message,
        lambda: [table(shown)],
        lambda: page(shown),
        lambda: picture(shown),
    )
    return Result(estimate, view)


def _shown(estimate: Estimate, first: Estimate) -> Estimate:
    """The comparison with its rows in the units in which the first calibration is shown."""
    lengths = ("first", "u_first", "second", "u_second", "difference", "u", "U")
    units, rows = first.shown_units(), []
    for row in estimate.result["coefficients"]:
        unit, size = units[row["name"]]
        rows.append({**row, **{key: row[key] / size for key in lengths}, "unit": unit})
    of_field = estimate.in_units([units[name] for name in estimate.names])
    return replace(of_field, result={**estimate.result, "coefficients": rows})
