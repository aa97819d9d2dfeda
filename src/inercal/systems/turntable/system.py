"""An instrument on a turntable, as all faces know it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from inercal.systems.contract import Channels, OfferedDesign, OfferedPlan, System

if TYPE_CHECKING:
    import numpy as np

    from inercal.faces.python.result import Result
    from inercal.faces.python.study import Study
    from inercal.faces.validate.case import Case
    from inercal.foundation._toml import Strict
    from inercal.foundation.arrays import Array
    from inercal.foundation.designs.foresight import Foresight
    from inercal.foundation.records.record import Record
    from inercal.foundation.results.result import Estimate
    from inercal.systems.turntable.settings import TurntableSettings


def _read_study(data: Mapping[str, Any], path: str | Path) -> TurntableSettings:
    from inercal.faces.studies.turntable import turntable_study

    return turntable_study(data, path)


def _study_file() -> type[Strict]:
    from inercal.faces.studies.turntable import TurntableStudyFile

    return TurntableStudyFile


def _new_study(channels: Channels) -> dict[str, Any]:
    from inercal.faces.studies.starting import turntable_study

    return turntable_study(channels)


def _complete(channels: Channels) -> bool:
    from inercal.foundation.records.channels import of_a_table

    return of_a_table(channels)


def _calibrate(
    records: Sequence[Record], study: Study, compare: bool, progress: Callable[[str], None]
) -> Result:
    from inercal.systems.turntable.verbs import calibrate

    return calibrate(records, study, compare, progress)


def _simulate(study: Study, rng: np.random.Generator) -> Record:
    from inercal.systems.turntable.verbs import simulate

    return simulate(study, rng)


def _positions(study: Study) -> Result:
    from inercal.systems.turntable.verbs import design

    return design(study)


def _tolerances(study: Study) -> Result:
    from inercal.systems.turntable.verbs import design_tolerances

    return design_tolerances(study)


def _sensitivity(study: Study) -> Result:
    from inercal.systems.turntable.verbs import sensitivity

    return sensitivity(study)


def _loaded(estimate: Estimate) -> Result:
    from inercal.systems.turntable.verbs import loaded

    return loaded(estimate)


def _foresight(settings: TurntableSettings) -> Foresight:
    from inercal.systems.turntable.positions.foresight import foresight

    return foresight(settings)


def _verticals(settings: TurntableSettings) -> Array:
    from inercal.systems.turntable.positions.foresight import verticals

    return verticals(settings)


def _rows(settings: TurntableSettings) -> Sequence[Sequence[str]]:
    from inercal.systems.turntable.positions.foresight import stated_positions

    return stated_positions(settings)


_POSITIONS = ("positions.plan", "positions.grid", "positions.list", "positions.file")
"""Keys of a study of which one says the positions."""


def _named() -> Mapping[str, Mapping[str, Any]]:
    from inercal.foundation.rigs.plans import NAMED

    return {name: {**dict.fromkeys(_POSITIONS), "positions.plan": name} for name in NAMED}


def _cases() -> Sequence[Case]:
    from inercal.faces.validate.turntable import CASES

    return CASES


SYSTEM = System(
    kind="turntable",
    command="calibrate turntable",
    title="instrument on a turntable",
    of="of a turntable",
    read_study=_read_study,
    study_file=_study_file,
    new_study=_new_study,
    first="sensitivity {study}",
    rigs=("two_axis_turntable", "three_axis_turntable"),
    tells=lambda channels: _complete(channels) and "acc_x" not in channels,
    complete=_complete,
    guess={"on_table": True},
    calibrate=_calibrate,
    simulate=_simulate,
    designs={"positions": OfferedDesign(_positions), "tolerances": OfferedDesign(_tolerances)},
    sensitivity=_sensitivity,
    loaded=_loaded,
    foresight=_foresight,
    verticals=_verticals,
    plan=OfferedPlan(
        "positions",
        ".csv",
        "90, 45 (angles of the axes in deg, outer first)",
        _rows,
        key="positions.list",
        others=_POSITIONS,
        named=_named,
    ),
    cases=_cases,
    shows="sensitivity, design and calibration on a turntable",
)
