"""Lines of a text file, plain or compressed, in blocks of about 2 MB."""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path

from inercal.errors import RecordError

_BLOCK = 1 << 21
_GZIP = b"\x1f\x8b"
_BOM = b"\xef\xbb\xbf"


@dataclass(frozen=True)
class Block:
    """Whole lines; ``first`` is the number of the first, counted from 1.

    The last block of a file is ``cut`` if it does not end with a line end, and ``early`` if the compressed
    data ends before its end mark.
    """

    lines: list[str]
    first: int = 1
    cut: bool = False
    early: bool = False

    def after(self, count: int) -> Block:
        """The block without its first ``count`` lines."""
        return Block(self.lines[count:], self.first + count, self.cut, self.early)

    @property
    def last(self) -> int:
        """Number of the last line."""
        return self.first + len(self.lines) - 1


def blocks(file: BufferedReader, path: Path) -> Iterator[Block]:
    """Blocks of lines of an open file, at least one; raises `RecordError` if it can't be text."""
    packed = file.peek(2)[:2] == _GZIP
    stream = gzip.GzipFile(fileobj=file) if packed else file
    first, early, held = 1, False, bytearray()
    try:
        while piece := stream.read1(_BLOCK):
            held += piece
            if len(held) < _BLOCK:
                continue
            end = held.rfind(b"\n") + 1
            if end == 0:
                raise RecordError(
                    path, f"line {first}: longer than {len(held)} bytes, expected lines of text"
                )
            lines = _text(held[:end], first).split("\n")
            lines.pop()
            yield Block(lines, first)
            first += len(lines)
            del held[:end]
    except EOFError:
        early = True
    except (gzip.BadGzipFile, zlib.error) as error:
        raise RecordError(path, f"compressed data is damaged after line {first} ({error})") from error
    if not held and first == 1:
        raise RecordError(path, "is empty, expected lines of numbers")
    if held or early:
        lines = _text(held, first).split("\n")
        cut = lines[-1] != ""
        yield Block(lines if cut else lines[:-1], first, cut, early)


def _text(data: bytearray, first: int) -> str:
    """Bytes as text: UTF-8, else Latin-1; line ends as a single newline."""
    if first == 1 and data.startswith(_BOM):
        data = data[len(_BOM) :]
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    return text.replace("\r\n", "\n") if "\r" in text else text
