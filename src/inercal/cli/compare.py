"""``inercal compare``."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from inercal.cli.options import ReportOutput
from inercal.cli.outcome import WHOLE, hand_over

if TYPE_CHECKING:
    from inercal.estimate.result import Estimate

_CALIBRATION = "Calibration that `inercal calibrate` or `inercal selfcal` wrote to --out."


def compare(
    first: Annotated[Path, Parameter(help=_CALIBRATION)],
    second: Annotated[Path, Parameter(help="The later one, of the same instrument.")],
    /,
    *,
    output: ReportOutput = ReportOutput(),  # noqa: B008  (frozen)
) -> int:
    """Compare two calibrations of one instrument."""
    from inercal.estimate.compare import Saved
    from inercal.estimate.compare import compare as compared
    from inercal.estimate.files import load
    from inercal.records.read import source_of
    from inercal.report.comparison import page, table

    output.check(WHOLE, (first, second))
    clock = time.perf_counter()
    files = [Saved(load(path), str(path)) for path in (first, second)]
    inputs = (source_of(first), source_of(second))
    read = time.perf_counter()
    estimate = compared(*files)
    timing = {"read": read - clock, "solve": time.perf_counter() - read}
    estimate = replace(estimate, inputs=inputs, timing=timing)
    shown = _shown(estimate, files[0].estimate)
    return hand_over(estimate, [table(shown)], lambda: page(shown), output, "comparison")


def _shown(estimate: Estimate, first: Estimate) -> Estimate:
    """The comparison with its rows in the units in which the first calibration is shown."""
    lengths = ("first", "u_first", "second", "u_second", "difference", "u", "U")
    units, rows = first.shown_units(), []
    for row in estimate.result["coefficients"]:
        unit, size = units[row["name"]]
        rows.append({**row, **{key: row[key] / size for key in lengths}, "unit": unit})
    return replace(estimate, result={**estimate.result, "coefficients": rows})
