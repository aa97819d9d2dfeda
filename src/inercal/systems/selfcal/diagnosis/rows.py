"""Gross faults of rows: readings logged late, once too often, not at all, or far off.

Each is judged by the error-state filter, not here; what angles and commands speak against, compared from row to row by
the rotation in between (`Turning`), is not tried.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.findings import EVERYTHING, Finding
from inercal.foundation.geometry.rotations import boxminus, conjugate, rotate
from inercal.foundation.inference.consistency import surprising
from inercal.foundation.records.places import counted, places
from inercal.systems.selfcal.diagnosis.fit_quality import filtered
from inercal.systems.selfcal.filters.filter_result import FilterResult
from inercal.systems.selfcal.filters.problem import FilterProblem
from inercal.systems.selfcal.filters.residuals import gimbals
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.recording import Recording
from inercal.systems.selfcal.platform.rig import JOINTS

_SHIFTS = tuple(by for by in range(-LIMITS.longest_shift, LIMITS.longest_shift + 1) if by)
"""Rows by which a log may be shifted."""


def _fault(
    code: str,
    text: str,
    repaired: Recording,
    alternatives: float,
    left_out: int = 0,
    times: int = 1,
    where: str = "",
) -> GrossFault:
    """A fault, and the recording without it; picked of so many ``alternatives``, so many ``times``, without
    ``left_out`` scalars."""
    harm = () if code == "gap" else EVERYTHING
    chance = left_out + 2.0 * times * math.log(alternatives / LIMITS.risk)
    return GrossFault(Finding(code, text, where, harm), repaired, chance)


class GrossFault(NamedTuple):
    """A fault with its ``finding``, the recording ``without`` it, and the fall of the sum of NIS by ``chance``: the
    likelihood ratio of two models exceeds 1/r by chance with probability r at most (Markov)."""

    finding: Finding
    without: Recording
    chance: float


@dataclass(frozen=True, eq=False)
class Turning:
    """Rotation from row to row, rad about the axes of p at the start of each: ``seen`` (n - 1, 3) by the encoders (NaN
    where a reading is missing), ``commanded`` (n - 1, 3); the same about the joints in ``moved`` and ``sent``
    (n - 1, 3); ``of_earth`` (n - 1, 3) the part of earth rate; ``up`` (n, 3) m/s^2 in p at the encoders'
    attitude; ``noise`` [rad] standard deviation of a difference of two encoder readings."""

    seen: Array
    commanded: Array
    moved: Array
    sent: Array
    of_earth: Array
    up: Array
    noise: float

    @property
    def jumps(self) -> NDArray[np.bool_]:
        """(n - 1,) true where the encoders differ from the command by more than noise and half of the command."""
        off = np.linalg.norm(self.seen - self.commanded, axis=1)
        share = LIMITS.jump_share * np.linalg.norm(self.commanded, axis=1)
        return np.asarray(off > LIMITS.noise_sigmas * self.noise + share)


def turning(recording: Recording, problem: FilterProblem) -> Turning:
    """Compare encoders and commands from row to row."""
    q, joints = gimbals(recording.th, problem.world)
    dt = recording.dt[:, None]
    # where a reading is missing the last known attitude does for the small part of earth rate
    complete = np.isfinite(recording.th).all(axis=1)
    last = np.maximum.accumulate(np.where(complete, np.arange(len(q)), 0))
    of_earth = rotate(conjugate(q[last]), problem.world.earth)[:-1] * dt
    commanded = recording.rate * dt - of_earth
    # at gimbal lock the joints of a rotation are not unique, and the shortest motion is taken
    sent = np.einsum("kij,kj->ki", np.linalg.pinv(joints[last][:-1], rcond=1e-3), commanded)
    return Turning(
        boxminus(q[1:], q[:-1]),
        commanded,
        np.diff(recording.th, axis=0),
        sent,
        of_earth,
        rotate(conjugate(q), problem.world.up),
        math.sqrt(2.0) * problem.noise.encoder,
    )


def faults_of_rows(recording: Recording, problem: FilterProblem) -> Iterator[GrossFault]:
    """Faults of stretches of rows."""
    turn = turning(recording, problem)
    yield from _shifts(recording, turn)
    yield from _late_accelerometers(recording, turn)
    yield from _frozen(recording)
    yield from _stuck(recording, turn)
    yield from _missing_rows(recording, turn)


def _shifts(recording: Recording, turn: Turning) -> Iterator[GrossFault]:
    """A command log shifted by some rows, throughout or from a row on."""
    n = len(recording.rate)
    rows = np.arange(n)

    def off(shift: int) -> Array:
        commanded = recording.rate[np.clip(rows + shift, 0, n - 1)] * recording.dt[:, None] - turn.of_earth
        return np.asarray(np.nan_to_num(np.square(turn.seen - commanded).sum(axis=1)))

    plain = off(0)
    by_shift = {shift: off(shift) for shift in _SHIFTS}
    whole = min(_SHIFTS, key=lambda shift: by_shift[shift].sum())
    if by_shift[whole].sum() < plain.sum():
        yield _shifted(recording, whole, 0, len(_SHIFTS))
    # squares before a row without the shift, from it on with it
    gain = {shift: np.cumsum((plain - squares)[::-1])[::-1] for shift, squares in by_shift.items()}
    part = max(_SHIFTS, key=lambda shift: gain[shift].max())
    if gain[part].max() < (LIMITS.noise_sigmas * turn.noise) ** 2:
        return
    # where rates are steady a shift hardly shows: the last row from which it may begin, and some before
    last = int(np.flatnonzero(gain[part] >= gain[part].max() - (LIMITS.noise_sigmas * turn.noise) ** 2)[-1])
    for first in last - np.append(0, 5 * 2 ** np.arange(10)):
        if first > 0:
            yield _shifted(recording, part, int(first), len(_SHIFTS) * n)


def _shifted(recording: Recording, shift: int, first: int, alternatives: float) -> GrossFault:
    """The recording with its commands from row ``first`` on taken ``shift`` rows further down."""
    rate = recording.rate.copy()
    last = len(rate) - 1
    rate[first:] = recording.rate[np.clip(np.arange(first, last + 1) + shift, 0, last)]
    how = "later" if shift > 0 else "earlier"
    text = f"commands are logged {counted(abs(shift), 'row')} {how} than the platform acts on them"
    where = places("row", np.arange(first, last + 1) + 1) if first else ""
    return _fault("command_shift", text, replace(recording, rate=rate), alternatives, where=where)


def _late_accelerometers(recording: Recording, turn: Turning) -> Iterator[GrossFault]:
    """Accelerometers logged some rows late or early: the shift that agrees best with the encoders."""
    moved = {shift: _by_rows(recording.acc, shift) for shift in _SHIFTS}

    def off(shift: int) -> float:
        apart = moved[shift] - turn.up
        return float(np.nanmean(np.square(apart))) if np.isfinite(apart).any() else math.inf

    shift = min(_SHIFTS, key=off)
    apart = recording.acc - turn.up
    if not np.isfinite(apart).any() or off(shift) > float(np.nanmean(np.square(apart))):
        return
    how = "late" if shift > 0 else "early"
    text = f"accelerometers are logged {counted(abs(shift), 'row')} {how}, against angles and commands"
    left_out = int(np.isfinite(recording.acc).sum() - np.isfinite(moved[shift]).sum())
    yield _fault("command_shift", text, replace(recording, acc=moved[shift]), len(_SHIFTS), left_out)


def _by_rows(values: Array, shift: int) -> Array:
    """Each row (n, m) replaced by that ``shift`` rows further down, NaN where there is none."""
    out = np.full_like(values, np.nan)
    if shift > 0:
        out[:-shift] = values[shift:]
    else:
        out[-shift:] = values[:shift]
    return out


def _frozen(recording: Recording) -> Iterator[GrossFault]:
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
            rest = read.copy()
            rest[rows[:, None], columns] = np.nan
            which = ", ".join(f"acc_{'xyz'[i]}" for i in columns if i < 3)
            which = "accelerometers and angles" if len(columns) == 6 else which
            text = f"{which} repeat{'' if len(columns) > 1 else 's'} one reading in {counted(len(rows) + 1, 'row')}"
            without = replace(recording, acc=rest[:, :3], th=rest[:, 3:])
            left_out, where = len(rows) * len(columns), places("row", rows + 1)
            yield _fault("dead_channel", text, without, 2.5 * n * n, left_out, where=where)


def _stuck(recording: Recording, turn: Turning) -> Iterator[GrossFault]:
    """An encoder that stands still while its joint is commanded to turn."""
    n = len(recording.th)
    for joint, name in enumerate(JOINTS):
        if joint in recording.fixed:
            continue
        sent, moved = np.abs(turn.sent[:, joint]), np.abs(turn.moved[:, joint])
        still = (sent > LIMITS.noise_sigmas * turn.noise) & (moved < LIMITS.still_share * sent)
        for start, end in _runs(still):
            rows = np.arange(start + 1, end + 1)
            degrees = math.degrees(float(turn.sent[start:end, joint].sum()))
            text = f"{name} stands still while it is told to turn by {degrees:.3g} deg"
            where = places("row", rows + 1)
            yield _stuck_encoder(recording, rows, text, where, 3.0 * n * n)
            later = f"{text}, and is wrong from then on"
            yield _stuck_encoder(recording, np.arange(start + 1, n), later, where, 3.0 * n)
        # at rest only the noise tells: the longest run, as a coarse encoder has many
        start, end = max(_runs(turn.moved[:, joint] == 0.0), key=lambda run: run[1] - run[0], default=(0, 0))
        if end - start >= LIMITS.repeated_rows and not still[start:end].any():
            rows = np.arange(start + 1, end + 1)
            text = f"{name} repeats one reading in {counted(len(rows) + 1, 'row')}"
            yield _stuck_encoder(recording, rows, text, places("row", rows + 1), 3.0 * n * n)


def _runs(true: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Start and end of each run of True of at least `LIMITS.stuck_rows`."""
    edges = np.flatnonzero(np.diff(np.pad(true.astype(np.int8), 1)))
    return [
        (int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= LIMITS.stuck_rows
    ]


def _stuck_encoder(
    recording: Recording, rows: NDArray[np.int64], text: str, where: str, alternatives: float
) -> GrossFault:
    """An encoder that is wrong in some rows, in which no angle is used."""
    th = recording.th.copy()
    left_out = int(np.isfinite(th[rows]).sum())
    th[rows] = np.nan
    return _fault("stuck_encoder", text, replace(recording, th=th), alternatives, left_out, where=where)


def _missing_rows(recording: Recording, turn: Turning) -> Iterator[GrossFault]:
    """Rows that are missing though time goes on evenly: a step of the angles that is a multiple of the command."""
    size = np.square(turn.commanded).sum(axis=1)
    fast = turn.jumps & (size > (LIMITS.noise_sigmas * turn.noise) ** 2)
    along = np.divide((turn.seen * turn.commanded).sum(axis=1), size, out=np.ones_like(size), where=fast)
    more = np.rint(along - 1.0)
    miss = np.linalg.norm(turn.seen - (1.0 + more[:, None]) * turn.commanded, axis=1)
    lost = fast & (more >= 1.0) & (miss < LIMITS.leap_share * np.sqrt(size) * (1.0 + more))
    if not lost.any():
        return
    rows = np.flatnonzero(lost)
    # the time that they took, with the commands of the rows before them held
    t = recording.t + np.append(0.0, np.cumsum(np.where(lost, more * recording.dt, 0.0)))
    alternatives = len(size) * len(_SHIFTS)
    text = f"about {counted(int(more[lost].sum()), 'row')} missing though time goes on: the angles leap along the turn"
    where = places("row", rows + 2)
    yield _fault("gap", text, replace(recording, t=t), alternatives, times=len(rows), where=where)
    # the commands went on being logged
    n = len(recording.rate)
    lag = np.append(0, np.cumsum(np.where(lost, more, 0.0)).astype(np.int64)[:-1])
    rate = recording.rate[np.minimum(np.arange(n) + lag, n - 1)]
    text, repaired = f"{text}; the commands have them", replace(recording, t=t, rate=rate)
    yield _fault("gap", text, repaired, alternatives, times=len(rows), where=where)


def single_readings(recording: Recording, problem: FilterProblem, now: FilterResult) -> GrossFault | None:
    """Single readings far from what the filter expects, left out: in each round the first of those near each other, for
    an early one spoils those after it."""
    rows = np.zeros(0, dtype=np.int64)
    left_out = 0
    channels = set[str]()
    acc, th = recording.acc.copy(), recording.th.copy()
    for _ in range(LIMITS.single_rounds):
        off = surprising(now.nis, now.dims, LIMITS.risk) if now.converged else rows[:0]
        if not len(off):
            break
        first = off[np.diff(off, prepend=-LIMITS.stuck_rows - LIMITS.single_apart) > LIMITS.single_apart]
        wrong = np.abs(now.innovations[first]) > LIMITS.single_sigmas
        if len(rows) + len(first) > LIMITS.single_rows or not wrong.any(axis=1).all():
            return None
        of_th = np.asarray(wrong[:, 3:].any(axis=1))
        th[first[of_th] + 1] = np.nan
        of_acc = np.asarray(wrong[:, :3] & ~of_th[:, None])
        acc[1:][first[:, None], np.arange(3)] = np.where(of_acc, np.nan, acc[1:][first])
        channels |= {"th"} if of_th.any() else set()
        channels |= {
            f"acc_{axis}" for axis, there in zip("xyz", np.any(of_acc, axis=0).tolist(), strict=True) if there
        }
        rows = np.append(rows, first)
        left_out += 3 * int(of_th.sum()) + int(of_acc.sum())
        now = filtered(replace(recording, acc=acc.copy(), th=th.copy()), problem)
    rows = np.unique(rows)
    if not len(rows) or (len(rows) > 3 and np.ptp(rows) < 2 * len(rows)):
        return None  # a change, not single readings
    where = ", ".join(sorted(channels))
    text = f"{counted(len(rows), 'reading')} far from what the filter expects, of {where}"
    repaired, where = replace(recording, acc=acc, th=th), places("row", rows + 2)
    return _fault("outlier", text, repaired, 2.0 * len(recording.t), left_out, len(rows), where)
