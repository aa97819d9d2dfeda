"""Limits of the readers: a file that asks for more is refused in one sentence, before memory or time is gone."""

from __future__ import annotations

from pathlib import Path

from inercal.foundation.errors import RecordError

_MIB = 1 << 20

HEADER = 65_536
"""Characters of the line that names the columns of a text file."""

TITLE = 200
"""Characters of the title of a column, and of a unit: one that is longer names no channel."""

LINE = 2 * _MIB
"""Bytes of a line of a text file."""

NESTING = 16
"""Levels of structures, groups and messages within each other."""

FIELDS = 10_000
"""Arrays of a file, or fields of the messages of a topic, that are listed."""


def unpacked(size: int) -> int:
    """Bytes that a file of ``size`` bytes may hold once it is unpacked: 256 MiB, and 100 for each of its own."""
    return 256 * _MIB + 100 * size


def memory(size: int) -> int:
    """Bytes of memory that reading a file of ``size`` bytes may take: 512 MiB, and four times what it may hold."""
    return 512 * _MIB + 4 * unpacked(size)


def seconds(size: int) -> int:
    """Processor time [s] that reading a file of ``size`` bytes may take: 8 s, and 4 s for each MiB."""
    return 8 + 4 * size // _MIB


def check_unpacked(path: Path, held: int, size: int) -> None:
    """Refuse a file of ``size`` bytes that holds more than it may; raises `RecordError`."""
    if held > unpacked(size):
        raise RecordError(
            path,
            f"found {size} bytes that unpack to {held} or more, expected at most 256 MiB and 100 for each byte, "
            f"{unpacked(size)} in all",
        )


def size_of(path: Path) -> int:
    """Bytes of a file, or of the files of a folder."""
    files = [path] if path.is_file() else [file for file in path.iterdir() if file.is_file()]
    return sum(file.stat().st_size for file in files)
