"""A study, and a column map, to begin with: guessed from the recordings there are.

A test before it is made, in Python: the uncertainties that its plan makes expect, and where it stops.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from inercal.faces.python.study import Study
from inercal.foundation.arrays import Array
from inercal.foundation.designs.foresight import Foresight
from inercal.foundation.errors import StudyError
from inercal.systems.contract import System
from inercal.systems.imu.system import SYSTEM as IMU
from inercal.systems.listed import SYSTEMS

if TYPE_CHECKING:
    from inercal.foundation.units import Unit


PLANNED = tuple(kind for kind, system in SYSTEMS.items() if system.foresight)
"""Kinds of study that plan a test."""


def foresight(study: Study) -> Foresight:
    """Uncertainties that the plan of a study makes expect. Raises `StudyError` for a study without one."""
    if (found := study.system.foresight) is None:
        raise _without_plan(study)
    with study.at_fault():
        return found(study.settings)


def verticals(study: Study) -> Array:
    """Directions (r, 3) of the vertical on the instrument at each stop that a study plans; none of a model in motion.

    Raises `StudyError` for a study without a plan.
    """
    if (found := study.system.verticals) is None:
        raise _without_plan(study)
    with study.at_fault():
        return found(study.settings)


def _without_plan(study: Study) -> StudyError:
    """The refusal of a study that plans no test."""
    return StudyError(study.path or "study", f"found the kind {study.kind}, expected one with a plan")


def begun(
    kind: str,
    files: Sequence[Path],
    study: Path,
    map_file: Path,
    rate: str | None = None,
    overrides: Iterable[str] = (),
) -> tuple[str, str | None]:
    """A commented study of that kind, and a map of the recordings, None where their headers say what they hold.

    ``study`` and ``map_file`` are the paths that its words name; ``rate`` is the sample rate, as text with its unit,
    of recordings without times; ``overrides`` as of ``--set``. Raises `RecordError` and `StudyError`.
    """
    from inercal.faces.studies.template import template

    channels, column_map = _described(SYSTEMS[kind], files, rate)
    named = None if column_map is None else map_file
    return template(kind, files, study, named, channels, overrides), column_map


def kind_of_record(files: Sequence[Path]) -> str:
    """The kind of study that recordings with canonical headers are for: that of an IMU where they do not tell."""
    from inercal.foundation.records.read import canonical_units

    channels = canonical_units(list(files)) or {}
    return next((kind for kind, system in SYSTEMS.items() if system.tells(channels)), IMU.kind)


def _described(
    system: System, files: Sequence[Path], rate: str | None
) -> tuple[Mapping[str, Unit | None], str | None]:
    """Channels of the recordings, with their units where known, and a map where the headers do not say these."""
    from inercal.foundation.records.guess import guess_map
    from inercal.foundation.records.read import canonical_units

    if not files:
        return {}, None
    channels = canonical_units(files) or {}
    if system.complete(channels):
        return channels, None
    column_map = guess_map(files, **system.guess, rate=rate)
    return dict.fromkeys(mapped(column_map)), column_map


def mapped(column_map: str) -> list[str]:
    """The channels of a map."""
    data = tomllib.loads(column_map)
    parts = [data, *(part for part in data.get("file", {}).values() if isinstance(part, dict))]
    return [name for part in parts for name in part.get("columns", ())]
