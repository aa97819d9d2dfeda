"""``inercal new``."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from inercal.cli.options import FileOutput, envelope
from inercal.errors import InputError

Recordings = Annotated[list[Path] | None, Parameter(help="Recordings, to guess a column map from.")]


def new_imu(files: Recordings = None, /, *, output: FileOutput = FileOutput()) -> None:  # noqa: B008  (frozen)
    """Write a study, and a map guessed from the recordings."""
    from inercal.study.template import imu_template

    _new("imu", files or [], output, imu_template)


def new_turntable(files: Recordings = None, /, *, output: FileOutput = FileOutput()) -> None:  # noqa: B008
    """Write a study of a turntable, and a map guessed from the recordings."""
    from inercal.study.template import turntable_template

    _new("turntable", files or [], output, turntable_template)


def _new(
    kind: str, files: list[Path], output: FileOutput, template: Callable[[list[Path], Path, Path | None], str]
) -> None:
    """Write a study of that kind, and a map where there are files; nothing is overwritten."""
    from inercal._files import write_text
    from inercal.records.guess import guess_map
    from inercal.records.read import source_of

    output.check((".toml",), files)
    study = output.out or Path(f"{kind}.toml")
    map_file = study.with_name(f"{study.stem}-map{study.suffix}")
    text = guess_map(files) if files else None
    for path in (study, map_file) if text is not None else (study,):
        if path.exists():
            raise InputError(path, "exists already, expected a new file name (--out)")
    written = [study]
    write_text(study, template(files, study, None if text is None else map_file))
    if text is not None:
        write_text(map_file, text)
        written.append(map_file)
    result = {"study": str(study), "map": None if text is None else str(map_file)}
    words = "\n".join(f"{path}: look it over and correct it" for path in written)
    output.emit(envelope(f"new {kind}", words, result, map(source_of, files)), words)
