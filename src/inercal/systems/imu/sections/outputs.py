"""Mean outputs of sections by the unknowns, and their derivatives.

With f the mean specific force of a section and w its mean rate of turn, both by the axes of the case,

    accelerometers  y = K0 + K1 (l + K2 l^2),  l = M f        gyro  y = D_F + S [T (w + e) + G f]

where e is what the section sees of earth rate. A vector that is fixed in space turns by -angle about the axis.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from inercal.foundation.arrays import Array
from inercal.systems.imu.sections.limits import LIMITS
from inercal.systems.imu.sections.problem import Iterate, Problem, RowBlock
from inercal.systems.imu.sections.unknowns import (
    CLOCK,
    COMMON,
    D_F,
    EARTH,
    EARTH_ALONG,
    EARTH_UP,
    GRAVITY,
    K0,
    K1,
    K2,
    LOCAL,
    MOUNTING,
    RATE,
    SWIVEL,
    TILT,
    G,
    M,
    S,
    T,
    Values,
    across,
    cross,
    level_axes,
    matrix,
    turned,
)

_STEP: Final = 1e-30


def verticals(problem: Problem, point: Iterate, common: Values, local: Values) -> Values:
    """Directions (..., n, 3) of specific force, by common unknowns (..., 43) and those of sections (..., n, 8)."""
    return _directions(problem, point, common, local)[0]


def _directions(
    problem: Problem, point: Iterate, common: Values, local: Values
) -> tuple[Values, Values, Values]:
    """Directions (..., n, 3) of specific force and of axes, and the level part of earth rate that is known."""
    tilt = (across(point.up) @ local[..., TILT, None])[..., 0]
    swivel = (across(point.axis) @ local[..., SWIVEL, None])[..., 0]
    mounting = np.broadcast_to(common[..., None, MOUNTING], tilt.shape)
    tied = problem.readings.tied[:, None]

    def tilted(v: Array) -> Values:
        once = turned(tilt, np.broadcast_to(v, tilt.shape))
        return turned(mounting, np.where(tied, turned(swivel, once), once) if tied.any() else once)

    axis = turned(mounting, turned(swivel, np.broadcast_to(point.axis, swivel.shape)))
    north = tilted(problem.north) if problem.north.any() else problem.north
    return tilted(point.up), axis, north


def effective(problem: Problem, x: Array) -> Array:
    """Unknowns (n, 8) that act in each section: placing is that of the setup, the rate has the error of its group, and
    earth rate may be that of a run."""
    of, readings = problem.local(x).copy(), problem.readings
    of[:, :RATE] = of[readings.leader, :RATE]
    of[:, EARTH] = of[readings.earth_leader, EARTH]
    if readings.rate_groups:
        of[:, RATE] += np.where(
            readings.rate_group >= 0, readings.rate * x[COMMON + readings.rate_group], 0.0
        )
    in_run = problem.runs >= 0
    of[in_run, EARTH] = x[problem.runs[in_run, None] + np.arange(3)]
    return of


def _session_biases(problem: Problem, x: Array) -> Array:
    """Biases (n, 2, 3) of the session of each section, of accelerometers [m/s^2] and gyro [rad/s]."""
    sessions, begin = problem.readings.sessions, problem.sessions_at
    biases = x[begin : begin + 6 * len(sessions)].reshape(-1, 2, 3)
    return np.concatenate([biases, np.zeros((1, 2, 3))])[problem.readings.session]


def outputs(problem: Problem, point: Iterate, common: Values, local: Values, biases: Array) -> Values:
    """Mean outputs (..., n, 3 kinds, 3 axes), by common unknowns (..., 43), those of sections (..., n, 8) and biases of
    their sessions (n, 2, 3)."""
    r = problem.readings
    up, axis, north = _directions(problem, point, common, local)
    whole = common[..., None, :]
    size = np.where(r.forced, r.force, whole[..., GRAVITY]) * (1.0 - point.short[:, 0]) * r.has_force
    force = size[..., None] * up
    vertical = np.where(r.forced, 0.0, whole[..., EARTH_UP] * r.has_force)
    earth = vertical[..., None] * up + north + (point.level @ local[..., EARTH, None])[..., 0]
    mean_force, mean_earth = (_over_turn(v, axis, r.swung[:, :1], r.swung[:, 1:]) for v in (force, earth))
    rate = (r.rate + local[..., RATE]) * np.where(r.turning, 1.0 + whole[..., CLOCK], 1.0)
    rate = rate + np.where((r.rate != 0.0) & ~r.know_axis & ~r.tied, whole[..., EARTH_ALONG], 0.0)
    angle = (r.angle + r.duration * local[..., RATE])[..., None]
    after = _over_turn(force, axis, np.cos(angle), np.sin(angle))
    turning = rate[..., None] * axis * (1.0 - point.short[:, 1:]) + mean_earth
    gains = matrix(common[..., M])[..., None, :, :]
    out = []
    for f in (force, after):
        line = (gains @ f[..., None])[..., 0]
        out.append(whole[..., K0] + whole[..., K1] * (line * (1.0 + whole[..., K2] * line) + biases[:, 0]))
    drift = (common[..., G].reshape(*common.shape[:-1], 1, 3, 3) @ mean_force[..., None])[..., 0]
    seen = (matrix(common[..., T])[..., None, :, :] @ turning[..., None])[..., 0]
    out.append(whole[..., D_F] + whole[..., S] * (seen + drift + biases[:, 1]))
    return np.stack(out, axis=-2)


def _over_turn(v: Values, axis: Values, cosine: Values, sine: Values) -> Values:
    """Vectors fixed in space, turned about an axis by minus an angle of this (mean) cosine and sine."""
    along = np.sum(axis * v, axis=-1, keepdims=True) * axis
    return np.asarray(along + cosine * (v - along) - sine * cross(axis, v))


def misfit(problem: Problem, point: Iterate) -> Array:
    """Outputs (n, 3, 3) less those of the model, 0 where there is none."""
    x = point.x
    model = outputs(problem, point, x[:COMMON], effective(problem, x), _session_biases(problem, x))
    return np.where(problem.readings.seen, problem.readings.y - model, 0.0)


def misfits(problem: Problem, point: Iterate, x: Array) -> Array:
    """Outputs (k, n, 9) less those of the model at unknowns x (k, p); biases of sessions are those of the point."""
    local = np.array([effective(problem, one) for one in x])
    model = outputs(problem, point, x[:, :COMMON], local, _session_biases(problem, point.x))
    left = np.where(problem.readings.seen, problem.readings.y - model, 0.0)
    return np.asarray(left.reshape(*left.shape[:2], 9))


def rows(problem: Problem, point: Iterate) -> tuple[RowBlock, ...]:
    """All rows of the linear problem at a point: means, and those of extras."""
    return (_means(problem, point), *(b for extra in problem.extras for b in extra.blocks(problem, point)))


def _means(problem: Problem, point: Iterate) -> RowBlock:
    """The rows of means, a cell for each section. Derivatives are by complex steps, of one unknown of all sections at
    once, so that their number does not grow with that of the sections."""
    r, x, n = problem.readings, point.x, len(problem.readings.sections)
    common = np.flatnonzero(problem.free[:COMMON])
    m = len(common)
    moved = np.tile(x[:COMMON].astype(complex), (m + LOCAL, 1))
    moved[range(m), common] += 1j * _STEP
    local = np.tile(effective(problem, x).astype(complex), (m + LOCAL, 1, 1))
    local[range(m, m + LOCAL), :, range(LOCAL)] += 1j * _STEP
    biases = _session_biases(problem, x)
    d = outputs(problem, point, moved, local, biases).imag.reshape(m + LOCAL, n, 9) / _STEP
    shared, of_local = np.zeros((n, 9, problem.shared)), np.moveaxis(d[m:], 0, 2).copy()
    shared[:, :, common] = np.moveaxis(d[:m], 0, 2)
    for k in range(len(r.rate_groups)):
        shared[:, :, COMMON + k] = of_local[:, :, RATE] * np.where(r.rate_group == k, r.rate, 0.0)[:, None]
    for k in range(len(r.sessions)):
        for kind, (sensor, scale) in enumerate(((0, K1), (0, K1), (1, S))):
            for i in range(3):
                place = problem.sessions_at + 6 * k + 3 * sensor + i
                shared[:, 3 * kind + i, place] = np.where(r.session == k, x[scale][i], 0.0)
    for section in np.flatnonzero(problem.runs >= 0):
        run = problem.runs[section]
        shared[section, :, run : run + 3] = of_local[section, :, EARTH]
        of_local[section, :, EARTH] = 0.0
    lead, own, of_earth = (
        problem.shared + LOCAL * section[:, None] for section in (r.leader, np.arange(n), r.earth_leader)
    )
    at = np.hstack([lead + np.arange(RATE), own + RATE, of_earth + np.arange(LOCAL)[EARTH]])
    gain = np.abs([x[K1], x[K1], x[S]])
    variance = r.variance.copy()
    g = problem.priors.site.gravity
    variance[:, :2] += (point.loss[:, :1] * (g * point.up * x[K1]) ** 2)[:, None]
    # what g-sensitivity adds where specific force is not known at all, but known elsewhere
    unfelt = (problem.sd[G].reshape(3, 3).max(axis=1) * g * x[S]) ** 2
    variance[:, 2] += np.where(r.has_force[:, None], 0.0, unfelt)
    variance[:, 2] += point.loss[:, 1:] * (r.rate[:, None] * point.axis * x[S]) ** 2
    return RowBlock(
        misfit(problem, point).reshape(n, 9),
        shared,
        of_local,
        at,
        variance.reshape(n, 9),
        {name: (on * gain**2).reshape(n, 9) for name, on in problem.on.items()},
        r.seen.reshape(n, 9),
        ("noise of the accelerometers",) * 6 + ("noise of the gyro",) * 3,
    )


def centred(problem: Problem, point: Iterate) -> Iterate:
    """The point with directions that are not known in the centre of their tilts, and level axes about these."""
    r = problem.readings
    x, up, axis = point.x.copy(), point.up.copy(), point.axis.copy()
    local, lead = problem.local(x), problem.local(point.x)[r.leader]
    tilt, swivel = (across(up) @ lead[:, TILT, None])[..., 0], (across(axis) @ lead[:, SWIVEL, None])[..., 0]
    for unknown, part, by, centre in (
        (~r.know_up & ~r.tied & ~r.led, TILT, tilt, up),
        (~r.know_axis & (r.rate != 0.0), SWIVEL, swivel, axis),
    ):
        centre[unknown] = turned(by[unknown], centre[unknown])
        centre[unknown] /= np.linalg.norm(centre[unknown], axis=1, keepdims=True)
        local[unknown, part] = 0.0
    same = np.sign(np.sum(point.up * point.axis, axis=1))[:, None]
    up = np.where((r.tied & ~r.forced)[:, None], same * axis, up)
    if r.led.any():
        gain = x[K1][:, None] * matrix(x[M])
        felt = (r.y[r.led, 0] - x[K0]) @ np.linalg.inv(gain).T
        up[r.led] = felt / np.linalg.norm(felt, axis=1, keepdims=True)
    out = replace(point, x=x, up=up, axis=axis, level=_kept_level(point.level, up))
    for extra in problem.extras:
        out = extra.centred(problem, out)
    return out


def _kept_level(before: Values, up: Array) -> Array:
    """Level axes (n, 3, 3) about verticals ``up`` (n, 3) that lie as those ``before`` did: axes chosen anew would jump
    where a vertical passes from the region of one choice to that of another, and what is known along them with it."""
    first = before[:, :, 0]
    first = first - up * np.sum(first * up, axis=1, keepdims=True)
    size = np.linalg.norm(first, axis=1, keepdims=True)
    first = first / np.maximum(size, LIMITS.level_axis)
    kept = np.stack([first, cross(up, first), up], axis=2)
    return np.where(size[:, :, None] > LIMITS.level_axis, kept, level_axes(up))
