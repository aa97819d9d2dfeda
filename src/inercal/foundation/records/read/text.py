"""Text files: CSV and its many dialects.

NumPy reads the first block of lines in one go, and compiled code those of longer files. Only where these can't, or
where something is missing, are lines gone through one by one: every row is kept, with NaN for what is no number, and
the lines are said.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, replace
from itertools import chain, repeat
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.errors import RecordError
from inercal.foundation.findings import Finding
from inercal.foundation.records.channels import Channel, may_be_empty
from inercal.foundation.records.checks import too_long
from inercal.foundation.records.places import counted, counted_names, places, shortened
from inercal.foundation.records.read.layout import UNENDED, Block, TextLayout, blocks, find_layout, is_rounded
from inercal.foundation.records.read.lying import lies_on_its_side, look_at_its_side, on_its_side
from inercal.foundation.records.read.rewriting import is_rewritten, with_layout
from inercal.foundation.records.read.table import LARGEST, FileOptions, FirstLook, RawTable
from inercal.foundation.records.read.time_stamps import seconds_of
from inercal.foundation.records.recognise.lines import heading
from inercal.foundation.records.recognise.shapes import lines_found
from inercal.foundation.records.titles import EXAMPLE, bare, canonical
from inercal.foundation.units import shown

_FEW = 4  # blocks that take NumPy, where nothing is missing, no longer than loading what is compiled
_MOST_ODD = 4096
_NO_LINES = np.empty(0, np.int64)
_HEADER_LINES, _LAYOUT_LINES = 50, 400
_TEXTS = 20  # columns of words
_REST = "rest of t"


@dataclass(frozen=True)
class _Flaws:
    """Numbers of the lines that can't be read, and of those where a column (by index) is empty."""

    bad: NDArray[np.int64]
    missing: tuple[NDArray[np.int64], ...]


def read(
    path: Path,
    options: FileOptions,
    channels: tuple[Channel, ...] | None,
    progress: Callable[[int], None],
) -> list[RawTable]:
    """Read a text file as one table; without ``channels`` its header must be canonical (``t [s],acc_x [m/s^2]``)."""
    if options.transpose:
        return on_its_side(path, options, channels, progress)
    with path.open("rb") as file:
        stream = blocks(file, path)
        if is_rewritten(options):
            head, stream, layout = with_layout(stream, options, _names_wanted(options, channels))
        else:
            head = next(stream)
            layout = find_layout(head.lines, options, path)
        located = locate(channels, layout, head.lines, path)
        t = next((channel for channel in located if channel.name == "t" and channel.stamps), None)
        numbers = {
            channel.name: index for channel, index in located.items()
            if channel.name != "label" and (channel is not t or not _in_words(t))
        }  # fmt: skip
        beside = None if t is None else _beside(t, layout, path)
        if beside is not None and t is not None and not _in_words(t):
            numbers[_REST] = beside
        label = next((index for channel, index in located.items() if channel.name == "label"), None)
        if not located:
            return [RawTable((), {}, contents(layout), 0)]

        pieces: list[list[Array]] = [[] for _ in numbers]
        labels: list[str] = []
        clocks: tuple[list[str], list[str]] = ([], [])
        flaws: list[_Flaws] = []
        rounded: dict[str, list[int]] = {name: [] for name in numbers}
        block = head
        wanted = tuple(numbers.values())
        for number, block in enumerate(chain([head.after(layout.first)], stream)):
            if not layout.decimal and (b"." in block.data or b"," in block.data):
                layout = layout.settled(block.lines)
            read_rows = _gone_through if number >= _FEW or (number and flaws) else _looked_at
            rows, flaw = read_rows(block, layout, wanted)
            flaws += flaw
            for name, column, piece in zip(numbers, pieces, rows.T, strict=True):
                column.append(piece.copy())
                if name != "t":
                    rounded[name] += _rounded(block, layout, numbers[name], piece)
            if label is not None:
                labels += _labels(block, layout, label)
            if t is not None and _in_words(t):
                for texts, index in zip(clocks, (located[t], beside), strict=True):
                    texts += [] if index is None else _labels(block, layout, index)
            progress(file.tell())
    values = {name: np.concatenate(pieces.pop(0)) for name in numbers}
    if t is not None and t.stamps is not None:
        rest = values.pop(_REST, None)
        if _in_words(t):
            values["t"] = seconds_of(clocks[0], t.stamps.order, clocks[1] or None) / t.unit.factor
        elif rest is not None:
            values["t"] = values["t"] + rest * (t.stamps.rest / t.unit.factor)
    if all(np.isnan(column).all() for column in values.values()):
        line = head.lines[layout.first]
        raise RecordError(
            path, f"no row of numbers, line {layout.first + 1} is {shown(line)}, expected numbers"
        )
    count = len(next(iter(values.values())))
    findings = _findings(flaws, tuple(numbers), block, layout, set(numbers.values()))
    findings += tuple(too_long(name, "line", lines) for name, lines in rounded.items() if lines)
    return [RawTable(tuple(located), values, contents(layout), count, tuple(labels), findings)]


