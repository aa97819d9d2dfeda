"""Rows out of bytes: whole lines of text, and frames as such lines, each byte of them used or counted as left out.

Text is cut at line ends. Where a source was joined within a row, what comes before the first line end is left out, for
a number may be cut, unless it is a header; a header that comes again, as from a device that was started anew, is passed
over. Frames become lines of their fields (`Feed.record_map`), so that all that follows is as of text.

A recording holds the bytes that were used, and those between frames; not the begun row that a break left behind, which
would run into the next. So the same rows are in it.
"""

from __future__ import annotations

import re
from collections import deque
from dataclasses import replace
from typing import IO, TYPE_CHECKING

from inercal.bench.live.sources import Arrival, Intake
from inercal.foundation.errors import MapError, RecordError
from inercal.foundation.records.frames import CounterTurns, Frame, frames_in
from inercal.foundation.records.places import counted_names, shortened
from inercal.foundation.records.read.table import FileOptions, FileShare
from inercal.foundation.units import shown

if TYPE_CHECKING:
    from collections.abc import Callable

    from inercal.foundation.records.maps import RecordMap

LONGEST = 1 << 16
"""Bytes of a line, above which it is no line of text."""

_WORD = re.compile(rb"\s*[A-Za-z_][^,;\t]*")
_MISSING = (b"", b"nan", b"na", b"n/a", b"null", b"none", b"inf")


class Feed:
    """The lines of a source, for `inercal.faces.stream.lines.Lines`.

    Parameters
    ----------
    intake : Intake
    record_map : RecordMap or None
        With ``sync`` under ``[file]`` the bytes are frames.
    may_be_cut : bool
        True for a source that may be joined within a row.
    record : file, optional
        Takes the bytes that the rows are made of.
    say : callable
        Told in words what goes wrong.

    Raises
    ------
    MapError
        A channel from a field that the frame does not have.
    """

    def __init__(
        self,
        intake: Intake,
        record_map: RecordMap | None,
        may_be_cut: bool,
        record: IO[bytes] | None,
        say: Callable[[str], None],
    ) -> None:
        self._intake, self._may_be_cut, self._record, self._say = intake, may_be_cut, record, say
        self._frame = frame_of(record_map)
        self.record_map = record_map if self._frame is None else _as_text(record_map, self._frame)
        self._stamp = _stamp_field(record_map, self._frame)
        self._turns = {
            name: CounterTurns() for name in {self._stamp, self._frame and self._frame.counter} if name
        }
        self._held = bytearray()
        self._lines: deque[bytes] = deque()
        self._header, self._begun, self._cut, self._skipping = b"", False, False, False
        self.arrived = 0.0
        """Time [s] (`time.perf_counter`) at which the line came that was taken last."""
        self.used = self.left_out = self.cut = self.damaged = self.headers = 0
        """Bytes in rows, bytes in none; rows cut at a join; frames with a wrong check; headers that came again."""
        self.record_failed = False

    @property
    def missing(self) -> int | None:
        """Number of frames that the counter shows missing, None without a counter."""
        counter = "" if self._frame is None else self._frame.counter
        return self._turns[counter].missing if counter else None

    def readline(self, _: int = -1) -> bytes:
        """The next line; empty at the end. Waits for it."""
        while not self._lines:
            arrival = self._intake.next(0.5)
            if arrival is not None:
                self._take(arrival)
            elif self._intake.ended:
                self.left_out += len(self._held)
                self._held.clear()
                return b""
        return self._lines.popleft()

    def _take(self, arrival: Arrival) -> None:
        """Cut a piece into lines."""
        if arrival.joined:
            self.left_out += len(self._held)
            self.cut += bool(self._held)
            self._held.clear()
            self._cut = self._may_be_cut
        self.arrived = arrival.at
        self._held += arrival.piece.data
        if self._frame is not None:
            self._frames(self._frame)
            return
        if arrival.piece.whole and not self._held.endswith(b"\n"):
            self._held += b"\n"
            self.used -= 1  # it did not come
        self._text()

    def _text(self) -> None:
        """Take the whole lines of what is held."""
        end = self._held.rfind(b"\n") + 1
        lines = [line + b"\n" for line in bytes(self._held[:end]).split(b"\n")[:-1]]
        taken = [line for line in lines if self._kept(line)]
        del self._held[:end]
        if len(self._held) > LONGEST:
            self.left_out += len(self._held)
            self._held.clear()
            self._skipping = True
        self._write(b"".join(taken))
        self._lines.extend(taken)

    def _kept(self, line: bytes) -> bool:
        """True for a line to hand on; any other is counted."""
        cut, self._cut = self._cut, False
        skipped, self._skipping = self._skipping, False
        header = _is_header(line)
        if skipped or (cut and not header):
            self.cut += 1
            self.left_out += len(line)
            return False
        self.used += len(line)
        if header and self._begun and line.strip() == self._header:
            self.headers += 1
            return False
        if header and self._header and b"[" in line and _first(line) == _first(self._header):
            raise RecordError(
                "the source",
                f"found other columns than at its beginning ({shown(line.decode('utf-8', 'replace').strip())}), "
                "expected the same",
            )
        if header and not self._begun:
            self._header = line.strip()
        self._begun = True
        return True

    def _frames(self, frame: Frame) -> None:
        """Take the frames of what is held, as lines."""
        found = frames_in(bytes(self._held), frame)
        self._write(bytes(self._held[: found.consumed]))
        del self._held[: found.consumed]
        self.left_out += found.passed_over
        self.used += found.consumed - found.passed_over
        self.damaged += found.damaged
        if not len(found.rows):
            return
        rows = found.rows.tolist()
        names = found.rows.dtype.names or ()
        for name, turns in self._turns.items():
            self._turns[name], numbers = turns.on(found.rows[name])
            if name == self._stamp:
                k = names.index(name)
                rows = [
                    (*row[:k], number, *row[k + 1 :])
                    for row, number in zip(rows, numbers.tolist(), strict=True)
                ]
        self._lines.extend(f"{','.join(map(repr, row))}\n".encode() for row in rows)

    def _write(self, data: bytes) -> None:
        """Record bytes; a record that cannot be written on is given up, and that is said."""
        if self._record is None or not data:
            return
        try:
            self._record.write(data)
        except OSError as error:
            self._say(f"the recording cannot be written on ({error.strerror or error}), it ends here")
            self._record, self.record_failed = None, True


