"""``inercal new``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from inercal.cli.options import FileOutput
from inercal.cli.outcome import emit, told
from inercal.errors import InputError

if TYPE_CHECKING:
    from inercal.units import Unit

Recordings = Annotated[list[Path] | None, Parameter(help="Recordings, to guess a column map from.")]


def new_imu(files: Recordings = None, /, *, output: FileOutput = FileOutput()) -> None:  # noqa: B008  (frozen)
    """Write a study, and a map guessed from the recordings."""
    from inercal.records.guess import guess_map
    from inercal.studies.template import imu_template

    column_map = guess_map(files) if files else None
    channels = [] if column_map is None else _mapped(column_map)
    _new("imu", files or [], output, partial(imu_template, channels=channels), column_map)


def new_turntable(files: Recordings = None, /, *, output: FileOutput = FileOutput()) -> None:  # noqa: B008
    """Write a study of a turntable, and a map guessed from recordings whose headers do not say what they hold."""
    from inercal.records.channels import of_a_table
    from inercal.records.guess import guess_map
    from inercal.records.read import canonical_units
    from inercal.studies.template import turntable_template

    channels: Mapping[str, Unit | None] = (canonical_units(files) if files else None) or {}
    column_map = None
    if files and not of_a_table(channels):
        column_map = guess_map(files, on_table=True)
        channels = dict.fromkeys(_mapped(column_map))
    _new("turntable", files or [], output, partial(turntable_template, channels=channels), column_map)


def new_selfcal(files: Recordings = None, /, *, output: FileOutput = FileOutput()) -> None:  # noqa: B008
    """Write a study of a self-calibration, and a map guessed from recordings that do not say what they hold."""
    from inercal.records.guess import guess_map
    from inercal.records.read import canonical_units
    from inercal.studies.template import selfcal_template

    channels = (canonical_units(files) if files else None) or {}
    column_map = guess_map(files) if files and "th_x" not in channels else None
    _new("selfcal", files or [], output, selfcal_template, column_map)


def new_aoa(files: Recordings = None, /, *, output: FileOutput = FileOutput()) -> None:  # noqa: B008
    """Write a study of an angle of attack, and a map guessed from recordings that do not say what they hold."""
    from inercal.records.guess import guess_map
    from inercal.records.read import canonical_units
    from inercal.studies.template import aoa_template

    channels = (canonical_units(files) if files else None) or {}
    column_map = guess_map(files, of_model=True) if files and "a1" not in channels else None
    _new("aoa", files or [], output, aoa_template, column_map)


def _mapped(column_map: str) -> list[str]:
    """The channels of a map."""
    import tomllib

    data = tomllib.loads(column_map)
    parts = [data, *(part for part in data.get("file", {}).values() if isinstance(part, dict))]
    return [name for part in parts for name in part.get("columns", ())]


def _new(
    kind: str,
    files: list[Path],
    output: FileOutput,
    template: Callable[[list[Path], Path, Path | None], str],
    column_map: str | None,
) -> None:
    """Write a study of that kind, and the map if there is one; nothing is overwritten."""
    from inercal._files import write_text
    from inercal.records.read import source_of

    output.check((".toml",), files)
    study = output.out or Path(f"{kind}.toml")
    map_file = None if column_map is None else study.with_name(f"{study.stem}-map{study.suffix}")
    written = [study] if map_file is None else [study, map_file]
    for path in written:
        if path.exists():
            raise InputError(path, "exists already, expected a new file name (--out)")
    write_text(study, template(files, study, map_file))
    if map_file is not None and column_map is not None:
        write_text(map_file, column_map)
    result = {"study": str(study), "map": None if map_file is None else str(map_file)}
    words = "\n".join(f"{path}: look it over and correct it" for path in written)
    if column_map is not None and not _mapped(column_map):
        words += "\nno accelerometer or gyro was recognised: the map lists the columns, give them channels and units"
    emit(told(f"new {kind}", words, result, map(source_of, files)), words, output)
