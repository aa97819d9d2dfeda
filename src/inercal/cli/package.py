"""``inercal examples``, ``schema``, ``completion`` and ``validate``: what comes with the package."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Literal

from cyclopts import Parameter

from inercal.cli import process_age, show
from inercal.cli.options import FileOutput, ResultOutput, reading
from inercal.cli.outcome import WHOLE, emit, hand_over
from inercal.foundation.errors import InputError


def validate(*, output: ResultOutput = ResultOutput()) -> int:  # noqa: B008  (frozen)
    """Rerun the published and closed-form cases."""
    from inercal.faces.report.validation import page, table
    from inercal.faces.validate.run import executor
    from inercal.faces.validate.run import validate as run
    from inercal.foundation._jit import compiling

    output.check(WHOLE)
    with compiling("validate", output.say), reading(output, "validating") as progress:
        estimate = run(executor(), progress)
    estimate = replace(estimate, timing={**estimate.timing, "total": process_age()})
    return hand_over(estimate, [table(estimate)], lambda: page(estimate), output, "record")


def examples(
    name: Annotated[str | None, Parameter(help="The example to copy; all are listed if absent.")] = None,
    /,
    *,
    output: FileOutput = FileOutput(),  # noqa: B008  (frozen)
) -> None:
    """List the recordings that ship with inercal, or copy one."""
    from pathlib import Path

    from inercal.examples import EXAMPLES, FOLDER, shipped
    from inercal.foundation._files import read_bytes, write_bytes
    from inercal.foundation.results.result import without_coefficients

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


def schema(*, output: FileOutput = FileOutput()) -> None:  # noqa: B008  (frozen)
    """Print the JSON Schema of study files."""
    import json

    from inercal.faces.studies.schema import json_schema
    from inercal.foundation._files import write_text

    output.check((".json",))
    document = json_schema()
    if output.out is not None:
        write_text(output.out, json.dumps(document, indent=1) + "\n")
    if output.json or output.out is None:
        show(json.dumps(document, indent=1))
    if output.out is not None:
        output.say_now(f"schema: {output.out}")


Shell = Literal["bash", "zsh", "fish"]

_FILES = 'COMPREPLY=( $(compgen -f -- "${cur}") )'
"""Completion of file names in the script for bash: without slashes after folders, and broken at blanks."""


_ZSH = """
if [[ "$funcstack[1]" == "_inercal" ]]; then
  _inercal "$@"
else
  compdef _inercal inercal
fi"""
"""End of the script for zsh: it may be loaded from a folder of ``$fpath``, or sourced."""


def completion(
    shell: Annotated[Shell, Parameter(help="The shell to complete in.")],
    /,
    *,
    output: FileOutput = FileOutput(),  # noqa: B008  (frozen)
) -> None:
    """Print the script by which a shell completes commands."""
    from inercal.foundation._files import write_text
    from inercal.foundation.results.result import without_coefficients

    output.check(())
    text = script(shell)
    if output.out is not None:
        write_text(output.out, text)
        output.say(f"completion: {output.out}")
    shown = text.rstrip("\n") if output.out is None else ""
    emit(
        without_coefficients("completion", f"completion for {shell}", {"shell": shell, "text": text}),
        shown,
        output,
    )


def script(shell: Shell) -> str:
    """The script of the whole tree of commands; it runs by itself, so that completing starts no Python."""
    from inercal.cli.tree import app

    text = app().generate_completion(shell=shell, prog_name="inercal")
    if shell == "bash":  # readline itself knows folders, blanks and ~: it is asked where nothing else fits
        text = text.replace(_FILES, "COMPREPLY=()")
        text = text.replace("complete -F _inercal inercal", "complete -o default -F _inercal inercal")
    if shell == "zsh":
        text = text.replace("_cyclopts_inercal", "_inercal").rstrip("\n") + _ZSH
    return text.rstrip("\n") + "\n"
