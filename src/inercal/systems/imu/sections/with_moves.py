"""Calibration from sections and the moves between them.

Moves whose samples are not whole are left out and named. The accelerometers are fitted alone first: the gyro must not
spoil them. Where moves raise their scatter or their u, the moves are at fault and lose their say in them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.records.checks.values import at_ends
from inercal.systems.imu.limits import LIMITS as OF_ALL
from inercal.systems.imu.sections.calibration import SectionCalibration, calibrate_sections
from inercal.systems.imu.sections.carried import Move
from inercal.systems.imu.sections.gyro_axes import ChannelOrder, CoarseMoves
from inercal.systems.imu.sections.limits import LIMITS
from inercal.systems.imu.sections.moves import MoveRows, move_rows
from inercal.systems.imu.sections.outputs import effective, verticals
from inercal.systems.imu.sections.priors import Priors, Size
from inercal.systems.imu.sections.section import Section
from inercal.systems.imu.sections.unknowns import COMMON, S


class MoveLeftOut(NamedTuple):
    """A move that is not whole: its place in the list, and why in words."""

    move: int
    why: str


@short_repr
@dataclass(frozen=True, eq=False)
class CalibrationWithMoves:
    """A calibration from sections and moves."""

    calibration: SectionCalibration
    alone: SectionCalibration
    """That of the accelerometers without the gyro."""
    used: tuple[int, ...]
    """Places of the moves that count."""
    left_out: tuple[MoveLeftOut, ...]
    spoiled: tuple[str, ...]
    """Terms, or the scatter, of the accelerometers that moves made worse, for which these have no say in them."""
    rescaled: bool
    """True where moves deny the scale that was said of the gyro."""
    channels: ChannelOrder | None = None
    """Axes that the channels of the gyro seem to measure, where no scale carries the verticals: no fit was made."""


def calibrate_with_moves(
    sections: Sequence[Section], moves: Sequence[Move], priors: Priors
) -> CalibrationWithMoves:
    """Calibrate accelerometers and gyro from sections, among them rests, and moves between these in the order of time.

    Raises
    ------
    LinAlgError
        Too little is known for any solution.
    """
    alone = calibrate_sections([replace(s, gyro=None, gyro_var=None) for s in sections], priors)
    left_out = not_whole(moves)
    whole = [k for k in range(len(moves)) if k not in {one.move for one in left_out}]
    left_out += tuple(
        MoveLeftOut(whole[one.move], one.why)
        for one in not_seen([moves[k] for k in whole], sections, priors, verticals_of(alone))
    )
    used = tuple(k for k in range(len(moves)) if k not in {one.move for one in left_out})
    kept = [moves[k] for k in used]
    if not kept:
        no_scale = priors.gyro_scale is None and not _turned(sections)
        joint = alone if no_scale else calibrate_sections(sections, priors)
        return CalibrationWithMoves(joint, alone, used, left_out, (), rescaled=False)
    scaled, rescaled, channels = _scaled(sections, kept, priors, alone)
    if channels is not None:
        return CalibrationWithMoves(alone, alone, (), left_out, (), rescaled=False, channels=channels)
    scaled = replace(scaled, excess=scaled.excess | alone.excess)
    extra = move_rows(len(sections), kept, scaled)
    joint = calibrate_sections(sections, scaled, (extra,))
    wander = _wander(joint, extra)
    if wander is not None:
        less = move_rows(len(sections), [_less(move, wander) for move in kept], scaled)
        without = calibrate_sections(sections, scaled, (less,))
        chance = 1.0 / np.sqrt(2.0 * max(joint.scatter_dof["moves"], 1.0))
        gained = np.log(joint.scatter["moves"] / without.scatter["moves"])
        if without.converged and gained > LIMITS.raised_scatter * chance:  # else rests are restless, no bias
            joint, extra = without, less
    spoiled = _spoiled(alone, joint)
    if spoiled:
        joint = _without_say(sections, scaled, extra, alone)
    return CalibrationWithMoves(joint, alone, used, left_out, spoiled, rescaled)


def not_whole(moves: Sequence[Move]) -> tuple[MoveLeftOut, ...]:
    """Moves with clipped samples, gaps or lost stamps."""
    if not moves:
        return ()
    y = np.concatenate([move.gyro for move in moves])
    clipped = np.any([at_ends(values) for values in y.T], axis=0)
    of = np.repeat(np.arange(len(moves)), [len(move.t) for move in moves])
    steps = np.concatenate([np.diff(move.t) for move in moves])
    usual = float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else np.inf
    out = []
    for k, move in enumerate(moves):
        step = np.diff(move.t)
        lost = int(np.sum(~np.isfinite(move.gyro).all(axis=1)))
        if not len(step) or not np.all(step > 0.0):
            out.append(MoveLeftOut(k, "its time stamps do not rise"))
        elif lost:
            out.append(MoveLeftOut(k, f"{lost} of its samples are lost"))
        elif (longest := float(step.max())) > OF_ALL.motion_gap * usual:
            out.append(MoveLeftOut(k, f"it has a gap of {longest:.3g} s"))
        elif count := int(np.sum(clipped[of == k])):
            out.append(MoveLeftOut(k, f"{count} of its samples are clipped"))
    return tuple(out)


def not_seen(
    moves: Sequence[Move], sections: Sequence[Section], priors: Priors, up: Array
) -> tuple[MoveLeftOut, ...]:
    """Moves in which the verticals ``up`` (n, 3) of rests turn by far more than the gyro did: rows are missing. Where
    nothing tells the size of the gyro's outputs, and no vertical turns, all: they leave its scale open."""
    if not moves:
        return ()
    bias = _rest_bias(sections)
    swept = np.array(
        [float(np.sum(np.linalg.norm(move.gyro[1:] - bias, axis=1) * np.diff(move.t))) for move in moves]
    )
    cosine = [np.clip(up[move.first] @ up[move.last], -1.0, 1.0) for move in moves]
    angle = np.arccos(cosine)
    # by the largest sweep, not by the stated unit: a wrong unit makes all of them small, and is named as such
    least = float(np.max(swept)) / LIMITS.largest_sweep
    missing = (angle > LIMITS.turned_vertical) & (swept < 0.5 * least * angle)
    out = [
        MoveLeftOut(int(k), "the vertical turns and the gyro does not: rows are missing")
        for k in np.flatnonzero(missing)
    ]
    if (
        priors.gyro_scale is None
        and not _turned(sections)
        and not np.any((angle > LIMITS.turned_vertical) & ~missing)
    ):
        open_still = "it turns about the vertical, which leaves the scale of a gyro in counts open"
        out += [MoveLeftOut(int(k), open_still) for k in np.flatnonzero(~missing)]
    return tuple(out)


