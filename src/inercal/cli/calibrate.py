"""``inercal calibrate``."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from inercal.cli.options import (
    Files,
    MapFile,
    Overrides,
    ReportOutput,
    RunFiles,
    StudyFile,
    of_study,
    read_record,
    read_repeats,
    working,
)
from inercal.cli.outcome import WHOLE, hand_over, printed

if TYPE_CHECKING:
    from inercal.estimate.result import Estimate
    from inercal.imu.aided.calibration import AidedCalibration
    from inercal.imu.ferraris.calibration import FerrarisCalibration
    from inercal.imu.multiposition import Calibration
    from inercal.records.record import Record
    from inercal.report.html import Picture


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
    files: RunFiles,
    /,
    *,
    study: StudyFile,
    map_file: MapFile = None,
    overrides: Overrides = None,
    output: ReportOutput = ReportOutput(),  # noqa: B008  (frozen)
) -> int:
    """Calibrate an IMU held by hand, set on its sides and turned, or turned by a table."""
    from inercal.estimate.repeat import combine_runs
    from inercal.imu.task import calibrate
    from inercal.studies.load import load_imu_study

    solved = _solve(
        files,
        study,
        map_file,
        output,
        lambda: load_imu_study(study, overrides or ()),
        read_repeats,
        calibrate,
    )
    runs = [estimate for _, estimate in solved]
    estimate = runs[0] if len(runs) == 1 else combine_runs(runs)
    estimate = replace(estimate, timing={**runs[-1].timing, "solve": estimate.timing["solve"]})

    def page() -> str:
        from inercal.report.figures import repeats
        from inercal.report.html import render

        drawn = _imu_pictures(solved[0][0]) if len(runs) == 1 else repeats(estimate)
        return render(estimate.shown(), drawn, "Calibration of an inertial measurement unit")

    return hand_over(estimate, [printed(estimate.shown())], page, output)


def _imu_pictures(found: Calibration | FerrarisCalibration | AidedCalibration) -> list[Picture]:
    """The pictures of whichever method was used."""
    from inercal.imu.aided.calibration import AidedCalibration
    from inercal.imu.ferraris.calibration import FerrarisCalibration

    match found:
        case FerrarisCalibration():
            from inercal.imu.ferraris.figures import pictures as of_ferraris

            return of_ferraris(found)
        case AidedCalibration():
            from inercal.imu.aided.figures import pictures as of_aided

            return of_aided(found)
        case _:
            from inercal.imu.figures import pictures

            return pictures(found)


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
    from inercal.studies.load import load_turntable_study
    from inercal.turntable.display import tolerances
    from inercal.turntable.task import Calibration, calibrate

    ((found, estimate),) = _solve(
        files,
        study,
        map_file,
        output,
        lambda: load_turntable_study(study, overrides or ()),
        lambda *one: [read_record(*one)],
        calibrate,
    )
    shown = replace(found, estimate=estimate).shown

    def page() -> str:
        from inercal.report.html import render
        from inercal.turntable.figures import pictures, rate_pictures

        drawn = pictures(found) if isinstance(found, Calibration) else rate_pictures(found)
        return render(shown, drawn, "Calibration on a turntable")

    return hand_over(estimate, [printed(shown), tolerances(estimate)], page, output)


def _solve(
    files: list[Path],
    study: Path,
    map_file: Path | None,
    output: ReportOutput,
    settings: Callable[[], S],
    read: Callable[[Sequence[Path], Path | None, ReportOutput], list[Record]],
    calibrate: Callable[[Record, S, Callable[[str], None]], C],
) -> list[tuple[C, Estimate]]:
    """Read study and records and calibrate with each; the estimates come with their times and inputs."""
    from inercal.records.read import source_of
    from inercal.studies.load import files_of

    output.check(WHOLE, (*files, map_file, study))
    told = settings()
    studied = files_of(study, told.given)
    output.spare(studied)
    clock = time.perf_counter()
    records = read(files, map_file, output)
    read_s = time.perf_counter() - clock
    solved = []
    with of_study(study), working(output) as progress:
        for number, record in enumerate(records, start=1):
            of_run = f"run {number} of {len(records)}: " if len(records) > 1 else ""
            found = calibrate(record, told, lambda text, of_run=of_run: progress(of_run + text))  # type: ignore[misc]
            estimate = found.estimate
            timing = {"read": read_s, "solve": estimate.timing["solve"]}
            inputs = (*estimate.inputs, *map(source_of, studied))
            solved.append((found, replace(estimate, timing=timing, inputs=inputs)))
    return solved
