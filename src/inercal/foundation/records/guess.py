"""A first column map for files nobody has described, with the reason for each guess beside it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import RecordError
from inercal.foundation.records.channels import Origin, of_a_table
from inercal.foundation.records.guessed_units import EVERYDAY, Guess, median, quoted, units_of
from inercal.foundation.records.places import counted_names
from inercal.foundation.records.read import format_of
from inercal.foundation.records.read.table import FirstLook
from inercal.foundation.records.recognise.clocks import clock
from inercal.foundation.records.recognise.sensors import sensors
from inercal.foundation.records.recognise.words import said
from inercal.foundation.records.titles import (
    OF_A_MODEL,
    bare,
    fits,
    numbered,
    of_table,
    rate_of_model,
    titled,
    triads_by_name,
)
from inercal.foundation.units import parse_quantity, parse_unit

_IN_NAMES = {"acc": r"acc|alpha", "gyro": r"gyr|omega"}
_RATE = re.compile(r"(?:\bfs|rate|freq\w*|hz)\b\W*(\d+(?:\.\d+)?)", re.IGNORECASE)
_MEASURED = re.compile(r"acc_\w+|a\d+|gyro\w*|y_[xy]|wc_[xyz]|th_[xyz]")
_LISTED = 40
_OPEN_RATE = ("# there is no time column", "[time]", 'rate = "PUT THE SAMPLE RATE HERE, such as 100 Hz"')
_HOT = 200.0  # degC: beyond it a temperature without a unit is a count


@dataclass(frozen=True)
class _File:
    """Guess about one file, or about the columns of one clock in it."""

    path: Path
    guesses: Mapping[str, Guess]
    leading: tuple[str, ...]
    unused: tuple[str, ...] = ()
    transposed: bool = False


@np.errstate(over="ignore", invalid="ignore")
def guess_map(
    paths: str | Path | Sequence[str | Path],
    on_table: bool = False,
    of_model: bool = False,
    rate: str | None = None,
) -> str:
    """Guess a column map from the files of one record themselves; of repeat runs the first is looked at.

    Headers are told by their names (``ax``, ``gyr_y``, ``imu.acc.z``, ``timestamp``) and units, arrays without a
    header by their shape: the time is the column that always rises, a triad goes by the name of its array or file,
    a unit by the size of gravity. Of a test ``on_table`` columns without names are not guessed, for angles and outputs
    look alike; nor those ``of_model`` that pitches, whose accelerometers are ``a1`` to ``an`` by their numbers or axes.

    ``rate`` is the sample rate, as text with its unit, where there is no time column. The map is TOML that reads these
    files, with a comment on each guess and on columns not used. Where no sensor was recognised, there are only
    comments, to write the map by. Raises `RecordError` where a file cannot be read, or nothing in it looks like a
    channel.
    """
    files: list[_File] = []
    hertz = None if rate is None else parse_quantity(rate, "frequency", "rate").value
    for path in [paths] if isinstance(paths, str | Path) else paths:
        looked = _look(Path(path), on_table, of_model, hertz)
        if not any(looked[0].guesses.keys() & other.guesses.keys() - {"t"} for other in files):
            files += looked
    if not any(_MEASURED.fullmatch(name) for file in files for name in file.guesses):
        return _skeleton(
            files, "phi1 phi2 acc_x" if on_table else "a1 a2 gyro" if of_model else "acc_x acc_y gyro_x"
        )
    names = dict.fromkeys(quoted(file.path.name) for file in files)
    lines = [
        f"# Guessed from {', '.join(names)}: check each line, above all",
        "# the units, the order of the axes and their signs.",
    ]
    if len(files) == 1:
        lines += _options(files[0], "file") + _columns(files[0], "columns")
    else:
        for file, name in zip(files, _table_names(files), strict=True):
            table = f"file.{name}"
            lines += ["", f"[{table}]", f"path = {quoted(file.path.name)}", *_options(file, "")]
            lines += _columns(file, f"{table}.columns")
    for file in files:
        lines += ["", *(f"# not used: {column}" for column in file.unused)] if file.unused else []
    if rate is not None and all("t" in file.guesses for file in files):
        raise RecordError(files[0].path, "found a column of times, expected none beside a sample rate")
    if any("t" not in file.guesses and not of_a_table(file.guesses) for file in files):
        lines += _rate([line for file in files for line in file.leading], rate)
    return "\n".join(lines) + "\n"


def of_means(column_map: str) -> str:
    """The map without the sample rate that is to be filled in: rows of means need no times."""
    return column_map.replace("\n" + "\n".join(_OPEN_RATE), "")


def columns_of(path: Path) -> tuple[Origin, ...]:
    """The columns of a file in their order, as a map names them; raises `RecordError` where it cannot be read."""
    return tuple(
        _origin(sample, index) for sample in _samples(path) for index in range(sample.values.shape[1])
    )


def _samples(path: Path) -> Sequence[FirstLook]:
    """The first look at the arrays of a file; raises `RecordError`."""
    try:
        return format_of(path).peek(path)
    except OSError as error:
        raise RecordError(path, f"cannot be read ({error.strerror or error})") from error


def _look(path: Path, on_table: bool, of_model: bool, rate: float | None) -> list[_File]:
    """Guess the channels of one file: of its longest columns, and of others that have a time of their own."""
    samples = sorted(_samples(path), key=lambda sample: -len(sample.values))
    lengths: dict[int, dict[str, Guess]] = {}
    for sample in samples:
        guesses = lengths.setdefault(len(sample.values), {})
        named = sample.names or on_table or of_model
        for guess in (
            _by_header(sample, on_table, of_model, path.name, rate) if named else _by_shape(sample, path)
        ):
            guesses.setdefault(guess.name, guess)
    leading = tuple(line for sample in samples for line in sample.leading)
    longest, *others = lengths.values() or [{}]
    lying = any(sample.options.transpose for sample in samples)
    files = [_File(path, longest, leading, transposed=lying)]
    for guesses in others:
        guessed = {name for file in files for name in file.guesses} - {"t"}
        new = {name: guess for name, guess in guesses.items() if name not in guessed}
        if "t" in new and len(new) > 1:
            files.append(_File(path, new, (), transposed=lying))
    if all(np.isnan(sample.values).all() for sample in samples):
        raise RecordError(path, f"found {_held(samples) or 'nothing'}, expected columns of numbers")
    return [replace(files[0], unused=_unused(samples, files)), *files[1:]]


def _held(samples: Sequence[FirstLook]) -> str:
    """The contents of a file in words."""
    return "; ".join(
        counted_names(sample.names, 8) or f"{sample.values.shape[1]} columns" for sample in samples
    )


def _unused(samples: Sequence[FirstLook], files: Sequence[_File]) -> tuple[str, ...]:
    """The columns that are no channel: how a map names them, and how they begin."""
    used = [guess.origin for file in files for guess in file.guesses.values()]
    columns = []
    for sample in samples:
        for index, values in enumerate(sample.values.T):
            if (origin := _origin(sample, index)) in used:
                continue
            begins = ", ".join(f"{value:.6g}" for value in values[:3])
            if np.isnan(values).all():
                begins = "no numbers; dates and words are not read"
            place = quoted(list(origin) if isinstance(origin, tuple) else origin)
            columns.append(f"{place} ({begins})")
    more = [f"{len(columns) - _LISTED} more"] if len(columns) > _LISTED else []
    return (*columns[:_LISTED], *more)


def _skeleton(files: Sequence[_File], names: str) -> str:
    """A map that says nothing yet: what to write, such as these channels, and the columns there are."""
    first, *others = names.split()
    unit = next(unit for unit in EVERYDAY[1:] if fits(first, unit))
    lines = ["# No accelerometer or gyro was recognised. Give each channel its column and unit, for example"]
    lines += [f"# [columns.{first}]", "# from = 1", f"# unit = {quoted(unit)}", "#"]
    lines += [f"# and likewise t, {', '.join(others)}. Without a time column, state the rate:"]
    lines += ["# [time]", '# rate = "100 Hz"', "#", "# What there is, with the first numbers:"]
    for file in files:
        held = [f"{quoted(guess.origin)} (perhaps {name})" for name, guess in file.guesses.items()]
        lines += [f"# {quoted(file.path.name)}", *(f"#   {column}" for column in (*held, *file.unused))]
    return "\n".join(lines) + "\n"


def _by_header(
    sample: FirstLook, on_table: bool, of_model: bool, file: str, rate: float | None
) -> list[Guess]:
    """Channels by the names in the header."""
    guesses = []
    for index, title in enumerate(sample.names):
        name, unit = titled(title, sample.units[index] if sample.units else None)
        if of_model:
            name = numbered(title) or OF_A_MODEL.get(name or "", name) or rate_of_model(title, unit)
        elif on_table:
            name = name or of_table(title)
        values = sample.values[:, index]
        # what is no number, as dates, can be a label alone; a time by its unit alone may be some interval
        if name is None or (name != "label" and np.isnan(values).all()):
            continue
        if name == "t" and titled(bare(title))[0] != "t" and not _is_clock(values):
            continue
        if name == "temperature" and unit is None and abs(median(values)) > _HOT:
            continue
        reason = f"the header says {quoted(title)}"
        guesses.append(Guess(name, _origin(sample, index), values, unit, reason))
    if of_model:
        return _counted(guesses)
    if not on_table:
        return _recognised(sample, guesses, file, rate)
    return guesses if any(_MEASURED.fullmatch(each.name) for each in guesses) else guesses + _by_norm(sample)


def _recognised(sample: FirstLook, guesses: list[Guess], file: str, rate: float | None) -> list[Guess]:
    """Channels by their names, the accelerometers and gyros among them recognised by all the evidence there is."""
    if found_t := clock(sample.names, sample.units, sample.values):
        origin, values = _origin(sample, found_t.column), sample.values[:, found_t.column]
        what = Guess("t", origin, values, found_t.unit, found_t.reason, found_t.grade)
        guesses = [what, *(guess for guess in guesses if guess.name != "t" and guess.origin != origin)]
    by_name = {guess.name: guess for guess in reversed(guesses)}
    t = None if rate is None else np.arange(len(sample.values)) / rate
    if stamps := by_name.get("t"):
        t = stamps.values * parse_unit(units_of({"t": stamps})["t"][0]).factor
    triads = sensors(sample.names, sample.units, sample.values, t, file)
    used = {_origin(sample, index) for triad in triads for index in triad.columns}
    found = {triad.sensor for triad in triads}
    titles = {_origin(sample, index): name for index, name in enumerate(sample.names)}
    kept = [
        guess
        for guess in guesses
        if guess.origin not in used
        and guess.name.partition("_")[0] not in found
        and not said(titles[guess.origin]).never
    ]
    for triad in triads:
        for axis, index, unit in zip("xyz", triad.columns, triad.units, strict=True):
            values, origin = sample.values[:, index], _origin(sample, index)
            what = Guess(
                f"{triad.sensor}_{axis}", origin, values, unit, triad.reason, triad.grade, triad.question
            )
            stated = by_name.get(what.name)
            if (
                stated is not None
                and stated.origin == origin
                and stated.unit
                and not fits(what.name, stated.unit)
            ):
                what = replace(what, unit=stated.unit, grade="", question="")
            elif stated is not None and stated.origin == origin and stated.unit:
                what = replace(what, unit=stated.unit)
            kept.append(what)
    return kept


def _counted(guesses: list[Guess]) -> list[Guess]:
    """Accelerometers of a model by the order of their columns, where two have one number."""
    places = [place for place, guess in enumerate(guesses) if re.fullmatch(r"a\d+", guess.name)]
    if len({guesses[place].name for place in places}) < len(places):
        for number, place in enumerate(places, 1):
            reason = f"{guesses[place].reason}, accelerometer {number} in the order of the columns"
            guesses[place] = replace(guesses[place], name=f"a{number}", reason=reason)
    return guesses


def _by_norm(sample: FirstLook) -> list[Guess]:
    """Sensors of names that say x, y, z and nothing known: the accelerometers are those whose norm is steadier."""
    units = [
        titled(*each)[1]
        for each in zip(sample.names, sample.units or (None,) * len(sample.names), strict=True)
    ]
    able = [unit is None or fits("acc_x", unit) for unit in units]
    found = [list(triad) for triad in triads_by_name(sample.names) if all(able[index] for index in triad)]
    return [
        Guess(f"{sensor}_{axis}", _origin(sample, index), sample.values[:, index], units[index], reason)
        for sensor, triad, reason in (_sensors(sample.values, found, ()) if len(found) in (1, 2) else ())
        for axis, index in zip("xyz", triad, strict=True)
    ]


def _is_clock(values: Array) -> bool:
    """True for numbers that never fall, and rise somewhere."""
    step = np.diff(values[np.isfinite(values)])
    return bool((step >= 0.0).all() and (step > 0.0).any())


def _origin(sample: FirstLook, index: int) -> Origin:
    """The name of a column in a map."""
    if sample.names:
        return (
            sample.names[index]
            if not sample.numbered and sample.names.count(sample.names[index]) == 1
            else index
        )
    return (sample.variable, index) if sample.variable else index


def _by_shape(sample: FirstLook, path: Path) -> list[Guess]:
    """Channels of an array without a header: a time that rises, and one triad or two."""
    values = sample.values

    def guess(name: str, index: int, reason: str) -> Guess:
        return Guess(name, _origin(sample, index), values[:, index], None, reason)

    rising = [index for index in range(values.shape[1]) if (np.diff(values[:, index]) > 0).all()]
    guesses = [guess("t", rising[0], "the column that always rises")] if rising else []
    rest = [index for index in range(values.shape[1]) if index not in rising[:1]]
    if len(rest) not in (3, 6):
        return guesses if not rest else []
    triads = [rest[:3], rest[3:]] if len(rest) == 6 else [rest]
    for sensor, triad, reason in _sensors(values, triads, (sample.variable, path.name)):
        guesses += [
            guess(f"{sensor}_{axis}", index, reason) for axis, index in zip("xyz", triad, strict=True)
        ]
    return guesses


def _sensors(
    values: Array, triads: list[list[int]], names: tuple[str, ...]
) -> list[tuple[str, list[int], str]]:
    """Which triad is which sensor, and why."""
    for name in names if len(triads) == 1 else ():
        named = [sensor for sensor, pattern in _IN_NAMES.items() if re.search(pattern, name, re.IGNORECASE)]
        if len(named) == 1:
            return [(named[0], triads[0], f"the name says {quoted(name)}")]
    spread = [_spread(values[:, triad]) for triad in triads]
    acc = int(np.argmin(spread))
    if len(triads) == 1:
        sensor = "acc" if spread[0] < 0.2 else "gyro"
        return [(sensor, triads[0], "its norm is steady" if sensor == "acc" else "its norm varies")]
    return [
        ("acc", triads[acc], "of the two triads the one with the steadier norm"),
        ("gyro", triads[1 - acc], "of the two triads the one with the less steady norm"),
    ]


def _spread(triad: Array) -> float:
    """Scatter of a triad's norm over its median."""
    norm = np.linalg.norm(triad, axis=1)
    middle = median(norm)
    return median(np.abs(norm - middle)) / middle if middle > 0 else np.inf


