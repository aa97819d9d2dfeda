"""A source kept alive by a thread: its pieces in a bounded store, tried again with growing pauses where it dies."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import NamedTuple

from inercal.bench.live.address import Mqtt, Replay, SerialPort, Source, Tcp, Udp
from inercal.bench.live.sources import Piece, Wire, open_wire
from inercal.foundation.errors import InercalError, InputError

ROOM = 16 << 20
"""Bytes that may wait to be worked on."""

PAUSES = (0.5, 30.0)
"""First and longest pause [s] before a source is tried again; each is twice the one before."""

SILENCE = 10.0
"""Time [s] without a byte after which that is said."""


class Arrival(NamedTuple):
    """A piece, when it came [s] (`time.perf_counter`), and whether something is missing between it and the last one:
    the source was opened anew, or there was no room."""

    piece: Piece
    at: float
    joined: bool


class Intake:
    """Reads a source in a thread of its own, from `begin` to `end`.

    Where there is no room, a source that can wait (a file, a connection) waits; of any other what comes is dropped, and
    counted.

    Parameters
    ----------
    source : Source
    say : callable
        Told in words that the source has died, lives again, or is silent.
    """

    def __init__(self, source: Source, say: Callable[[str], None]) -> None:
        self._source, self._say = source, say
        self._pieces: deque[Arrival] = deque()
        self._room, self._ended = ROOM, False
        self._change = threading.Condition()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._read, name=f"source {source}", daemon=True)
        self._wire: Wire | None = None
        self.failure: InercalError | None = None
        """The error that ended the source, once it has ended with one."""
        self.received = self.dropped = self.lost_datagrams = self.reconnections = 0
        """Bytes received, bytes dropped for want of room, datagrams that the system dropped, times opened anew."""
        self.alive = False

    def begin(self) -> None:
        """Open the source and begin to read; raises `InputError` where it cannot be opened."""
        try:
            self._wire = open_wire(self._source)
        except OSError as error:
            raise InputError(self._source, f"cannot be opened ({_reason(error)})") from error
        self.alive = True
        self._thread.start()

    def next(self, timeout: float) -> Arrival | None:
        """The next arrival; None where none has come in time, or the source has ended (`ended`)."""
        with self._change:
            if not self._pieces and not self._ended:
                self._change.wait(timeout)
            if not self._pieces:
                return None
            arrival = self._pieces.popleft()
            self._room += len(arrival.piece.data)
            self._change.notify_all()
            return arrival

    @property
    def ended(self) -> bool:
        """True once the source has ended and all of it was taken."""
        return self._ended and not self._pieces

    def stop(self) -> None:
        """Ask the source to end: what has come until now is still handed out, but for a recording."""
        self._stop.set()
        with self._change:
            if isinstance(self._source, Replay):
                self._pieces.clear()
            self._change.notify_all()

    def end(self) -> None:
        """Stop, and wait until the source is let go."""
        self.stop()
        if self._thread.is_alive():
            self._thread.join(timeout=6.0)

    def _read(self) -> None:
        """Read until the source ends or it is asked to end."""
        joined, heard, quiet = True, time.monotonic(), False
        try:
            while not self._stop.is_set():
                try:
                    piece = self._wire.read() if self._wire is not None else None
                except OSError as error:
                    self._again(error)
                    joined, heard, quiet = True, time.monotonic(), False
                    continue
                if piece is None:
                    break
                if piece.data:
                    heard, quiet = time.monotonic(), False
                    joined = self._put(piece, joined)
                elif not quiet and time.monotonic() - heard > SILENCE:
                    quiet = True
                    self._say(f"{self._source}: nothing has come for {SILENCE:g} s")
        except InercalError as error:
            self.failure = error
        except Exception as error:
            self.failure = InputError(self._source, f"fails: unexpected {type(error).__name__} ({error})")
        finally:
            self._close()
            with self._change:
                self._ended = True
                self._change.notify_all()

    def _put(self, piece: Piece, joined: bool) -> bool:
        """Hand a piece on; True where it was dropped, so that the next one does not follow on the last."""
        now = time.perf_counter()
        self.received += len(piece.data)
        self.lost_datagrams += piece.lost
        patient = isinstance(self._source, Replay | Tcp)
        with self._change:
            while self._room < len(piece.data):
                if not patient or self._stop.is_set():
                    if not self.dropped:
                        self._say(
                            f"{self._source}: rows come faster than they are worked on, some are dropped"
                        )
                    self.dropped += len(piece.data)
                    return True
                self._change.wait(0.1)
            self._room -= len(piece.data)
            self._pieces.append(Arrival(piece, now, joined))
            self._change.notify_all()
        return False

    def _again(self, error: OSError) -> None:
        """Open a source that has died, again and again, with growing pauses."""
        self._close()
        pause, longest = PAUSES
        self._say(f"{self._source}: lost ({_reason(error)}), tried again in {pause:g} s")
        while not self._stop.wait(pause):
            try:
                self._wire = open_wire(self._source)
            except OSError as again:
                pause = min(2.0 * pause, longest)
                self._say(f"{self._source}: cannot be opened ({_reason(again)}), tried again in {pause:g} s")
            else:
                self.reconnections += 1
                self.alive = True
                self._say(f"{self._source}: there again")
                return

    def _close(self) -> None:
        """Let the wire go, however it is."""
        self.alive = False
        wire, self._wire = self._wire, None
        if wire is not None:
            with suppress(OSError):
                wire.close()


def may_begin_within_a_row(source: Source) -> bool:
    """True for a source that may be joined in the middle of a row."""
    return isinstance(source, SerialPort | Tcp)


def is_datagrams(source: Source) -> bool:
    """True for a source of whole rows."""
    return isinstance(source, Udp | Mqtt)


def _reason(error: OSError) -> str:
    """The operating system's words."""
    return error.strerror or str(error) or type(error).__name__
