"""``inercal examples``."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from inercal.cli.options import FileOutput, envelope
from inercal.errors import InputError


def examples(
    name: Annotated[str | None, Parameter(help="The example to copy; all are listed if absent.")] = None,
    /,
    *,
    output: FileOutput = FileOutput(),  # noqa: B008  (frozen)
) -> None:
    """List the recordings that ship with inercal, or copy one."""
    from pathlib import Path

    from inercal._files import write_bytes
    from inercal.examples import EXAMPLES, FOLDER
    from inercal.records.read import source_of

    if name is None:
        if output.out is not None:
            raise InputError("--out", "found no example to copy, expected its name before")
        rows = [{"name": e.name, "title": e.title, "files": list(e.files)} for e in EXAMPLES.values()]
        text = "\n".join(f"{e.name:11s} {e.title}" for e in EXAMPLES.values())
        output.emit(envelope("examples", f"{len(rows)} examples", {"examples": rows}), text)
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
        if target.exists():
            raise InputError(target, "exists already, expected a new folder (--out)")
    for file in example.files:
        write_bytes(folder / Path(file).name, (FOLDER / file).read_bytes())
    result = {"folder": str(folder), "run": example.command(str(folder))}
    data = envelope(
        "examples", f"copied to {folder}", result, [source_of(FOLDER / file) for file in example.files]
    )
    output.emit(data, f"copied to {folder}; now run\n{result['run']}")
