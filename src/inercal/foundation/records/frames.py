"""Binary frames: sync bytes, numbers, and a check, as a map describes them; sought in a file or in bytes as they come.

What is found depends on the bytes alone, not on the pieces in which they come. Where a check fails the search goes
on one byte later, so that no damaged frame takes a sound one with it; each byte is in a frame or is passed over.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.records.checksums import NONE, Check


@dataclass(frozen=True)
class Frame:
    """The layout of a frame: ``sync``, then ``fields`` of the ``types`` (of NumPy, or ``x3`` for three bytes of no
    use), and at the end the ``check`` over all before it from the byte ``check_begin`` on, in the byte ``order``.

    ``length`` is that of the whole frame [byte]; what lies between the last field and the check is of no use.
    ``counter`` names the field that goes up by one from frame to frame, if there is one.
    """

    sync: bytes
    fields: tuple[str, ...]
    types: tuple[str, ...]
    check: Check = NONE
    check_begin: int = 0
    order: str = "<"
    length: int = 0
    counter: str = ""

    @property
    def least(self) -> int:
        """Length [byte] of sync, fields and check."""
        return len(self.sync) + sum(map(_bytes, self.types)) + self.check.width // 8

    @property
    def size(self) -> int:
        """Length [byte] of a whole frame."""
        return self.length or self.least

    @cached_property
    def dtype(self) -> np.dtype[Any]:
        """The fields of a frame, those of no use left out."""
        names, formats, offsets, at = [], [], [], len(self.sync)
        for name, kind in zip(self.fields, self.types, strict=True):
            if not kind.startswith("x"):
                names.append(name)
                formats.append(kind)
                offsets.append(at)
            at += _bytes(kind)
        return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": self.size})

    @cached_property
    def _sought(self) -> tuple[NDArray[np.uint8], int, int, bool, NDArray[np.int64], NDArray[np.int64]]:
        """The arguments of the search after the bytes."""
        check = self.check
        form = np.array([check.kind, check.width, check.start, check.reflected, check.end], np.int64)
        sync = np.frombuffer(self.sync, np.uint8)
        return sync, self.size, self.check_begin, self.order == "<", form, check.table


class FoundFrames(NamedTuple):
    """Frames that were found: ``rows`` (n,) of the fields, the ``consumed`` bytes, which need not be looked at again,
    those of them that were ``passed_over``, and the number of frames whose check failed."""

    rows: NDArray[Any]
    consumed: int
    passed_over: int
    damaged: int


def frames_in(data: bytes, frame: Frame) -> FoundFrames:
    """The frames in bytes; those of a frame that has only begun are not consumed."""
    from inercal.foundation.records.frame_kernel import seek

    raw = np.frombuffer(data, np.uint8)
    places = np.empty(len(raw) // frame.size + 1, np.int64)
    count, consumed, damaged = seek(raw, *frame._sought, places)
    whole = raw[places[:count, None] + np.arange(frame.size)]
    rows = np.ascontiguousarray(whole).view(frame.dtype).reshape(count)
    return FoundFrames(rows, int(consumed), int(consumed - count * frame.size), int(damaged))


class CounterTurns(NamedTuple):
    """The ``newest`` value of a counter that begins anew at 2^bits, as if it never did, -1 before the first; and how
    many before that are ``missing``."""

    newest: int = -1
    missing: int = 0

    def on(self, values: NDArray[Any]) -> tuple[CounterTurns, NDArray[np.int64]]:
        """After more values (n,) of an unsigned type: how the counter stands, and the values as if it never began
        anew. Each is within half the range of the newest before it, for one out of order may be wrong."""
        bits = 8 * values.dtype.itemsize
        numbers = values.astype(np.int64)
        if not len(numbers) or bits > 32:
            return self, numbers
        half = 1 << (bits - 1)
        begin = numbers[0] - 1 if self.newest < 0 else self.newest
        steps = half - (half - np.diff(numbers, prepend=begin)) % (2 * half)
        numbers = begin + np.cumsum(steps)
        row = 0
        for first in np.flatnonzero(steps < 0).tolist():
            if first < row:
                continue
            row, newest = first, numbers[first - 1] if first else begin
            while row < len(numbers) and numbers[row] < newest:
                if off := (newest - half - numbers[row]) // (2 * half) + 1:
                    numbers[row:] += 2 * half * off
                row += numbers[row] < newest
        newest = np.maximum.accumulate(np.concatenate([[begin], numbers]))
        gained = np.diff(newest)
        missing = int(np.sum(gained[gained > 0] - 1)) - int(np.sum(numbers < newest[:-1]))
        return CounterTurns(int(newest[-1]), self.missing + missing), numbers


def _bytes(kind: str) -> int:
    """Length [byte] of a field."""
    return int(kind[1:]) if kind.startswith("x") else np.dtype(kind).itemsize
