"""Small constant errors that the model leaves out, found in the innovations of the error-state filter.

Innovations change linearly with such an error: ``z = z_0 + Z theta``, where column i of Z is the change when the
recording is corrected by a small theta_i and filtered again. What makes them smallest is least squares, and the sum of
squares that it takes away is chi-square where there is no error: the filter with theta as further states, without a
prior, would find the same (Friedland, IEEE Trans. Automatic Control 14 (1969) 359). One kind of error after the other
is taken in, the one that explains most first, together with those found before. What a study states with an
uncertainty may be wrong by about that: it is fitted along with all, its uncertainty for a prior.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from inercal.arrays import Array
from inercal.geometry.earth import EARTH_RATE
from inercal.geometry.rotations import boxminus, exp, rotate
from inercal.selfcal.diagnosis.gross import RISK
from inercal.selfcal.filters.filter_result import FilterResult
from inercal.selfcal.filters.problem import FilterProblem
from inercal.selfcal.filters.residuals import gimbals
from inercal.selfcal.filters.run import estimate
from inercal.selfcal.platform.coefficients import NAMES
from inercal.selfcal.platform.recording import Recording
from inercal.selfcal.platform.rig import JOINTS, World

Case = tuple[Recording, FilterProblem]

ORDERS = np.arange(1, 65)
"""Periods per turn that an error of an encoder is looked for at."""

LEAST_COSINE = 0.2
"""Rows with a smaller |cos thy| are left out: near gimbal lock innovations are smaller than stated."""

LEAST_SIGMAS = 4.0
"""Standard uncertainties by which one parameter of an error must still differ from 0 beside errors found later."""

_MOST, _ROUNDS = 5, 10
_FLAT = 1e-12


@dataclass(frozen=True, eq=False)
class Cause:
    """A kind of error: ``names`` of its parameters, a small ``step`` of each, the case ``corrected`` by values of
    them, of how many alternatives it was picked, and the standard deviation ``prior`` of each parameter about 0."""

    kind: str
    names: tuple[str, ...]
    step: float
    corrected: Callable[[Recording, FilterProblem, Array], Case]
    alternatives: int = 1
    prior: float = math.inf


@dataclass(frozen=True, eq=False)
class Found:
    """An error that is there: its ``values`` (m,) and their standard uncertainties ``u`` (m,), in SI."""

    cause: Cause
    values: Array
    u: Array


def filtered(case: Case) -> FilterResult:
    """What the error-state filter makes of a case."""
    return estimate(*case, "error-state")


def regular(recording: Recording, found: FilterResult) -> Array:
    """Normalised innovations (n - 1, 6), NaN near gimbal lock."""
    near = ~(np.abs(np.cos(recording.th[1:, 1])) >= LEAST_COSINE)
    innovations = found.innovations.copy()
    innovations[near & np.isfinite(recording.th[1:, 1])] = np.nan
    return innovations


def likely(recording: Recording, problem: FilterProblem, stated: Cause | None) -> FilterProblem:
    """The problem with what is ``stated`` moved, within its uncertainty, to where the recording fits best.

    Where one of it would have to move further than chance takes it, at a risk of `RISK` over all, the recording
    contradicts what is stated, and nothing is moved.
    """
    from scipy.special import ndtri

    if stated is None:
        return problem
    fit = _fitted((recording, problem), [_none_of(stated)])[0]
    limit = -float(ndtri(0.5 * RISK / len(fit.values)))
    if not np.abs(fit.values).max() <= limit * stated.prior:
        return problem
    return _corrected((recording, problem), [fit])[1]


def search(
    recording: Recording, problem: FilterProblem, stated: Cause | None = None
) -> tuple[list[Found], Case]:
    """Find what the model leaves out, and what is ``stated`` does not explain within its uncertainty.

    Returns
    -------
    found : list of `Found`
    case : (Recording, FilterProblem)
        Corrected by all of it.
    """
    causes, base, taken = _causes(problem), (recording, problem), list[Found]()
    if stated is not None:
        taken = _fitted(base, [_none_of(stated)])
    case = _corrected(base, taken)
    now = filtered(case)
    for _ in range(_MOST):
        if not now.converged:
            break
        z = regular(case[0], now)
        held = [_slopes(case, each.cause, z) for each in taken]
        kinds = {each.cause.kind for each in taken}
        tried = [cause for cause in (*causes, *_harmonics(case, now, z)) if cause.kind not in kinds]
        gains = [_gain(z, taken, held, cause, _slopes(case, cause, z), len(tried)) for cause in tried]
        if not max(gains, default=0.0) > 0.0:
            break
        cause = tried[int(np.argmax(gains))]
        fitted = _fitted(base, [*taken, _none_of(cause)])
        # earlier ones that were taken for a part of this one
        last = fitted.pop()
        taken = [*(each for each in fitted if each.cause is stated or _clear(each)), last]
        if len(taken) <= len(fitted):
            taken = _fitted(base, taken)
        case = _corrected(base, taken)
        now = filtered(case)
    return [each for each in taken if each.cause is not stated], case


def _none_of(cause: Cause) -> Found:
    """An error of which nothing is known yet."""
    return Found(cause, np.zeros(len(cause.names)), np.ones(len(cause.names)))


def _clear(found: Found) -> bool:
    """Whether a parameter of an error differs from 0."""
    return bool(np.abs(found.values / found.u).max() > LEAST_SIGMAS)


def _fitted(base: Case, taken: Sequence[Found]) -> list[Found]:
    """All errors together by least squares, linearised again where they are large."""
    found = list(taken)
    for _ in range(_ROUNDS):
        case = _corrected(base, found)
        z = regular(case[0], filtered(case))
        Z = np.concatenate([_slopes(case, each.cause, z) for each in found], axis=-1)
        fit = _least_squares(Z, z, found)
        ends = np.cumsum([len(each.values) for each in found])[:-1]
        parts = zip(found, np.split(fit.change, ends), np.split(fit.u, ends), strict=True)
        found = [Found(each.cause, each.values + by, u) for each, by, u in parts]
        if np.all(np.abs(fit.change) < 0.1 * fit.u):
            break
    return found


def _corrected(base: Case, taken: Sequence[Found]) -> Case:
    """The case without the errors found."""
    for each in taken:
        base = each.cause.corrected(*base, each.values)
    return base


def _slopes(case: Case, cause: Cause, z: Array) -> Array:
    """(n - 1, 6, m) derivative of the innovations by the parameters of a cause."""
    columns = []
    for values in cause.step * np.eye(len(cause.names)):
        changed = cause.corrected(*case, values)
        columns.append((regular(changed[0], filtered(changed)) - z) / cause.step)
    return np.stack(columns, axis=-1)


class _Fit(NamedTuple):
    """Least squares: ``change`` (m,) of the parameters, its ``u`` (m,), mean square ``left`` and sum of squares
    ``gained``."""

    change: Array
    u: Array
    left: float
    gained: float


def _least_squares(Z: Array, z: Array, at: Sequence[Found]) -> _Fit:
    """Change from the values of errors ``at`` that makes ``z + Z change`` and their misfit to their priors smallest;
    combinations without effect stay as they are."""
    used = np.isfinite(z) & np.isfinite(Z).all(axis=-1)
    scatter = math.sqrt(max(1.0, float(np.mean(np.square(z[used]))))) if used.any() else 1.0
    weight = scatter * np.concatenate([np.full(len(each.values), 1.0 / each.cause.prior) for each in at])
    known = weight * np.concatenate([each.values for each in at])
    columns, values = np.vstack([Z[used], np.diag(weight)]), np.append(z[used], known)
    size = np.sqrt(np.square(columns).sum(axis=0))
    without = size == 0.0
    size[without] = 1.0
    columns = columns / size
    strength, ways = np.linalg.eigh(columns.T @ columns)
    ways[without] = 0.0  # eigenvectors have them in other combinations by rounding
    inverse = np.where(strength > _FLAT, 1.0 / np.maximum(strength, _FLAT), 0.0)
    along = ways.T @ (columns.T @ values)
    gained = float(along @ (inverse * along))
    # innovations larger than stated, for whatever reason, must not make errors of the model
    left = max(1.0, (float(values @ values) - gained) / max(int(used.sum()), 1))
    u = np.sqrt(left * (np.square(ways) @ inverse)) / size
    return _Fit(-(ways @ (inverse * along)) / size, u + np.finfo(float).tiny, left, gained)


def _gain(
    z: Array, taken: Sequence[Found], held: Sequence[Array], cause: Cause, slopes: Array, tried: int
) -> float:
    """Sum of squares that a cause takes away beyond those taken already, above what chance does."""
    from scipy.special import chdtri

    after = _least_squares(np.concatenate([*held, slopes], axis=-1), z, [*taken, _none_of(cause)])
    before = _least_squares(np.concatenate(held, axis=-1), z, taken).gained if held else 0.0
    chance = float(chdtri(slopes.shape[-1], RISK / (tried * cause.alternatives)))
    return (after.gained - before) / after.left - chance


def _causes(problem: FilterProblem) -> tuple[Cause, ...]:
    """What may be wrong of the site, the base, the gyros and the clock of the commands."""
    general = (
        Cause("latitude", ("north", "up"), 1e-3 * EARTH_RATE, _other_earth),
        Cause("delay", ("delay",), 0.01, _delayed),
        Cause("mounting", ("gamma_x", "gamma_y", "gamma_z"), 1e-5, _other_mounting),
    )
    if len(problem.prior) > len(NAMES):
        return general
    return (
        *general,
        Cause("base", ("beta_x", "beta_y", "beta_z"), 1e-5, _other_base),
        Cause("scale", ("kg1_x", "kg1_y", "kg1_z"), 1e-5, _other_scale),
    )


def _other_mounting(recording: Recording, problem: FilterProblem, values: Array) -> Case:
    """Sensors turned by gamma [rad] against the axes that the encoders tell of: ``q_bp = q_encoders qexp(gamma)``."""
    turn = exp(values)
    return replace(recording, acc=rotate(turn, recording.acc), rate=rotate(turn, recording.rate)), problem


def _other_earth(recording: Recording, problem: FilterProblem, values: Array) -> Case:
    """Earth rate with other north and upward parts [rad/s]."""
    north, up = directions(problem.world)
    earth = problem.world.earth + values[0] * north + values[1] * up
    return recording, replace(problem, world=problem.world._replace(earth=earth))


def directions(world: World) -> tuple[Array, Array]:
    """Unit vectors north and up in b; any level one for north at a pole."""
    up = world.up / np.linalg.norm(world.up)
    level = world.earth - (world.earth @ up) * up
    if np.linalg.norm(level) < 1e-9 * EARTH_RATE:
        level = np.eye(3)[int(np.argmin(np.abs(up)))]
        level = level - (level @ up) * up
    return level / np.linalg.norm(level), up


def _delayed(recording: Recording, problem: FilterProblem, values: Array) -> Case:
    """Commands that act later by a part of a row."""
    part = float(values[0])
    before = np.vstack([recording.rate[:1], recording.rate[:-1]])
    after = np.vstack([recording.rate[1:], recording.rate[-1:]])
    other = before if part > 0.0 else after
    return replace(recording, rate=recording.rate + abs(part) * (other - recording.rate)), problem


def _other_base(recording: Recording, problem: FilterProblem, values: Array) -> Case:
    """A base turned by beta [rad]."""
    q, world = exp(values), problem.world
    turned = world._replace(earth=rotate(q, world.earth), up=rotate(q, world.up))
    return recording, replace(problem, world=turned)


def _other_scale(recording: Recording, problem: FilterProblem, values: Array) -> Case:
    """Gyros with scale errors."""
    return replace(recording, rate=recording.rate * (1.0 + values)), problem


def _harmonics(case: Case, now: FilterResult, z: Array) -> list[Cause]:
    """Errors periodic in the angle of a joint: of each joint the order that its innovations show most."""
    angles, joints = _found_angles(case, now)
    th = angles[1:]
    size = np.sqrt(np.square(joints[1:]).sum(axis=2))
    by_joint = np.einsum("kij,kj->ki", np.linalg.pinv(joints[1:], rcond=1e-3), z[:, 3:] * size)
    causes = []
    for joint in range(3):
        used = np.isfinite(by_joint[:, joint] + th[:, joint])
        angle, missed = th[used, joint], by_joint[used, joint]
        # half a period is the least from which an order is told from a constant
        orders = ORDERS[ORDERS * np.ptp(angle) > math.pi] if used.any() else ORDERS[:0]
        if len(orders):
            powers = np.abs(np.exp(1j * orders[:, None] * angle) @ missed)
            causes.append(_harmonic(joint, int(orders[np.argmax(powers)]), angles[:, joint]))
    return causes


def _found_angles(case: Case, now: FilterResult) -> tuple[Array, Array]:
    """Gimbal angles (n, 3) [rad] that the filter found, and the axes (n, 3, 3) of the joints: at rest the angles read
    change with their noise alone, which they would explain."""
    recording, problem = case
    assert now.history is not None
    read, joints = gimbals(np.nan_to_num(recording.th), problem.world)
    off = boxminus(read, now.history.attitude)
    return recording.th - np.einsum("kij,kj->ki", np.linalg.pinv(joints, rcond=1e-3), off), joints


def _harmonic(joint: int, order: int, angle: Array) -> Cause:
    """An error ``a sin(k th) + b cos(k th)`` of an encoder at angles th (n,)."""
    waves = np.stack([np.sin(order * angle), np.cos(order * angle)])

    def corrected(recording: Recording, problem: FilterProblem, values: Array) -> Case:
        th = recording.th.copy()
        th[:, joint] -= values @ waves
        return replace(recording, th=th), problem

    return Cause(f"harmonic {order} of {JOINTS[joint]}", ("sin", "cos"), 1e-6, corrected, len(ORDERS))
