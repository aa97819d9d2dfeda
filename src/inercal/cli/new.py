"""``inercal new``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from inercal.cli.options import FileOutput, Overrides
from inercal.cli.outcome import emit
from inercal.foundation.errors import InputError

Rate = Annotated[
    str | None,
    Parameter(help='Sample rate of recordings without a time column, for the map: "100 Hz", "100.00(1) Hz".'),
]
Recordings = Annotated[list[Path] | None, Parameter(help="Recordings, to guess a column map from.")]


def new_imu(
    files: Recordings = None,
    /,
    *,
    rate: Rate = None,
    overrides: Overrides = None,
    output: FileOutput = FileOutput(),  # noqa: B008  (frozen)
) -> None:
    """Write a study, and a map guessed from the recordings."""
    _new("imu", files or [], overrides or [], output, rate)


def new_strapdown(
    files: Recordings = None,
    /,
    *,
    rate: Rate = None,
    overrides: Overrides = None,
    output: FileOutput = FileOutput(),  # noqa: B008  (frozen)
) -> None:
    """Write a study of a strapdown unit, and a map guessed from recordings that do not say what they hold."""
    _new("strapdown", files or [], overrides or [], output, rate)


def new_turntable(
    files: Recordings = None,
    /,
    *,
    rate: Rate = None,
    overrides: Overrides = None,
    output: FileOutput = FileOutput(),  # noqa: B008  (frozen)
) -> None:
    """Write a study of a turntable, and a map guessed from recordings whose headers do not say what they hold."""
    _new("turntable", files or [], overrides or [], output, rate)


def new_selfcal(
    files: Recordings = None,
    /,
    *,
    rate: Rate = None,
    overrides: Overrides = None,
    output: FileOutput = FileOutput(),  # noqa: B008  (frozen)
) -> None:
    """Write a study of a self-calibration, and a map guessed from recordings that do not say what they hold."""
    _new("selfcal", files or [], overrides or [], output, rate)


def new_aoa(
    files: Recordings = None,
    /,
    *,
    rate: Rate = None,
    overrides: Overrides = None,
    output: FileOutput = FileOutput(),  # noqa: B008  (frozen)
) -> None:
    """Write a study of an angle of attack, and a map guessed from recordings that do not say what they hold."""
    _new("aoa", files or [], overrides or [], output, rate)


def new_lab(
    *,
    overrides: Overrides = None,
    output: FileOutput = FileOutput(),  # noqa: B008  (frozen)
) -> None:
    """Write what a laboratory states in its certificates, to be filled in."""
    from inercal.foundation._files import write_text
    from inercal.foundation.results.result import without_coefficients
    from inercal.laboratory.certificate.lab import lab_template

    output.check((".toml",))
    path = output.out or Path("lab.toml")
    if path.exists():
        raise InputError(path, "exists already, expected a new file name (--out)")
    write_text(path, lab_template(path, overrides or ()))
    words = f'{path}: fill in each "?" and look it over'
    emit(without_coefficients("new lab", words, {"lab": str(path)}), words, output)


def _new(kind: str, files: list[Path], overrides: list[str], output: FileOutput, rate: str | None) -> None:
    """Write a study of that kind, and the map if there is one; nothing is overwritten."""
    from inercal.faces.python.beginning import begun, mapped
    from inercal.faces.studies.starting import UNKNOWN
    from inercal.foundation._files import write_text
    from inercal.foundation.records.read import source_of
    from inercal.foundation.results.result import without_coefficients
    from inercal.foundation.units import parse_quantity

    output.check((".toml",), files)
    if rate is not None:
        if not parse_quantity(rate, "frequency", "--rate", "100 Hz").value > 0.0:
            raise InputError("--rate", f"found {rate}, expected a rate above 0")
        if not files:
            raise InputError("--rate", "found without a recording, expected one for the map")
    study = output.out or Path(f"{kind}.toml")
    beside = study.with_name(f"{study.stem}-map{study.suffix}")
    text, column_map = begun(kind, files, study, beside, rate, overrides)
    map_file = None if column_map is None else beside
    written = [study] if map_file is None else [study, map_file]
    for path in written:
        if path.exists():
            raise InputError(path, "exists already, expected a new file name (--out)")
    write_text(study, text)
    if map_file is not None and column_map is not None:
        write_text(map_file, column_map)
    result = {"study": str(study), "map": None if map_file is None else str(map_file)}
    words = "\n".join(f"{path}: look it over and correct it" for path in written)
    if f'= "{UNKNOWN}" ' in text:
        words = words.replace("look it over and correct it", f'fill in each "{UNKNOWN}" and look it over', 1)
    if column_map is not None and not mapped(column_map):
        words += "\nno accelerometer or gyro was recognised: the map lists the columns, give them channels and units"
    emit(without_coefficients(f"new {kind}", words, result, map(source_of, files)), words, output)
