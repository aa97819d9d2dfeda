"""Gravity carried from position to position through the gyro: a check of the sense of the turns.

The turns themselves cannot tell in which sense they were made.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.rotations import angle_between
from inercal.foundation.records.column import Triad
from inercal.systems.imu.ferraris.gravity_transfer import is_recorded
from inercal.systems.imu.ferraris.method import Matrices
from inercal.systems.imu.ferraris.names import POSITIONS
from inercal.systems.imu.ferraris.sections import Sections
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.recording import clipped_rows
from inercal.systems.imu.turns import carried, cut_turns


def misses(acc: Triad, gyro: Triad, sections: Sections, solution: Matrices) -> tuple[float, float] | None:
    """Root-mean-square angle [rad] between carried and measured verticals after the ways between the positions.

    Returns
    -------
    (as stated, with all turns in the other sense), or None where the ways were not recorded.
    """
    order = sorted(POSITIONS, key=lambda name: int(sections.acc[name][0]))
    f = np.array(
        [solution.accelerometer.correct(acc.values[sections.acc[name]].mean(axis=0)) for name in order]
    )
    verticals = f / np.linalg.norm(f, axis=1, keepdims=True)
    spans, clipped = [], clipped_rows(gyro)
    for k, (here, there) in enumerate(itertools.pairwise(order)):
        start, stop = int(sections.gyro[here][-1]), int(sections.gyro[there][0])
        if is_recorded(gyro, clipped, start, stop):
            spans.append((k, start, stop))
    if len(spans) < LIMITS.fewest_transitions:
        return None
    turns = cut_turns(gyro.t, gyro.values, np.zeros_like(gyro.values), spans)
    model, none = solution.gyro, np.zeros((3, 3))
    as_stated, reversed_ = (
        carried(turns, verticals, each, none) for each in (model, replace(model, scale=-model.scale))
    )
    ends = verticals[turns.last]
    return _rms(angle_between(as_stated, ends)), _rms(angle_between(reversed_, ends))


def _rms(angles: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(angles**2)))
