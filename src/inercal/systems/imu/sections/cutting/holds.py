"""Holds of a recording: where the instrument stands still, for accelerometers and for gyros each by their own evidence.

The variance in windows of 0.4 s has two humps on a logarithmic scale, of rest and of motion; still is what lies below
the valley between them. Of several valleys (table, hand, motion) the one is taken whose poses fix most (`choice`).
Each hold is grown to where it stops being still, and judged: by the drift of its outputs, and by the mean of the gyro
against that of the others, for a smooth turn about the vertical leaves the accelerometers as they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.records.dwells import Dwell, breaks
from inercal.systems.imu.sections.cutting.choice import HoldSet, best
from inercal.systems.imu.sections.cutting.limits import LIMITS
from inercal.systems.imu.sections.cutting.windows import Places, Windows, valleys


@dataclass(frozen=True)
class UnusedHold:
    """A stretch, samples ``start`` to ``stop`` (exclusive), that looks like a hold, and why it is none."""

    start: int
    stop: int
    why: str


@dataclass(frozen=True)
class Holds:
    """Holds in which the accelerometers, and in which the gyros may be read, stretches of neither, the calmest row."""

    acc: tuple[Dwell, ...]
    gyro: tuple[Dwell, ...]
    unused: tuple[UnusedHold, ...]
    calmest: int = 0

    @property
    def rests(self) -> tuple[Dwell, ...]:
        """Holds of the accelerometers without the begin and end of motions, which the gyro sees first: their means and
        the moves between them need all of the motion outside. In a restless hand one stays as it is."""
        return tuple(_still_for_both(hold, self.gyro) for hold in self.acc)


def _still_for_both(hold: Dwell, of_gyro: Sequence[Dwell]) -> Dwell:
    """A hold as far as the gyro rests in it, where that is most of it."""
    both = [replace(one, start=max(one.start, hold.start), stop=min(one.stop, hold.stop)) for one in of_gyro]
    longest = max(both, key=lambda one: one.samples, default=hold)
    return longest if longest.samples > LIMITS.still_for_both * hold.samples else hold


@np.errstate(divide="ignore", invalid="ignore")  # what is not finite is no hold
def holds_of(t: Array, acc: Array | None, gyro: Array | None) -> Holds:
    """Find the holds of a recording.

    Parameters
    ----------
    t : (n,)
        Time [s] of the rows.
    acc, gyro : (n, 3) or None
        Outputs in any unit; None: not there. Rows that are not finite are never still.
    """
    block = _block(t)
    if len(t) < (LIMITS.blocks_of_window + 1) * block:
        return Holds((), (), ())
    cuts, step = _cuts(t), _step(t)
    shortest = max(LIMITS.blocks_of_window, int(LIMITS.shortest_hold / (block * step)) - 1)
    turning = None if gyro is None else Windows.of(gyro, block, cuts)
    unrest = None if turning is None else turning.unrest()
    gates = [] if unrest is None else valleys(unrest[0] + unrest[1])
    harmless = 0.0
    held: list[Dwell] = []
    resting: list[Dwell] = []
    if acc is not None:
        windows = Windows.of(acc, block, cuts)
        slow = np.zeros(len(windows.variance)) if unrest is None else unrest[1]
        cap = (LIMITS.restless_hold * windows.gravity) ** 2
        harmless = _harmless(windows, slow, block * step)
        sets = [
            (gate, windows.stretches((windows.variance < level) & (slow < gate), shortest))
            for level in windows.levels(cap)
            for gate in sorted({*(max(gate, harmless) for gate in gates), np.inf})
        ]
        noise = float(np.sqrt(np.nanmin(windows.variance) / block)) / max(windows.gravity, 1e-300)
        held = best(
            [HoldSet(gate, stretches, windows.poses(stretches)) for gate, stretches in sets],
            max(windows.gravity, 1e-300),
            noise,
        )
    if turning is not None and unrest is not None:
        rests = [turning.stretches(unrest[0] + unrest[1] < gate, shortest) for gate in gates or [np.inf]]
        resting = max(rests, key=len)
    kept, unused = [], []
    if acc is not None:
        triads = [(acc, 0.0)] if gyro is None else [(acc, 0.0), (gyro, harmless)]
        grown = _grown(triads, held, block, cuts)
        sound, unsound = _judged(t, grown, acc, gyro, windows.gravity, block)
        kept.append(sound)
        unused += unsound
    if gyro is not None:
        sound, unsound = _judged(t, _grown([(gyro, 0.0)], resting, block, cuts), None, gyro, 0.0, block)
        kept.append(sound)
        unused += unsound if acc is None else []
    calm = windows if acc is not None else turning
    return Holds(
        kept[0] if acc is not None else (),
        kept[-1] if gyro is not None else (),
        tuple(unused),
        0 if calm is None else int(np.argmin(calm.variance)) * block,
    )


def steady_rates(t: Array, gyro: Array) -> tuple[Dwell, ...]:
    """Stretches in which a gyro (n, 3) turns steadily: calm, off its output at rest, and without a drift."""
    block = _block(t)
    if len(t) < (LIMITS.blocks_of_window + 1) * block:
        return ()
    cuts = _cuts(t)
    windows = Windows.of(gyro, block, cuts)
    variance, turning = windows.unrest()
    calm, moving = valleys(variance), valleys(variance + turning)
    if not moving:
        return ()
    still = (variance < (calm or moving)[0]) & (turning > moving[0])
    found = _grown(
        [(gyro, 0.0)], windows.stretches(still, int(LIMITS.shortest_rate / _step(t) / block)), block, cuts
    )
    rest = windows.middle + windows.at_rest()
    steady = []
    for hold in found:
        third = hold.samples // 3
        first, last = hold.of(gyro)[:third].mean(axis=0), hold.of(gyro)[-third:].mean(axis=0)
        if np.linalg.norm(last - first) < LIMITS.steady_rate * np.linalg.norm(0.5 * (first + last) - rest):
            steady.append(hold)
    return tuple(steady)


def _step(t: Array) -> float:
    """Median interval [s] of times (n,) that increase; 0 where none does."""
    steps = np.diff(t)
    return float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0


def _block(t: Array) -> int:
    """Rows of a block."""
    step = _step(t)
    return max(round(LIMITS.still_window / LIMITS.blocks_of_window / step), 2) if step else len(t)


def _cuts(t: Array) -> Places:
    """Rows before which time breaks."""
    return breaks(t, 0.5 * LIMITS.still_window + 3.0 * _step(t))


def _harmless(windows: Windows, turning: Array, time: float) -> float:
    """Square [output^2] of a rate that does no harm to the mean of accelerometers, in the gyro's output.

    The scale of a gyro in counts is told by how fast the vertical turns where the gyro does: ``turning`` (m,) are
    squares of its mean output in windows that begin every ``time`` [s]. 0 where it never does.
    """
    lag = 2 * LIMITS.blocks_of_window
    change = np.linalg.norm(windows.means[lag:] - windows.means[:-lag], axis=1)
    rate = change / windows.gravity / (lag * time)
    output = np.sqrt(turning[lag // 2 : -lag // 2])
    told = (
        (rate > LIMITS.slowest_telling)
        & (rate < LIMITS.fastest_telling)
        & np.isfinite(output)
        & (output > 0.0)
    )
    if np.count_nonzero(told) < 2 * LIMITS.blocks_of_window:
        return 0.0
    return float((LIMITS.harmless_rate * np.median(output[told] / rate[told])) ** 2)


def _grown(
    triads: Sequence[tuple[Array, float]], stretches: Sequence[Dwell], block: int, cuts: Places
) -> list[Dwell]:
    """Stretches of blocks as samples, each grown or cut to where a triad (n, 3) stops being as still as inside.

    With each triad stands the square of a change that does no harm.
    """
    n = len(triads[0][0])
    grown: list[Dwell] = []
    for k, stretch in enumerate(stretches):
        start, stop = stretch.start * block, stretch.stop * block
        reach = (LIMITS.blocks_of_window + 1) * block
        low = max(start - reach, grown[-1].stop if grown else 0, int(max(cuts[cuts <= start], default=0)))
        after = stretches[k + 1].start * block if k + 1 < len(stretches) else n
        high = min(stop + reach, after, int(min(cuts[cuts >= stop], default=n)))
        first, last = low, high
        for x, harmless in triads:
            begin, end = still_edges(x[low:high], start - low, stop - low, block, harmless)
            first, last = max(first, low + begin), min(last, low + end)
        if last - first > block:
            grown.append(Dwell(first, last))
    return grown


def still_edges(x: Array, start: int, stop: int, block: int, harmless: float) -> tuple[int, int]:
    """The first and the last sample (exclusive) about ``start`` and ``stop`` up to which rows (n, 3) are as inside.

    Told by means over a block and by mean squares about the mean, in blocks that begin at every row.
    """
    core = slice(start + block, stop - 2 * block + 1)
    middle = x[start + block : stop - block].mean(axis=0)
    sums = np.cumsum(np.concatenate([np.zeros((1, x.shape[1])), x - middle]), axis=0)
    means = (sums[block:] - sums[:-block]) / block
    power = np.cumsum(np.concatenate([[0.0], ((x - middle) ** 2).sum(axis=1)]))
    power = (power[block:] - power[:-block]) / block
    shift = (means**2).sum(axis=1)
    least = max(harmless, 1e-30)
    off = ~(shift <= max(LIMITS.hold_edge**2 * shift[core].mean(), least)) | ~(
        power <= max(LIMITS.hold_edge_power * power[core].mean(), least)
    )
    before, after = np.flatnonzero(off[: core.start]), np.flatnonzero(off[core.stop :])
    # the outermost row of the last block that is off is the first of the motion; a slow one began before
    margin = 1 + block // 5
    begin = int(before[-1]) + margin if len(before) else 0
    end = core.stop + int(after[0]) + block - margin if len(after) else len(x)
    return begin, end


def _judged(
    t: Array, holds: Sequence[Dwell], acc: Array | None, gyro: Array | None, gravity: float, block: int
) -> tuple[tuple[Dwell, ...], list[UnusedHold]]:
    """The sound ones among holds, and the others with the reason."""
    why = {hold: reason for hold in holds if (reason := _too_short(t, hold))}
    if acc is not None:
        why |= {
            hold: reason
            for hold in holds
            if hold not in why and (reason := drifting(hold.of(acc), gravity, block))
        }
    left = [hold for hold in holds if hold not in why]
    if gyro is not None and len(left) >= LIMITS.holds_to_compare:
        means = np.array([hold.of(gyro).mean(axis=0) for hold in left])
        off = np.linalg.norm(means - np.median(means, axis=0), axis=1)
        noise = np.sqrt(np.median([hold.of(gyro).var(axis=0).sum() for hold in left]))
        limit = max(LIMITS.turning_hold * float(np.median(off)), float(noise))
        for hold, size in zip(left, off, strict=True):
            if size > limit:
                why[hold] = (
                    f"the gyro turns: its mean is {size / float(np.median(off)):.0f} times as far off as usual"
                )
    return (
        tuple(hold for hold in holds if hold not in why),
        [UnusedHold(hold.start, hold.stop, reason) for hold, reason in why.items()],
    )


def _too_short(t: Array, hold: Dwell) -> str:
    """A reason in words, empty if there is none."""
    length = float(t[hold.stop - 1] - t[hold.start]) * hold.samples / (hold.samples - 1)
    return (
        ""
        if length >= LIMITS.shortest_hold
        else f"lasts {length:.2f} s, less than {LIMITS.shortest_hold:g} s"
    )


def drifting(x: Array, gravity: float, block: int) -> str:
    """A reason in words, empty if rows (n, 3) of one hold do not drift; means of a ``block`` of rows tell the noise."""
    third = len(x) // 3
    count = third // block
    change = x[-third:].mean(axis=0) - x[:third].mean(axis=0)
    means = x[: len(x) // block * block].reshape(-1, block, x.shape[1]).mean(axis=1)
    noise = float((np.diff(means, axis=0) ** 2).sum(axis=1).mean()) / max(count, 1) if len(means) > 1 else 0.0
    size = float(np.linalg.norm(change))
    if size <= max(LIMITS.drift_in_hold * gravity, LIMITS.drift_sigmas * float(np.sqrt(noise))):
        return ""
    return f"specific force drifts in it by {100.0 * size / gravity:.1f} % of gravity"
