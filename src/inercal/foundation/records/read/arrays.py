"""Named arrays, as all formats of arrays share them: from the arrays of an open file to the columns wanted."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.errors import InercalError, RecordError
from inercal.foundation.findings import Finding
from inercal.foundation.records.channels import Channel
from inercal.foundation.records.checks import missing, too_long
from inercal.foundation.records.places import counted_names, shortened
from inercal.foundation.records.read.child import Tell, Work, in_child
from inercal.foundation.records.read.limits import FIELDS, check_unpacked, memory, size_of
from inercal.foundation.records.read.table import FileOptions, FirstLook, RawTable
from inercal.foundation.records.read.values import numbers, rounded, texts
from inercal.foundation.records.titles import bare, canonical
from inercal.foundation.units import parse_unit

T = TypeVar("T")

_LISTED = 20
_MOST_CHANNELS, _LONGER = 12, 20  # of an array whose rows are channels, and how many times longer they are


@dataclass(frozen=True)
class NamedArray:
    """An array (rows, columns) of an open file; ``load`` reads one of its columns (rows,), ``several`` some at once
    where that takes less time.

    A column holds numbers, dates or durations (NumPy's, taken as seconds, of dates since 1970), or, if ``text``,
    strings. ``unit`` is the one the file states, of dates and durations s; ``clock`` names the array of the file
    that holds the time stamps of the rows, where the file says so.
    """

    rows: int
    columns: int
    load: Callable[[int], NDArray[Any]]
    text: bool = False
    unit: str | None = None
    clock: str | None = None
    several: Callable[[Sequence[int]], list[NDArray[Any]]] | None = None


def held(values: NDArray[Any], unit: str | None = None, clock: str | None = None) -> NamedArray:
    """An array (n,) or (n, k) that is in memory."""
    columns = 1 if values.ndim == 1 else values.shape[1]
    kind = values.dtype.kind
    unit = "s" if kind in "Mm" else unit
    return NamedArray(len(values), columns, partial(_of, values), kind in "SU", unit, clock)


def _of(values: NDArray[Any], column: int) -> NDArray[Any]:
    """A column of an array; all of it where that has only one dimension."""
    return values if values.ndim == 1 else values[:, column]


@dataclass(frozen=True)
class Contents:
    """The arrays of a file by name, in order; ``tabular`` if they are the columns of one table.

    ``described`` says what the file holds, where that is not the list of its arrays.
    """

    arrays: Mapping[str, NamedArray]
    findings: tuple[Finding, ...] = ()
    tabular: bool = False
    described: str = ""

    @property
    def words(self) -> str:
        """The contents of the file in words."""
        if self.described:
            return self.described
        if self.tabular:
            names = [shortened(name) for name in self.arrays]
        else:
            numbers = ((shortened(name), array) for name, array in self.arrays.items() if not array.text)
            names = [f"{name} ({array.rows} x {array.columns})" for name, array in numbers]
        return f"the {'columns' if self.tabular else 'arrays'} {counted_names(names, _LISTED)}"


def transposed(contents: Contents, path: Path) -> Contents:
    """The contents with each array of several columns on its side: rows were channels.

    Raises `RecordError` where the file is a table, whose columns have names.
    """
    if contents.tabular:
        raise RecordError(
            path, "found a table with named columns, expected none for `transpose` under [file]"
        )
    arrays = {
        name: array
        if array.columns == 1 or array.text
        else held(np.stack([array.load(k) for k in range(array.columns)]), array.unit)
        for name, array in contents.arrays.items()
    }
    return replace(contents, arrays=arrays)


def _nothing(_: Path) -> None:
    """Import nothing: a function with a name, which a child that is no fork can be handed."""


@dataclass(frozen=True)
class ArrayFormat:
    """A format whose files hold named arrays: ``opened`` lends those of a file while it is open, in a child process.

    ``name`` says what a file of it is, for the error about a damaged one: ``a MAT file``. Whatever a library
    trips over in such a file becomes a `RecordError`. ``imported`` imports what a file is read with,
    once for all children.
    """

    name: str
    opened: Callable[[Path], AbstractContextManager[Contents]]
    imported: Callable[[Path], object] = _nothing

    def read(
        self,
        path: Path,
        options: FileOptions,
        channels: tuple[Channel, ...] | None,
        progress: Callable[[int], None],
    ) -> list[RawTable]:
        """Read the wanted columns, or those that canonical names and units tell."""
        return self._in_child(partial(self._read, path, options, channels), path, progress)

    def header(self, path: Path) -> tuple[Channel, ...]:
        """The channels that canonical names and units tell; raises `InputError` where there are none."""
        return self._in_child(partial(self._header, path), path)

    def peek(self, path: Path) -> list[FirstLook]:
        """Look at the arrays of a file."""
        return self._in_child(partial(self._peek, path), path)

    def _in_child(self, work: Work[T], path: Path, progress: Tell = lambda _: None) -> T:
        """The result of work in a child, which need not import the library again."""
        self.imported(path)
        return in_child(work, path, progress)

    def _read(
        self, path: Path, options: FileOptions, channels: tuple[Channel, ...] | None, progress: Tell
    ) -> list[RawTable]:
        """As `read`, in the child."""
        with self._lent(path) as lent:
            contents = transposed(lent, path) if options.transpose else lent
            wanted = self_named(contents, path) if channels is None else channels
            wanted_tables = tables(contents, options, wanted, path, mapped=channels is not None)
        progress(path.stat().st_size)
        return wanted_tables

    def _header(self, path: Path, _: Tell) -> tuple[Channel, ...]:
        """As `header`, in the child."""
        with self._lent(path) as contents:
            return self_named(contents, path)

    def _peek(self, path: Path, _: Tell) -> list[FirstLook]:
        """As `peek`, in the child."""
        with self._lent(path) as contents:
            return samples(contents, path)

    @contextmanager
    def _lent(self, path: Path) -> Iterator[Contents]:
        """The contents of a file while it is open; errors as `RecordError`."""
        with guarded(path, self.name), self.opened(path) as contents:
            if all(array.text for array in contents.arrays.values()):
                raise RecordError(path, "holds no two-dimensional array of numbers, expected one at least")
            yield contents


@contextmanager
def guarded(path: Path, name: str) -> Iterator[None]:
    """Whatever a library trips over in a damaged file, as `RecordError`: it is not ``name``, such as a bag."""
    if path.is_file():
        path.open("rb").close()  # what the system has against it is said in its own words
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            yield
    except InercalError:
        raise
    except MemoryError as error:
        most = memory(size_of(path)) >> 20
        raise RecordError(
            path, f"asks for more than the {most} MiB of memory that a file of its size may take"
        ) from error
    except Exception as error:
        raise RecordError(path, f"cannot be read as {name} ({reason(error)})") from error


def reason(error: Exception) -> str:
    """The message of a library error on one line."""
    return " ".join(str(error).split())[:200] or type(error).__name__


def self_named(contents: Contents, path: Path) -> tuple[Channel, ...]:
    """The channels whose arrays have canonical names and units; raises `InputError` where there are none."""
    arrays = {name: array for name, array in contents.arrays.items() if array.columns == 1}
    titles = {name: re.sub(r"^[^\[]*/", "", name) for name in arrays}
    if "t" not in (re.sub(r"\s*\[.*", "", title) for title in titles.values()):
        titles = {name: re.sub(r"^time(?!\w)", "t", title) for name, title in titles.items()}
    return canonical(((name, titles[name], arrays[name].unit) for name in arrays), path)


def tables(
    contents: Contents, options: FileOptions, channels: tuple[Channel, ...], path: Path, mapped: bool
) -> list[RawTable]:
    """Those of the channels that the file holds, in a table for each clock.

    A wanted column t is the clock of all arrays with as many rows, of those that state a clock only if it
    was ``mapped`` by hand. Raises `RecordError` where columns of one clock have different lengths.
    """
    placed = {channel: place for channel in channels if (place := _place(channel, contents, options, path))}
    check_unpacked(path, sum(8 * contents.arrays[name].rows for name, _ in placed.values()), size_of(path))
    groups: dict[str | None, dict[Channel, tuple[str, int]]] = {}
    for channel, clock in _clocks(placed, contents.arrays, mapped).items():
        groups.setdefault(clock, {})[channel] = placed[channel]
    if not groups:
        return [RawTable((), {}, contents.words, 0, (), contents.findings)]
    parts = [_table(contents, group, clock, path) for clock, group in groups.items()]
    read = (column for part in parts for column in (*part.values.values(), part.clock))
    if all(column is None or np.isnan(column).all() for column in read):
        raise RecordError(path, "no row of numbers in the mapped columns, expected numbers")
    return parts


def samples(contents: Contents, path: Path) -> list[FirstLook]:
    """A first look at the arrays of a file: single columns by length, with their names, and each table.

    Where all tables lie on their side, they are looked at as `transposed`, and the options say so.
    """
    tables_held = [array for array in contents.arrays.values() if array.columns > 1 and not array.text]
    lying = bool(tables_held) and not contents.tabular and all(map(_lies_on_its_side, tables_held))
    if lying:
        contents = transposed(contents, path)
    options = FileOptions(transpose=lying)
    stated = _rates(contents)
    arrays = {name: array for name, array in islice(contents.arrays.items(), FIELDS) if array.rows > 1}
    check_unpacked(path, sum(8 * each.rows * each.columns for each in arrays.values()), size_of(path))
    looks = []
    for rows in dict.fromkeys(array.rows for array in arrays.values()):
        single = {name: each for name, each in arrays.items() if each.columns == 1 and each.rows == rows}
        if single:
            values = np.column_stack(
                [np.full(rows, np.nan) if each.text else numbers(each.load(0)) for each in single.values()]
            )
            units = tuple(each.unit for each in single.values())
            looks.append(FirstLook(values, tuple(single), options, units=units, stated=stated))
    for name, array in arrays.items():
        if array.columns > 1 and not array.text:
            values = np.column_stack([numbers(array.load(column)) for column in range(array.columns)])
            looks.append(FirstLook(values, (), options, name, stated=stated))
    return looks


def _rates(contents: Contents) -> tuple[str, ...]:
    """Single numbers whose names say that they are the sample rate, or its interval [s], as lines."""
    lines = []
    for name, array in islice(contents.arrays.items(), FIELDS):
        last = re.split(r"[/.]", name)[-1].lower()
        word = re.fullmatch(
            r"(fs|rate|sample_?rate|sampling_?(?:rate|frequency)|freq\w*)|(dt|ts|sample_?time)(?:_s)?", last
        )
        if word is None or array.rows != 1 or array.columns != 1 or array.text:
            continue
        number = float(numbers(array.load(0))[0])
        if np.isfinite(number) and number > 0.0:
            lines.append(f"rate = {number if word[1] else 1.0 / number:.10g}")
    return tuple(lines)


def _lies_on_its_side(array: NamedArray) -> bool:
    """True for a few rows that are much longer than they are many: channels, not samples."""
    return 2 <= array.rows <= _MOST_CHANNELS and array.columns > _LONGER * array.rows


def _clocks(
    placed: Mapping[Channel, tuple[str, int]], arrays: Mapping[str, NamedArray], mapped: bool
) -> dict[Channel, str | None]:
    """Name of the clock of each channel; None for the column t, and for what goes with it."""
    t = next((name for channel, (name, _) in placed.items() if channel.name == "t"), None)
    clocks: dict[Channel, str | None] = {}
    homeless = []
    for channel, (name, _) in placed.items():
        array = arrays[name]
        alike = t is not None and array.rows == arrays[t].rows and (mapped or array.clock is None)
        clocks[channel] = None if alike or t in (name, array.clock) else array.clock
        if not alike and array.clock is None:
            homeless.append(channel)
    lengths = {clock: arrays[clock].rows for clock in clocks.values() if clock is not None}
    for channel in homeless:
        rows = arrays[placed[channel][0]].rows
        clocks[channel] = next((clock for clock, length in lengths.items() if length == rows), None)
    return clocks


def _table(
    contents: Contents, places: Mapping[Channel, tuple[str, int]], clock: str | None, path: Path
) -> RawTable:
    """The columns of one clock."""
    values: dict[str, Array] = {}
    labels: tuple[str, ...] = ()
    rows: dict[str, int] = {}
    long: list[Finding] = []
    for channel, (name, loaded) in _loaded(contents, places).items():
        array = contents.arrays[name]
        rows[channel.name] = len(loaded)
        if channel.name == "label":
            labels = texts(loaded)
            continue
        if array.text:
            raise RecordError(path, f"{name} holds text, expected numbers for {channel.name}")
        if loaded.dtype.kind in "Mm" and channel.unit.symbol != "s":
            raise RecordError(path, f'{name} holds dates, which are read in seconds, expected unit = "s"')
        values[channel.name] = numbers(loaded)
        if channel.name != "t" and (beyond := rounded(loaded)).size:
            long.append(too_long(channel.name, "row", beyond + 1))
    if len(set(rows.values())) > 1:
        counts = ", ".join(f"{count} rows of {name}" for name, count in rows.items())
        raise RecordError(
            path, f"found {counts}, expected as many of each, or a [file.NAME] for each clock of this file"
        )
    stamps = None
    if clock is not None:
        array = contents.arrays[clock]
        stamps = numbers(array.load(0)) * parse_unit(array.unit or "s", f"{path}: {clock}").factor
    return RawTable(
        tuple(places), values, contents.words, max(rows.values()), labels,
        (*contents.findings, *missing(values), *long), stamps,
    )  # fmt: skip


def _loaded(
    contents: Contents, places: Mapping[Channel, tuple[str, int]]
) -> dict[Channel, tuple[str, NDArray[Any]]]:
    """Channels with the name of their array and their columns."""
    together: dict[str, list[int]] = {}
    for name, column in places.values():
        together.setdefault(name, []).append(column)
    read = {}
    for name, columns in together.items():
        array = contents.arrays[name]
        if array.several is not None and len(columns) > 1:
            read[name] = dict(zip(columns, array.several(columns), strict=True))
        else:
            read[name] = {column: array.load(column) for column in columns}
    return {channel: (name, read[name][column]) for channel, (name, column) in places.items()}


def _place(channel: Channel, contents: Contents, options: FileOptions, path: Path) -> tuple[str, int] | None:
    """Name of the array, and the column in it, that a channel comes from; None if this file has none such."""
    match channel.origin:
        case int(number) if contents.tabular:
            name, column = dict(enumerate(contents.arrays)).get(number), 0
        case int(number):
            name, column = _single(contents, options, path), number
        case str(title):
            name, column = _named(title, contents, path), 0
            if name is not None and (columns := contents.arrays[name].columns) > 1:
                raise RecordError(path, f'{name} has {columns} columns, expected ["{name}", column]')
        case (title, number):
            name, column = _named(title, contents, path), number
    return None if name is None or column >= contents.arrays[name].columns else (name, column)


def _named(title: str, contents: Contents, path: Path) -> str | None:
    """The array of that name; the end of its path will do, and the unit in brackets may be left out."""
    if title in contents.arrays:
        return title
    plain = {name: bare(name).strip("/") for name in contents.arrays}
    names = [name for name, bare in plain.items() if bare == title.strip("/")]
    names = names or [name for name, bare in plain.items() if bare.rpartition("/")[2] == title]
    if len(names) > 1:
        raise RecordError(path, f"found {title} in {' and '.join(names[:3])}, expected the whole path")
    return names[0] if names else None


def _single(contents: Contents, options: FileOptions, path: Path) -> str | None:
    """Name of the array a plain column number refers to."""
    if options.variable is not None:
        return _named(options.variable, contents, path)
    several = [name for name, array in contents.arrays.items() if array.rows > 1 and array.columns > 1]
    if len(several) != 1:
        raise RecordError(path, f"holds {contents.words}, expected `variable` under [file] to name one")
    return several[0]
