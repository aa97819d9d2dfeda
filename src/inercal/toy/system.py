"""A toy, as all faces know it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from inercal.systems.contract import System

if TYPE_CHECKING:
    import numpy as np

    from inercal._toml import Strict
    from inercal.face.result import Result
    from inercal.face.study import Study
    from inercal.records.record import Record
    from inercal.toy.study import ToySettings


def _read_study(data: Mapping[str, Any], path: str | Path) -> ToySettings:
    from inercal.toy.study import toy_study

    return toy_study(data, path)


def _study_file() -> type[Strict]:
    from inercal.toy.study import ToyStudyFile

    return ToyStudyFile


def _calibrate(
    records: Sequence[Record], study: Study, compare: bool, say: Callable[[str], None]
) -> Result:
    from inercal.toy.verbs import calibrate

    return calibrate(records, study, compare, say)


def _simulate(study: Study, rng: np.random.Generator) -> Record:
    from inercal.toy.verbs import simulate

    return simulate(study, rng)


SYSTEM = System(
    kind="toy",
    command="calibrate toy",
    title="toy",
    of="of a toy",
    read_study=_read_study,
    study_file=_study_file,
    new_study=lambda channels: {"toy": {"mean": 1.0}},
    first="simulate toy {study} --out simulated.csv",
    table="toy",
    calibrate=_calibrate,
    simulate=_simulate,
)
