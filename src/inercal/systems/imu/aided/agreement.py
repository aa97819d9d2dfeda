"""Agreement of outputs with what the motion of a table, or of another reference, makes of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.systems.imu.aided.blocks import Blocks, small_turn
from inercal.systems.imu.aided.table import TableMotion
from inercal.systems.imu.limits import LIMITS


@dataclass(frozen=True)
class Agreement:
    """Agreement of an output with the table: ``scale`` [output per SI unit], and ``miss``, the rms it leaves over
    the rms of the output's variation."""

    scale: float
    miss: float


def agreement(y: Array, x: Array) -> Agreement:
    """Fit ``y = scale x + bias``, one scale for the three axes of (n, 3)."""
    dy, dx = y - y.mean(axis=0), x - x.mean(axis=0)
    scale = float(np.sum(dx * dy) / max(float(np.sum(dx * dx)), 1e-300))
    size = float(np.sum(dy * dy))
    if scale <= 0.0 or size == 0.0:
        return Agreement(scale, 1.0)
    return Agreement(scale, float(np.sqrt(np.sum((dy - scale * dx) ** 2) / size)))


def match(blocks: Blocks, x: Array) -> Agreement:
    """The agreement of the channels that are there with what the table says, (n, 3)."""
    return agreement(blocks.y[:, blocks.axes], x[:, blocks.axes])


def expected(blocks: Blocks, motion: TableMotion) -> Array:
    """Specific force in units of gravity, or rate [rad/s], (n, 3) on the instrument's axes, roughly."""
    if blocks.triad.sensor == "acc":
        return motion.attitude(blocks.middle)[:, 2, :]
    pieces = max(1, round(float(np.median(blocks.length)) / LIMITS.block))
    ends = np.linspace(0, blocks.nodes.shape[1] - 1, pieces + 1).round().astype(int)
    C = motion.attitude(blocks.nodes[:, ends])
    turn = small_turn(np.swapaxes(C[:, :-1], -1, -2) @ C[:, 1:]).sum(axis=1)
    return np.asarray(turn / blocks.length[:, None])
