"""Sources of bytes by wire: opened, read piece by piece in a thread, tried again with growing pauses where they die.

Each raises `OSError` where its wire fails; pieces wait in a bounded store.
"""

from __future__ import annotations

import gzip
import queue
import socket
import struct
import sys
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Any, NamedTuple, Protocol

from inercal.bench.live.address import Mqtt, Replay, SerialPort, Source, Tcp, Udp
from inercal.bench.live.broker import Broker
from inercal.foundation._files import is_pipe
from inercal.foundation.errors import InercalError, InputError, MissingExtraError, RecordError

WAIT = 0.1
"""Time [s] after which a source that has nothing lets others look whether it is to end."""

PIECE = 1 << 16

_SO_RXQ_OVFL = 40
"""Option of sockets, on Linux alone, by which the system counts datagrams that it had no room for."""


class Piece(NamedTuple):
    """Bytes that came together; ``whole`` where they end with a row, as a datagram does; ``lost`` is the number of
    datagrams that the system has dropped before them."""

    data: bytes
    whole: bool = False
    lost: int = 0


class Wire(Protocol):
    """An open source."""

    def read(self) -> Piece | None:
        """The next piece, empty where none came in time; None at the end of what ends in order.

        Raises `OSError` where the wire fails.
        """

    def close(self) -> None:
        """Let the wire go."""


def open_wire(source: Source) -> Wire:
    """Open a source; raises `OSError` where it cannot be, `InputError` where trying again would be of no use."""
    match source:
        case SerialPort():
            return _Serial(source)
        case Udp():
            return _Udp(source)
        case Tcp():
            return _Tcp(source)
        case Mqtt():
            return _Mqtt(source)
        case Replay():
            return _Replay(source)


class _Serial:
    """A serial port."""

    def __init__(self, at: SerialPort) -> None:
        try:
            import serial
        except ImportError as error:
            raise MissingExtraError("a serial port", "live") from error
        try:
            self._port: Any = serial.Serial(at.device, at.baud, timeout=WAIT, exclusive=_EXCLUSIVE)
        except ValueError as error:  # a rate that the port does not have
            raise OSError(str(error)) from error

    def read(self) -> Piece:
        """The bytes that have arrived; waits for the first."""
        return Piece(self._port.read(min(max(1, self._port.in_waiting), PIECE)))

    def close(self) -> None:
        """Close the port."""
        self._port.close()


_EXCLUSIVE = None if sys.platform == "win32" else True


class _Udp:
    """Datagrams at a port."""

    def __init__(self, at: Udp) -> None:
        self._socket = bound(at.host, at.port)
        self._lost = 0

    def read(self) -> Piece:
        """A datagram, and how many were dropped before it."""
        try:
            if not hasattr(self._socket, "recvmsg"):  # Windows
                return Piece(self._socket.recv(PIECE), True)
            data, beside, _, _ = self._socket.recvmsg(PIECE, 64)
        except TimeoutError:
            return Piece(b"")
        dropped = 0
        for level, kind, value in beside:
            if level == socket.SOL_SOCKET and kind == _SO_RXQ_OVFL and len(value) >= 4:
                count = struct.unpack("=I", value[:4])[0]
                dropped, self._lost = (count - self._lost) % (1 << 32), count
        return Piece(data, True, dropped)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


def bound(host: str, port: int) -> socket.socket:
    """A socket for datagrams, whose buffer has room for some seconds."""
    family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
    made = socket.socket(family, socket.SOCK_DGRAM)
    try:
        made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
        if sys.platform == "linux":
            made.setsockopt(socket.SOL_SOCKET, _SO_RXQ_OVFL, 1)
        made.settimeout(WAIT)
        made.bind(address)
    except OSError:
        made.close()
        raise
    return made


class _Tcp:
    """A connection to a server."""

    def __init__(self, at: Tcp) -> None:
        self._socket = socket.create_connection((at.host, at.port), timeout=5.0)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        self._socket.settimeout(WAIT)

    def read(self) -> Piece:
        """The bytes that have come."""
        try:
            data = self._socket.recv(PIECE)
        except TimeoutError:
            return Piece(b"")
        if not data:
            raise OSError("the other end has closed the connection")
        return Piece(data)

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()


class _Mqtt:
    """Messages of a topic."""

    def __init__(self, at: Mqtt) -> None:
        self._messages: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        self._broker = Broker(at, self._messages.put)

    def read(self) -> Piece:
        """A message."""
        try:
            return Piece(self._messages.get(timeout=WAIT), True)
        except queue.Empty:
            if self._broker.lost:
                raise OSError(self._broker.lost) from None
            return Piece(b"")

    def close(self) -> None:
        """Leave the broker."""
        self._broker.close()


class _Replay:
    """A recording, packed or not."""

    def __init__(self, at: Replay) -> None:
        if is_pipe(at.file):
            raise RecordError(at.file, "is a pipe or a device, expected a recording in a file")
        try:
            with at.file.open("rb") as file:
                packed = file.read(2) == b"\x1f\x8b"
            self._file: Any = gzip.open(at.file) if packed else at.file.open("rb")  # noqa: SIM115
        except OSError as error:
            raise RecordError(at.file, f"cannot be read ({error.strerror or error})") from error
        self._path = at.file

    def read(self) -> Piece | None:
        """The next bytes."""
        try:
            data = self._file.read(PIECE)
        except (OSError, EOFError, ValueError) as error:
            raise RecordError(self._path, f"cannot be read ({error})") from error
        return Piece(data) if data else None

    def close(self) -> None:
        """Close the file."""
        self._file.close()


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
