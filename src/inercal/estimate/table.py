"""A small table of texts: printed by a command, and shown on a page."""

from __future__ import annotations

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
        lines = (head, *self.rows)
        widths = [max(len(line[i]) for line in lines) for i in range(len(head))]
        return "\n".join(
            "  ".join(
                cell.ljust(width) if i < self.words else cell.rjust(width)
                for i, (cell, width) in enumerate(zip(line, widths, strict=True))
            ).rstrip()
            for line in lines
        )


def heads(*texts: str) -> tuple[tuple[str, str], ...]:
    """Columns of a table from texts such as ``time [s]``: names with their units."""
    parts = (text.partition(" [") for text in texts)
    return tuple((name, unit.removesuffix("]")) for name, _, unit in parts)
