"""Means of a triad over short blocks of time, and the motion of the table in the same blocks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.errors import RecordError
from inercal.foundation.geometry.rotations import skew
from inercal.foundation.records.checks.values import at_ends
from inercal.foundation.records.column import Triad
from inercal.foundation.records.record import Record
from inercal.systems.imu.aided.table import TableMotion, forward
from inercal.systems.imu.limits import LIMITS

EDGE = 0.05
"""Half the time [s] over which the rate at the end of a block is taken."""


@dataclass(frozen=True, eq=False)
class Blocks:
    """Means ``y`` (n, 3) [output] of a triad over blocks.

    ``samples`` (n, s) [s] are the times of the samples, ``nodes`` (n, s + 1) [s] the ends of their intervals,
    ``resting`` (n,) whether the table rests throughout, ``clipped`` how many blocks each axis that saturates has lost,
    ``axes`` the numbers of the channels that are there; ``y`` of the others is 0.
    """

    triad: Triad
    y: Array
    samples: Array
    nodes: Array
    resting: NDArray[np.bool_]
    clipped: Mapping[str, int]
    axes: tuple[int, ...] = (0, 1, 2)

    @property
    def middle(self) -> Array:
        """Middles (n,) [s]."""
        return 0.5 * (self.nodes[:, 0] + self.nodes[:, -1])

    @property
    def length(self) -> Array:
        """Lengths (n,) [s]."""
        return np.asarray(self.nodes[:, -1] - self.nodes[:, 0])

    def only(self, kept: NDArray[np.bool_]) -> Blocks:
        """The blocks of a mask (n,)."""
        return replace(
            self,
            y=self.y[kept],
            samples=self.samples[kept],
            nodes=self.nodes[kept],
            resting=self.resting[kept],
        )


def triad_of(record: Record, sensor: str) -> Triad | None:
    """The channels of a sensor, at the middles of their samples: NaN (n,) for one that is not there; None without any.

    What was gained since the row before is the rate half a sample earlier. Raises `RecordError` where units or clocks
    differ.
    """
    there = {axis: record[f"{sensor}_{axis}"] for axis in "xyz" if f"{sensor}_{axis}" in record}
    if not there:
        return None
    first = next(iter(there.values()))
    if len(there) == 3:
        triad = record.triad(sensor)
    else:
        for column in there.values():
            if column.t is not first.t or column.unit != first.unit:
                raise RecordError(
                    column.source.path,
                    f"{column.name} in {column.unit.symbol} has another unit or clock than {first.name} in "
                    f"{first.unit.symbol}, expected one for the sensor",
                )
        none = np.full(len(first.t), np.nan)
        values = [there[axis].values if axis in there else none for axis in "xyz"]
        triad = Triad(sensor, first.unit, first.t, np.stack(values, axis=-1), first.source)
    half = 0.5 / triad.rate if first.increment and np.isfinite(triad.rate) else 0.0
    return replace(triad, t=triad.t - half) if half else triad


def cut(triad: Triad, motion: TableMotion, rests: Array, least: float = LIMITS.block) -> Blocks:
    """Cut a triad into blocks of equally many samples, ``least`` [s] at least, without those that lack samples or
    saturate.

    Raises
    ------
    RecordError
        Hardly any block lies within the time of the table's angles, or the clock falls back.
    """
    in_order = forward(triad.t, triad.sensor, triad.source.path)
    triad = replace(triad, t=triad.t[in_order], values=triad.values[in_order])
    interval = 1.0 / triad.rate
    if not np.isfinite(interval):
        raise RecordError(triad.source.path, f"{triad.sensor} has no increasing time stamps")
    t = triad.t
    length = max(least, (t[-1] - t[0]) / LIMITS.most_blocks, 2.0 * motion.step)
    s = max(1, round(length / interval))
    n = len(t) // s
    steps = np.clip(np.diff(t), 0.0, 1.5 * interval)
    low, high = t - 0.5 * np.r_[interval, steps], t + 0.5 * np.r_[steps, interval]
    axes = tuple(k for k in range(3) if np.isfinite(triad.values[:, k]).any())
    good = np.asarray(np.isfinite(triad.values[:, axes]).all(axis=1))
    outputs = np.where(np.isin(range(3), axes), triad.values, 0.0)
    at_end = {}
    for k in axes:
        at_end["xyz"[k]] = at_ends(triad.values[:, k])
    whole = np.r_[True, (np.diff(t) > 0.5 * interval) & (np.diff(t) < 1.5 * interval)]

    def rows(x: NDArray[Any]) -> NDArray[Any]:
        return x[: n * s].reshape(n, s, *x.shape[1:])

    nodes = np.concatenate([rows(low)[:, :1], rows(high)], axis=1)
    kept = rows(good).all(axis=1) & rows(whole)[:, 1:].all(axis=1)
    in_blocks = {axis: rows(at).any(axis=1) for axis, at in at_end.items()}
    inside = (nodes[:, 0] >= motion.t[0] - motion.step) & (nodes[:, -1] <= motion.t[-1] + motion.step)
    clipped = {axis: int(np.sum(at & inside)) for axis, at in in_blocks.items() if np.any(at & inside)}
    kept &= inside & ~np.any(list(in_blocks.values()), axis=0)
    if np.count_nonzero(kept) < LIMITS.fewest_blocks:
        raise RecordError(
            triad.source.path,
            f"found {np.count_nonzero(kept) * s * interval:.3g} s of {triad.sensor} within the time of the table's "
            f"angles ({motion.t[0]:.2f} to {motion.t[-1]:.2f} s), expected the same test on one time axis",
        )
    nodes = nodes[kept]
    weights = np.diff(nodes, axis=1)
    weights /= weights.sum(axis=1, keepdims=True)
    y = np.einsum("ns,nsi->ni", weights, rows(outputs)[kept])
    return Blocks(triad, y, rows(t)[kept], nodes, _within(nodes, rests), clipped, axes)


def _within(nodes: Array, rests: Array) -> NDArray[np.bool_]:
    """True (n,) for blocks within a rest of the table."""
    if not len(rests):
        return np.zeros(len(nodes), dtype=bool)
    k = np.clip(np.searchsorted(rests[:, 0], nodes[:, 0], side="right") - 1, 0, None)
    return np.asarray((nodes[:, 0] >= rests[k, 0]) & (nodes[:, -1] <= rests[k, 1]))


@dataclass(frozen=True, eq=False)
class BlockMotion:
    """Mean motion of the table in each block, for angles that come ``shift`` [s] late.

    ``rate`` (n, 3) [rad/s] mean rate of the table on the instrument's axes, without earth rate; ``C_bn`` (n, 3, 3)
    mean of the attitude, which takes gravity and earth rate to these axes; ``rate_slope`` and ``C_slope`` their
    derivatives with time; ``arm`` (n, 3, 3) [1/s^2] acceleration by a lever arm.
    """

    shift: float
    rate: Array
    C_bn: Array
    rate_slope: Array
    C_slope: Array
    arm: Array


def reference(blocks: Blocks, motion: TableMotion, shift: float) -> BlockMotion:
    """The motion of the table in blocks.

    Angles, not rates, are integrated: noise of the encoders stays at the ends of a turn.
    """
    C_nodes = motion.attitude(blocks.nodes + shift)
    turn = small_turn(np.swapaxes(C_nodes[:, :-1], -1, -2) @ C_nodes[:, 1:])
    C_bn = np.swapaxes(motion.attitude(blocks.samples + shift).mean(axis=1), -1, -2)
    ends = blocks.nodes[:, [0, -1]] + shift
    before, after = motion.attitude(ends - EDGE), motion.attitude(ends + EDGE)
    rates = small_turn(np.swapaxes(before, -1, -2) @ after) / (2.0 * EDGE)
    length = blocks.length
    rate_slope = (rates[:, 1] - rates[:, 0]) / length[:, None]
    C_slope = np.swapaxes(C_nodes[:, -1] - C_nodes[:, 0], -1, -2) / length[:, None, None]
    spin = skew(turn / np.diff(blocks.nodes, axis=1)[..., None])
    arm = skew(rate_slope) + (spin @ spin).mean(axis=1)
    return BlockMotion(shift, turn.sum(axis=1) / length[:, None], C_bn, rate_slope, C_slope, arm)


def small_turn(R: Array) -> Array:
    """Rotation vectors (..., 3) of rotations below a right angle."""
    v = 0.5 * np.stack(
        [R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]], axis=-1
    )
    sine = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.asarray(
        v * np.where(sine > 1e-8, np.arcsin(np.minimum(sine, 1.0)) / np.maximum(sine, 1e-300), 1.0)
    )
