"""``inercal new``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from inercal.cli.options import FileOutput, envelope
from inercal.errors import InputError


def new_imu(
    files: Annotated[list[Path] | None, Parameter(help="Recordings, to guess a column map from.")] = None,
    /,
    *,
    output: FileOutput = FileOutput(),  # noqa: B008  (frozen)
) -> None:
    """Write a study, and a map guessed from the recordings."""
    from inercal._files import write_text
    from inercal.records.guess import guess_map
    from inercal.records.read import source_of
    from inercal.study.template import imu_template

    output.check((".toml",), files or ())
    study = output.out or Path("imu.toml")
    map_file = study.with_name(f"{study.stem}-map{study.suffix}")
    text = guess_map(files) if files else None
    for path in (study, map_file) if text is not None else (study,):
        if path.exists():
            raise InputError(path, "exists already, expected a new file name (--out)")
    written = [study]
    write_text(study, imu_template(files or (), study, None if text is None else map_file))
    if text is not None:
        write_text(map_file, text)
        written.append(map_file)
    result = {"study": str(study), "map": None if text is None else str(map_file)}
    words = "\n".join(f"{path}: look it over and correct it" for path in written)
    output.emit(envelope("new imu", words, result, map(source_of, files or ())), words)
