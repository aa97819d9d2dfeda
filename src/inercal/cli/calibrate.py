"""``inercal calibrate``."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from inercal.cli import process_age
from inercal.cli.options import (
    Files,
    MapFile,
    Overrides,
    ReportOutput,
    StudyFile,
    of_study,
    read_record,
    working,
)
from inercal.cli.outcome import hand_over

if TYPE_CHECKING:
    from inercal.estimate.result import Estimate
    from inercal.records.record import Record


class Calibrated(Protocol):
    """What the calibration of any system brings back."""

    @property
    def estimate(self) -> Estimate:
        """The estimate."""


class Settings(Protocol):
    """What any study tells."""

    @property
    def given(self) -> Mapping[str, Any]:
        """Its keys as they were given."""


S = TypeVar("S", bound=Settings)
C = TypeVar("C", bound=Calibrated)


def calibrate_imu(
    files: Files,
    /,
    *,
    study: StudyFile,
    map_file: MapFile = None,
    overrides: Overrides = None,
    output: ReportOutput = ReportOutput(),  # noqa: B008  (frozen)
) -> int:
    """Calibrate an IMU that was held still in many poses by hand."""
    from inercal.imu.task import calibrate
    from inercal.study.load import load_imu_study

    found, estimate = _solve(
        files, study, map_file, output, lambda: load_imu_study(study, overrides or ()), calibrate
    )

    def page() -> str:
        from inercal.imu.figures import pictures
        from inercal.report.html import render

        return render(estimate, pictures(found), "Calibration of an inertial measurement unit")

    return hand_over(estimate, estimate, page, output, estimate.status.advice)


def calibrate_turntable(
    files: Files,
    /,
    *,
    study: StudyFile,
    map_file: MapFile = None,
    overrides: Overrides = None,
    output: ReportOutput = ReportOutput(),  # noqa: B008  (frozen)
) -> int:
    """Calibrate an instrument that was taken through positions on a turntable."""
    from inercal.study.load import load_turntable_study
    from inercal.turntable.display import tolerances
    from inercal.turntable.task import Calibration, calibrate

    found, estimate = _solve(
        files, study, map_file, output, lambda: load_turntable_study(study, overrides or ()), calibrate
    )
    shown = replace(found, estimate=estimate).shown

    def page() -> str:
        from inercal.report.html import render
        from inercal.turntable.figures import pictures, rate_pictures

        drawn = pictures(found) if isinstance(found, Calibration) else rate_pictures(found)
        return render(shown, drawn, "Calibration on a turntable")

    return hand_over(estimate, shown, page, output, table=tolerances(estimate))


def _solve(
    files: list[Path],
    study: Path,
    map_file: Path | None,
    output: ReportOutput,
    settings: Callable[[], S],
    calibrate: Callable[[Record, S, Callable[[str], None]], C],
) -> tuple[C, Estimate]:
    """Read study and record and calibrate; the estimate comes with its times and inputs."""
    from inercal.records.read import source_of
    from inercal.study.load import files_of

    output.check((".json", ".toml"), (*files, map_file, study))
    told = settings()
    studied = files_of(study, told.given)
    output.spare(studied)
    clock = time.perf_counter()
    record = read_record(files, map_file, output)
    read_s = time.perf_counter() - clock
    with of_study(study), working(output) as progress:
        found = calibrate(record, told, progress)
    estimate = found.estimate
    timing = {"read": read_s, "solve": estimate.timing["solve"], "total": process_age()}
    return found, replace(estimate, timing=timing, inputs=(*estimate.inputs, *map(source_of, studied)))
