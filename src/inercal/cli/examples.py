"""``inercal examples``."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from inercal.cli.options import FileOutput
from inercal.cli.outcome import emit
from inercal.errors import InputError


def examples(
    name: Annotated[str | None, Parameter(help="The example to copy; all are listed if absent.")] = None,
    /,
    *,
    output: FileOutput = FileOutput(),  # noqa: B008  (frozen)
) -> None:
    """List the recordings that ship with inercal, or copy one."""
    from pathlib import Path

    from inercal._files import read_bytes, write_bytes
    from inercal.estimate.result import without_coefficients
    from inercal.examples import EXAMPLES, FOLDER, shipped

    if name is None:
        if output.out is not None:
            raise InputError("--out", "found no example to copy, expected its name before")
        rows = [{"name": e.name, "title": e.title, "files": list(e.files)} for e in EXAMPLES.values()]
        text = "\n".join(f"{e.name:11s} {e.title}" for e in EXAMPLES.values())
        emit(without_coefficients("examples", f"{len(rows)} examples", {"examples": rows}), text, output)
        return
    if name not in EXAMPLES:
        raise InputError(name, f"no such example, expected one of {', '.join(EXAMPLES)}")
    example, folder = EXAMPLES[name], output.out or Path(name)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(folder, f"cannot be made ({error.strerror})") from error
    for file in example.files:
        target = folder / Path(file).name
        if target.exists() and read_bytes(target) != read_bytes(FOLDER / file):
            raise InputError(target, "exists already, expected a new folder (--out)")
    for file in example.files:
        write_bytes(folder / Path(file).name, read_bytes(FOLDER / file))
    result = {"folder": str(folder), "run": example.command(str(folder))}
    sources = map(shipped, example.files)
    estimate = without_coefficients("examples", f"copied to {folder}", result, sources)
    emit(estimate, f"{estimate.message}; now run\n{result['run']}", output)
