"""``inercal examples``."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from inercal.cli.options import Output
from inercal.errors import InputError


def examples(
    name: Annotated[str | None, Parameter(help="The example to copy; all are listed if absent.")] = None,
    /,
    *,
    output: Output = Output(),  # noqa: B008  (frozen)
) -> None:
    """List the recordings that ship with inercal, or copy one with its study and map to the folder --out.

    The folder is named after the example if --out is absent.

    Example: inercal examples xsens --out xsens
    """
    from pathlib import Path

    from inercal._files import write_bytes
    from inercal.examples import EXAMPLES, FOLDER

    if name is None:
        rows = [{"name": e.name, "title": e.title, "files": list(e.files)} for e in EXAMPLES.values()]
        text = "\n".join(f"{e.name:10s} {e.title}" for e in EXAMPLES.values())
        output.emit({"command": "examples", "result": {"examples": rows}}, text)
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
    output.emit(
        {"command": "examples", "result": {"folder": str(folder), "run": example.command(str(folder))}},
        f"copied to {folder}; now run\n{example.command(str(folder))}",
    )
