"""Sinks of rows: each behind a bounded queue and a thread of its own, so that a slow one stops nobody."""

from __future__ import annotations

import math
import os
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, Protocol

from inercal.bench.live.address import Mqtt, PieceFolder, Sink, Text, Udp
from inercal.bench.live.broker import Broker
from inercal.bench.live.counts import SinkCounts, TimeSpread
from inercal.bench.live.pieces import EstimatorRow, PieceFiles, payload
from inercal.foundation.errors import InputError

ROOM = 10_000
"""Rows that may wait for a sink."""

WAIT = 0.2
GOODBYE = 5.0
"""Time [s] that a sink is given at the end whose reader may be stuck."""


class Writer(Protocol):
    """The place where the rows of a sink go; each method raises `OSError` or `InercalError` where it cannot go on."""

    @property
    def held(self) -> int:
        """Rows that were taken and are not out yet."""

    @property
    def goodbye(self) -> float:
        """Time [s] that it is given at the end, and before a checkpoint, for the rows that it has."""

    def begin(self, columns: Sequence[str]) -> None:
        """Take the titles of the rows, before the first of them."""

    def write(self, rows: Sequence[EstimatorRow]) -> int:
        """Take rows, perhaps none, some time after the last call; how many were delivered."""

    def settle(self) -> None:
        """Put on the disk what is held back."""

    def close(self) -> None:
        """End in order."""


class Outlet:
    """A sink at work.

    Parameters
    ----------
    sink : Sink
    print_line : callable
        Takes lines for standard output.
    say : callable
        Told in words what goes wrong.

    Raises
    ------
    InputError
        The sink cannot be opened.
    """

    def __init__(
        self,
        sink: Sink,
        print_line: Callable[[str], None],
        say: Callable[[str], None],
    ) -> None:
        self.name, self._say = str(sink), say
        try:
            self._writer = _writer(sink, print_line, say)
        except OSError as error:
            raise InputError(sink, f"cannot be opened ({error.strerror or error})") from error
        self._rows: deque[EstimatorRow] = deque()
        self._change = threading.Condition()
        self._busy, self._closing, self._settled, self._asked_to_settle = False, False, True, False
        self._columns: Sequence[str] = ()
        self._begun = False
        self._written = self._dropped = 0
        self._times = TimeSpread()
        self.failure = ""
        self._thread = threading.Thread(target=self._work, name=f"sink {sink}", daemon=True)

    def begin(self, columns: Sequence[str]) -> None:
        """Begin to take rows of these columns."""
        self._columns, self._begun = columns, True
        self._thread.start()

    def offer(self, row: EstimatorRow) -> None:
        """Take a row, or drop the row if the queue is full."""
        with self._change:
            if self.failure or len(self._rows) >= ROOM:
                if not self._dropped and not self.failure:
                    self._say(f"{self.name}: is too slow, rows are dropped")
                self._dropped += 1
                return
            self._rows.append(row)
            self._settled = False
            if not self._busy:
                self._change.notify_all()

    def settle(self) -> None:
        """Wait until all rows are written, as long as a sink is given at the end."""
        with self._change:
            self._asked_to_settle = True
            self._change.notify_all()
            self._change.wait_for(lambda: self._settled or bool(self.failure), self._writer.goodbye)

    def close(self) -> None:
        """Write what waits, as far as it goes in time, and end; the rest is dropped, and counted."""
        with self._change:
            self._closing = True
            self._change.notify_all()
        if not self._begun:
            self._writer.close()
            return
        self._thread.join(self._writer.goodbye)
        late = self._thread.is_alive()
        with self._change:
            held = self._writer.held if late else 0
            self._written -= held
            self._dropped += len(self._rows) + held
            self._rows.clear()
        if late:
            self._say(
                f"{self.name}: has not taken its last rows in {self._writer.goodbye:g} s, they are dropped"
            )

    @property
    def counts(self) -> SinkCounts:
        """Rows written and dropped until now."""
        with self._change:
            return SinkCounts(
                self._written,
                self._dropped,
                self._times.quantile(0.5),
                self._times.quantile(0.99),
                self.failure,
            )

    def _work(self) -> None:
        """Write rows as they come."""
        try:
            self._writer.begin(self._columns)
            while not self._closing or self._rows:
                self._some()
            self._writer.close()
        except Exception as error:  # whatever a library makes of it: the others go on
            why = (error.strerror if isinstance(error, OSError) else "") or str(error)
            with self._change:
                self.failure = why
                self._written -= self._writer.held
                self._dropped += len(self._rows) + self._writer.held
                self._rows.clear()
                self._change.notify_all()
            self._say(f"{self.name}: takes no more rows ({why})")
            with suppress(Exception):
                self._writer.close()

    def _some(self) -> None:
        """Write the rows that wait; of a sink that fails meanwhile they count as dropped."""
        with self._change:
            if not self._rows and not self._closing and not self._asked_to_settle:
                self._change.wait(WAIT)
            rows, settling = list(self._rows), self._asked_to_settle
            self._rows.clear()
            self._busy = True
        delivered = 0
        try:
            delivered = self._writer.write(rows)
            if settling:
                self._writer.settle()
        finally:
            now = time.perf_counter()
            with self._change:
                self._busy = False
                self._written += delivered
                self._dropped += len(rows) - delivered
                for row in rows if delivered == len(rows) and not self._writer.held else ():
                    self._times.on(now - row.at)
                if settling and not self._rows:
                    self._settled, self._asked_to_settle = True, False
                self._change.notify_all()


