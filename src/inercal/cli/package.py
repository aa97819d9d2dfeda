"""Beginnings, and what ships: ``inercal new``, ``examples``, ``schema``, ``completion`` and ``validate``."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from inercal.cli import process_age, show
from inercal.cli.options import FileOutput, Overrides, ResultOutput, reading
from inercal.cli.outcome import WHOLE, hand_over, tell
from inercal.cli.records_in import Answers
from inercal.foundation.errors import InputError

Rate = Annotated[
    str | None,
    Parameter(help='Sample rate of recordings without a time column, for the map: "100 Hz", "100.00(1) Hz".'),
]
Recordings = Annotated[list[Path] | None, Parameter(help="Recordings, to guess a column map from.")]


def _beginning(kind: str) -> Callable[..., None]:
    """The command that writes a study of a kind, and a map guessed from recordings that need one."""

    def command(
        files: Recordings = None,
        /,
        *,
        rate: Rate = None,
        answers: Answers = None,
        overrides: Overrides = None,
        output: FileOutput = FileOutput(),
    ) -> None:
        _new(kind, files or [], overrides or [], output, rate, answers or ())

    return command


new_aoa = _beginning("aoa")
new_imu = _beginning("imu")
new_selfcal = _beginning("selfcal")
new_strapdown = _beginning("strapdown")
new_turntable = _beginning("turntable")


def new_lab(
    *,
    overrides: Overrides = None,
    output: FileOutput = FileOutput(),
) -> None:
    """Write what a laboratory states in its certificates, to be filled in."""
    from inercal.foundation._files import write_text
    from inercal.laboratory.certificate.lab import lab_template

    output.check((".toml",))
    path = output.out or Path("lab.toml")
    if path.exists():
        raise InputError(path, "exists already, expected a new file name (--out)")
    write_text(path, lab_template(path, overrides or ()))
    words = f'{path}: fill in each "?" and look it over'
    tell(output, "new lab", words, {"lab": str(path)})


def _new(
    kind: str,
    files: list[Path],
    overrides: list[str],
    output: FileOutput,
    rate: str | None,
    answered: Sequence[str],
) -> None:
    """Write a study of that kind, and the map if there is one; nothing is overwritten."""
    from inercal.faces.python.beginning import asked_in, begun, mapped, sections_of
    from inercal.faces.studies.starting import UNKNOWN
    from inercal.foundation._files import write_text
    from inercal.foundation.records.maps import answers_of
    from inercal.foundation.records.read import source_of
    from inercal.foundation.units import parse_quantity

    output.check((".toml",), files)
    if rate is not None:
        if not parse_quantity(rate, "frequency", "--rate", "100 Hz").value > 0.0:
            raise InputError("--rate", f"found {rate}, expected a rate above 0")
        if not files:
            raise InputError("--rate", "found without a recording, expected one for the map")
    answers = answers_of(answered)
    if answers and not files:
        raise InputError("--answer", "found without a recording, expected one for the map")
    study = output.out or Path(f"{kind}.toml")
    beside = study.with_name(f"{study.stem}-map{study.suffix}")
    text, column_map = begun(kind, files, study, beside, rate, overrides, answers)
    map_file = None if column_map is None else beside
    stated = any(override.strip().startswith(("imu.method", "imu.section")) for override in overrides)
    told = None if stated else sections_of(kind, files, column_map)
    table = None if told is None else study.with_name("sections.csv")
    asked = () if told is None else told[1]
    if table is not None:
        keys = ['imu.method="sections"', f"imu.sections={table}", *overrides]
        text, _ = begun(kind, files, study, beside, rate, keys, answers)
    contents = {study: text}
    if map_file is not None and column_map is not None:
        contents[map_file] = column_map
    if table is not None and told is not None:
        contents[table] = told[0]
    for path in contents:
        if path.exists():
            raise InputError(path, "exists already, expected a new file name (--out)")
    for path, content in contents.items():
        write_text(path, content)
    result = {"study": str(study), "map": None if map_file is None else str(map_file)}
    if table is not None:
        result["sections"] = str(table)
    words = "\n".join(f"{path}: look it over and correct it" for path in contents)
    if f'= "{UNKNOWN}" ' in text:
        words = words.replace("look it over and correct it", f'fill in each "{UNKNOWN}" and look it over', 1)
    if column_map is not None and not mapped(column_map):
        words += "\nno accelerometer or gyro was recognised: the map lists the columns, give them channels and units"
    words = "\n".join([words, *([] if column_map is None else asked_in(column_map))])
    words = "\n".join([words, *(question.line for question in asked)])
    tell(output, f"new {kind}", words, result, map(source_of, files), findings=asked)


def validate(*, output: ResultOutput = ResultOutput()) -> int:
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
    output: FileOutput = FileOutput(),
) -> None:
    """List the recordings that ship with inercal, or copy one."""
    from pathlib import Path

    from inercal.examples import EXAMPLES, FOLDER, shipped
    from inercal.foundation._files import make_folder, read_bytes, write_bytes

    if name is None:
        if output.out is not None:
            raise InputError("--out", "found no example to copy, expected its name before")
        rows = [{"name": e.name, "title": e.title, "files": list(e.files)} for e in EXAMPLES.values()]
        text = "\n".join(f"{e.name:11s} {e.title}" for e in EXAMPLES.values())
        tell(output, "examples", f"{len(rows)} examples", {"examples": rows}, text=text)
        return
    if name not in EXAMPLES:
        raise InputError(name, f"no such example, expected one of {', '.join(EXAMPLES)}")
    example, folder = EXAMPLES[name], output.out or Path(name)
    make_folder(folder)
    for file in example.files:
        target = folder / Path(file).name
        if target.exists() and read_bytes(target) != read_bytes(FOLDER / file):
            raise InputError(target, "exists already, expected a new folder (--out)")
    for file in example.files:
        write_bytes(folder / Path(file).name, read_bytes(FOLDER / file))
    result = {"folder": str(folder), "run": example.command(str(folder))}
    sources = map(shipped, example.files)
    words = f"copied to {folder}"
    tell(output, "examples", words, result, sources, f"{words}; now run\n{result['run']}")


def schema(*, output: FileOutput = FileOutput()) -> None:
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
    output: FileOutput = FileOutput(),
) -> None:
    """Print the script by which a shell completes commands."""
    from inercal.foundation._files import write_text

    output.check(())
    text = script(shell)
    if output.out is not None:
        write_text(output.out, text)
        output.say(f"completion: {output.out}")
    shown = text.rstrip("\n") if output.out is None else ""
    tell(output, "completion", f"completion for {shell}", {"shell": shell, "text": text}, text=shown)


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