def frame_of(record_map: RecordMap | None) -> Frame | None:
    """The frame that a map describes, None for text; raises `MapError` for numbers without sync bytes."""
    if record_map is None or len(record_map.parts) != 1:
        return None  # several parts are refused with the lines
    options = record_map.parts[0].options
    if options.binary and options.frame is None:
        raise MapError(
            record_map.path,
            "file.sync: missing, expected the bytes with which a frame of a live source begins",
        )
    return options.frame


def _as_text(record_map: RecordMap | None, frame: Frame) -> RecordMap | None:
    """The map of the lines that frames become."""
    if record_map is None:
        return None
    (part,) = record_map.parts
    names, channels = list(frame.dtype.names or ()), []
    for channel in part.channels or ():
        origin = names.index(channel.origin) if channel.origin in names else channel.origin
        if not isinstance(origin, int) or not 0 <= origin < len(names):
            held = counted_names([shortened(name) for name in names], 12)
            raise MapError(
                f"{record_map.path}: columns.{channel.name}.from",
                f"found no {shown(channel.origin)} in the frame ({held}), expected it there",
            )
        channels.append(replace(channel, origin=origin))
    as_text = FileShare(tuple(channels), FileOptions(delimiter=",", decimal=".", comment=""))
    return replace(record_map, parts=(as_text,))


def _stamp_field(record_map: RecordMap | None, frame: Frame | None) -> str:
    """The unsigned field of a frame that the time is from; empty where there is none."""
    if record_map is None or frame is None or record_map.ignore_time:
        return ""
    names = frame.dtype.names or ()
    for channel in record_map.parts[0].channels or ():
        if channel.name == "t":
            field = names[channel.origin] if isinstance(channel.origin, int) else str(channel.origin)
            return field if field in names and frame.dtype[field].kind == "u" else ""
    return ""


def _is_header(line: bytes) -> bool:
    """True for a line of which most fields are words."""
    fields = re.split(rb"[,;\t]", line.strip())
    words = sum(bool(_WORD.fullmatch(field)) and field.strip().lower() not in _MISSING for field in fields)
    return 2 * words > len(fields)


def _first(line: bytes) -> bytes:
    """The first field of a line."""
    return re.split(rb"[,;\t]", line.strip(), maxsplit=1)[0]