def _turned(sections: Sequence[Section]) -> bool:
    """True where sections other than rests tell the scale of the gyro."""
    return any(s.kind != "rest" and s.gyro is not None for s in sections)


def _rest_bias(sections: Sequence[Section]) -> Array:
    """Median output (3,) of the gyro at rest, 0 where it was never."""
    rests = [
        s.gyro for s in sections if s.kind == "rest" and s.gyro is not None and np.isfinite(s.gyro).all()
    ]
    return np.median(rests, axis=0) if rests else np.zeros(3)


def _scaled(
    sections: Sequence[Section], moves: Sequence[Move], priors: Priors, alone: SectionCalibration
) -> tuple[Priors, bool, ChannelOrder | None]:
    """The priors with a scale of the gyro that carries the verticals of rests, whether what was said of it does not,
    and the order of its channels where no scale does. A scale that other sections tell needs no guess."""
    if _turned(sections):
        return priors, False, None
    said = priors.gyro_scale
    coarse = CoarseMoves.of(moves, verticals_of(alone), _rest_bias(sections))
    if said is not None and coarse.missed(said.median) < OF_ALL.vertical_miss:
        return priors, False, None
    best = coarse.best()
    if best.miss > OF_ALL.vertical_miss and len(moves) >= OF_ALL.fewest_turns:
        return priors, False, coarse.order(best.miss)
    if said is not None and best.miss > OF_ALL.vertical_miss:
        return priors, False, None
    return replace(priors, gyro_scale=Size(best.scale, LIMITS.open_scale)), said is not None, None


def verticals_of(found: SectionCalibration) -> Array:
    """Directions of specific force (n, 3) of a calibration."""
    x = found.point.x
    return np.asarray(verticals(found.problem, found.point, x[:COMMON], effective(found.problem, x)).real)