def _in_words(t: Channel) -> bool:
    """True for times that are dates and times of day in words."""
    return bool(t.stamps and t.stamps.order)


def _beside(t: Channel, layout: TextLayout, path: Path) -> int | None:
    """Number of the column with the rest of the time, None where there is none."""
    if t.stamps is None or t.stamps.beside is None:
        return None
    found = _index(replace(t, origin=t.stamps.beside), layout, path)
    if found is None:
        raise RecordError(path, f"time.beside: found no {shown(t.stamps.beside)} in {contents(layout)}")
    return found


def _names_wanted(options: FileOptions, channels: tuple[Channel, ...] | None) -> tuple[str, ...]:
    """The names of numbers in objects or documents that channels are found by."""
    origins = [channel.origin for channel in channels or ()]
    origins += [
        each.stamps.beside for each in channels or () if each.stamps and each.stamps.beside is not None
    ]
    return tuple(dict.fromkeys(str(each) for each in origins)) if options.lines else ()


def header(path: Path) -> tuple[Channel, ...]:
    """The channels that a canonical header names; raises `InputError` for any other file."""
    with path.open("rb") as file:
        lines = next(blocks(file, path)).lines
    return _canonical(find_layout(lines, FileOptions(), path), lines, path)


def peek(path: Path) -> list[FirstLook]:
    """Look at the first 2 MB of a text file; lines before the header are found out."""
    with path.open("rb") as file:
        head = next(blocks(file, path))
    if lies_on_its_side(head.lines):
        return [look_at_its_side(path)]
    if (found := lines_found(head.lines)) is not None:
        block, _, layout = with_layout(iter([head]), found.options, found.named)
        first = _first_look(block, layout, found.options)
        return [replace(first, names=found.names, units=found.units, numbered=not found.named)]
    above = heading(head.lines)
    try:
        look = _look(head, _leading(head.lines, path), path)
    except RecordError:
        if above is None:
            raise
        look = None
    if above is None or (look is not None and look.names and not _has_odd_row(look)):
        return [look] if look is not None else []
    other = _look(head, above.first, path)
    if other.names or other.values.shape[1] < len(above.names):
        return [look or other]
    more = other.values.shape[1] - len(above.names)
    names, units = (*above.names, *[""] * more), (*above.units, *[None] * more) if above.units else ()
    return [replace(other, names=names, units=units, numbered=True)]


def _look(head: Block, skip: int, path: Path) -> FirstLook:
    """The rows behind so many lines, with the names in the header, if any."""
    layout = find_layout(head.lines, FileOptions(skip=skip), path)
    layout = layout.settled(head.lines[layout.first :])
    look = _first_look(head.after(layout.first), layout, FileOptions(skip=skip))
    names = (*layout.header, *repeat("", layout.width))[: layout.width] if layout.header else ()
    return replace(look, names=names, leading=tuple(head.lines[:skip]))


def _first_look(block: Block, layout: TextLayout, options: FileOptions) -> FirstLook:
    """The rows of a block, and the texts of columns that hold no numbers."""
    rows, _ = _line_by_line(block, layout, tuple(range(layout.width)))
    worded = np.flatnonzero(np.isnan(rows).mean(axis=0) > 0.5) if len(rows) else ()
    texts = {int(index): tuple(_labels(block, layout, int(index))) for index in worded[:_TEXTS]}
    return FirstLook(rows, (), options, texts=texts)


def _has_odd_row(look: FirstLook) -> bool:
    """True where the first row lacks numbers that nearly all others have, as a row of units does."""
    missing = np.isnan(look.values)
    return bool((missing[0] & (missing.mean(axis=0) < 0.1)).any()) if len(missing) else False


