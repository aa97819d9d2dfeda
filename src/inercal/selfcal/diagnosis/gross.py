"""Gross faults of a recording: proposals of what happened to it, each with the recording as it would be without.

A proposal is judged by a filter, not here: it must lower the sum of normalised innovations squared by more than its
``cost``. Where the recording is sound that happens with a probability of at most `RISK` for all proposals of a
kind: the likelihood ratio of two models exceeds 1/r by chance with probability r at most (Markov's inequality), and
twice its logarithm is the change of that sum. Scalars that a proposal leaves out count 1 each.

Angles and commands are compared from row to row: `Turning` holds what each says of the rotation in between.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from inercal.arrays import Array
from inercal.findings import Finding
from inercal.geometry.rotations import boxminus, conjugate, rotate
from inercal.records.places import counted, places
from inercal.selfcal.filters.problem import FilterProblem
from inercal.selfcal.filters.residuals import gimbals
from inercal.selfcal.platform.recording import Recording
from inercal.selfcal.platform.rig import JOINTS

RISK = 1e-3
"""Accepted probability of a false finding, of each kind."""

SHIFTS = (-3, -2, -1, 1, 2, 3)
"""Rows by which a command log may be shifted."""

_LEAST = 3
"""Rows for which an encoder must stand still."""

_SAME = 20
"""Rows for which it must repeat one reading to the last digit, where its joint is not told to turn."""


@dataclass(frozen=True, eq=False)
class Proposal:
    """A ``finding`` and the ``recording`` as it would be without the fault; ``cost`` as in the module."""

    finding: Finding
    recording: Recording
    cost: float


@dataclass(frozen=True, eq=False)
class Turning:
    """Rotation from row to row, rad about the axes of p at the start of each: ``seen`` (n - 1, 3) by the encoders (NaN
    where a reading is missing), ``told`` (n - 1, 3) by the commands; the same about the joints in ``moved`` and
    ``sent`` (n - 1, 3); ``of_earth`` (n - 1, 3) the part of earth rate; ``up`` (n, 3) m/s^2 in p at the encoders'
    attitude; ``noise`` [rad] standard deviation of a difference of two encoder readings."""

    seen: Array
    told: Array
    moved: Array
    sent: Array
    of_earth: Array
    up: Array
    noise: float

    @property
    def jumps(self) -> NDArray[np.bool_]:
        """(n - 1,) where the encoders turn otherwise than told by more than noise and half of what was told."""
        off = np.linalg.norm(self.seen - self.told, axis=1)
        return np.asarray(off > 10.0 * self.noise + 0.5 * np.linalg.norm(self.told, axis=1))


def turning(recording: Recording, problem: FilterProblem) -> Turning:
    """Compare encoders and commands from row to row."""
    q, joints = gimbals(recording.th, problem.world)
    dt = recording.dt[:, None]
    # where a reading is missing the last known attitude does for the small part of earth rate
    known = np.isfinite(recording.th).all(axis=1)
    last = np.maximum.accumulate(np.where(known, np.arange(len(q)), 0))
    of_earth = rotate(conjugate(q[last]), problem.world.earth)[:-1] * dt
    told = recording.rate * dt - of_earth
    # at gimbal lock the joints of a rotation are not unique, and the shortest motion is taken
    sent = np.einsum("kij,kj->ki", np.linalg.pinv(joints[last][:-1], rcond=1e-3), told)
    return Turning(
        boxminus(q[1:], q[:-1]),
        told,
        np.diff(recording.th, axis=0),
        sent,
        of_earth,
        rotate(conjugate(q), problem.world.up),
        math.sqrt(2.0) * problem.noise.encoder,
    )


def proposals(recording: Recording, problem: FilterProblem) -> Iterator[Proposal]:
    """All gross faults that the recording may have."""
    turn = turning(recording, problem)
    yield from _accelerometer_axes(recording, turn)
    yield from _shifts(recording, turn)
    yield from _late_accelerometers(recording, turn)
    yield from _frozen(recording)
    yield from _stuck(recording, turn)
    yield from _missing_rows(recording, turn)


def _cost(alternatives: float, left_out: int = 0) -> float:
    """Change of the sum of NIS that chance explains, for so many alternatives."""
    return 2.0 * math.log(alternatives / RISK) + left_out


def _accelerometer_axes(recording: Recording, turn: Turning) -> Iterator[Proposal]:
    """Accelerometers exchanged or reversed: the signed permutation nearest to what they say against the encoders."""
    acc, up = recording.acc[1:], turn.up[1:]
    both = np.isfinite(acc).all(axis=1) & np.isfinite(up).all(axis=1)
    match = acc[both].T @ up[both]
    sensors = (0, 1, 2)

    def fit(order: tuple[int, ...], signs: tuple[float, ...]) -> float:
        return float(sum(signs[i] * match[i, order[i]] for i in sensors))

    ways = list(product(permutations(sensors), product((1.0, -1.0), repeat=3)))
    order, signs = max(ways, key=lambda way: fit(*way))
    said = []
    for i in sensors:
        if order[i] != i:
            said.append(f"acc_{'xyz'[i]} looks like {'-' if signs[i] < 0.0 else ''}acc_{'xyz'[order[i]]}")
        elif signs[i] < 0.0:
            said.append(f"acc_{'xyz'[i]} looks reversed")
    if not said:
        return
    right = np.empty_like(recording.acc)
    for i in sensors:
        right[:, order[i]] = signs[i] * recording.acc[:, i]
    code = "sign_suspect" if order == sensors else "channel_swap"
    yield Proposal(Finding(code, ", ".join(said)), replace(recording, acc=right), _cost(len(ways) - 1))


def _shifts(recording: Recording, turn: Turning) -> Iterator[Proposal]:
    """A command log shifted by some rows, throughout or from a row on."""
    n = len(recording.rate)
    rows = np.arange(n)

    def off(shift: int) -> Array:
        told = recording.rate[np.clip(rows + shift, 0, n - 1)] * recording.dt[:, None] - turn.of_earth
        return np.asarray(np.nan_to_num(np.square(turn.seen - told).sum(axis=1)))

    plain = off(0)
    by_shift = {shift: off(shift) for shift in SHIFTS}
    whole = min(SHIFTS, key=lambda shift: by_shift[shift].sum())
    yield _shifted(recording, whole, 0, _cost(len(SHIFTS)))
    # squares before a row without the shift, from it on with it
    gain = {shift: np.cumsum((plain - squares)[::-1])[::-1] for shift, squares in by_shift.items()}
    part = max(SHIFTS, key=lambda shift: gain[shift].max())
    # where rates are steady a shift hardly shows: the last row from which it may begin, and some before
    last = int(np.flatnonzero(gain[part] >= gain[part].max() - (10.0 * turn.noise) ** 2)[-1])
    for first in last - np.append(0, 5 * 2 ** np.arange(10)):
        if first > 0:
            yield _shifted(recording, part, int(first), _cost(len(SHIFTS) * n))


def _shifted(recording: Recording, shift: int, first: int, cost: float) -> Proposal:
    """The recording with its commands from row ``first`` on taken ``shift`` rows further down."""
    rate = recording.rate.copy()
    last = len(rate) - 1
    rate[first:] = recording.rate[np.clip(np.arange(first, last + 1) + shift, 0, last)]
    how = "later" if shift > 0 else "earlier"
    text = f"commands are logged {counted(abs(shift), 'row')} {how} than the platform acts on them"
    where = places("row", np.arange(first, last + 1) + 1) if first else ""
    return Proposal(Finding("command_shift", text, where), replace(recording, rate=rate), cost)


def _late_accelerometers(recording: Recording, turn: Turning) -> Iterator[Proposal]:
    """Accelerometers logged some rows late or early: the shift nearest to what the encoders say."""
    moved = {shift: _by_rows(recording.acc, shift) for shift in SHIFTS}

    def off(shift: int) -> float:
        apart = moved[shift] - turn.up
        return float(np.nanmean(np.square(apart))) if np.isfinite(apart).any() else math.inf

    shift = min(SHIFTS, key=off)
    how = "late" if shift > 0 else "early"
    text = f"accelerometers are logged {counted(abs(shift), 'row')} {how}, against angles and commands"
    left_out = int(np.isfinite(recording.acc).sum() - np.isfinite(moved[shift]).sum())
    cost = _cost(len(SHIFTS), left_out)
    yield Proposal(Finding("command_shift", text), replace(recording, acc=moved[shift]), cost)


def _by_rows(values: Array, shift: int) -> Array:
    """Each row (n, m) replaced by that ``shift`` rows further down, NaN where there is none."""
    out = np.full_like(values, np.nan)
    if shift > 0:
        out[:-shift] = values[shift:]
    else:
        out[-shift:] = values[:shift]
    return out


def _frozen(recording: Recording) -> Iterator[Proposal]:
    """Readings that repeat, of all sensors, the accelerometers, or one of them: the longest run, as a coarse one has
    many."""
    n = len(recording.acc)
    read = np.hstack([recording.acc, recording.th])
    same = np.diff(read, axis=0) == 0.0
    for columns in ([0, 1, 2, 3, 4, 5], [0, 1, 2], [0], [1], [2]):
        runs = _runs(same[:, columns].all(axis=1))
        start, end = max(runs, key=lambda run: run[1] - run[0], default=(0, 0))
        if end > start:
            rows = np.arange(start + 1, end + 1)
            known = read.copy()
            known[rows[:, None], columns] = np.nan
            which = (
                "accelerometers and angles"
                if len(columns) == 6
                else ", ".join(f"acc_{'xyz'[i]}" for i in columns)
            )
            text = f"{which} repeat{'' if len(columns) > 1 else 's'} one reading in {counted(len(rows) + 1, 'row')}"
            cost = _cost(2.5 * n * n, len(rows) * len(columns))
            without = replace(recording, acc=known[:, :3], th=known[:, 3:])
            yield Proposal(Finding("dead_channel", text, places("row", rows + 1)), without, cost)


def _stuck(recording: Recording, turn: Turning) -> Iterator[Proposal]:
    """An encoder that stands still while its joint is told to turn."""
    n = len(recording.th)
    for joint, name in enumerate(JOINTS):
        sent, moved = np.abs(turn.sent[:, joint]), np.abs(turn.moved[:, joint])
        still = (sent > 10.0 * turn.noise) & (moved < 0.1 * sent)
        for start, end in _runs(still):
            rows = np.arange(start + 1, end + 1)
            degrees = math.degrees(float(turn.sent[start:end, joint].sum()))
            text = f"{name} stands still while it is told to turn by {degrees:.3g} deg"
            found = Finding("stuck_encoder", text, places("row", rows + 1))
            yield _without_angles(recording, rows, found, 3.0 * n * n)
            later = Finding("stuck_encoder", f"{text}, and is wrong from then on", found.where)
            yield _without_angles(recording, np.arange(start + 1, n), later, 3.0 * n)
        # at rest only the noise tells: the longest run, as a coarse encoder has many
        start, end = max(_runs(turn.moved[:, joint] == 0.0), key=lambda run: run[1] - run[0], default=(0, 0))
        if end - start >= _SAME and not still[start:end].any():
            rows = np.arange(start + 1, end + 1)
            text = f"{name} repeats one reading in {counted(len(rows) + 1, 'row')}"
            found = Finding("stuck_encoder", text, places("row", rows + 1))
            yield _without_angles(recording, rows, found, 3.0 * n * n)


def _runs(true: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Start and end of each run of True of at least `_LEAST`."""
    edges = np.flatnonzero(np.diff(np.pad(true.astype(np.int8), 1)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= _LEAST]


def _without_angles(
    recording: Recording, rows: NDArray[np.int64], finding: Finding, alternatives: float
) -> Proposal:
    """The recording without the angles of some rows."""
    th = recording.th.copy()
    left_out = int(np.isfinite(th[rows]).sum())
    th[rows] = np.nan
    return Proposal(finding, replace(recording, th=th), _cost(alternatives, left_out))


def _missing_rows(recording: Recording, turn: Turning) -> Iterator[Proposal]:
    """Rows that are missing though time goes on evenly: a step of the angles that is a multiple of that told."""
    size = np.square(turn.told).sum(axis=1)
    fast = turn.jumps & (size > (10.0 * turn.noise) ** 2)
    along = np.divide((turn.seen * turn.told).sum(axis=1), size, out=np.ones_like(size), where=fast)
    more = np.rint(along - 1.0)
    miss = np.linalg.norm(turn.seen - (1.0 + more[:, None]) * turn.told, axis=1)
    lost = fast & (more >= 1.0) & (miss < 0.1 * np.sqrt(size) * (1.0 + more))
    if not lost.any():
        return
    rows = np.flatnonzero(lost)
    # the time that they took, with the commands of the rows before them held
    t = recording.t + np.append(0.0, np.cumsum(np.where(lost, more * recording.dt, 0.0)))
    cost = len(rows) * _cost(len(size) * len(SHIFTS))
    text = f"about {counted(int(more[lost].sum()), 'row')} missing though time goes on: the angles leap along the turn"
    where = places("row", rows + 2)
    yield Proposal(Finding("gap", text, where), replace(recording, t=t), cost)
    # the commands went on being logged
    n = len(recording.rate)
    lag = np.append(0, np.cumsum(np.where(lost, more, 0.0)).astype(np.int64)[:-1])
    rate = recording.rate[np.minimum(np.arange(n) + lag, n - 1)]
    finding = Finding("gap", f"{text}; the commands have them", where)
    yield Proposal(finding, replace(recording, t=t, rate=rate), cost)
