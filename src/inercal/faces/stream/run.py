"""A recursive estimator on a stream: samples in, lines out, the state saved now and then and resumed.

A saved state says which rows it has seen. A stream that begins with the row that the saved one began
with is that stream again: the rows seen are passed over, without output, and must be the same ones. Any other
stream is one that goes on: there, rows with a time stamp no later than the last one seen are passed over. From
then on every line is, digit for digit, what a run without interruption gives for that row.

One row without a time stamp does not tell, for coarse counts repeat. There the first 64 rows must be those of the
saved stream, and wait for each other; where these were all alike, nothing can tell, and the stream goes on.

A state is saved only after the lines of all rows in it have been taken by the reader, so none is lost: those
since the last save are given once more after the run has been killed. A last row whose line has not ended is
answered, but not kept in the state, for it may not have been whole.

A row whose stamp does not go on is held until later ones decide whether it is wrong (`inercal.faces.stream.doubt`), and
an estimator may hold rows, which then are in its state, until it knows more. Their lines are given at the end of
the stream; a run that goes on from there gives them once more, as they are where rows follow.
"""

from __future__ import annotations

import math
import signal
import threading
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager, nullcontext
from dataclasses import dataclass
from itertools import chain, islice
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple, Protocol, TypeVar, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from inercal.faces.stream.checkpoint import alone, fingerprint, load, save
from inercal.faces.stream.doubt import Doubt, HeldRows
from inercal.faces.stream.lines import Lines, Sample, StreamLine
from inercal.foundation.errors import RecordError
from inercal.foundation.records.places import counted
from inercal.foundation.records.write import number

S = TypeVar("S")
T = TypeVar("T", contravariant=True)

Output = Sequence[float | str]
"""Values of an output line; NaN is written as nothing, texts as they are."""

_HEAD = 64