def _leading(lines: list[str], path: Path) -> int:
    """Number of odd lines before the header or the first row."""
    for skip in range(min(_HEADER_LINES, len(lines))):
        try:
            layout = find_layout(lines[:_LAYOUT_LINES], FileOptions(skip=skip), path)
        except RecordError:
            continue
        if layout.header or layout.fields(lines[layout.first]) is not None:
            return skip
    return 0


def locate(
    channels: tuple[Channel, ...] | None, layout: TextLayout, lines: list[str], path: Path
) -> dict[Channel, int]:
    """Number of the column of each channel that a text file holds.

    ``channels`` are those wanted, None for all that the header, one of the first ``lines``, must then name.
    Raises `RecordError` where it names none, or one twice.
    """
    wanted = _canonical(layout, lines, path) if channels is None else channels
    return {channel: index for channel in wanted if (index := _index(channel, layout, path)) is not None}


def _canonical(layout: TextLayout, lines: list[str], path: Path) -> tuple[Channel, ...]:
    """The channels a canonical header names; columns of other names are none of ours."""
    where = f"{path}: line {layout.header_line}"
    if not layout.header:
        line = layout.first
        raise RecordError(
            path,
            f"line {line + 1}: found {shown(lines[line])}, expected a header such as {EXAMPLE}, "
            "or a map (`inercal new` imu, turntable, selfcal or aoa writes one)",
        )
    return canonical(((index, title, None) for index, title in enumerate(layout.header)), where)


def _index(channel: Channel, layout: TextLayout, path: Path) -> int | None:
    """Number of the column a channel comes from, None if this file has none such."""
    match channel.origin:
        case int(number):
            return number if number < layout.width else None
        case str(title):
            plain = [bare(name) for name in layout.header]
            titles = layout.header if title in layout.header else plain
            if titles.count(title) > 1:
                raise RecordError(
                    path, f"line {layout.header_line}: {title!r} twice, expected a column number"
                )
            return titles.index(title) if title in titles else None
        case _:
            return None


def contents(layout: TextLayout) -> str:
    """The contents of the file in words."""
    if not layout.header:
        return f"{layout.width} columns without a header"
    return f"columns {counted_names([shortened(name) for name in layout.header], 20)}"


def _gone_through(block: Block, layout: TextLayout, indices: tuple[int, ...]) -> tuple[Array, list[_Flaws]]:
    """All rows (n, k) of a block by compiled code, those lines apart that hold other than plain numbers."""
    from inercal.foundation.records.read.plain_rows import plain_rows

    places = np.full(layout.width, -1)
    places[list(indices)] = range(len(indices))
    marks = [layout.delimiter or "\0", layout.decimal or "0", *(each[0] for each in layout.comments)]
    if any(not mark.isascii() for mark in marks) or len(set(indices)) < len(indices):
        return _looked_at(block, layout, indices)
    marks.insert(2, block.mark.decode())
    data = np.frombuffer(block.data, np.uint8)
    rows, flaws, pieces = np.empty((block.count, len(indices))), [], []
    at, line, odd = 0, block.first, 1
    while at < len(data):
        count, end = plain_rows(data, at, "".join(marks).encode(), places, LARGEST, rows)
        pieces.append(rows[:count].copy())
        empty = np.isnan(rows[:count])
        if empty.any():
            flaws.append(_Flaws(_NO_LINES, tuple(line + np.flatnonzero(column) for column in empty.T)))
        line += count
        odd = 1 if count > odd else min(2 * odd, _MOST_ODD)
        at = end
        for _ in range(odd):
            end = block.data.find(block.mark, end) + 1 or len(data)
        if at < end:
            part = block.part(at, end, line)
            apart, flaw = _looked_at(part, layout, indices)
            pieces.append(apart)
            flaws += flaw
            line += part.count
        at = end
    return np.concatenate(pieces), flaws


def _looked_at(block: Block, layout: TextLayout, indices: tuple[int, ...]) -> tuple[Array, list[_Flaws]]:
    """All rows (n, k) of a block, by NumPy where it can."""
    rows = _at_once(block, layout, indices)
    if rows is not None:
        return rows, []
    rows, flaw = _line_by_line(block, layout, indices)
    return rows, [flaw]


