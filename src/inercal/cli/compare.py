"""``inercal compare``."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from inercal.cli import process_age
from inercal.cli.options import ReportOutput
from inercal.cli.outcome import hand_over

_CALIBRATION = "Calibration that `inercal calibrate --out` wrote."


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
    from inercal.estimate.exchange import load
    from inercal.records.read import source_of
    from inercal.report.comparison import page, table

    output.check((".json", ".toml"), (first, second))
    clock = time.perf_counter()
    files = [Saved(load(path), str(path)) for path in (first, second)]
    inputs = (source_of(first), source_of(second))
    read = time.perf_counter()
    estimate = compared(*files)
    timing = {"read": read - clock, "solve": time.perf_counter() - read, "total": process_age()}
    estimate = replace(estimate, inputs=inputs, timing=timing)
    return hand_over(estimate, [table(estimate)], lambda: page(estimate), output, "comparison")
