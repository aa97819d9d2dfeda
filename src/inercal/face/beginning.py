"""A study, and a column map, to begin with: guessed from the recordings there are."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from inercal.studies.template import Kind
    from inercal.units import Unit


def begun(
    kind: Kind,
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
    from inercal.studies.template import template

    channels, column_map = _described(kind, files, rate)
    named = None if column_map is None else map_file
    return template(kind, files, study, named, channels, overrides), column_map


def kind_of_record(files: Sequence[Path]) -> Kind:
    """The kind of study that recordings with canonical headers are for: that of an IMU where they do not tell."""
    from inercal.records.channels import of_a_table
    from inercal.records.read import canonical_units

    channels = canonical_units(list(files)) or {}
    if "th_x" in channels:
        return "selfcal"
    if "a1" in channels:
        return "aoa"
    return "turntable" if of_a_table(channels) and "acc_x" not in channels else "imu"


def _described(
    kind: Kind, files: Sequence[Path], rate: str | None
) -> tuple[Mapping[str, Unit | None], str | None]:
    """Channels of the recordings, with their units where known, and a map where the headers do not say these."""
    from inercal.records.channels import of_a_table
    from inercal.records.guess import guess_map
    from inercal.records.read import canonical_units

    if not files:
        return {}, None
    channels: Mapping[str, Unit | None] = {} if kind == "imu" else canonical_units(files) or {}
    plain = {
        "imu": False,
        "strapdown": {"acc_x", "gyro_x"} <= channels.keys(),
        "turntable": of_a_table(channels),
        "selfcal": "th_x" in channels,
        "aoa": "a1" in channels,
    }
    if plain[kind]:
        return channels, None
    column_map = guess_map(files, on_table=kind == "turntable", of_model=kind == "aoa", rate=rate)
    return (dict.fromkeys(mapped(column_map)) if kind in ("imu", "turntable") else channels), column_map


def mapped(column_map: str) -> list[str]:
    """The channels of a map."""
    data = tomllib.loads(column_map)
    parts = [data, *(part for part in data.get("file", {}).values() if isinstance(part, dict))]
    return [name for part in parts for name in part.get("columns", ())]
