"""A small table of texts: printed by a command, and shown on a page."""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Table:
    """Rows of texts under named columns.

    ``columns`` are names and units, empty where a column has none; the first ``words`` of them are text and begin at
    the left, the others are numbers. ``rows`` have a cell for each column; ``caption`` says what they are.
    """

    title: str
    caption: str
    columns: tuple[tuple[str, str], ...]
    rows: tuple[tuple[str, ...], ...]
    words: int = 1

    def text(self) -> str:
        """The table as aligned lines, without title and caption; empty without rows."""
        if not self.rows:
            return ""
        head = tuple(f"{name} [{unit}]" if unit else name for name, unit in self.columns)
        return "\n".join(aligned([head, *self.rows], range(self.words)))


def aligned(rows: Sequence[Sequence[str]], words: Container[int] = (0,), between: str = "  ") -> list[str]:
    """Rows of cells as lines of aligned columns; those of ``words`` begin at the left, the others end at the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        between.join(
            cell.ljust(width) if i in words else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]


def heads(*texts: str) -> tuple[tuple[str, str], ...]:
    """Columns of a table from texts such as ``time [s]``: names with their units."""
    parts = (text.partition(" [") for text in texts)
    return tuple((name, unit.removesuffix("]")) for name, _, unit in parts)
