"""Streams without a header that says what they hold: recognised from their first lines, which are then read again."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import IO, TYPE_CHECKING

from inercal.foundation.errors import InputError, RecordError
from inercal.foundation.records.channels import is_channel
from inercal.foundation.records.titles import name_and_unit

if TYPE_CHECKING:
    from inercal.foundation.records.maps import RecordMap

_TO_TELL = 400
"""Lines from which columns are recognised."""

_HEADED = 3
"""Lines among which a header stands that says it all."""


class Replayed:
    """A stream whose first lines were read already."""

    def __init__(self, lines: list[bytes], stream: IO[bytes]) -> None:
        self._lines, self._stream = lines, stream

    def readline(self, size: int = -1, /) -> bytes:
        """The next line, or at most ``size`` bytes of it; empty at the end."""
        if not self._lines:
            return self._stream.readline(size)
        line = self._lines.pop(0)
        if 0 <= size < len(line):
            self._lines.insert(0, line[size:])
            return line[:size]
        return line


def _is_ours(line: bytes) -> bool:
    """True for a header with a channel of ours and its unit: what is wrong in it is said in its own words."""
    titles = [name_and_unit(title) for title in line.decode("latin-1").split(",")]
    return any(is_channel(name) and name != "t" and unit is not None for name, unit in titles)


def recognised_stream(
    stream: IO[bytes], where: str, answered: Sequence[str] = ()
) -> tuple[Replayed, RecordMap | None]:
    """A stream that is read from its begin, and the map recognised from its first lines, None where its header says
    what it holds; ``where`` names it in errors, and ``answered`` is as of ``--answer``.

    Raises `RecordError` where nothing is recognised, and `MapError` for a guess without an answer.
    """
    from inercal.foundation.records.read import canonical_units

    lines: list[bytes] = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "stream.csv"

        def known(count: int) -> bool:
            while len(lines) < count and (line := stream.readline(1 << 20)):
                lines.append(line)
            path.write_bytes(b"".join(lines))
            return canonical_units([path]) is not None

        if (known(_HEADED) and not answered) or len(lines) < _HEADED or _is_ours(lines[0]):
            return Replayed(lines, stream), None
        known(_TO_TELL)
        from inercal.foundation.records.maps import answers_of  # slow to load, for it brings a checker
        from inercal.foundation.records.recognise.map_text import recognised

        try:
            record_map = recognised([path], answers_of(answered))
        except InputError as error:
            raise RecordError(where, error.message) from error
    if record_map is not None:
        record_map = replace(record_map, path=Path(where))
        record_map.refuse_guess()
    return Replayed(lines, stream), record_map
