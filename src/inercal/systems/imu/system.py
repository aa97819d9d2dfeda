"""An inertial measurement unit, as all faces know it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from inercal.systems.contract import Channels, OfferedDesign, System

if TYPE_CHECKING:
    import numpy as np

    from inercal.faces.python.result import Result
    from inercal.faces.python.study import Study
    from inercal.faces.stream.estimators import Make, Say, SayFinding
    from inercal.faces.validate.case import Case
    from inercal.foundation._toml import Strict
    from inercal.foundation.findings import Finding
    from inercal.foundation.records.record import Record
    from inercal.systems.imu.settings import ImuSettings


def _read_study(data: Mapping[str, Any], path: str | Path) -> ImuSettings:
    from inercal.faces.studies.imu import imu_study

    return imu_study(data, path)


def _study_file() -> type[Strict]:
    from inercal.faces.studies.imu import ImuStudyFile

    return ImuStudyFile


def _new_study(channels: Channels) -> dict[str, Any]:
    from inercal.faces.studies.starting import imu_study

    return imu_study(channels)


def _sections(records: Sequence[Record]) -> tuple[str, tuple[Finding, ...]] | None:
    from inercal.systems.imu.sections.beginning import beginning

    return beginning(records)


def _counted(settings: ImuSettings) -> bool:
    from inercal.systems.imu.task import in_rows

    return in_rows(settings)


def _calibrate(
    records: Sequence[Record], study: Study, compare: bool, progress: Callable[[str], None]
) -> Result:
    from inercal.systems.imu.verbs import calibrate

    return calibrate(records, study, compare, progress)


def _simulate(study: Study, rng: np.random.Generator) -> Record:
    from inercal.systems.imu.verbs import simulate

    return simulate(study, rng)


def _design(study: Study) -> Result:
    from inercal.systems.imu.verbs import design

    return design(study)


def _stream(settings: ImuSettings, interval: float, say: Say, say_finding: SayFinding) -> Make:
    from inercal.faces.stream.estimators import monitor

    return monitor(interval, say)


def _cases() -> Sequence[Case]:
    from inercal.faces.validate.imu import CASES

    return CASES


SYSTEM = System(
    kind="imu",
    command="calibrate imu",
    title="IMU by hand, on its sides, or on a table",
    of="for `inercal calibrate imu`",
    read_study=_read_study,
    study_file=_study_file,
    new_study=_new_study,
    sections=_sections,
    first="calibrate imu {files}",
    table="imu",
    counted=_counted,
    calibrate=_calibrate,
    simulate=_simulate,
    designs={"sections": OfferedDesign(_design)},
    stream=_stream,
    streams="rest and noise",
    converts=True,
    cases=_cases,
    shows="calibration of IMUs, and conversion to other tools",
)