def _writer(sink: Sink, print_line: Callable[[str], None], say: Callable[[str], None]) -> Writer:
    """The writer of a sink."""
    match sink:
        case Text(file=None):
            return _Printed(print_line)
        case Text():
            return _TextFile(sink)
        case PieceFolder():
            return PieceFiles(sink)
        case Udp():
            return _Datagrams(sink)
        case Mqtt():
            return _Messages(sink, say)


class _AtOnce:
    """A writer that holds no row back, and whose reader may be stuck."""

    held = 0

    @property
    def goodbye(self) -> float:
        """Time [s] for the last rows."""
        return GOODBYE

    def settle(self) -> None:
        """Hold no row back."""


class _Printed(_AtOnce):
    """Lines on standard output."""

    def __init__(self, print_line: Callable[[str], None]) -> None:
        self._print = print_line

    def begin(self, columns: Sequence[str]) -> None:
        """Print the titles."""
        self._print(",".join(columns))

    def write(self, rows: Sequence[EstimatorRow]) -> int:
        """Print lines."""
        if rows:
            self._print("\n".join(row.text for row in rows))
        return len(rows)

    def close(self) -> None:
        """Standard output stays open."""


class _TextFile(_AtOnce):
    """Lines in a file, which is a new one."""

    def __init__(self, sink: Text) -> None:
        self._file = new_file(str(sink.file))

    def begin(self, columns: Sequence[str]) -> None:
        """Write the titles."""
        os.write(self._file, f"{','.join(columns)}\n".encode())

    def write(self, rows: Sequence[EstimatorRow]) -> int:
        """Append whole lines to the file."""
        data = "".join(f"{row.text}\n" for row in rows).encode()
        while data:
            data = data[os.write(self._file, data) :]
        return len(rows)

    def settle(self) -> None:
        """Bring the file to the disk."""
        with suppress(OSError):  # a pipe
            os.fsync(self._file)

    def close(self) -> None:
        """Close the file."""
        os.close(self._file)


def new_file(path: str) -> int:
    """A file to write to that was not there, or a pipe or device; raises `InputError` for one that is there."""
    from inercal.foundation._files import is_pipe

    flags = os.O_WRONLY | (0 if is_pipe(path) else os.O_CREAT | os.O_EXCL) | getattr(os, "O_BINARY", 0)
    try:
        return os.open(path, flags, 0o666)
    except FileExistsError:
        raise InputError(path, "is there already, expected the name of a new file") from None
    except OSError as error:
        raise InputError(path, f"cannot be written ({error.strerror or error})") from error


class _Datagrams(_AtOnce):
    """A line a datagram, the titles first and again each second, so that who comes later knows them."""

    def __init__(self, sink: Udp) -> None:
        self._address: Any
        family, _, _, _, self._address = socket.getaddrinfo(sink.host, sink.port, type=socket.SOCK_DGRAM)[0]
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._titles, self._due = b"", -math.inf

    def begin(self, columns: Sequence[str]) -> None:
        """Take the titles."""
        self._titles = f"{','.join(columns)}\n".encode()

    def write(self, rows: Sequence[EstimatorRow]) -> int:
        """Send them; nobody may be listening."""
        if time.monotonic() >= self._due:
            self._due = time.monotonic() + 1.0
            self._sent(self._titles)
        return sum(self._sent(f"{row.text}\n".encode()) for row in rows)

    def _sent(self, data: bytes) -> bool:
        """Send a datagram; false where the system could not."""
        try:
            self._socket.sendto(data, self._address)
        except ConnectionRefusedError:  # of an earlier one: nobody was listening
            return True
        except OSError:
            return False
        return True

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


class _Messages(_AtOnce):
    """A message a row at a broker, which is tried again with growing pauses where it has gone."""

    def __init__(self, sink: Mqtt, say: Callable[[str], None]) -> None:
        self._at, self._say = sink, say
        self._columns: Sequence[str] = ()
        self._broker: Broker | None = Broker(sink)
        self._pause, self._due = 0.5, 0.0

    def begin(self, columns: Sequence[str]) -> None:
        """Take the titles."""
        self._columns = columns

    def write(self, rows: Sequence[EstimatorRow]) -> int:
        """Publish them; those that the broker has not confirmed when it goes are lost, and counted."""
        if self._broker is None and not self._again():
            return 0
        assert self._broker is not None
        confirmed = self._broker.send([payload(self._columns, row.values) for row in rows])
        if self._broker.lost:
            self._say(f"{self._at}: lost ({self._broker.lost}), tried again")
            self._broker.close()
            self._broker, self._pause, self._due = None, 0.5, time.monotonic() + 0.5
        return confirmed

    def _again(self) -> bool:
        """True once the broker answers again."""
        if time.monotonic() < self._due:
            return False
        try:
            self._broker = Broker(self._at)
        except OSError:
            self._pause = min(2.0 * self._pause, 30.0)
            self._due = time.monotonic() + self._pause
            return False
        self._say(f"{self._at}: there again")
        return True

    def close(self) -> None:
        """Leave the broker."""
        if self._broker is not None:
            self._broker.close()
