"""``inercal compare``."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from inercal.cli.options import ReportOutput
from inercal.cli.outcome import WHOLE, give

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
    from inercal.face.comparison import of_comparison
    from inercal.records.read import source_of

    output.check(WHOLE, (first, second))
    clock = time.perf_counter()
    files = [Saved(load(path), str(path)) for path in (first, second)]
    inputs = (source_of(first), source_of(second))
    read = time.perf_counter()
    estimate = compared(*files)
    timing = {"solve": time.perf_counter() - read}
    result = of_comparison(replace(estimate, inputs=inputs, timing=timing), files[0].estimate)
    return give(result, output, read - clock, "comparison")
