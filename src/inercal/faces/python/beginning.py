"""A study to begin with, a column map and a table of sections, guessed from the recordings."""

from __future__ import annotations

import tempfile
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from inercal.foundation.errors import InputError
from inercal.systems.contract import System
from inercal.systems.imu.system import SYSTEM as IMU
from inercal.systems.listed import SYSTEMS

if TYPE_CHECKING:
    from inercal.faces.python.study import Study
    from inercal.foundation.findings import Finding
    from inercal.foundation.records.record import Record
    from inercal.foundation.units import Unit


def begun(
    kind: str,
    files: Sequence[Path],
    study: Path,
    map_file: Path,
    rate: str | None = None,
    overrides: Iterable[str] = (),
    answers: Mapping[str, str] | None = None,
) -> tuple[str, str | None]:
    """A commented study of that kind, and a map of the recordings, None where their headers say what they hold.

    ``study`` and ``map_file`` are the paths that its words name; ``rate`` is the sample rate, as text with its unit,
    of recordings without times; ``overrides`` as of ``--set``; ``answers`` as of ``--answer``. Raises `InputError`.
    """
    from inercal.faces.studies.template import template

    channels, column_map = _described(SYSTEMS[kind], files, rate, answers)
    named = None if column_map is None else map_file
    return template(kind, files, study, named, channels, overrides), column_map


def sections_of(
    kind: str, files: Sequence[Path], column_map: str | None
) -> tuple[str, tuple[Finding, ...]] | None:
    """The table of sections of recordings, as text, and what is asked about it; ``column_map`` is that of `begun`.

    None where they are not evaluated by sections, or cannot be read until the map is corrected.
    """
    from inercal.foundation._files import write_text
    from inercal.foundation.records.read import read_runs

    sections = SYSTEMS[kind].sections
    if sections is None or not files:
        return None
    with tempfile.TemporaryDirectory() as folder:
        map_file = None if column_map is None else Path(folder) / "map.toml"
        if map_file is not None and column_map is not None:
            write_text(map_file, column_map)
        try:
            return sections(read_runs(files, map_file, counted=True))
        except InputError:
            return None


def study_for(kind: str, records: Sequence[Record], overrides: Iterable[str]) -> tuple[Study, str]:
    """The study of records without one, and in words what it is: the one that `begun` would write, and ``overrides``.

    Raises `InputError` where no latitude or gravity is among these.
    """
    from inercal.faces.python.study import Study
    from inercal.faces.studies.load import put
    from inercal.faces.studies.starting import UNKNOWN

    system = SYSTEMS[kind]
    keys = system.new_study(
        {name: column.unit for name, column in records[0].columns.items()} | _labelled(records)
    )
    told = None if system.sections is None else system.sections(records)
    if told is not None:
        keys[system.table] = {"method": "sections"}
    for override in overrides:
        put(keys, override, Path())
    if keys["site"].get("latitude") == UNKNOWN:
        raise InputError("--latitude", 'missing, expected it where there is no --study, such as "48 deg"')
    method = keys[system.table].get("method")
    found = f", {told[0].count(chr(10)) - 1} sections found" if told and method == "sections" else ""
    return Study(kind, system.read_study(keys, "study")), f"method {method}{found}"


def _labelled(records: Sequence[Record]) -> dict[str, None]:
    """The channel of labels, where records have some."""
    return {"label": None} if any(record.labels for record in records) else {}


def kind_of_record(files: Sequence[Path]) -> str:
    """The kind of study that recordings with canonical headers are for: that of an IMU where they do not tell."""
    from inercal.foundation.records.read import canonical_units

    channels = canonical_units(list(files)) or {}
    return next((kind for kind, system in SYSTEMS.items() if system.tells(channels)), IMU.kind)


def _described(
    system: System, files: Sequence[Path], rate: str | None, answers: Mapping[str, str] | None
) -> tuple[Mapping[str, Unit | None], str | None]:
    """Channels of the recordings, with their units where known, and a map where the headers do not say these."""
    from inercal.foundation.records.read import canonical_units
    from inercal.foundation.records.recognise.map_text import guess_map

    if not files:
        return {}, None
    channels = canonical_units(files) or {}
    if system.complete(channels):
        return channels, None
    column_map = guess_map(files, **system.guess, rate=rate, answers=answers)
    return dict.fromkeys(mapped(column_map)), column_map


def mapped(column_map: str) -> list[str]:
    """The channels of a map."""
    return [name for columns in _tables(column_map) for name in columns]


def asked_in(column_map: str) -> list[str]:
    """Of each sensor of a map how sure it is and why, or what is asked and how to answer it, a line each."""
    from inercal.foundation.records.channels import sensor_and_axis

    lines: dict[str, str] = {}
    for columns in _tables(column_map):
        for name, entry in columns.items():
            sensor, grade = sensor_and_axis(name)[0], entry.get("grade")
            words = f"{sensor}: {grade}, {entry.get('because')}"
            if grade == "guess":
                answer = f'--answer "{sensor}={entry["unit"]}" or another unit'
                words = f"{sensor}: {entry.get('question')} Answer it with {answer}"
            if grade:
                lines.setdefault(sensor, words)
    return list(lines.values())


def _tables(column_map: str) -> list[Mapping[str, Any]]:
    """The tables of columns of a map."""
    data = tomllib.loads(column_map)
    parts = [data, *(part for part in data.get("file", {}).values() if isinstance(part, dict))]
    return [part.get("columns", {}) for part in parts]
