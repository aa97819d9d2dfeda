"""Text files that lie on their side: a line for each channel."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from inercal.foundation.errors import RecordError
from inercal.foundation.findings import Finding
from inercal.foundation.records.channels import Channel
from inercal.foundation.records.read.arrays import Contents, held, tables
from inercal.foundation.records.read.layout import UNENDED, blocks, find_layout
from inercal.foundation.records.read.table import FileOptions, RawTable


def on_its_side(
    path: Path,
    options: FileOptions,
    channels: tuple[Channel, ...] | None,
    progress: Callable[[int], None],
) -> list[RawTable]:
    """Read a file with a line for each channel; a line may begin with a name, by which the map then finds it.

    Raises `RecordError` where the lines have no numbers, or not equally many.
    """
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
    progress(path.stat().st_size)
    columns = {name: held(row) for name, row in zip(names, values, strict=True)}
    return tables(Contents(columns, findings, tabular=True), options, channels or (), path, mapped=True)
