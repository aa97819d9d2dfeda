"""The sense of stated turns, and what the motion between the rests says of it.

Turns alone cannot tell: a gyro that counts backward, turned backward, reads as one that counts forward. In the motion
from rest to rest the accelerometers show which way it went.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import LinAlgError

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.rotations import angle_between
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.sections.carried import Move, increments, net_rotations
from inercal.systems.imu.sections.cutting.checks import specific_force
from inercal.systems.imu.sections.section import Section
from inercal.systems.imu.sections.with_moves import not_whole


class Sense(NamedTuple):
    """The sense of turns: ``backward``, where all outputs have the sign opposite to what is stated; rms angles [rad] by
    which verticals miss that are carried as turns are ``stated``, and in the ``other`` sense; NaN: nothing tells."""

    backward: bool
    stated: float = np.nan
    other: float = np.nan

    @property
    def denied(self) -> bool:
        """True where the motion says that the turns were made the other way."""
        return self.stated > LIMITS.vertical_miss and self.other < min(
            LIMITS.vertical_miss, 0.5 * self.stated
        )

    @property
    def contradicted(self) -> bool:
        """True where neither sense carries verticals from rest to rest."""
        return self.stated > LIMITS.vertical_miss and not self.denied


def sense_of(sections: Sequence[Section], moves: Sequence[Move], step: float) -> Sense:
    """The sense of the turns among sections, by these and by the moves between rests; ``step`` is the interval of the
    gyro's samples [s]."""
    rests = [k for k, one in enumerate(sections) if one.kind == "rest" and one.acc is not None]
    still = [one.gyro for one in sections if one.kind == "rest" and one.gyro is not None]
    turns = [one for one in sections if one.kind == "turn" and one.gyro is not None and one.axis is not None]
    if not still or not turns or len(rests) < 2:
        return Sense(False)
    bias = np.median(still, axis=0)
    rates = np.array([one.axis * one.angle / one.duration for one in turns if one.axis is not None])
    off = np.array([one.gyro - bias for one in turns if one.gyro is not None])
    backward = bool(np.all(np.sum(off * rates, axis=1) < 0.0))
    recorded = [
        move
        for move in moves
        if len(move.t) > 1
        and LIMITS.shortest_transfer < move.duration < LIMITS.longest_transfer
        and np.max(np.diff(move.t)) < LIMITS.motion_gap * step
    ]
    left_out = {one.move for one in not_whole(recorded)}
    used = [move for k, move in enumerate(recorded) if k not in left_out]
    if len(used) < LIMITS.fewest_transitions:
        return Sense(backward)
    up = np.full((len(sections), 3), np.nan)
    up[rests] = specific_force(np.array([sections[k].acc for k in rests]))
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    try:
        gain = np.linalg.lstsq(rates, off, rcond=None)[0].T
        inverse = np.linalg.inv(gain)
    except LinAlgError:
        return Sense(backward)
    moved = increments(used)
    phi = (moved.gyro - moved.dt[..., None] * bias) @ inverse.T
    ends = np.array([(move.first, move.last) for move in used])
    return Sense(backward, *(_missed(sign * phi, up, ends) for sign in (1.0, -1.0)))


def _missed(phi: Array, up: Array, ends: Array) -> float:
    """Rms angle [rad] by which verticals miss that are carried through rotations phi (L, m, 3)."""
    carried = np.einsum("mji,mj->mi", net_rotations(phi), up[ends[:, 0]])
    return float(np.sqrt(np.mean(angle_between(carried, up[ends[:, 1]]) ** 2)))
