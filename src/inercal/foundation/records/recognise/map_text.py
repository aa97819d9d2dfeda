"""Column maps of recordings that nobody has described, each entry with its grade, its reason, and what it asks."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from inercal.foundation.errors import InputError, RecordError
from inercal.foundation.records.channels import Origin, measures_motion, of_a_table, sensor_and_axis
from inercal.foundation.records.maps import ASIDE, OPEN, RecordMap, check_answers, map_of
from inercal.foundation.records.read import canonical_units
from inercal.foundation.records.recognise.tables import FileGuess, look, rate_in, samples_of
from inercal.foundation.records.recognise.units import EVERYDAY, quoted, units_of
from inercal.foundation.records.titles import fits, is_unit
from inercal.foundation.units import parse_quantity, shown


@np.errstate(over="ignore", invalid="ignore")
def guess_map(
    paths: str | Path | Sequence[str | Path],
    on_table: bool = False,
    of_model: bool = False,
    rate: str | None = None,
    answers: Mapping[str, str] | None = None,
) -> str:
    """Guess a column map from the files of one record themselves; of repeat runs the first is looked at.

    Headers are told by their names (``ax``, ``gyr_y``, ``imu.acc.z``, ``timestamp``) and units, arrays without a
    header by their shape: the time is the column that always rises, a triad goes by the name of its array or file,
    a unit by the size of gravity. Of a test ``on_table`` columns without names are not guessed, for angles and outputs
    look alike; nor those ``of_model`` that pitches, whose accelerometers are ``a1`` to ``an`` by their numbers or axes.

    ``rate`` is the sample rate, as text with its unit, where there is no time column; ``answers`` are units of sensors
    or channels, ``none`` of those left aside, and ``rate``. The map is TOML that reads these files, each entry with its
    grade and reason, with comments on columns not used. Where no sensor was recognised, there are only comments, to
    write the map by. Raises `RecordError` where a file cannot be read, or nothing in it looks like a channel, and
    `InputError` for an answer to nothing that is there.
    """
    files: list[FileGuess] = []
    answers = answers or {}
    rate = answers.get("rate", rate)
    hertz = None if rate is None else parse_quantity(rate, "frequency", "rate").value
    chosen = {name: answer for name, answer in answers.items() if name != "rate" and not is_unit(answer)}
    for path in [paths] if isinstance(paths, str | Path) else paths:
        looked = look(Path(path), on_table, of_model, hertz, chosen)
        if not any(looked[0].guesses.keys() & other.guesses.keys() - {"t"} for other in files):
            files += looked
    names_there = {name for file in files for name in file.guesses}
    check_answers(answers, names_there | {sensor_and_axis(name)[0] for name in names_there})
    for name, title in chosen.items():
        if title != ASIDE and not any(title in file.titles for file in files):
            raise InputError(
                "--answer", f"{name}: found {shown(title)}, expected a unit, {ASIDE}, or the name of a column"
            )
    answers = {name: answer for name, answer in answers.items() if name not in chosen or answer == ASIDE}
    files = [_answered(file, answers) for file in files]
    if not any(measures_motion(name) for file in files for name in file.guesses):
        return _skeleton(
            files, "phi1 phi2 acc_x" if on_table else "a1 a2 gyro" if of_model else "acc_x acc_y gyro_x"
        )
    names = dict.fromkeys(quoted(file.path.name) for file in files)
    lines = [
        f"# Recognised from {', '.join(names)}: check each line, above all",
        "# the units, the order of the axes and their signs.",
    ]
    if len(files) == 1:
        lines += _options(files[0], "file") + _columns(files[0], "columns", answers)
    else:
        for file, name in zip(files, _table_names(files), strict=True):
            table = f"file.{name}"
            lines += ["", f"[{table}]", f"path = {quoted(file.path.name)}", *_options(file, "")]
            lines += _columns(file, f"{table}.columns", answers)
            stamps = [] if _one_kind(files) else _stamps(file)
            lines += ["", f"[{table}.time]", *stamps] if stamps else []
    for file in files:
        lines += ["", *(f"# not used: {column}" for column in file.unused)] if file.unused else []
    if rate is not None and all("t" in file.guesses for file in files):
        raise RecordError(files[0].path, "found a column of times, expected none beside a sample rate")
    lines += _time(files, rate)
    return "\n".join(lines) + "\n"


def recognised(
    paths: Sequence[Path],
    answers: Mapping[str, str],
    on_table: bool = False,
    of_model: bool = False,
) -> RecordMap | None:
    """The map of files whose headers do not say what they hold; None where they do, or no sensor is recognised.

    Parameters and errors as of `guess_map`.
    """
    if canonical_units(paths) is not None:
        check_answers(answers, ())
        return None
    data = tomllib.loads(guess_map(paths, on_table, of_model, answers=answers))
    return map_of(data, paths[0], written=False) if data else None


def map_for(
    paths: Sequence[Path], written: RecordMap | None, answers: Mapping[str, str], how: Mapping[str, Any]
) -> RecordMap | None:
    """The map that files are read by: the one that is ``written``, with the answers, else what is recognised; None of
    files that say themselves what they hold. ``how`` columns are recognised: options of `recognised`.

    Raises `MapError` and `RecordError`; guesses are still in it.
    """
    if written is not None:
        return written.answered(answers)
    if not answers and (not paths or canonical_units(paths) is not None):
        return None
    return recognised(paths, answers, **how)


def _answered(file: FileGuess, answers: Mapping[str, str]) -> FileGuess:
    """The file without the channels that are left aside."""
    aside = [name for name, answer in answers.items() if answer == ASIDE]
    kept = {
        name: guess for name, guess in file.guesses.items()
        if name not in aside and sensor_and_axis(name)[0] not in aside
    }  # fmt: skip
    return replace(file, guesses=kept)


def columns_of(path: Path) -> tuple[Origin, ...]:
    """The columns of a file in their order, as a map names them; raises `RecordError` where it cannot be read."""
    return tuple(
        sample.origin(index) for sample in samples_of(path) for index in range(sample.values.shape[1])
    )


def _skeleton(files: Sequence[FileGuess], names: str) -> str:
    """A map that says nothing yet: what to write, such as these channels, and the columns there are."""
    first, *others = names.split()
    unit = next(unit for unit in EVERYDAY[1:] if fits(first, unit))
    lines = ["# No accelerometer or gyro was recognised. Give each channel its column and unit, for example"]
    lines += [f"# [columns.{first}]", "# from = 1", f"# unit = {quoted(unit)}", "#"]
    lines[1:1] = [f"# {file.known}." for file in files if file.known]
    lines += [f"# and likewise t, {', '.join(others)}. Without a time column, state the rate:"]
    lines += ["# [time]", '# rate = "100 Hz"', "#", "# What there is, with the first numbers:"]
    for file in files:
        held = [f"{quoted(guess.origin)} (perhaps {name})" for name, guess in file.guesses.items()]
        lines += [f"# {quoted(file.path.name)}", *(f"#   {column}" for column in (*held, *file.unused))]
    return "\n".join(lines) + "\n"


def _columns(file: FileGuess, table: str, answers: Mapping[str, str]) -> list[str]:
    """The columns of a file as TOML."""
    units = units_of(file.guesses, answers)
    lines = []
    for name, guess in file.guesses.items():
        found = units[name]
        because = guess.reason if name == "label" or not found.reason else f"{guess.reason}; {found.reason}"
        if name[1:].isdigit() and name[0] == "a":
            lines += ["", f"# say under [sensors.{name}] of the study where it sits and points"]
        else:
            lines += [""]
        origin = list(guess.origin) if isinstance(guess.origin, tuple) else guess.origin
        lines += [f"[{table}.{name}]", f"from = {quoted(origin)}"]
        lines += [] if name == "label" else [f"unit = {quoted(found.unit)}"]
        lines += ["sign = -1"] if guess.factor < 0.0 else []
        lines += [] if abs(guess.factor) == 1.0 else [f"scale = {abs(guess.factor)!r}"]
        lines += [f"grade = {quoted(found.grade)}", f"because = {quoted(because)}"]
        lines += [f"question = {quoted(found.question)}"] if found.question else []
    return lines


def _options(file: FileGuess, table: str) -> list[str]:
    """The layout of a file as TOML, as far as it is not found out on reading."""
    lines, options = [], file.options
    if file.leading:
        lines += [
            f"skip = {len(file.leading)}",
            f"# the first of these lines is {quoted(file.leading[0][:60])}",
        ]
    if options.transpose:
        lines += ["# channels are rows", "transpose = true"]
    lines += [f"lines = {quoted(options.lines)}"] if options.lines else []
    lines += [f"message = {quoted(options.message)}"] if options.message else []
    lines += [f"pattern = {quoted(list(options.pattern))}"] if options.pattern else []
    if not lines:
        return []
    return ["", f"[{table}]", *lines] if table else lines


def _time(files: Sequence[FileGuess], rate: str | None) -> list[str]:
    """The table of the time as TOML: how stamps are read, and the rate where files have none."""
    lines = _stamps(files[0]) if _one_kind(files) else []
    comment: list[str] = []
    if any("t" not in file.guesses and not of_a_table(file.guesses) for file in files):
        comment, stated = _rate([line for file in files for line in (*file.leading, *file.stated)], rate)
        lines += stated
    return ["", *comment, "[time]", *lines] if lines else []


def _one_kind(files: Sequence[FileGuess]) -> bool:
    """True where the stamps of all files are of one kind, which is said once."""
    return len({file.guesses["t"].stamps for file in files if "t" in file.guesses}) < 2


def _stamps(file: FileGuess) -> list[str]:
    """Keys by which the stamps of a file are read, as TOML; none of plain numbers."""
    stamps = file.guesses["t"].stamps if "t" in file.guesses else None
    if stamps is None:
        return []
    lines = [f"stamps = {quoted(stamps.order)}"] if stamps.order else []
    beside = list(stamps.beside) if isinstance(stamps.beside, tuple) else stamps.beside
    lines += [f"beside = {quoted(beside)}"] if beside is not None else []
    lines += [f'rest = "{"ns" if stamps.rest < 1e-7 else "us"}"'] if stamps.rest else []
    return lines + ([f"wrap = {stamps.wrap:.0f}"] if stamps.wrap else [])


def _rate(leading: Iterable[str], rate: str | None) -> tuple[list[str], list[str]]:
    """A comment on the sample rate of files without times, and the rate: as stated, or as a line of a file says."""
    if rate is not None:
        return ["# there is no time column"], [f"rate = {quoted(rate)}"]
    sentence, stated = rate_in(leading)
    if stated:
        return [f"# there is no time column; a line says {quoted(sentence[:60])}"], [
            f'rate = "{_with_u(stated)} Hz"'
        ]
    comment = "# there is no time column: state the sample rate where times are needed, such as 100 Hz"
    return [comment], [f"rate = {quoted(OPEN)}"]


def _with_u(rate: str) -> str:
    """A rate that a file states, with its uncertainty: half its last digit, or 1 %, whichever is larger."""
    digits = len(rate.partition(".")[2])
    u = max(0.5 * 10.0**-digits, 0.01 * float(rate))
    places = max(digits, 0 if u >= 1.0 else 2 if u < 0.1 else 1)
    return f"{float(rate):.{places}f}({max(1, round(u * 10**places))})"


def _table_names(files: Sequence[FileGuess]) -> list[str]:
    """``acc`` or ``gyro`` for a file of that triad alone, else by its number."""
    names = []
    for number, file in enumerate(files, 1):
        sensors = {name.rpartition("_")[0] for name in file.guesses if name not in ("t", "label")}
        name = sensors.pop() if sensors in ({"acc"}, {"gyro"}) else f"part{number}"
        names.append(name if name not in names else f"part{number}")
    return names
