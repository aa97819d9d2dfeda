"""Choice of the turn among the motions about each axis, with findings that speak against it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import EVERYTHING, Finding
from inercal.foundation.records.column import Triad
from inercal.systems.imu.ferraris.detection import Detected
from inercal.systems.imu.ferraris.gravity_transfer import Carried, carry
from inercal.systems.imu.ferraris.motions import Motion
from inercal.systems.imu.ferraris.names import POSITIONS, TURNS
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.settings import FerrarisSettings

ASK = "label it, or state it under imu.ferraris.sections"


@dataclass(frozen=True, eq=False)
class Choice:
    """The turns ``motions`` by axis; the ``doubt`` (3,) about their angles [rad], by what else they may have been; what
    speaks ``against`` the result, and other ``findings``."""

    motions: dict[int, Motion]
    doubt: Array
    against: tuple[Finding, ...]
    findings: tuple[Finding, ...]


def choose(acc: Triad, gyro: Triad, detected: Detected, options: FerrarisSettings) -> Choice:
    """The turn about each axis, as far as there is a motion that can be it.

    It gives the scale factor by which gravity is carried from rest to rest, where that is known; else one near the
    nominal, or of counts one like those of the other axes. Of motions that cannot be told apart one in the stated
    sense is taken, of a single stretch between holds, and the likeliest; the others make the doubt about its angle.
    """
    carried = carry(acc, gyro, detected) if all(name in detected.positions for name in POSITIONS) else None
    about = {axis: [m for m in detected.motions if m.axis == axis] for axis in range(3)}
    turns: dict[int, Motion] = {}
    doubt, graded, untold = np.zeros(3), list[tuple[bool, Finding]](), []
    for axis, motions in about.items():
        gains = np.array([_gain(m, axis, carried, options.turn) for m in motions])
        off, u = np.abs(gains), math.inf
        if carried is not None and carried.u[axis] < LIMITS.transfer_scale_u:
            off = off / carried.scale[axis] - 1.0
            u = math.hypot(options.turn_u / options.turn, LIMITS.turn_scale_u, float(carried.u[axis]))
        elif gyro.unit.dimension == "rate":
            off = off * gyro.unit.factor - 1.0
        else:
            own = _largest({axis: motions})
            off = (
                off * abs(options.turn) / own - 1.0
                if own > LIMITS.turn_size * _largest(about)
                else np.inf * off
            )
        rows = [k for k in range(len(motions)) if abs(off[k]) < LIMITS.turn_deviation]
        if not rows:
            continue
        least = float(np.min(np.abs(off[rows]))) / u
        rows = [k for k in rows if (off[k] / u) ** 2 <= least**2 + LIMITS.turn_chi2]
        rows = [k for k in rows if gains[k] > 0.0] or rows
        best = min(rows, key=lambda k: (not motions[k].single, abs(off[k]), motions[k].stop))
        other = max(rows, key=lambda k: abs(gains[k] - gains[best]))
        turns[axis], where = motions[best], _where(acc, motions[best])
        apart = abs(abs(float(gains[other] / gains[best])) - 1.0)
        doubt[axis] = apart * abs(options.turn)
        if least > LIMITS.turn_sigmas:
            by = math.degrees(abs(options.turn) * (1.0 + float(off[best])))
            message = (
                f"gravity, carried through the motion between the rests, says that the turn {TURNS[axis]} found was "
                f"by {by:.1f} deg, not by {math.degrees(abs(options.turn)):g} deg: {ASK}, and check imu.ferraris.turn"
            )
            graded.append((True, Finding("contradiction", message, where, EVERYTHING)))
        if apart > max(LIMITS.slight_turn_difference, abs(options.turn_u / options.turn)):
            message = (
                f"which motion is the turn {TURNS[axis]} is not certain: the one taken and the one from "
                f"{_where(acc, motions[other])} differ by {100 * apart:.2g} %: {ASK}"
            )
            graded.append((apart > LIMITS.grave_turn_difference, Finding("turn_doubtful", message, where)))
        if math.isinf(u):
            untold.append(TURNS[axis])
    if untold:
        message = (
            "the motion between the rests does not tell by what angle the instrument was turned: that the motions "
            f"found are the whole of {', '.join(untold)} is taken for granted"
        )
        graded.append((False, Finding("turn_doubtful", message)))
    against, findings = (tuple(f for grave, f in graded if grave is each) for each in (True, False))
    return Choice(turns, doubt, against, findings)


def _gain(motion: Motion, axis: int, carried: Carried | None, turn: float) -> float:
    """The scale factor [output per rad/s] if this was the turn; bias and g-sensitivity are those in the positions."""
    if carried is None:
        return float(motion.rotation[axis] / turn)
    bias = carried.at_rest.rate_bias + carried.at_rest.apparent_g @ motion.up
    return float((motion.integral - motion.duration * bias)[axis] / turn)


def _largest(about: Mapping[int, list[Motion]]) -> float:
    """The largest rotation [output s] of a single stretch about one of the axes."""
    return max(
        (abs(m.rotation[k]) for k, each in about.items() for m in each if m.stretches == 1), default=0.0
    )


def _where(acc: Triad, motion: Motion) -> str:
    """Begin and end of a motion, in words."""
    return f"t {acc.t[motion.start]:.2f} to {acc.t[motion.stop - 1]:.2f} s"
