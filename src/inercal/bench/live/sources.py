"""Sources of bytes by wire: opened, read piece by piece, closed; each raises `OSError` where its wire fails."""

from __future__ import annotations

import gzip
import queue
import socket
import struct
import sys
from typing import Any, NamedTuple, Protocol

from inercal.bench.live.address import Mqtt, Replay, SerialPort, Source, Tcp, Udp
from inercal.bench.live.broker import Broker
from inercal.foundation._files import is_pipe
from inercal.foundation.errors import MissingExtraError, RecordError

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
