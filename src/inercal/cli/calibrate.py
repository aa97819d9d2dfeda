"""``inercal calibrate``."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from inercal.cli.options import (
    MapFile,
    Overrides,
    ReportOutput,
    RunFiles,
    Span,
    StudyFile,
    read_repeats,
    working,
)
from inercal.cli.outcome import WHOLE, give


def calibrate_imu(
    files: RunFiles,
    /,
    *,
    study: StudyFile,
    map_file: MapFile = None,
    span: Span = Span(),  # noqa: B008  (frozen)
    overrides: Overrides = None,
    output: ReportOutput = ReportOutput(),  # noqa: B008  (frozen)
) -> int:
    """Calibrate an IMU held by hand, set on its sides and turned, or turned by a table."""
    from inercal.imu.task import in_rows

    return _calibrated("imu", files, study, map_file, span, overrides, output, in_rows)


def calibrate_turntable(
    files: RunFiles,
    /,
    *,
    study: StudyFile,
    map_file: MapFile = None,
    span: Span = Span(),  # noqa: B008  (frozen)
    overrides: Overrides = None,
    output: ReportOutput = ReportOutput(),  # noqa: B008  (frozen)
) -> int:
    """Calibrate an instrument that was taken through positions on a turntable."""
    return _calibrated("turntable", files, study, map_file, span, overrides, output)


def _calibrated(
    kind: str,
    files: list[Path],
    study: Path,
    map_file: Path | None,
    span: Span,
    overrides: list[str] | None,
    output: ReportOutput,
    in_rows: Callable[[Any], bool] = lambda _: False,
) -> int:
    """Read study and records, calibrate, and hand over; ``in_rows`` of the settings: the rows need no times."""
    from importlib import import_module

    from inercal.face.study import read_study

    output.check(WHOLE, (*files, map_file, study))
    the_study = read_study(kind, study, overrides or ())
    output.spare(the_study.files)
    clock = time.perf_counter()
    records = read_repeats(files, map_file, output, span, in_rows(the_study.settings))
    read_s = time.perf_counter() - clock
    system = import_module(f"inercal.face.{kind}")
    with working(output) as progress:
        result = system.calibrate(records, the_study, progress=progress)
    return give(result, output, read_s)
