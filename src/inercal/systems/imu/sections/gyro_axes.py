"""A gyro between rests before any fit: the scale and the order of its channels that carry the verticals of rests.

The rotation of a move by a gyro of one scale is that of its increments over it. Accelerometers give the verticals that
it should carry from rest to rest; where no scale does, other signs or another order of the channels may.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from inercal.foundation.arrays import Array
from inercal.systems.imu.limits import LIMITS as OF_ALL
from inercal.systems.imu.sections.carried import Increments, Move, increments, net_rotations
from inercal.systems.imu.sections.limits import LIMITS

_INTERVALS: Final = 80
"""Intervals of a move, for a first guess."""

_SCALES: Final = 62
"""Scales that are tried, 8 % apart: well inside the catch of a fit."""


class CarryingScale(NamedTuple):
    """The scale [output per rad/s] that carries verticals best, and the angle [rad] by which it misses them."""

    scale: float
    miss: float


@dataclass(frozen=True)
class ChannelOrder:
    """Axes of the accelerometers, ``signs`` and places ``order``, that the channels x, y, z of a gyro seem to measure,
    and the angle [rad] by which these miss the verticals as they stand."""

    order: tuple[int, ...]
    signs: tuple[float, ...]
    miss: float

    @property
    def told(self) -> bool:
        """True where another order or other signs make sense of the moves."""
        return (self.order, self.signs) != ((0, 1, 2), (1.0, 1.0, 1.0))


@dataclass(frozen=True, eq=False)
class CoarseMoves:
    """Moves in few intervals: integrals ``raw`` (L, m, 3) of outputs less those at rest, verticals (m, 3) before and
    after."""

    raw: Array
    before: Array
    after: Array

    @staticmethod
    def of(moves: Sequence[Move], verticals: Array, bias: Array) -> CoarseMoves:
        """Moves between rests of these ``verticals`` (n, 3), with the output ``bias`` (3,) at rest."""
        coarse = _thinned(increments(moves))
        first, last = (np.array([getattr(move, end) for move in moves]) for end in ("first", "last"))
        return CoarseMoves(coarse.gyro - coarse.dt[..., None] * bias, verticals[first], verticals[last])

    def missed(self, scale: float, axes: Array | None = None) -> float:
        """Median angle [rad] by which a scale misses the verticals; ``axes`` (3, 3) from outputs to those of the
        accelerometers."""
        R = net_rotations((self.raw if axes is None else self.raw @ axes.T) / scale)
        carried = np.einsum("mji,mj->mi", R, self.before)
        return float(np.sqrt(np.median(np.sum((carried - self.after) ** 2, axis=1))))

    def best(self, axes: Array | None = None) -> CarryingScale:
        """The best of all scales with which a move of median size sweeps an angle that a hand turns."""
        swept = max(float(np.median(np.sum(np.linalg.norm(self.raw, axis=-1), axis=0))), 1e-300)
        scales = swept / np.geomspace(LIMITS.least_sweep, LIMITS.largest_sweep, _SCALES)
        misses = [self.missed(float(scale), axes) for scale in scales]
        return CarryingScale(float(scales[int(np.argmin(misses))]), min(misses))

    def order(self, miss: float) -> ChannelOrder:
        """The order and the signs of channels that carry the verticals; as they are, where none does."""
        found = ChannelOrder((0, 1, 2), (1.0, 1.0, 1.0), miss)
        least = OF_ALL.vertical_miss
        for order in itertools.permutations(range(3)):
            for signs in itertools.product((1.0, -1.0), repeat=3):
                axes = np.zeros((3, 3))
                axes[order, range(3)] = signs
                there = self.best(axes).miss
                if there < least:
                    found, least = ChannelOrder(order, signs, miss), there
        return found


def _thinned(moved: Increments) -> Increments:
    """Increments in few intervals."""
    length = max(1, len(moved.dt) // _INTERVALS)
    pad = -len(moved.dt) % length
    dt, gyro, acc = (
        np.pad(x, [(0, pad)] + [(0, 0)] * (x.ndim - 1)).reshape(-1, length, *x.shape[1:]).sum(axis=1)
        for x in (moved.dt, moved.gyro, moved.acc)
    )
    return Increments(dt, gyro, acc)
