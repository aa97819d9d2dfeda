"""Time stamps that do not go on: which of them are wrong, told of a column at once or row by row, by one rule.

A stamp goes on from the one before where its step is not above `Limits.leap_steps` times the usual one. One that
does not is in doubt, with all that follow, until later ones decide:

- One goes on from the last that was sound, over all rows in doubt: those out of order are wrong. But where rows only
  came late, or changed places, there is no room for them between the two: they stay, for their order alone is wrong.
- Three in a row go on from each other: time has leapt, forward (rows are missing) or backward (the clock was set), or
  the rate has changed. Those before them that are out of order are wrong.
- So many are in doubt that the clock has no steps to go by: all stay as they are.

What stands in order is never wrong, but for the first stamp and the last, which have no neighbour on one side: these
are where they are alone and far away.
"""

from __future__ import annotations

import itertools
import math
import operator
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.records.arrival import evenly
from inercal.foundation.records.column import Column
from inercal.foundation.records.limits import LIMITS
from inercal.foundation.records.places import counted, places

_SAID = 3


class Order(NamedTuple):
    """Knowledge of the time after some rows: the ``last`` sound stamp [s], NaN before the first, the last ``steps``
    [s] between such, and the stamps that are ``held``, in doubt (NaN of rows without one)."""

    last: float = math.nan
    steps: tuple[float, ...] = ()
    held: tuple[float, ...] = ()

    def on(self, t: float) -> tuple[Order, Sequence[bool]]:
        """After a row's stamp [s] (NaN of one without): what is known, and for each row that is decided now, the oldest
        first, whether its stamp is sound. A row is decided at once where it goes on and none is in doubt."""
        known = math.isfinite(t)
        if not self.held:
            if not known:
                return self, (True,)
            step = t - self.last
            if step >= 0.0 and self._is_usual(step):
                return Order(t, (*self.steps[1 - LIMITS.known_steps :], step) if step else self.steps), (
                    True,
                )
        held = (*self.held, t)
        goes_on = known and self._goes_on(held)
        sound = self._overtaken(held) if goes_on else self._confirmed(held) if known else None
        if sound is None:
            if len(held) < LIMITS.doubtful_rows:
                return self._replace(held=held), ()
            sound = [True] * len(held)
        stamps = [each for each, kept in zip(held, sound, strict=True) if kept and math.isfinite(each)]
        if not stamps:
            return Order(self.last, self.steps), sound
        steps = [later - before for before, later in itertools.pairwise([self.last, *stamps])]
        gained = (*self.steps, *(step for step in steps if step > 0.0))
        return Order(max(stamps) if goes_on else stamps[-1], gained[-LIMITS.known_steps :]), sound

    def end(self) -> Sequence[bool]:
        """For each row in doubt whether its stamp is sound, where none follows."""
        if math.isnan(self.last):
            return [True] * len(self.held)
        sound, least = [], math.inf
        for t in reversed(self.held):
            sound.append(not t < self.last and not t > least)
            least = min(least, t) if t >= self.last else least
        sound.reverse()
        ahead = [t for t, each in zip(self.held, sound, strict=True) if each and math.isfinite(t)]
        far = (
            len(self.steps) >= LIMITS.last_steps
            and len(ahead) == 1
            and ahead[0] - self.last > LIMITS.far_steps * self.usual
        )
        return [each and not (far and math.isfinite(t)) for t, each in zip(self.held, sound, strict=True)]

    @property
    def usual(self) -> float:
        """The usual step [s], above most that jitter makes."""
        return sorted(self.steps)[-min(LIMITS.usual_rank, len(self.steps))]

    def _is_usual(self, step: float) -> bool:
        """True for a step [s] that is no leap; all are leaps before the first is known."""
        left = min(LIMITS.usual_rank, len(self.steps))
        for known in reversed(self.steps):  # most often the last ones tell
            left -= step <= LIMITS.leap_steps * known
            if not left:
                return True
        return False

    def _goes_on(self, held: Sequence[float]) -> bool:
        """True where the newest of the stamps in doubt goes on from before them all."""
        return bool(self.steps) and 0.0 <= held[-1] - self.last <= LIMITS.leap_steps * self.usual * len(held)

    def _overtaken(self, held: Sequence[float]) -> list[bool]:
        """Verdicts on stamps, True for sound, the newest of which goes on from before them all."""
        between, rows = held[:-1], len(held)
        room = held[-1] - self.last >= (rows - 0.5) * sorted(self.steps)[len(self.steps) // 2]
        reach = self.last + LIMITS.leap_steps * self.usual * rows
        in_order = _ascending(self.last, between, held[-1])
        return [*(each or (not room and t <= reach) for each, t in zip(in_order, between, strict=True)), True]

    def _confirmed(self, held: Sequence[float]) -> list[bool] | None:
        """Verdicts on stamps, True for sound, the newest of which confirm each other; None where they do not."""
        chain = [k for k, t in enumerate(held) if math.isfinite(t)][-LIMITS.chain_stamps :]
        steps = [held[b] - held[a] for a, b in itertools.pairwise(chain)]
        if len(chain) < LIMITS.chain_stamps or min(steps) < 0.0:
            return None
        alike = 0.0 < max(steps) <= LIMITS.leap_steps * min(steps)
        if not (alike or all(map(self._is_usual, steps))):
            return None
        first = chain[0]
        if self.last <= held[first]:
            in_order = _ascending(self.last, held[:first], held[first])
            near = held[first] - LIMITS.leap_steps * max(steps) * len(held)  # as rows that only came late
            late = [near <= t <= held[first] and t >= self.last for t in held[:first]]
            return [*map(operator.or_, in_order, late), *[True] * (len(held) - first)]
        # before a clock that was set, or at the beginning: sound is what leads up to it
        sound, after = [True] * len(held), first
        for k in (k for k in reversed(range(first)) if math.isfinite(held[k])):
            apart = held[after] - held[k]
            alone = k == 0 or math.isfinite(self.last)
            sound[k] = apart >= 0.0 and not (alone and apart > LIMITS.far_steps * max(steps) * (after - k))
            after = k if sound[k] else after
        return sound


def _ascending(low: float, stamps: Sequence[float], high: float) -> list[bool]:
    """True for those of some stamps that stand in order between two others; NaN do."""
    sound = []
    for t in stamps:
        inside = not (t < low or t > high)
        low = t if inside and math.isfinite(t) else low
        sound.append(inside)
    return sound


_LEAD = 128
"""Rows in order, from which on it makes no difference which were in doubt before them."""

_BEFORE = 1024
"""Rows at most before these in which the known steps are sought: stamps may repeat."""

_NO_ORDER = 10_000, 1000
"""Backward steps, and one in so many rows, beyond which a column has no order to judge: it would take its time."""


def outlying(t: Array) -> NDArray[np.int64]:
    """Rows (from 0) of ``t`` (n,) [s] whose stamps are wrong: those of which `Order` says so, row by row.

    What stands in order is sound, so that rows are looked at one by one only around backward steps, and at both ends.
    """
    finite = np.isfinite(t)
    rows = None if finite.all() else np.flatnonzero(finite)
    backward = np.flatnonzero(np.diff(t if rows is None else t[rows]) < 0.0) + 1
    if backward.size > max(_NO_ORDER[0], len(t) // _NO_ORDER[1]):
        return np.zeros(0, dtype=np.int64)
    ends = [*(backward if rows is None else rows[backward]).tolist(), len(t)]
    wrong: list[int] = []
    order, row, coming = Order(), 0, 0
    while row < len(t):
        while ends[coming] < row:
            coming += 1
        first = ends[coming] - _LEAD
        if order.steps and not order.held and first - LIMITS.known_steps > row:
            steps = np.diff(t[max(first - _BEFORE, row) : first])
            known = steps[steps > 0.0][-LIMITS.known_steps :]
            if np.isfinite(steps).all() and len(known) == LIMITS.known_steps:
                order, row = Order(float(t[first - 1]), tuple(known.tolist())), first
        order, sound = order.on(float(t[row]))
        row += 1
        wrong += [row - len(sound) + k for k, each in enumerate(sound) if not each]
    wrong += [len(t) - len(order.held) + k for k, each in enumerate(order.end()) if not each]
    return np.array(wrong, dtype=np.int64)


def with_sound_stamps(columns: Mapping[str, Column]) -> tuple[dict[str, Column], tuple[Finding, ...]]:
    """Columns by name on time axes whose wrong stamps are NaN, and those of arrival even steps, with a finding on each
    such axis."""
    clocks = {id(column.t): column for column in columns.values()}
    axes, findings = {}, list[Finding]()
    for key, column in clocks.items():
        subject = "t" if len(clocks) == 1 else f"t of {Path(column.source.path).name}"
        rows = outlying(column.t)
        axes[key] = column.t
        if rows.size:
            axes[key] = column.t.copy()
            axes[key][rows] = np.nan
            findings.append(_finding(column.t, axes[key], rows, subject))
        axes[key], of_arrival = evenly(axes[key], subject)
        findings += [] if of_arrival is None else [of_arrival]
    kept = {
        name: column if axes[id(column.t)] is column.t else replace(column, t=axes[id(column.t)])
        for name, column in columns.items()
    }
    return kept, tuple(findings)


def _finding(t: Array, kept: Array, rows: NDArray[np.int64], subject: str) -> Finding:
    """``outlying_time`` on the ``rows`` of a time axis ``t`` (n,) [s] of which those ``kept`` are sound."""
    sound, words = np.flatnonzero(np.isfinite(kept)), []
    for row in rows[:_SAID].tolist():
        at = int(np.searchsorted(sound, row))
        words.append(beside(float(t[row]), kept[sound[max(at - 1, 0) : at + 1]].tolist()))
    more = f" and {rows.size - _SAID} more" if rows.size > _SAID else ""
    text = f"{subject}: {counted(rows.size, 'wrong stamp')} set aside: {', '.join(words)}{more}"
    return Finding("outlying_time", text, places("row", rows + 1))


def beside(t: float, neighbours: Sequence[float]) -> str:
    """A stamp, and those of the rows beside it [s], in words."""
    return f"{t:.10g} s beside {' and '.join(f'{each:.10g}' for each in neighbours)} s"
