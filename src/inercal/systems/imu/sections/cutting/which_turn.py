"""Six sides and three turns in a log that nobody labelled: which rests are sides, and which motion was the turn.

Next to a turn the instrument may be brought to where it is to start from, and a turn may pause for a new grip. Which
of the motions about an axis are the turn is told by the scale of the gyro that carries gravity from rest to rest.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.findings import EVERYTHING, Finding
from inercal.foundation.records.column import Triad
from inercal.foundation.records.dwells import Dwell, breaks
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.sections.cutting.cut import TriadSamples
from inercal.systems.imu.sections.cutting.gravity_transfer import AtRest, Carried, carry
from inercal.systems.imu.sections.cutting.holds import holds_of
from inercal.systems.imu.sections.cutting.limits import LIMITS as LIMITS_OF_HOLDS
from inercal.systems.imu.sections.cutting.log import on_clock
from inercal.systems.imu.sections.cutting.motions import AccelerometerLevel, SectionMotion, motions, part

_SIDES = {
    f"{sign}{letter}": float(f"{sign}1") * np.eye(3)[k] for k, letter in enumerate("xyz") for sign in "+-"
}

ASK = "Label it, or state it under imu.ferraris.sections."


@dataclass(frozen=True, eq=False)
class FoundInLog:
    """Sides as ``+x`` and turns by axis, each first and last sample (exclusive) of the accelerometers; the ``doubt``
    (3,) about the angles of the turns [rad], by what else they may have been; and ``findings``."""

    sides: Mapping[str, tuple[int, int]]
    turns: Mapping[int, tuple[int, int]]
    doubt: Array
    findings: tuple[Finding, ...]


def found_in_log(acc: Triad, gyro: Triad, turn: tuple[float, float]) -> FoundInLog:
    """The sides and turns of a log; ``turn`` are the angle of each turn and its u [rad]."""
    rate = on_clock(TriadSamples(gyro.t, gyro.values, np.zeros(len(gyro.t), dtype=bool)), acc.t)
    cuts = breaks(acc.t, LIMITS.motion_gap / acc.rate)
    holds = [_without_hand(hold, acc, cuts) for hold in holds_of(acc.t, acc.values, rate).acc]
    if not holds:
        return FoundInLog({}, {}, np.zeros(3), ())
    level = AccelerometerLevel.of(acc, holds)
    sides = _sides(acc, holds, level)
    bias = np.mean([np.nanmean(part(gyro, acc, hold.start, hold.stop)[1], axis=0) for hold in holds], axis=0)
    candidates = list(motions(acc, gyro, holds, level, bias, cuts))
    at_rest = AtRest.of(acc, gyro, sides)
    told = None if at_rest is None else carry(acc, gyro, holds, at_rest, candidates)
    turns, doubt, findings = _choice(acc, gyro, candidates, at_rest, told, turn)
    return FoundInLog(
        {way: (hold.start, hold.stop) for way, hold in sides.items()},
        {axis: (motion.start, motion.stop) for axis, motion in turns.items()},
        doubt,
        findings,
    )


def _without_hand(hold: Dwell, acc: Triad, cuts: NDArray[np.int64]) -> Dwell:
    """A hold less a window at either end, where the hand may still be on it and turns begin slowly; or up to a break of
    the record."""
    window = round(LIMITS_OF_HOLDS.still_window * acc.rate)
    margin, edges = min(window, hold.samples // 4), np.array([0, len(acc.t), *cuts])
    begin, end = (0 if np.min(np.abs(edges - at)) <= window else margin for at in (hold.start, hold.stop))
    return Dwell(hold.start + begin, hold.stop - end)


def _sides(acc: Triad, holds: Sequence[Dwell], level: AccelerometerLevel) -> dict[str, Dwell]:
    """The hold of each side: of several, those of the two sides of an axis that are nearest in time, so that biases
    that wander drop out of their difference."""
    ways = np.array([level.up(hold.of(acc.values)) for hold in holds])
    sides: dict[str, Dwell] = {}
    for letter in "xyz":
        there = {}
        for way in (f"+{letter}", f"-{letter}"):
            found = [h for h, up in zip(holds, ways, strict=True) if up @ _SIDES[way] > LIMITS.upright_cosine]
            longest = max((hold.samples for hold in found), default=0)
            if found:
                there[way] = [hold for hold in found if 2 * hold.samples >= longest]
        if len(there) == 2:
            pairs = itertools.product(*there.values())
            sides |= dict(zip(there, min(pairs, key=lambda pair: _apart(*pair)), strict=True))
        else:
            sides |= {way: max(found, key=lambda hold: hold.samples) for way, found in there.items()}
    return sides


def _apart(here: Dwell, there: Dwell) -> int:
    """Samples between two holds."""
    return max(here.start, there.start) - min(here.stop, there.stop)


def _choice(
    acc: Triad,
    gyro: Triad,
    candidates: Sequence[SectionMotion],
    at_rest: AtRest | None,
    told: Carried | None,
    stated: tuple[float, float],
) -> tuple[dict[int, SectionMotion], Array, tuple[Finding, ...]]:
    """The turn about each axis, as far as there is a motion that can be it, the doubt about its angle, and findings.

    Where gravity does not tell the scale factor, one near the nominal is right, of counts one like those of the other
    axes. Of motions that cannot be told apart one in the stated sense is taken, of a single stretch between holds, and
    the likeliest.
    """
    turn, turn_u = stated
    about = {axis: [m for m in candidates if m.axis == axis] for axis in range(3)}
    turns: dict[int, SectionMotion] = {}
    doubt, findings, untold = np.zeros(3), list[Finding](), []
    for axis, found in about.items():
        gains = np.array([_gain(m, axis, at_rest, turn) for m in found])
        off, u = np.abs(gains), math.inf
        if told is not None and told.u[axis] < LIMITS.transfer_scale_u:
            off = off / told.scale[axis] - 1.0
            u = math.hypot(turn_u / turn, LIMITS.turn_scale_u, float(told.u[axis]))
        elif gyro.unit.dimension == "rate":
            off = off * gyro.unit.factor - 1.0
        else:
            own = _largest({axis: found})
            alike = own > LIMITS.turn_size * _largest(about)
            off = off * abs(turn) / own - 1.0 if alike else np.inf * off
        rows = [k for k in range(len(found)) if abs(off[k]) < LIMITS.turn_deviation]
        if not rows:
            continue
        least = float(np.min(np.abs(off[rows]))) / u
        rows = [k for k in rows if (off[k] / u) ** 2 <= least**2 + LIMITS.turn_chi2]
        rows = [k for k in rows if gains[k] > 0.0] or rows
        best = min(rows, key=lambda k: (not found[k].single, abs(off[k]), found[k].stop))
        other = max(rows, key=lambda k: abs(gains[k] - gains[best]))
        turns[axis], where = found[best], _where(acc, found[best])
        apart = abs(abs(float(gains[other] / gains[best])) - 1.0)
        doubt[axis] = apart * abs(turn)
        name = f"the turn about {'xyz'[axis]}"
        if least > LIMITS.turn_sigmas:
            by = math.degrees(abs(turn) * (1.0 + float(off[best])))
            text = (
                f"Gravity, carried from rest to rest, says that {name} was by {by:.1f} deg, not {_deg(turn)}."
            )
            act = f"{ASK} Check imu.ferraris.turn."
            findings.append(Finding("contradiction", text, where, EVERYTHING, action=act))
        if apart > max(LIMITS.slight_turn_difference, abs(turn_u / turn)):
            text = f"Which motion is {name} is not certain: two differ by {100 * apart:.2g} %."
            grave = apart > LIMITS.grave_turn_difference
            items = ({"taken": where, "or": _where(acc, found[other])},)
            code, harm = ("contradiction", EVERYTHING) if grave else ("turn_doubtful", ())
            findings.append(Finding(code, text, where, harm, action=ASK, items=items))
        if math.isinf(u):
            untold.append("xyz"[axis])
    if untold:
        text = f"That the motions about {', '.join(untold)} are whole turns is taken for granted."
        act = f"Leave the log running from side to side, so that gravity tells. {ASK}"
        findings.append(Finding("turn_doubtful", text, action=act))
    return turns, doubt, tuple(findings)


def _deg(angle: float) -> str:
    """The size of an angle, in words."""
    return f"{math.degrees(abs(angle)):g} deg"


def _gain(motion: SectionMotion, axis: int, at_rest: AtRest | None, turn: float) -> float:
    """The scale factor [output per rad/s] if this was the turn; bias and g-sensitivity are those in the sides."""
    if at_rest is None:
        return float(motion.rotation[axis] / turn)
    bias = at_rest.rate_bias + at_rest.by_g @ motion.up
    return float((motion.integral - motion.duration * bias)[axis] / turn)


def _largest(about: Mapping[int, Sequence[SectionMotion]]) -> float:
    """The largest rotation [output s] of a single stretch about one of the axes."""
    sizes = (abs(m.rotation[k]) for k, found in about.items() for m in found if m.stretches == 1)
    return max(sizes, default=0.0)


def _where(acc: Triad, motion: SectionMotion) -> str:
    """Begin and end of a motion, in words."""
    return f"t {acc.t[motion.start]:.2f} to {acc.t[motion.stop - 1]:.2f} s"