def _at_once(block: Block, layout: TextLayout, indices: tuple[int, ...]) -> Array | None:
    """All rows (n, k) of a block; None if any line is other than full of numbers."""
    lines, delimiter = block.lines, layout.delimiter
    if delimiter is None:
        widths = set(map(len, map(str.split, lines)))
    else:
        widths = {count + 1 for count in set(map(str.count, lines, repeat(delimiter)))}
    if widths != {layout.width} or any(map(str.startswith, lines, repeat(layout.comments))):
        return None
    if layout.decimal == ",":
        if any("." in line for line in lines):
            return None
        lines = [line.replace(",", ".") for line in lines]
    try:
        rows: Array = np.loadtxt(lines, delimiter=delimiter, usecols=indices, comments=None, ndmin=2)
    except ValueError:
        return None
    return rows if len(rows) == len(lines) and (np.abs(rows) < LARGEST).all() else None


def _line_by_line(block: Block, layout: TextLayout, indices: tuple[int, ...]) -> tuple[Array, _Flaws]:
    """All rows (n, k) of a block, NaN where there is no number, and where that is."""
    rows = np.full((len(block.lines), len(indices)), np.nan)
    lines: list[int] = []
    bad: list[int] = []
    for number, line in enumerate(block.lines, block.first):
        if not layout.is_row(line):
            continue
        fields = layout.fields(line)
        numbers = [None] if fields is None else [layout.number(fields[index]) for index in indices]
        if None in numbers:
            bad.append(number)
        if fields is not None:
            rows[len(lines)] = [math.nan if value is None else value for value in numbers]
        lines.append(number)
    rows = rows[: len(lines)]
    place, badly = np.array(lines, np.int64), np.array(bad, np.int64)
    empty = np.isnan(rows) & ~np.isin(place, badly)[:, np.newaxis]
    return rows, _Flaws(badly, tuple(place[column] for column in empty.T))


def _rounded(block: Block, layout: TextLayout, index: int, values: Array) -> list[int]:
    """Numbers of the lines where the whole number in a column, read as ``values`` (rows of the block,), was rounded."""
    far = np.flatnonzero(np.abs(values) >= 2.0**53)
    if not far.size:
        return []
    rows = [(number, line) for number, line in enumerate(block.lines, block.first) if layout.is_row(line)]
    texts = ((*rows[i], values[i]) for i in far.tolist())
    return [
        number for number, line, value in texts
        if is_rounded((layout.fields(line) or [""] * layout.width)[index], float(value))
    ]  # fmt: skip


def _labels(block: Block, layout: TextLayout, index: int) -> list[str]:
    """The text of the label column, one for each row."""
    rows = (layout.fields(line) for line in block.lines if layout.is_row(line))
    return [sys.intern(fields[index].strip()) if fields else "" for fields in rows]


def _cut(last: Block, layout: TextLayout) -> str:
    """The last number of a block that does not end with a line end, if it may have had more digits; else nothing."""
    *before, line = last.lines[-_LAYOUT_LINES:]
    fields = layout.fields(line) if layout.is_row(line) else None
    if fields is None or not fields[-1].strip():
        return ""
    rows = (layout.fields(each) for each in before if layout.is_row(each))
    return "" if layout.is_whole(fields[-1], [row[-1] for row in rows if row]) else fields[-1].strip()


def _findings(
    flaws: Iterable[_Flaws], names: tuple[str, ...], last: Block, layout: TextLayout, indices: Collection[int]
) -> tuple[Finding, ...]:
    """Findings on rows that cannot be read, and on a file that ends too soon."""
    bad = np.concatenate([_NO_LINES, *(flaw.bad for flaw in flaws)])
    findings = []
    if last.cut and bad.size and bad[-1] == last.last:
        bad = bad[:-1]
        findings.append(Finding("truncated", "the file ends within a row", f"line {last.last}"))
    elif last.early:
        findings.append(Finding("truncated", "the compressed data ends too soon", f"line {last.last}"))
    elif last.cut and layout.width - 1 in indices and (number := _cut(last, layout)):
        findings.append(Finding("truncated", f"{UNENDED}, {shown(number)}, may be cut", f"line {last.last}"))
    if bad.size:
        text = f"{counted(bad.size, 'row')} other than {layout.width} fields with numbers, left as NaN"
        findings.append(Finding("bad_row", text, places("line", bad)))
    for index, name in enumerate(names):
        lines = np.concatenate([_NO_LINES, *(flaw.missing[index] for flaw in flaws)])
        if lines.size and not may_be_empty(name):
            findings.append(
                Finding("nan", f"{name}: {counted(lines.size, 'missing value')}", places("line", lines))
            )
    return tuple(findings)