def _wander(found: SectionCalibration, extra: MoveRows) -> Array | None:
    """Distance of the bias of the gyro from its mean in each rest (n, 3) [output], as far as it is more than noise;
    None where that hardly turns a move.

    A bias that drifts is that of the rests beside a move, not their mean: their residuals, less the part of them that
    is noise.
    """
    scatter = found.scatter.get("gyro", 0.0) * np.abs(found.point.x[S])
    variance = found.problem.readings.variance[:, 2]
    if not np.any(scatter > 0.0):
        return None
    wander = np.where(found.problem.readings.seen[:, 2], found.residuals[:, 2], 0.0)
    wander = wander * scatter**2 / (scatter**2 + variance)
    first, last = extra.ends
    tau = extra.increments.durations
    turned = 0.5 * (wander[first] + wander[last]) / found.point.x[S] * tau[:, None]
    usual = found.scatter["moves"] * np.sqrt(tau)
    off = float(np.sqrt(np.mean(np.sum(turned**2, axis=1)) / np.mean(usual**2)))
    return np.asarray(wander) if off > LIMITS.harmless_wander else None


def _less(move: Move, wander: Array) -> Move:
    """A move without the bias that the rests beside it have beyond the mean (n, 3), which changes evenly in it."""
    part = ((move.t - move.t[0]) / move.duration)[:, None]
    return replace(move, gyro=move.gyro - (1.0 - part) * wander[move.first] - part * wander[move.last])


def _spoiled(alone: SectionCalibration, joint: SectionCalibration) -> tuple[str, ...]:
    """Terms of the accelerometers whose u the moves raise, and ``scatter`` where they raise that beyond chance."""
    out = [
        name
        for name in alone.names
        if name in joint.names and joint.value(name)[1] > LIMITS.raised_u * alone.value(name)[1]
    ]
    for name, scatter in alone.scatter.items():
        if name.startswith("acc") and name in joint.scatter:
            chance = 1.0 / np.sqrt(2.0 * max(alone.scatter_dof[name], 1.0))
            if np.log(joint.scatter[name] / scatter) > LIMITS.raised_scatter * chance:
                out.append("scatter")
    if any(name.startswith("acc") for name in joint.scatter.keys() - alone.scatter.keys()):
        out.append("scatter")
    return tuple(dict.fromkeys(out))


def _without_say(
    sections: Sequence[Section], priors: Priors, extra: MoveRows, alone: SectionCalibration
) -> SectionCalibration:
    """The accelerometers alone, and the gyro by moves between rests whose scatter is that of the accelerometers
    alone."""
    size = alone.noise["acc"]
    plain = [s if s.acc is None else replace(s, acc_var=None, scatter="") for s in sections]
    held = replace(priors, acc_scatter=Size(size, LIMITS.held_scatter), excess=priors.excess - {"acc"})
    joint = calibrate_sections(plain, held, (extra,))
    x, u, U, dof, C = (np.array(y) for y in (joint.x, joint.u, joint.U, joint.dof, joint.covariance))
    at = [k for k, name in enumerate(joint.names) if name in alone.names]
    own = [alone.names.index(joint.names[k]) for k in at]
    other = [k for k in range(len(joint.names)) if k not in at]
    for mine, theirs in ((x, alone.x), (u, alone.u), (U, alone.U), (dof, alone.dof)):
        mine[at] = theirs[own]
    common = joint.common.copy()
    for mine, theirs in ((C, alone.covariance), (common, alone.common)):
        mine[np.ix_(at, at)] = theirs[np.ix_(own, own)]
        mine[np.ix_(at, other)] = mine[np.ix_(other, at)] = 0.0
    gyro = {name for k in other for name in [joint.names[k]]}
    return replace(
        joint,
        x=x,
        u=u,
        U=U,
        dof=dof,
        covariance=C,
        common=common,
        by_prior=(*alone.by_prior, *(name for name in joint.by_prior if name in gyro)),
        leaning=(*alone.leaning, *(name for name in joint.leaning if name in gyro)),
        residuals=np.concatenate([alone.residuals[:, :2], joint.residuals[:, 2:]], axis=1),
    )
