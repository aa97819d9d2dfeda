"""Channels of a file: by the names in its header, by numbers and physics, or by the shape of an array without names."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import RecordError
from inercal.foundation.records.channels import TimeForm, measures_motion, of_a_table
from inercal.foundation.records.places import counted_names
from inercal.foundation.records.read import format_of
from inercal.foundation.records.read.join import unwrapped
from inercal.foundation.records.read.table import FileOptions, FirstLook
from inercal.foundation.records.read.time_stamps import seconds_of
from inercal.foundation.records.recognise.clocks import clock
from inercal.foundation.records.recognise.known_inputs import not_taken, of_known_input
from inercal.foundation.records.recognise.sensors import sensors
from inercal.foundation.records.recognise.stems import by_count
from inercal.foundation.records.recognise.thermometers import one_thermometer
from inercal.foundation.records.recognise.units import Guess, median, quoted, units_of
from inercal.foundation.records.recognise.words import MEASURED, is_size, said, sensors_named
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
from inercal.foundation.units import parse_unit

_RATE = re.compile(r"(?:\bfs|rate|freq\w*|hz)\b\W*(\d+(?:\.\d+)?)", re.IGNORECASE)
_LISTED = 40
_HOT = 200.0  # degC: beyond it a temperature without a unit is a count


@dataclass(frozen=True)
class FileGuess:
    """Guess about one file, or about the columns of one clock in it; ``known`` are words on a known input that is taken
    for no channel."""

    path: Path
    guesses: Mapping[str, Guess]
    leading: tuple[str, ...]
    unused: tuple[str, ...] = ()
    options: FileOptions = field(default_factory=FileOptions)
    titles: tuple[str, ...] = ()
    known: str = ""
    stated: tuple[str, ...] = ()


def samples_of(path: Path) -> Sequence[FirstLook]:
    """The first look at the arrays of a file; raises `RecordError`."""
    try:
        return format_of(path).peek(path)
    except OSError as error:
        raise RecordError(path, f"cannot be read ({error.strerror or error})") from error


def rate_in(lines: Iterable[str]) -> tuple[str, str]:
    """The first of some lines that states a sample rate, and the rate [Hz] as it is written; empty where none does."""
    return next(((line, match[1]) for line in lines if (match := _RATE.search(line))), ("", ""))


def look(
    path: Path, on_table: bool, of_model: bool, rate: float | None, chosen: Mapping[str, str]
) -> list[FileGuess]:
    """Guess the channels of one file: of its longest columns, and of others that have a time of their own.

    ``chosen`` are names of columns by sensor, where it was asked which of several are meant.
    """
    samples = sorted(_together(samples_of(path)), key=lambda sample: -len(sample.values))
    if rate is None and (
        in_words := rate_in(line for each in samples for line in (*each.stated, *each.leading))[1]
    ):
        rate = float(in_words) or None
    lengths: dict[int, dict[str, Guess]] = {}
    for sample in samples:
        guesses = lengths.setdefault(len(sample.values), {})
        named = sample.names or on_table or of_model
        for guess in (
            _by_header(sample, on_table, of_model, path.name, rate, chosen)
            if named
            else _by_shape(sample, path, rate, chosen)
        ):
            guesses.setdefault(guess.name, _scaled(guess, sample.leading))
    leading = tuple(line for sample in samples for line in sample.leading)
    longest, *others = lengths.values() or [{}]
    options = next((sample.options for sample in samples if sample.options.transpose), samples[0].options)
    titles = tuple(name.strip() for sample in samples for name in sample.names)
    known = next((words for sample in samples if (words := not_taken(sample, on_table))), "")
    stated = tuple(line for sample in samples for line in sample.stated)
    files = [FileGuess(path, longest, leading, options=options, titles=titles, known=known, stated=stated)]
    for guesses in others:
        guessed = {name for file in files for name in file.guesses} - {"t"}
        new = {name: guess for name, guess in guesses.items() if name not in guessed}
        if "t" in new and len(new) > 1:
            files.append(FileGuess(path, new, (), options=options))
    if all(np.isnan(sample.values).all() for sample in samples):
        raise RecordError(path, f"found {_held(samples) or 'nothing'}, expected columns of numbers")
    return [replace(files[0], unused=_unused(samples, files)), *files[1:]]


def _together(samples: Sequence[FirstLook]) -> list[FirstLook]:
    """Arrays of a file as one table where they are equally long, and each names its columns or is a triad of the sensor
    that its name says: what one tells of the other is seen then."""
    made: list[FirstLook] = []
    for rows in dict.fromkeys(len(sample.values) for sample in samples):
        alike = [sample for sample in samples if len(sample.values) == rows]
        parts = [sample for sample in alike if sample.names or _is_triad(sample)]
        if len(parts) < 2 or not any(map(_is_triad, parts)):
            made += alike
            continue
        names = [sample.names or tuple(f"{sample.variable} {axis}" for axis in "xyz") for sample in parts]
        units = [sample.units or (None,) * sample.values.shape[1] for sample in parts]
        origins = [tuple(map(sample.origin, range(sample.values.shape[1]))) for sample in parts]
        whole = replace(
            parts[0],
            values=np.hstack([sample.values for sample in parts]),
            names=sum(names, ()),
            units=sum(units, ()),
            origins=sum(origins, ()),
            variable="",
        )
        made += [whole, *(sample for sample in alike if not (sample.names or _is_triad(sample)))]
    return made


def _is_triad(sample: FirstLook) -> bool:
    """True for three columns without names of an array whose own name says one sensor."""
    return not sample.names and sample.values.shape[1] == 3 and len(sensors_named(sample.variable)) == 1


def _scaled(guess: Guess, leading: Sequence[str]) -> Guess:
    """A channel by the scale that a line of a Gyroflow log states before the rows."""
    kinds = {"t": ("tscale", "s"), "gyro": ("gscale", "rad/s"), "acc": ("ascale", "g")}
    key, unit = kinds.get(guess.name.partition("_")[0], ("", ""))
    stated = next(
        (match[1] for line in leading if (match := re.fullmatch(rf"\s*{key}\s*,\s*(\S+?),*\s*", line))), ""
    )
    if not key or not stated or not any("GYROFLOW" in line for line in leading):
        return guess
    try:
        factor = float(stated)
    except ValueError:
        return guess
    reason = f"{guess.reason.partition(';')[0]}; the file says {key} {stated}"
    usable = np.isfinite(factor) and factor > 0.0
    return (
        replace(guess, unit=unit, factor=factor, grade="certain", reason=reason, question="")
        if usable
        else guess
    )


def _held(samples: Sequence[FirstLook]) -> str:
    """The contents of a file in words."""
    return "; ".join(
        counted_names(sample.names, 8) or f"{sample.values.shape[1]} columns" for sample in samples
    )


def _unused(samples: Sequence[FirstLook], files: Sequence[FileGuess]) -> tuple[str, ...]:
    """The columns that are no channel: how a map names them, and how they begin."""
    used = [guess.origin for file in files for guess in file.guesses.values()]
    columns = []
    for sample in samples:
        for index, values in enumerate(sample.values.T):
            if (origin := sample.origin(index)) in used:
                continue
            begins = ", ".join(f"{value:.6g}" for value in values[:3])
            if np.isnan(values).all():
                begins = "no numbers"
            place = quoted(list(origin) if isinstance(origin, tuple) else origin)
            columns.append(f"{place} ({begins})")
    more = [f"{len(columns) - _LISTED} more"] if len(columns) > _LISTED else []
    return (*columns[:_LISTED], *more)


def _by_header(
    sample: FirstLook,
    on_table: bool,
    of_model: bool,
    file: str,
    rate: float | None,
    chosen: Mapping[str, str],
) -> list[Guess]:
    """Channels by the names in the header."""
    guesses = []
    called = sample.names if on_table or of_model else by_count(sample.names, sample.values)
    for index, (title, meant) in enumerate(zip(sample.names, called, strict=True)):
        beside = sample.units[index] if sample.units else None
        name, unit = titled(meant, beside)
        if of_model:
            name = numbered(title) or OF_A_MODEL.get(name or "", name) or rate_of_model(title, unit)
        elif on_table:
            name = name or of_table(title)
        if name is None and MEASURED.get(said(title, beside).unit) == "temperature":
            name = "temperature"
        values = sample.values[:, index]
        # what is no number, as dates, can be a label alone; a time by its unit alone may be some interval
        if name is None or (name != "label" and np.isnan(values).all()):
            continue
        if name == "t" and titled(bare(meant))[0] != "t" and not _is_clock(values):
            continue
        if name == "temperature" and unit is None and abs(median(values)) > _HOT:
            continue
        reason = f"the header says {quoted(title)}"
        guesses.append(Guess(name, sample.origin(index), values, unit, reason))
    if of_model:
        return _counted(guesses)
    if not on_table:
        return _recognised(sample, called, guesses, file, rate, chosen)
    if any(measures_motion(each.name) for each in guesses) and of_a_table(each.name for each in guesses):
        return guesses
    return of_known_input(sample, guesses) or (
        guesses if any(measures_motion(each.name) for each in guesses) else guesses + _by_norm(sample)
    )


def _recognised(
    sample: FirstLook,
    called: Sequence[str],
    guesses: list[Guess],
    file: str,
    rate: float | None,
    chosen: Mapping[str, str],
) -> list[Guess]:
    """Channels by their names, the accelerometers and gyros among them recognised by all the evidence there is."""
    if found_t := clock(called, sample.units, sample.values, sample.texts):
        origin, values = sample.origin(found_t.column), sample.values[:, found_t.column]
        said_of = found_t.unit, found_t.reason, found_t.grade, found_t.question
        if found_t.stamps is not None:
            values = _times(sample, found_t.column, found_t.stamps)
        what = Guess("t", origin, values, *said_of, _placed(sample, found_t.stamps))
        guesses = [what, *(guess for guess in guesses if guess.name != "t" and guess.origin != origin)]
    by_name = {guess.name: guess for guess in reversed(guesses)}
    t = None if rate is None else np.arange(len(sample.values)) / rate
    if stamps := by_name.get("t"):
        t = stamps.values * parse_unit(units_of({"t": stamps})["t"].unit).factor
    triads = sensors(sample.names, sample.units, sample.values, t, file, called, chosen)
    guesses = one_thermometer(sample, guesses, chosen)
    used = {sample.origin(index) for triad in triads for index in triad.columns}
    found = {triad.sensor for triad in triads}
    titles = {sample.origin(index): name for index, name in enumerate(sample.names)}
    kept = [
        guess
        for guess in guesses
        if guess.origin not in used
        and guess.name.partition("_")[0] not in found
        and (guess.name.startswith("wc_") or not said(titles[guess.origin]).never)
    ]
    for triad in triads:
        for axis, index, unit in zip("xyz", triad.columns, triad.units, strict=True):
            values, origin = sample.values[:, index], sample.origin(index)
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
            if sample.names[index].startswith("-"):
                what = replace(
                    what, factor=-1.0, reason=f"{what.reason}; {quoted(sample.names[index])} is reversed"
                )
            kept.append(what)
    return _aside(sample, called, kept if triads else [*kept, *_alone(sample, kept)])


def _alone(sample: FirstLook, guesses: Sequence[Guess]) -> list[Guess]:
    """The gyro, or the accelerometer, of one axis that is not named, beside a time: its unit is one of rate or
    acceleration, and no word says that it is something else."""
    if not any(guess.name == "t" for guess in guesses) or any(
        measures_motion(guess.name) for guess in guesses
    ):
        return []
    found = []
    for index, name in enumerate(sample.names):
        words = said(name, sample.units[index] if sample.units else None)
        sensor = MEASURED.get(words.unit, "")
        other = words.sensor not in ("", sensor) or words.axis or words.never or words.seldom
        if sensor in ("acc", "gyro") and not other and not is_size(name):
            values = sample.values[:, index]
            reason = f"the header says {quoted(name.strip())}"
            channel = "gyro" if sensor == "gyro" else "a1"
            found.append(Guess(channel, sample.origin(index), values, words.unit, reason, "certain"))
    return found if len(found) == 1 else []


def _aside(sample: FirstLook, called: Sequence[str], guesses: list[Guess]) -> list[Guess]:
    """Channels, the last of which says that a magnetometer is left aside where there is one."""
    names = [
        name.strip()
        for index, name in enumerate(sample.names)
        if (words := said(called[index], sample.units[index] if sample.units else None)).sensor == "mag"
        and words.axis
    ]
    if not names or not guesses or not guesses[-1].grade:
        return guesses
    reason = f"{guesses[-1].reason}; a magnetometer is left aside: {', '.join(map(quoted, names[:3]))}"
    return [*guesses[:-1], replace(guesses[-1], reason=reason)]


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
    if len(found) not in (1, 2):
        return []
    spread = [_spread(sample.values[:, triad]) for triad in found]
    acc = int(np.argmin(spread))
    kinds = [
        "acc" if place == acc and (len(found) == 2 or spread[0] < 0.2) else "gyro"
        for place in range(len(found))
    ]
    steadier = "the norm is steady" if len(found) == 1 else "of two triads, this has the steadier norm"
    return [
        Guess(
            f"{kind}_{axis}", sample.origin(index), sample.values[:, index], units[index],
            steadier if kind == "acc" else "the norm varies",
        )
        for kind, triad in zip(kinds, found, strict=True)
        for axis, index in zip("xyz", triad, strict=True)
    ]  # fmt: skip


def _is_clock(values: Array) -> bool:
    """True for numbers that never fall, and rise somewhere."""
    step = np.diff(values[np.isfinite(values)])
    return bool((step >= 0.0).all() and (step > 0.0).any())


def _times(sample: FirstLook, column: int, stamps: TimeForm) -> Array:
    """Times of stamps, in the unit of their numbers, as a map reads them."""
    beside = stamps.beside if isinstance(stamps.beside, int) else None
    if stamps.order:
        of_day = None if beside is None else sample.texts[beside]
        return seconds_of(sample.texts[column], stamps.order, of_day)
    values = sample.values[:, column]
    if stamps.wrap:
        return unwrapped(values, stamps.wrap)
    return values if beside is None else values + stamps.rest * sample.values[:, beside]


def _placed(sample: FirstLook, stamps: TimeForm | None) -> TimeForm | None:
    """Stamps whose column beside is named as a map names it."""
    if stamps is None or not isinstance(stamps.beside, int):
        return stamps
    return replace(stamps, beside=sample.origin(stamps.beside))


def _by_shape(sample: FirstLook, path: Path, rate: float | None, chosen: Mapping[str, str]) -> list[Guess]:
    """Channels of an array without names, by its numbers, or by its own name where that says the sensor."""
    names = ("",) * sample.values.shape[1]
    file = (
        path.name
        if not sample.variable or len(sensors_named(sample.variable)) != 1
        else f"{sample.variable}."
    )
    return _recognised(replace(sample, names=names, numbered=True), names, [], file, rate, chosen)


def _spread(triad: Array) -> float:
    """Scatter of a triad's norm over its median."""
    norm = np.linalg.norm(triad, axis=1)
    middle = median(norm)
    return median(np.abs(norm - middle)) / middle if middle > 0 else np.inf
