"""Gross faults of a test on a table: units, signs, axes and clocks with which sensors and angles do not agree."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from inercal.foundation.arrays import Array
from inercal.systems.imu.aided.agreement import agreement, expected, match
from inercal.systems.imu.aided.attitudes import AttitudeMotion, mounted
from inercal.systems.imu.aided.blocks import Blocks
from inercal.systems.imu.aided.table import TableMotion
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.settings import mountings


def tells(sensor: str, x: Array) -> bool:
    """True where what the table says of a triad, as from `expected`, varies enough for its output to be compared."""
    return bool(
        np.max(np.ptp(x, axis=0)) > (LIMITS.least_force_change if sensor == "acc" else LIMITS.slowest_turn)
    )


def lag(blocks: Blocks, motion: TableMotion) -> float:
    """Time [s] in whole blocks by which the angles come late, by when table and gyro turn; 0 unless clearly better."""
    commanded = np.linalg.norm(expected(blocks, motion), axis=1)
    seen = np.linalg.norm(blocks.y - np.median(blocks.y, axis=0), axis=1)
    commanded, seen = commanded - commanded.mean(), seen - seen.mean()
    size = np.linalg.norm(commanded) * np.linalg.norm(seen)
    if size == 0.0:
        return 0.0
    both = np.correlate(commanded, seen, mode="full") / size
    middle, length = len(seen) - 1, float(np.median(blocks.length))
    reach = min(int(LIMITS.longest_lag / length), len(seen) // 2)
    near = both[middle - reach : middle + reach + 1]
    best = int(np.argmax(near)) - reach
    return best * length if near[best + reach] > both[middle] + LIMITS.lag_correlation else 0.0


def cures(sides: list[Blocks], motion: TableMotion) -> Iterator[str]:
    """Sentences that would make sense of outputs that do not follow the table."""
    ranked = []
    for words, reading in motion.readings():
        other = mounted(reading, sides)[0] if isinstance(reading, AttitudeMotion) else reading
        misses = [match(each, expected(each, other)).miss for each in sides]
        if max(misses) < LIMITS.agreement_miss:
            ranked.append((sum(misses), words))
    identity = ("+x", "+y", "+z")
    inputs = [expected(each, motion) for each in sides]
    for axes, turn in mountings().items():
        misses = [match(each, x @ turn).miss for each, x in zip(sides, inputs, strict=True)]
        if axes != identity and max(misses) < LIMITS.agreement_miss:
            ranked.append((sum(misses), _mounted(motion, turn)))
    if ranked:
        yield from (words for _, words in sorted(ranked)[:3])
        return
    for each, x in zip(sides, inputs, strict=True):
        yield from _channels(each, x)


def _mounted(motion: TableMotion, turn: Array) -> str:
    """The mounting that turns the nominal axes by a rotation, as the study would say it."""
    from inercal.foundation.rigs.chain import Fixed

    last = [each.rotation for each in motion.chain.elements if isinstance(each, Fixed)]
    whole = (last[-1] if last else np.eye(3)) @ turn
    axes = [
        f"{'+' if column.sum() > 0 else '-'}{'xyz'[int(np.argmax(np.abs(column)))]}" for column in whole.T
    ]
    quoted = ", ".join(f'"{axis}"' for axis in axes)
    return f"the instrument is mounted with imu.aided.mounting = [{quoted}]"


def _channels(blocks: Blocks, x: Array) -> Iterator[str]:
    """Other signs or another order of a triad's own axes."""
    sensor = blocks.triad.sensor
    if match(blocks, x).miss < LIMITS.agreement_miss:
        return
    axes = blocks.axes
    miss, order, signs = min(
        (agreement(blocks.y[:, axes], x[:, order] * np.array(signs)).miss, order, signs)
        for order in itertools.permutations(range(3), len(axes))
        for signs in itertools.product((1.0, -1.0), repeat=len(axes))
    )
    if miss < LIMITS.agreement_miss:
        measured = ", ".join(
            f"{sensor}_{name} measures {'+' if sign > 0 else '-'}{'xyz'[axis]}"
            for name, axis, sign in zip(("xyz"[k] for k in axes), order, signs, strict=True)
            if axis != "xyz".index(name) or sign < 0
        )
        yield f"{measured} of the mounting that is stated"
