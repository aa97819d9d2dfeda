"""A strapdown unit, as all faces know it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from inercal.systems.contract import Channels, OfferedDesign, OfferedPlan, System

if TYPE_CHECKING:
    import numpy as np

    from inercal.faces.python.result import Result
    from inercal.faces.python.study import Study
    from inercal.faces.stream.estimators import Make, Say, SayFinding
    from inercal.faces.validate.case import Case
    from inercal.foundation._toml import Strict
    from inercal.foundation.arrays import Array
    from inercal.foundation.designs.foresight import Foresight
    from inercal.foundation.records.record import Record
    from inercal.systems.strapdown.settings import StrapdownSettings


def _read_study(data: Mapping[str, Any], path: str | Path) -> StrapdownSettings:
    from inercal.faces.studies.strapdown import strapdown_study

    return strapdown_study(data, path)


def _study_file() -> type[Strict]:
    from inercal.faces.studies.strapdown import StrapdownStudyFile

    return StrapdownStudyFile


def _new_study(channels: Channels) -> dict[str, Any]:
    from inercal.faces.studies.starting import strapdown_study

    return strapdown_study()


def _calibrate(
    records: Sequence[Record], study: Study, compare: bool, progress: Callable[[str], None]
) -> Result:
    from inercal.systems.strapdown.verbs import calibrate

    return calibrate(records, study, compare, progress)


def _prepare(study: Study, compare: bool) -> None:
    from inercal.systems.strapdown.verbs import prepare

    prepare(study, compare)


def _simulate(study: Study, rng: np.random.Generator) -> Record:
    from inercal.systems.strapdown.verbs import simulate

    return simulate(study, rng)


def _design(study: Study) -> Result:
    from inercal.systems.strapdown.verbs import design

    return design(study)


def _prepare_design(study: Study) -> None:
    from inercal.systems.strapdown.verbs import prepare_design

    prepare_design(study)


def _stream(settings: StrapdownSettings, interval: float, say: Say, say_finding: SayFinding) -> Make:
    from inercal.faces.stream.estimators import strapdown

    return strapdown(settings, interval, say, say_finding)


def _foresight(settings: StrapdownSettings) -> Foresight:
    from inercal.systems.strapdown.before.foresight import foresight

    return foresight(settings)


def _verticals(settings: StrapdownSettings) -> Array:
    from inercal.systems.strapdown.before.foresight import verticals

    return verticals(settings)


def _rows(settings: StrapdownSettings) -> Sequence[Sequence[str]]:
    from inercal.systems.strapdown.before.design import stated_turns

    return stated_turns(settings.plan) if settings.plan is not None else ()


def _named() -> Mapping[str, Mapping[str, Any]]:
    from inercal.systems.strapdown.before.design import nineteen

    return {"19 positions": {"plan.start": ["0 deg", "-90 deg", "0 deg"], "plan.turns": nineteen()}}


def _cases() -> Sequence[Case]:
    from inercal.faces.validate.strapdown import CASES

    return CASES


SYSTEM = System(
    kind="strapdown",
    command="calibrate strapdown",
    title="strapdown unit in rests and turns",
    of="of a strapdown unit",
    read_study=_read_study,
    study_file=_study_file,
    new_study=_new_study,
    first="simulate strapdown {study} --out simulated.csv",
    table="strapdown",
    complete=lambda channels: {"acc_x", "gyro_x"} <= set(channels),
    calibrate=_calibrate,
    prepare=_prepare,
    simulate=_simulate,
    designs={"strapdown": OfferedDesign(_design, _prepare_design)},
    stream=_stream,
    streams="coefficients",
    foresight=_foresight,
    verticals=_verticals,
    plan=OfferedPlan(
        "strapdown",
        ".toml",
        "y, 90 deg (axis of the unit, angle)",
        _rows,
        key="plan.turns",
        named=_named,
    ),
    converts=True,
    cases=_cases,
    shows="calibration of strapdown units",
)
