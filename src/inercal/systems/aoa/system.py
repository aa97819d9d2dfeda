"""A wind-tunnel model on a sting, as all faces know it."""

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
    from inercal.foundation.results.result import Estimate
    from inercal.systems.aoa.settings import AoaSettings


def _read_study(data: Mapping[str, Any], path: str | Path) -> AoaSettings:
    from inercal.faces.studies.aoa import aoa_study

    return aoa_study(data, path)


def _study_file() -> type[Strict]:
    from inercal.faces.studies.aoa import AoaStudyFile

    return AoaStudyFile


def _new_study(channels: Channels) -> dict[str, Any]:
    from inercal.faces.studies.starting import aoa_study

    return aoa_study()


def _of_model(channels: Channels) -> bool:
    return "a1" in channels


def _calibrate(
    records: Sequence[Record], study: Study, compare: bool, progress: Callable[[str], None]
) -> Result:
    from inercal.systems.aoa.verbs import calibrate

    return calibrate(records, study, compare, progress)


def _prepare(study: Study, compare: bool) -> None:
    from inercal.systems.aoa.verbs import prepare

    prepare(study, compare)


def _simulate(study: Study, rng: np.random.Generator) -> Record:
    from inercal.systems.aoa.verbs import simulate

    return simulate(study, rng)


def _runs(
    table: str | Path,
    study: Study,
    read: Callable[[Path], Record],
    compare: bool,
    progress: Callable[[str], None],
) -> Result:
    from inercal.systems.aoa.verbs import runs

    return runs(table, study, read, compare, progress)


def _design(study: Study) -> Result:
    from inercal.systems.aoa.verbs import design

    return design(study)


def _prepare_design(study: Study) -> None:
    from inercal.systems.aoa.verbs import prepare_design

    prepare_design(study)


def _stream(settings: AoaSettings, interval: float, say: Say, say_finding: SayFinding) -> Make:
    from inercal.faces.stream.estimators import aoa

    return aoa(settings, interval, say, say_finding)


def _loaded(estimate: Estimate) -> Result:
    from inercal.systems.aoa.verbs import loaded

    return loaded(estimate)


def _foresight(settings: AoaSettings) -> Foresight:
    from inercal.systems.aoa.foresight import foresight

    return foresight(settings)


def _verticals(settings: AoaSettings) -> Array:
    from inercal.systems.aoa.foresight import verticals

    return verticals(settings)


def _rows(settings: AoaSettings) -> Sequence[Sequence[str]]:
    given = settings.given.get("sensors", {})
    return [
        [name, str(each["axis"]), str(each.get("r", "0 m"))] for name, each in given.items() if "axis" in each
    ]


def _sensors(rows: Sequence[Sequence[str]], given: Mapping[str, Any]) -> Mapping[str, Any]:
    """Keys of the accelerometers of these lines; those of ``given`` that are in none are taken out."""
    from inercal.foundation.errors import InputError

    wrong = [", ".join(row) for row in rows if len(row) != 3]
    if wrong:
        raise InputError("sensors", f"found {wrong[0]!r}, expected name, axis, place such as {_LINE}")
    sensors = given.get("sensors", {})
    names = {row[0] for row in rows}
    gone = {f"sensors.{name}": None for name in sensors if "axis" in sensors[name] and name not in names}
    stated = {f"sensors.{name}": {"axis": axis, "r": place} for name, axis, place in rows}
    return gone | {f"{at}.{key}": word for at, keys in stated.items() for key, word in keys.items()}


_LINE = "a1, -z, -0.25 m (name, axis, place ahead of the pivot)"


def _cases() -> Sequence[Case]:
    from inercal.faces.validate.aoa import CASES

    return CASES


SYSTEM = System(
    kind="aoa",
    command="aoa",
    title="wind-tunnel model on a sting",
    of="for `inercal aoa`",
    read_study=_read_study,
    study_file=_study_file,
    new_study=_new_study,
    first="simulate aoa {study} --out simulated.csv",
    rigs=("sting",),
    unread="motion",
    unsimulated="estimator",
    tells=_of_model,
    complete=_of_model,
    guess={"of_model": True},
    calibrate=_calibrate,
    prepare=_prepare,
    compares=True,
    simulate=_simulate,
    runs=_runs,
    designs={"aoa": OfferedDesign(_design, _prepare_design)},
    stream=_stream,
    streams="angle",
    loaded=_loaded,
    foresight=_foresight,
    verticals=_verticals,
    plan=OfferedPlan("aoa", "", _LINE, _rows, keys=_sensors),
    cases=_cases,
    shows="angle of attack",
)
