"""A platform in gimbals, as all faces know it."""

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
    from inercal.systems.selfcal.settings import SelfcalSettings


def _read_study(data: Mapping[str, Any], path: str | Path) -> SelfcalSettings:
    from inercal.faces.studies.selfcal import selfcal_study

    return selfcal_study(data, path)


def _study_file() -> type[Strict]:
    from inercal.faces.studies.selfcal import SelfcalStudyFile

    return SelfcalStudyFile


def _new_study(channels: Channels) -> dict[str, Any]:
    from inercal.faces.studies.starting import selfcal_study

    return selfcal_study()


def _of_platform(channels: Channels) -> bool:
    return "th_x" in channels


def _calibrate(
    records: Sequence[Record], study: Study, compare: bool, progress: Callable[[str], None]
) -> Result:
    from inercal.systems.selfcal.verbs import calibrate

    return calibrate(records, study, compare, progress)


def _prepare(study: Study, compare: bool) -> None:
    from inercal.systems.selfcal.verbs import prepare

    prepare(study, compare)


def _simulate(study: Study, rng: np.random.Generator) -> Record:
    from inercal.systems.selfcal.verbs import simulate

    return simulate(study, rng)


def _design(study: Study) -> Result:
    from inercal.systems.selfcal.verbs import design

    return design(study)


def _prepare_design(study: Study) -> None:
    from inercal.systems.selfcal.verbs import prepare_design

    prepare_design(study)


def _stream(settings: SelfcalSettings, interval: float, say: Say, say_finding: SayFinding) -> Make:
    from inercal.faces.stream.estimators import selfcal

    return selfcal(settings, interval, say, say_finding)


def _foresight(settings: SelfcalSettings) -> Foresight:
    from inercal.systems.selfcal.before.foresight import foresight

    return foresight(settings)


def _verticals(settings: SelfcalSettings) -> Array:
    from inercal.systems.selfcal.before.foresight import verticals

    return verticals(settings)


def _rows(settings: SelfcalSettings) -> Sequence[Sequence[str]]:
    from inercal.systems.selfcal.before.path_design import stated_moves

    return stated_moves(settings.plan.moves) if settings.plan is not None else ()


def _named() -> Mapping[str, Mapping[str, Any]]:
    names = ("paper", "paper two turns", "best", "plain")
    return {name: {"plan.turns": None, "plan.path": name} for name in names}


def _cases() -> Sequence[Case]:
    from inercal.faces.validate.selfcal import CASES

    return CASES


SYSTEM = System(
    kind="selfcal",
    command="selfcal",
    title="platform in gimbals",
    of="for `inercal selfcal`",
    read_study=_read_study,
    study_file=_study_file,
    new_study=_new_study,
    first="simulate selfcal {study} --out simulated.csv",
    rigs=("three_axis_gimbals",),
    tells=_of_platform,
    complete=_of_platform,
    calibrate=_calibrate,
    prepare=_prepare,
    compares=True,
    simulate=_simulate,
    designs={"selfcal": OfferedDesign(_design, _prepare_design)},
    stream=_stream,
    streams="coefficients",
    foresight=_foresight,
    verticals=_verticals,
    plan=OfferedPlan(
        "selfcal",
        ".toml",
        "z, 180 deg (joint, angle, and a rate of its own) or rest, 60 s",
        _rows,
        key="plan.turns",
        others=("plan.path",),
        named=_named,
    ),
    cases=_cases,
    shows="self-calibration of a platform",
)
