"""``inercal new``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from inercal.cli.options import FileOutput, Overrides
from inercal.cli.outcome import emit
from inercal.errors import InputError

if TYPE_CHECKING:
    from inercal.studies.template import Kind
    from inercal.units import Unit

Recordings = Annotated[list[Path] | None, Parameter(help="Recordings, to guess a column map from.")]


def new_imu(
    files: Recordings = None,
    /,
    *,
    overrides: Overrides = None,
    output: FileOutput = FileOutput(),  # noqa: B008  (frozen)
) -> None:
    """Write a study, and a map guessed from the recordings."""
    from inercal.records.guess import guess_map

    column_map = guess_map(files) if files else None
    channels = dict.fromkeys([] if column_map is None else _mapped(column_map))
    _new("imu", files or [], output, channels, column_map, overrides or [])


def new_turntable(
    files: Recordings = None,
    /,
    *,
    overrides: Overrides = None,
    output: FileOutput = FileOutput(),  # noqa: B008  (frozen)
) -> None:
    """Write a study of a turntable, and a map guessed from recordings whose headers do not say what they hold."""
    from inercal.records.channels import of_a_table
    from inercal.records.guess import guess_map
    from inercal.records.read import canonical_units

    channels: Mapping[str, Unit | None] = (canonical_units(files) if files else None) or {}
    column_map = None
    if files and not of_a_table(channels):
        column_map = guess_map(files, on_table=True)
        channels = dict.fromkeys(_mapped(column_map))
    _new("turntable", files or [], output, channels, column_map, overrides or [])


def new_selfcal(
    files: Recordings = None,
    /,
    *,
    overrides: Overrides = None,
    output: FileOutput = FileOutput(),  # noqa: B008  (frozen)
) -> None:
    """Write a study of a self-calibration, and a map guessed from recordings that do not say what they hold."""
    from inercal.records.guess import guess_map
    from inercal.records.read import canonical_units

    channels = (canonical_units(files) if files else None) or {}
    column_map = guess_map(files) if files and "th_x" not in channels else None
    _new("selfcal", files or [], output, channels, column_map, overrides or [])


def new_aoa(
    files: Recordings = None,
    /,
    *,
    overrides: Overrides = None,
    output: FileOutput = FileOutput(),  # noqa: B008  (frozen)
) -> None:
    """Write a study of an angle of attack, and a map guessed from recordings that do not say what they hold."""
    from inercal.records.guess import guess_map
    from inercal.records.read import canonical_units

    channels = (canonical_units(files) if files else None) or {}
    column_map = guess_map(files, of_model=True) if files and "a1" not in channels else None
    _new("aoa", files or [], output, channels, column_map, overrides or [])


def _mapped(column_map: str) -> list[str]:
    """The channels of a map."""
    import tomllib

    data = tomllib.loads(column_map)
    parts = [data, *(part for part in data.get("file", {}).values() if isinstance(part, dict))]
    return [name for part in parts for name in part.get("columns", ())]


def _new(
    kind: Kind,
    files: list[Path],
    output: FileOutput,
    channels: Mapping[str, Unit | None],
    column_map: str | None,
    overrides: list[str],
) -> None:
    """Write a study of that kind, and the map if there is one; nothing is overwritten."""
    from inercal._files import write_text
    from inercal.estimate.result import without_coefficients
    from inercal.records.read import source_of
    from inercal.studies.starting import UNKNOWN
    from inercal.studies.template import template

    output.check((".toml",), files)
    study = output.out or Path(f"{kind}.toml")
    map_file = None if column_map is None else study.with_name(f"{study.stem}-map{study.suffix}")
    written = [study] if map_file is None else [study, map_file]
    for path in written:
        if path.exists():
            raise InputError(path, "exists already, expected a new file name (--out)")
    text = template(kind, files, study, map_file, channels, overrides)
    write_text(study, text)
    if map_file is not None and column_map is not None:
        write_text(map_file, column_map)
    result = {"study": str(study), "map": None if map_file is None else str(map_file)}
    words = "\n".join(f"{path}: look it over and correct it" for path in written)
    if f'= "{UNKNOWN}" ' in text:
        words = words.replace("look it over and correct it", f'fill in each "{UNKNOWN}" and look it over', 1)
    if column_map is not None and not _mapped(column_map):
        words += "\nno accelerometer or gyro was recognised: the map lists the columns, give them channels and units"
    emit(without_coefficients(f"new {kind}", words, result, map(source_of, files)), words, output)