class Recursive(Protocol[S]):
    """An estimator that goes from sample to sample.

    ``kind`` names it, ``columns`` are the titles of its output lines, and ``settings`` is a state (in the sense
    of `inercal.faces.stream.checkpoint`) of all that, with the samples, decides its numbers.
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

    def step(self, state: S, sample: Sample) -> tuple[S, Sequence[Output]]:
        """The state after a sample, and the lines it gives, if any.

        The state handed in may be used up: its arrays may be those of the new one.
        """

    def finish(self, state: S) -> Sequence[Output]:
        """The lines of rows that were held, where the stream ends with that state."""


@runtime_checkable
class Sufficient(Protocol[T]):
    """An estimator that may know enough before its stream ends."""

    def enough(self, state: T) -> str:
        """Words for a state that needs no more rows; empty for others."""


def _never(_: object) -> str:
    """No state is enough."""
    return ""


@dataclass(frozen=True)
class Saving:
    """File of the saved state, rows from one save to the next, and what is done before each: a writer that holds lines
    back lets them go."""

    path: Path
    every: int
    before: Callable[[], None] = lambda: None


class _RowsSeen(NamedTuple):
    """Rows that a state has seen: their number, CRC-32 of each of the first and of all, and the last sound stamp."""

    rows: int = 0
    head: NDArray[np.int64] = np.empty(0, np.int64)
    all: int = 0
    t: float = -math.inf

    def after(self, line: StreamLine, t: float) -> _RowsSeen:
        """The position after one more row."""
        head = np.append(self.head, zlib.crc32(line.data)) if self.rows < _HEAD else self.head
        crc = zlib.crc32(line.data, self.all)
        return _RowsSeen(self.rows + 1, head, crc, t if math.isfinite(t) else self.t)


class _Whole(NamedTuple):
    """A saved state with its position, and the rows in doubt."""

    position: _RowsSeen
    doubt: HeldRows
    state: Any


def run(
    estimator: Recursive[S],
    lines: Lines,
    write: Callable[[str], None],
    saving: Saving | None = None,
    say: Callable[[str], None] = lambda _: None,
    after: float = -math.inf,
) -> int:
    """Run an estimator to the end of a stream; one that is `Sufficient` until it knows enough, which is said.

    Parameters
    ----------
    estimator : Recursive
    lines : Lines
    write : callable
        Takes an output line without its end, the titles first; returns when it is on its way.
    saving : Saving, optional
        The state is loaded from there if the file exists, and saved there.
    say : callable
        Told where a saved state is gone on from, and how many rows are passed over.
    after : float
        Time [s] of the last line that a reader has: those up to it, titles too, are not given again.

    Returns
    -------
    int
        Rows that the state has now seen.

    Raises
    ------
    InputError
        A checkpoint that is not of this estimator, in use by another run, or that cannot be written; a stream that
        begins as the saved one and then differs.
    KeyboardInterrupt
        On an interrupt, SIGTERM or SIGHUP, once the row in work is done and the state is saved.
    """
    with nullcontext() if saving is None else alone(saving.path):
        return _run(estimator, lines, write, saving, say, after)


def _run(
    estimator: Recursive[S],
    lines: Lines,
    write: Callable[[str], None],
    saving: Saving | None,
    say: Callable[[str], None],
    after: float,
) -> int:
    """As `run`, with the checkpoint to itself."""
    enough = estimator.enough if isinstance(estimator, Sufficient) else _never
    mark = fingerprint({"estimator": estimator.settings, "stream": lines.settings})
    whole = _Whole(_RowsSeen(), HeldRows(), estimator.initial())
    if saving is not None and saving.path.exists():
        whole = load(saving.path, estimator.kind, mark, whole)
        say(f"resumed after row {whole.position.rows} of {saving.path}")
    position, state, doubt, saved = whole.position, whole.state, Doubt.of(whole.doubt), whole.position.rows

    def keep(least: int = 1) -> None:
        nonlocal saved
        if saving is not None and position.rows - saved >= least:
            saving.before()
            save(saving.path, estimator.kind, mark, _Whole(position, doubt.saved, state))
            saved = position.rows

    def give(outputs: Sequence[Output]) -> None:
        for output in (each for each in outputs if not _given(each, after)):
            write(",".join(each if isinstance(each, str) else number(each) for each in output))

    def step(samples: Sequence[Sample]) -> None:
        nonlocal state
        for sample in samples:
            state, outputs = estimator.step(state, sample)
            give(outputs)

    give([estimator.columns])
    if words := enough(state):
        say(words)
        return position.rows
    with closing(lines), _interrupts() as interrupts:
        try:
            for line, sample, again in _new_samples(lines, position, interrupts, say):
                if not line.whole:
                    keep()
                doubt, decided = (doubt.without_held() if again else doubt).on(sample, line.number, lines)
                step(decided)
                if line.whole:
                    position = position.after(line, doubt.order.last if lines.stamped else sample.t)
                    keep(1 if saving is None else saving.every)
                if words := enough(state):
                    say(words)
                    break
        except KeyboardInterrupt:
            if interrupts.waiting:
                keep()
            raise
        keep()
        step(doubt.end(lines))
        give(estimator.finish(state))
    return position.rows


def _given(output: Output, after: float) -> bool:
    """True for a line that a reader has: titles, and what is not later than ``after`` [s]."""
    return math.isfinite(after) and (isinstance(output[0], str) or output[0] <= after)


def _new_samples(
    lines: Lines, position: _RowsSeen, interrupts: _Interrupts, say: Callable[[str], None]
) -> Iterator[tuple[StreamLine, Sample, bool]]:
    """The rows that are not in a position yet, and of the first whether rows before it were passed over by stamps;
    raises `RecordError` where they are not those that follow it.

    A row that is later than the position, or has no time, waits for the next but one that has: a wrong stamp among
    those passed over does not end that.
    """
    rows, row = iter(lambda: interrupts.next(lines), None), position.rows
    passed, earlier = math.nan, 0
    if row:
        same, held = _begins_alike(rows, position, lines.stamped)
        rows = chain(held, rows)
        if same:
            _pass_over(islice(rows, row), position, lines.where, say)
        elif lines.stamped and math.isfinite(position.t):
            passed = position.t
            say(f"rows up to t = {passed} s are passed over")
        else:
            say("the stream goes on, no row is passed over")
    later: list[tuple[StreamLine, Sample]] = []
    for line in rows:
        sample = lines.sample(line, row + len(later))
        if sample.t <= passed:
            earlier += 1 + len(later)
            later.clear()
            continue
        later.append((line, sample))
        if not math.isnan(passed):
            if sum(math.isfinite(each.t) for _, each in later) < 2:
                continue
            say(f"{counted(earlier, 'row')} passed over")
        again = earlier > 0 and not math.isnan(passed)
        passed = math.nan
        for k, each in enumerate(later):
            yield *each, again and k == 0
        row += len(later)
        later.clear()
    if not math.isnan(passed):
        over = f"{counted(earlier, 'row')} passed over"
        say(over if later else f"the stream ended after {counted(earlier, 'row')}, all passed over")
        for k, each in enumerate(later):
            yield *each, earlier > 0 and k == 0


def _begins_alike(
    rows: Iterator[StreamLine], position: _RowsSeen, stamped: bool
) -> tuple[bool, list[StreamLine]]:
    """True for a stream that begins, as far as it goes, with the rows that a position began with; the rows taken."""
    head = position.head[: 1 if stamped else _HEAD].tolist()
    if len(head) > 1 and len(set(head)) == 1:
        return False, []
    held: list[StreamLine] = []
    for crc, line in zip(head, rows, strict=False):  # in this order no row is taken beyond the head
        held.append(line)
        if zlib.crc32(line.data) != crc:
            return False, held
    return True, held


def _pass_over(
    rows: Iterator[StreamLine], position: _RowsSeen, where: str, say: Callable[[str], None]
) -> None:
    """Pass over the rows of a position; raises `RecordError` where they are others."""
    seen = _RowsSeen()
    for line in rows:
        seen = seen.after(line, math.nan)
    if seen.rows < position.rows:
        say(f"the stream ended after {seen.rows} of these rows, all passed over")
    elif seen.all != position.all:
        raise RecordError(
            where,
            f"found other rows than the {seen.rows} of the checkpoint, expected the same stream from its "
            "beginning, or one that goes on",
        )
    else:
        say(f"{counted(seen.rows, 'row')} passed over")


class _Interrupts:
    """Interrupts, which end the waiting for a line at once, and else wait until the row in work is done.

    A second one does not wait.
    """

    def __init__(self) -> None:
        self.waiting = False
        self._asked = False

    def handle(self, signum: int, frame: FrameType | None) -> None:
        """Handle SIGINT, SIGTERM and SIGHUP."""
        if self.waiting or self._asked:
            raise KeyboardInterrupt
        self._asked = True

    def next(self, lines: Lines) -> StreamLine | None:
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
    asking = [signal.Signals[name] for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
    ignored = [signum for signum in asking if signal.getsignal(signum) is signal.SIG_IGN]  # as by nohup
    before = {signum: signal.signal(signum, interrupts.handle) for signum in asking if signum not in ignored}
    try:
        yield interrupts
    finally:
        for signum, handler in before.items():
            signal.signal(signum, handler)