def _columns(file: _File, table: str) -> list[str]:
    """The columns of a file as TOML."""
    units = units_of(file.guesses)
    lines = []
    for name, guess in file.guesses.items():
        unit, reason = units[name]
        comment = guess.reason if name == "label" else f"{guess.reason}; {reason}"
        if name[1:].isdigit() and name[0] == "a":
            comment += f"; say under [sensors.{name}] of the study where it sits and points"
        origin = list(guess.origin) if isinstance(guess.origin, tuple) else guess.origin
        lines += [f"# QUESTION: {guess.question}"] if guess.question and name.endswith("_x") else []
        lines += ["", f"# {comment}", f"[{table}.{name}]", f"from = {quoted(origin)}"]
        lines += [] if name == "label" else [f"unit = {quoted(unit)}"]
    return lines


def _options(file: _File, table: str) -> list[str]:
    """The layout of a file as TOML, as far as it is not found out on reading."""
    lines = []
    if file.leading:
        lines += [
            f"skip = {len(file.leading)}",
            f"# the first of these lines is {quoted(file.leading[0][:60])}",
        ]
    if file.transposed:
        lines += ["# channels are rows", "transpose = true"]
    if not lines:
        return []
    return ["", f"[{table}]", *lines] if table else lines


def _rate(leading: Iterable[str], rate: str | None) -> list[str]:
    """The sample rate as TOML, where there is no time column: as stated, or as a line of the file says."""
    if rate is not None:
        return ["", "# there is no time column", "[time]", f"rate = {quoted(rate)}"]
    sentence = next((line for line in leading if _RATE.search(line)), None)
    match = _RATE.search(sentence) if sentence is not None else None
    if sentence is not None and match:
        return [
            "",
            f"# there is no time column; a line says {quoted(sentence[:60])}",
            "[time]",
            f'rate = "{match[1]} Hz"',
        ]
    return ["", *_OPEN_RATE]


def _table_names(files: Sequence[_File]) -> list[str]:
    """``acc`` or ``gyro`` for a file of that triad alone, else by its number."""
    names = []
    for number, file in enumerate(files, 1):
        sensors = {name.rpartition("_")[0] for name in file.guesses if name not in ("t", "label")}
        name = sensors.pop() if sensors in ({"acc"}, {"gyro"}) else f"part{number}"
        names.append(name if name not in names else f"part{number}")
    return names
