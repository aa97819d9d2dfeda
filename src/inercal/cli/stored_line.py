"""The command line of a kept result, which anybody may have written: the part of it that ``inercal rerun`` runs.

It is read by the parser of the commands themselves, so that no spelling means one thing here and another there; what it
says is held against the lists below, and a line is written anew. A command or an option that is in no list is refused.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import chdir
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from inercal.foundation.errors import InputError, plain
from inercal.foundation.units import shown
from inercal.systems.contract import System
from inercal.systems.listed import SYSTEMS
from inercal.systems.selfcal.system import SYSTEM as SELFCAL
from inercal.systems.turntable.system import SYSTEM as TURNTABLE

if TYPE_CHECKING:
    from cyclopts import App

    from inercal.laboratory.again import LaidOut

COMMANDS_AGAIN = {
    **{system.command: kind for kind, system in SYSTEMS.items()},
    **{f"design {name}": kind for kind, system in SYSTEMS.items() for name in system.designs},
    "sensitivity": TURNTABLE.kind,
    "simulate selfcal": SELFCAL.kind,
    **dict.fromkeys(("allan", "temperature", "compare", "history", "validate"), ""),
}
"""Commands that make a result of files and nothing else, each with the kind of its study, empty without one."""

Use = Literal["file", "value", "below", "dropped", "refused"]
"""Uses of an option: ``file`` that was kept with the result, ``value`` that is computed with, file that is written
``below`` the folder of the rerun; ``dropped``, since the result is the same without; ``refused``."""

OPTIONS_AGAIN: Mapping[str, Use] = {
    **dict.fromkeys(("FILES", "STUDY", "FIRST", "SECOND", "OF"), "file"),
    **dict.fromkeys(("--study", "--map", "--join", "--runs", "--tolerance"), "file"),
    **dict.fromkeys(
        (
            "--set",
            "--begin",
            "--end",
            "--answer",
            "--latitude",
            "--at",
            "--order",
            "--filter",
            "--compare",
            "--states",
        ),
        "value",
    ),
    **dict.fromkeys(
        ("--static", "--centrifugal", "--tangential", "--smooth", "--points", "--front"), "value"
    ),
    **dict.fromkeys(("--seed", "--coefficient", "--until", "simulate selfcal --runs"), "value"),
    **dict.fromkeys(("--out", "--report"), "below"),
    **dict.fromkeys(("--json", "--quiet", "--keep", "--store", "--instrument"), "dropped"),
    **dict.fromkeys(("--cluster", "--checkpoint", "--workers"), "dropped"),
    **dict.fromkeys(("--stream", "--every", "--until-goals", "--checkpoint-every", "--after"), "refused"),
}
"""The use of each option of these commands; one that means something else in a command stands there with it."""

_STUDIES = ("STUDY", "--study")
_WHERE = "its command line"


@dataclass(frozen=True)
class StoredLine:
    """A command line that may be run again: the command, and the values of what it was given, by option."""

    command: str
    given: Mapping[str, tuple[Any, ...]]

    @property
    def _system(self) -> System | None:
        """The system of its study, None without one."""
        return SYSTEMS.get(COMMANDS_AGAIN[self.command])

    def use(self, name: str) -> Use:
        """The use of one of its options."""
        return _use(self.command, name)

    def words(self, laid: LaidOut) -> tuple[str, ...]:
        """Arguments of the command on files that are laid out; raises `InputError` where it would read others."""
        arguments, options = [], []
        for name, values in self.given.items():
            use = self.use(name)
            if use == "dropped":
                continue
            for value in values:
                word = _word(name, value, use, laid)
                if name.startswith("-"):
                    options.append(name if value is True else f"{name}={word}")
                else:
                    arguments.append(word)
        self.check_named(laid)
        last = ["--", *arguments] if arguments else []
        return (*self.command.split(), *options, "--json", "--quiet", *last)

    def check_named(self, laid: LaidOut) -> None:
        """Refuse a study, map or table that names a file elsewhere; raises `InputError`."""
        study, column_map, table = (
            self._file(laid, *names)
            for names in (_STUDIES, ("--map",), ("--runs",) if self._system and self._system.runs else ())
        )
        for path in filter(None, (study, column_map, table)):
            laid.name_places(path)
        with chdir(laid.folder):  # names are meant as from where the command runs
            for path in self._named(laid, study, column_map, table):
                laid.check(path)

    def _named(
        self, laid: LaidOut, study: Path | None, column_map: Path | None, table: Path | None
    ) -> Iterator[Path]:
        """The files that are named by others."""
        from inercal.faces.studies.load import files_named as of_study
        from inercal.foundation.records.maps import read_map
        from inercal.foundation.records.read import files_named as of_map

        if study is not None:
            keys = [laid.moved(key) for key in self.given.get("--set", ())]
            assert self._system is not None
            unread = self._system.unread if self.command == self._system.command else ""
            yield from of_study(self._system, study, keys, unread)
        runs = [[Path(laid.place(str(file))) for file in self.given.get("FILES", ())]]
        if table is not None:
            from inercal.systems.aoa.runs.run_table import read_runs_table

            runs = [[run.path] for run in read_runs_table(table).runs]
        for files in runs:
            yield from files if column_map is None else of_map(files, read_map(column_map))

    def _file(self, laid: LaidOut, *names: str) -> Path | None:
        """The file that one of these options was given."""
        return next(
            (Path(laid.place(str(self.given[name][0]))) for name in names if name in self.given), None
        )


def stored_line(arguments: object) -> StoredLine:
    """The command line of a result, as its provenance states it.

    Raises `InputError`, naming the word and what was expected, where it is none that `COMMANDS_AGAIN` and
    `OPTIONS_AGAIN` allow.
    """
    from cyclopts import CycloptsError

    from inercal.cli.tree import COMMANDS, app, refused

    if not isinstance(arguments, list | tuple) or not all(isinstance(each, str) for each in arguments):
        raise InputError(_WHERE, f"found {shown(arguments)}, expected a list of words")
    if not arguments:
        raise InputError(
            _WHERE, "is not known (made in Python, or by an older inercal), expected that of a command"
        )
    line = [plain(_WHERE, word) for word in arguments]
    root = app()
    try:
        chain, _, _ = root.parse_commands(line)
        command = " ".join(chain)
        if command not in COMMANDS_AGAIN:
            found = shown(command or line[0])
            raise InputError(_WHERE, f"found {found}, expected a command that only makes a result of files")
        function, bound, _ = root.parse_args(line)
    except CycloptsError as error:
        raise InputError(_WHERE, refused(root, error)) from error
    verb, kind = (*chain, "")[:2]
    if function.__module__ != COMMANDS[verb, kind][0].partition(":")[0]:
        raise InputError(_WHERE, f"found a question for help, expected `inercal {command}` with its files")
    given = dict(_given(root[verb][kind] if kind else root[verb], bound.arguments))
    for name in given:
        if _use(command, name) == "refused":
            raise InputError(_WHERE, f"found {name}, expected options that only read files or compute")
    return StoredLine(command, given)


def _use(command: str, name: str) -> Use:
    """The use of an option of a command."""
    return OPTIONS_AGAIN.get(f"{command} {name}", OPTIONS_AGAIN.get(name, "refused"))


def _given(command: App, bound: Mapping[str, Any]) -> Iterator[tuple[str, tuple[Any, ...]]]:
    """Options and arguments of a command that were given, each with its values."""
    values: dict[str, Any] = {}
    for name, value in bound.items():
        if is_dataclass(value):
            options = (each for each in fields(value) if each.init)
            own = {each.name: (getattr(value, each.name), each.default) for each in options}
            values |= {each: found for each, (found, default) in own.items() if found != default}
        else:
            values[name] = value
    for argument in command.assemble_argument_collection():
        value = values.get(argument.field_info.name)
        if argument.name != "*" and argument.parse and value is not None and value is not False:
            yield argument.name, tuple(value) if isinstance(value, list) else (value,)


def _word(name: str, value: object, use: Use, laid: LaidOut) -> str:
    """A value as a word of the new line."""
    match use:
        case "file":
            place = laid.place(str(value))
            return place if Path(place).is_absolute() else f"./{place}"  # a bracket first would begin a list
        case "below":
            return str(laid.root / f"{name[2:]}{Path(str(value)).suffix}")
        case _:
            return laid.moved(str(value)) if name == "--set" else str(value)
