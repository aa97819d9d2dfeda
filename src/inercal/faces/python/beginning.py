"""A study to begin with, a column map and a table of sections, guessed from the recordings."""

from __future__ import annotations

import tempfile
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from inercal.foundation.errors import InputError
from inercal.systems.contract import System
from inercal.systems.imu.system import SYSTEM as IMU
from inercal.systems.listed import SYSTEMS

if TYPE_CHECKING:
    from inercal.foundation.findings import Finding
    from inercal.foundation.units import Unit


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


def sections_of(
    kind: str, files: Sequence[Path], column_map: str | None
) -> tuple[str, tuple[Finding, ...]] | None:
    """The table of sections of recordings, as text, and what is asked about it; ``column_map`` is that of `begun`.

    None where they are not evaluated by sections, or cannot be read until the map is corrected.
    """
    from inercal.foundation._files import write_text
    from inercal.foundation.records.guess import of_means
    from inercal.foundation.records.read import read_runs

    sections = SYSTEMS[kind].sections
    if sections is None or not files:
        return None
    with tempfile.TemporaryDirectory() as folder:
        map_file = None if column_map is None else Path(folder) / "map.toml"
        if map_file is not None and column_map is not None:
            write_text(map_file, of_means(column_map))
        try:
            return sections(read_runs(files, map_file, counted=True))
        except InputError:
            return None


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
