"""A recursive estimator on a stream: sample in, line out, the state saved now and then and resumed.

What is saved says which rows the state has seen. A stream that begins with the row that the saved one began
with is that stream again: the rows seen are passed over, without output, and must be the same ones. Any other
stream is one that goes on: there, rows with a time stamp no later than the last one seen are passed over. From
then on every line is, digit for digit, what a run without interruption gives for that row.

A state is saved only after the lines of all rows in it have been taken by the reader, so none is lost: those
since the last save are given once more after the run has been killed. A last row whose line has not ended is
answered, but not kept in the state, for it may not have been whole.
"""

from __future__ import annotations

import math
import signal
import threading
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple, Protocol, TypeVar

from inercal.errors import RecordError
from inercal.estimate.checkpoint import fingerprint, load, save
from inercal.records.write.text import number
from inercal.stream.lines import Line, Lines, Sample

S = TypeVar("S")

Output = Sequence[float | str]
"""Values of an output line; NaN is written as nothing, texts as they are."""


class Recursive(Protocol[S]):
    """An estimator that goes from sample to sample.

    ``kind`` names it, ``columns`` are the titles of its output lines, and ``settings`` is a state (in the sense
    of `inercal.estimate.checkpoint`) of all that, with the samples, decides its numbers.
    """

    @property
    def kind(self) -> str:
        """Such as ``monitor``."""

    @property
    def columns(self) -> Sequence[str]:
        """Such as ``t [s]``."""

    @property
    def settings(self) -> object:
        """Settings on which the state depends."""

    def initial(self) -> S:
        """The state before the first sample."""

    def step(self, state: S, sample: Sample) -> tuple[S, Output | None]:
        """The state after a sample, and the line it gives, if any.

        The state handed in may be used up: its arrays may be those of the new one.
        """


@dataclass(frozen=True)
class Saving:
    """Where the state is saved, and every how many rows."""

    path: Path
    every: int


class _Position(NamedTuple):
    """What a state has seen: rows, the CRC-32 of the first and of all of them, and the last time stamp [s]."""

    rows: int = 0
    first: int = 0
    all: int = 0
    t: float = -math.inf

    def after(self, line: Line, t: float) -> _Position:
        """The position after one more row."""
        crc = zlib.crc32(line.data, self.all)
        return _Position(
            self.rows + 1, self.first if self.rows else crc, crc, t if math.isfinite(t) else self.t
        )


class _Whole(NamedTuple):
    """What is saved."""

    position: _Position
    state: Any


def run(
    estimator: Recursive[S],
    lines: Lines,
    write: Callable[[str], None],
    saving: Saving | None = None,
    say: Callable[[str], None] = lambda _: None,
) -> int:
    """Run an estimator to the end of a stream.

    Parameters
    ----------
    estimator : Recursive
    lines : Lines
    write : callable
        Takes an output line without its end, the titles first; returns when it is on its way.
    saving : Saving, optional
        The state is loaded from there if the file exists, and saved there.
    say : callable
        Told where a saved state is gone on from.

    Returns
    -------
    int
        Rows that the state has now seen.

    Raises
    ------
    InputError
        A checkpoint that is not of this estimator, or that cannot be written; a stream that begins as the
        saved one and then differs.
    KeyboardInterrupt
        On an interrupt, once the row in work is done and the state is saved.
    """
    mark = fingerprint({"estimator": estimator.settings, "stream": lines.settings})
    whole = _Whole(_Position(), estimator.initial())
    if saving is not None and saving.path.exists():
        whole = load(saving.path, estimator.kind, mark, whole)
        say(f"resumed after row {whole.position.rows} of {saving.path}")
    (position, state), saved = whole, whole.position.rows

    def keep(least: int = 1) -> None:
        nonlocal saved
        if saving is not None and position.rows - saved >= least:
            save(saving.path, estimator.kind, mark, _Whole(position, state))
            saved = position.rows

    write(",".join(estimator.columns))
    with _interrupts() as interrupts:
        try:
            for line, sample in _new_samples(lines, position, interrupts, say):
                if not line.whole:
                    keep()
                state, output = estimator.step(state, sample)
                if output is not None:
                    write(",".join(each if isinstance(each, str) else number(each) for each in output))
                if line.whole:
                    position = position.after(line, sample.t)
                    keep(1 if saving is None else saving.every)
        except KeyboardInterrupt:
            if interrupts.waiting:
                keep()
            raise
    keep()
    lines.close()
    return position.rows


def _new_samples(
    lines: Lines, position: _Position, interrupts: _Interrupts, say: Callable[[str], None]
) -> Iterator[tuple[Line, Sample]]:
    """The rows that are not in a position yet; raises `RecordError` where they are not those that follow it."""
    line, row = interrupts.next(lines), position.rows
    passed = math.nan
    if row and line is not None:
        if zlib.crc32(line.data) == position.first:
            seen = _Position()
            while line is not None and seen.rows < row:
                seen, line = seen.after(line, math.nan), interrupts.next(lines)
            if seen.rows == row and seen.all != position.all:
                raise RecordError(
                    lines.where,
                    f"found other rows than the {row} of the checkpoint, expected the same stream from its "
                    "beginning, or one that goes on",
                )
        elif lines.stamped and math.isfinite(position.t):
            passed = position.t
            say(f"rows up to t = {passed} s are passed over")
    while line is not None:
        sample = lines.sample(line, row)
        if not sample.t <= passed:
            passed = math.nan
            row += 1
            yield line, sample
        line = interrupts.next(lines)


class _Interrupts:
    """Interrupts, which end the waiting for a line at once, and else wait until the row in work is done.

    A second one does not wait.
    """

    def __init__(self) -> None:
        self.waiting = False
        self._asked = False

    def handle(self, signum: int, frame: FrameType | None) -> None:
        """Handle SIGINT."""
        if self.waiting or self._asked:
            raise KeyboardInterrupt
        self._asked = True

    def next(self, lines: Lines) -> Line | None:
        """The next line, None at the end."""
        self.waiting = True
        if self._asked:
            raise KeyboardInterrupt
        line = lines.next()
        self.waiting = False
        return line


@contextmanager
def _interrupts() -> Iterator[_Interrupts]:
    """Interrupts as long as the block lasts; outside the main thread there are none."""
    interrupts = _Interrupts()
    if threading.current_thread() is not threading.main_thread():
        yield interrupts
        return
    before = signal.signal(signal.SIGINT, interrupts.handle)
    try:
        yield interrupts
    finally:
        signal.signal(signal.SIGINT, before)
