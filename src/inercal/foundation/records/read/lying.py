"""Text files that lie on their side: a line for each channel."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import RecordError
from inercal.foundation.findings import Finding
from inercal.foundation.records.channels import Channel
from inercal.foundation.records.read.arrays import Contents, held, tables
from inercal.foundation.records.read.layout import UNENDED, blocks, find_layout
from inercal.foundation.records.read.table import FileOptions, FirstLook, RawTable

_MOST, _LONG = 60, 100  # lines of a text on its side, and fields of each at least


def lies_on_its_side(lines: Sequence[str]) -> bool:
    """True for a few lines of very many fields: channels, not rows."""
    rows = [line for line in lines if line.strip()]
    if not 1 < len(rows) <= _MOST:
        return False
    widths = {max(len(line.split(mark)) for mark in (",", ";", "\t", None)) for line in rows}
    return min(widths) > _LONG and max(widths) - min(widths) <= 1


def look_at_its_side(path: Path) -> FirstLook:
    """A first look at a text with a line for each channel; raises `RecordError` as `on_its_side`."""
    options = FileOptions(transpose=True)
    columns, _ = _columns(path, options)
    named = not all(name.startswith("line ") for name in columns)
    return FirstLook(np.stack(list(columns.values()), axis=1), tuple(columns) if named else (), options)


def on_its_side(
    path: Path,
    options: FileOptions,
    channels: tuple[Channel, ...] | None,
    progress: Callable[[int], None],
) -> list[RawTable]:
    """Read a file with a line for each channel; a line may begin with a name, by which the map then finds it.

    Raises `RecordError` where the lines have no numbers, or not equally many.
    """
    columns, findings = _columns(path, options)
    progress(path.stat().st_size)
    arrays = {name: held(values) for name, values in columns.items()}
    return tables(Contents(arrays, findings, tabular=True), options, channels or (), path, mapped=True)


def _columns(path: Path, options: FileOptions) -> tuple[dict[str, Array], tuple[Finding, ...]]:
    """The channels (n,) of a text by the name at the begin of each line, or its number."""
    lines: list[str] = []
    with path.open("rb") as file:
        for block in blocks(file, path):
            lines += block.lines
    layout = find_layout(lines, options, path).settled(lines)
    rows = [layout.fields(line) for line in lines[options.skip :] if layout.is_row(line)]
    if any(row is None for row in rows):
        raise RecordError(
            path, "found lines of different lengths, expected equally many numbers for each channel"
        )
    texts = [row for row in rows if row]
    named = all(layout.number(row[0]) is None for row in texts)
    names = [row[0].strip() if named else f"line {k}" for k, row in enumerate(texts, 1)]
    numbers = [[layout.number(text) for text in row[named:]] for row in texts]
    if any(value is None for row in numbers for value in row):
        raise RecordError(path, "found words among the numbers, expected a line of numbers for each channel")
    values = np.array(numbers, dtype=float)
    last = texts[-1]
    cut = block.cut and not layout.is_whole(last[-1], last[named:-1])
    findings = (
        (Finding("truncated", f"{UNENDED}, {last[-1]}, may be cut", f"line {block.last}"),) if cut else ()
    )
    return dict(zip(names, values, strict=True)), findings
