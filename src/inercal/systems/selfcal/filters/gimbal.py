"""An unscented filter of gimbal angles, the rival to which the paper compares its quaternion filter.

State: the angles th (3), then the coefficients (p,), all noise added to covariances. Angles move at

    th' = T (w_Ip - C_pb w_Ib),   T = J^-1,

integrated by Runge and Kutta's fourth order or by Euler, whose steps bias the coefficients. T is singular where the
inner angle is 90 deg: outer and platform angle are not unique there, and near it the numbers of this filter are wrong
or not even finite. Nothing is done against that; the least |cos thy| is returned.

In the coordinates of the joints, along the axes (i, j, k) on which they lie at zero angles, C_bp = R1(a) R2(b) R3(c)
whatever the rig: angles a, b, c are those of the gimbals times their signs and the parity of (i, j, k)
(`inercal.systems.selfcal.platform.kinematics`), and so are rates, which are axial vectors.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

import numpy as np

from inercal.foundation._jit import allocating, kernel
from inercal.foundation.arrays import Array
from inercal.foundation.geometry.kernels import Vector
from inercal.foundation.inference.sigma_point import (
    FACTORS,
    draw,
    empty_moments,
    empty_points,
    moments,
    update,
    weights,
)
from inercal.systems.selfcal.estimators import FACTOR_OF
from inercal.systems.selfcal.filters.filter_result import (
    Estimates,
    FilterState,
    Trace,
    empty_estimates,
    remember,
)
from inercal.systems.selfcal.filters.plain import accelerometers, on_the_base, platform_rate
from inercal.systems.selfcal.filters.problem import (
    AttitudeStart,
    FilterModel,
    FilterProblem,
    admitted,
    updating,
    watch,
)
from inercal.systems.selfcal.platform.kinematics import Axes, angles, attitude, nearest_turn, parity
from inercal.systems.selfcal.platform.model import specific_force
from inercal.systems.selfcal.platform.recording import Steps
from inercal.systems.selfcal.platform.rig import World

Cosines: TypeAlias = tuple[float, float, float, float, float, float]


def initial(problem: FilterProblem, th: Array, start: AttitudeStart | None = None) -> FilterState:
    """The state before the first step: coefficients 0 with the prior, angles ``th`` (3,) or those of ``start``."""
    world, p = problem.world, len(problem.prior)
    read = np.array(th, dtype=float)
    sigma, at = problem.noise.encoder, read.copy()
    if start is not None:
        sigma, at = start.sigma, np.array(angles(start.attitude, read, world.axes, world.signs))
    covariance = np.diag(np.concatenate([np.full(3, sigma**2), problem.prior**2]))
    return FilterState(at, np.zeros(p), covariance, np.zeros(3, dtype=np.int64), read)


def advance(
    state: FilterState, problem: FilterProblem, steps: Steps, history: bool = True
) -> tuple[FilterState, Trace]:
    """Take the filter through m steps, as `inercal.systems.selfcal.filters.error_state.advance` does."""
    out = empty_estimates(len(steps.dt), len(problem.prior), history)
    factor = FACTORS[problem.filter.factor or FACTOR_OF["gimbal-ukf"]]
    euler = problem.filter.integration == "euler"
    health = _advance(state, problem.model, factor, euler, steps, out)
    return state, Trace(out, *health)


@kernel
def cosines(hat: Vector) -> Cosines:
    """Cosine and sine of a, of b, of c (3,) [rad]."""
    a, b, c = hat
    return math.cos(a), math.sin(a), math.cos(b), math.sin(b), math.cos(c), math.sin(c)


@kernel
def _turned(cos: float, sin: float, d: float) -> tuple[float, float]:
    """Cosine and sine of an angle turned on by ``d`` [rad], by a series where that is exact: points are close by."""
    if abs(d) < 0.01:
        d2 = d * d
        c = 1.0 - d2 * (0.5 - d2 * (1.0 / 24.0 - d2 / 720.0))
        s = d * (1.0 - d2 * (1.0 / 6.0 - d2 * (1.0 / 120.0 - d2 / 5040.0)))
    else:
        c, s = math.cos(d), math.sin(d)
    return cos * c - sin * s, sin * c + cos * s


@kernel
def near(at: Cosines, d: Vector) -> Cosines:
    """The same as `cosines`, at angles that differ by ``d`` (3,) [rad] from those of ``at``."""
    cos_a, sin_a = _turned(at[0], at[1], d[0])
    cos_b, sin_b = _turned(at[2], at[3], d[1])
    cos_c, sin_c = _turned(at[4], at[5], d[2])
    return cos_a, sin_a, cos_b, sin_b, cos_c, sin_c


@kernel
def _inside(at: Cosines, v: Vector) -> Vector:
    """A vector (3,) given in b on the inner gimbal, before the platform's joint: R2(-b) R1(-a) v."""
    tilted = at[0] * v[2] - at[1] * v[1]
    return at[2] * v[0] - at[3] * tilted, at[0] * v[1] + at[1] * v[2], at[3] * v[0] + at[2] * tilted


@kernel
def rates(at: Cosines, w: Vector, earth: Vector) -> Vector:
    """Rates (3,) of a, b, c [rad/s]: ``w`` (3,) of the platform in p, ``earth`` (3,) in b, against inertial space."""
    of_earth = _inside(at, earth)
    # there the joints lie along (cos b, 0, sin b), (0, 1, 0), (0, 0, 1)
    a = (at[4] * w[0] - at[5] * w[1] - of_earth[0]) / at[2]
    return a, at[5] * w[0] + at[4] * w[1] - of_earth[1], w[2] - of_earth[2] - at[3] * a


@kernel
def force(at: Cosines, up: Vector) -> Vector:
    """Specific force (3,) in p of a platform at rest, ``up`` (3,) that in b."""
    x, y, z = _inside(at, up)
    return at[4] * x + at[5] * y, at[4] * y - at[5] * x, z


@kernel
def _further(d: Vector, h: float, r: Vector) -> Vector:
    """``d + h r``."""
    return d[0] + h * r[0], d[1] + h * r[1], d[2] + h * r[2]


@kernel
def step(at: Cosines, d: Vector, w: Vector, earth: Vector, dt: float, euler: bool) -> Vector:
    """Angles after ``dt`` [s] against those of ``at``, from which they differ by ``d`` (3,) [rad] before; ``w`` and
    ``earth`` as of `rates`, held."""
    r1 = rates(near(at, d), w, earth)
    if euler:
        return _further(d, dt, r1)
    r2 = rates(near(at, _further(d, 0.5 * dt, r1)), w, earth)
    r3 = rates(near(at, _further(d, 0.5 * dt, r2)), w, earth)
    r4 = rates(near(at, _further(d, dt, r3)), w, earth)
    d = _further(_further(d, dt / 6.0, r1), dt / 3.0, r2)
    return _further(_further(d, dt / 3.0, r3), dt / 6.0, r4)


@kernel
def along(v: Vector | Array, axes: Axes, sign: float) -> Vector:
    """Components (3,) along (i, j, k) of a vector, times ``sign``: the parity for rates, 1 for forces."""
    return sign * v[axes[0]], sign * v[axes[1]], sign * v[axes[2]]


@kernel
def hat(th: Vector | Array, e: float, signs: Array) -> Vector:
    """The angles a, b, c (3,) of gimbal angles, and back; ``e`` the parity."""
    return e * signs[0] * th[0], e * signs[1] * th[1], e * signs[2] * th[2]


class GimbalStep(NamedTuple):
    """A step of the platform: its ``commanded`` rate (3,) [rad/s], ``dt`` [s], and true for ``euler`` integration."""

    commanded: Vector
    dt: float
    euler: bool


@kernel
def _predict(
    th: Array,
    c: Array,
    extended: bool,
    turn: GimbalStep,
    world: World,
    columns: Array,
    shifted: Array,
    z: Array,
) -> None:
    """Put into ``z`` (2 n + 1, 3) the angles of all points after a step, against ``th``; ``columns`` (n, n) are those
    of the points before; ``shifted`` (p,) is used up."""
    axes, signs = world.axes, world.signs
    n, e = len(columns), parity(axes)
    at, earth_k = cosines(hat(th, e, signs)), along(world.earth, axes, e)
    for k in range(2 * n):
        column, sign = (columns[k], 1.0) if k < n else (columns[k - n], -1.0)
        for j in range(len(shifted)):
            shifted[j] = c[j] + sign * column[3 + j]
        if extended:
            earth_k = along(on_the_base(world.earth, shifted, extended), axes, e)
        d = hat((sign * column[0], sign * column[1], sign * column[2]), e, signs)
        rate = along(platform_rate(turn.commanded, shifted, extended), axes, e)
        d = step(at, d, rate, earth_k, turn.dt, turn.euler)
        z[1 + k, 0], z[1 + k, 1], z[1 + k, 2] = hat(d, e, signs)


@kernel
def _add_walk(P: Array, thy: float, variance: float, world: World) -> None:
    """Add ``T variance T^T`` [rad^2] to the covariance of angles: only outer and platform angle go together."""
    signs = world.signs
    b = parity(world.axes) * signs[1] * thy
    secant = 1.0 / math.cos(b)
    P[0, 0] += variance * secant * secant
    P[1, 1] += variance
    P[2, 2] += variance * secant * secant
    both = signs[0] * signs[2] * variance * secant * secant * math.sin(b)
    P[0, 2] -= both
    P[2, 0] -= both


@kernel
def _read(
    th: Array, c: Array, extended: bool, world: World, columns: Array, shifted: Array, f: Array, z: Array
) -> None:
    """Put into ``z`` (2 n + 1, 6) readings of accelerometers [m/s^2] and encoders [rad, against ``th``] at all points
    of ``columns`` (n, n); ``shifted`` (p,) and ``f`` (3,) are used up."""
    axes, signs = world.axes, world.signs
    n, e = len(columns), parity(axes)
    at, up_k = cosines(hat(th, e, signs)), along(world.up, axes, 1.0)
    for k in range(2 * n):
        column, sign = (columns[k], 1.0) if k < n else (columns[k - n], -1.0)
        for j in range(len(shifted)):
            shifted[j] = c[j] + sign * column[3 + j]
        if extended:
            up_k = along(on_the_base(world.up, shifted, extended), axes, 1.0)
        d = (sign * column[0], sign * column[1], sign * column[2])
        f[axes[0]], f[axes[1]], f[axes[2]] = force(near(at, hat(d, e, signs)), up_k)
        z[1 + k, 0], z[1 + k, 1], z[1 + k, 2] = accelerometers((f[0], f[1], f[2]), shifted)
        z[1 + k, 3], z[1 + k, 4], z[1 + k, 5] = d


@allocating
def _advance(
    state: FilterState, model: FilterModel, factor: int, euler: bool, steps: Steps, out: Estimates
) -> tuple[float, int, float]:
    """The loop; returns the lowest eigenvalue, the number of fallbacks, the least |cos thy|."""
    th, c, P, level, read = state.attitude, state.coefficients, state.covariance, state.near, state.th
    world, noise, gate, layout = model
    intervals, rate, acc, th_m, _, _ = steps
    n, p = len(P), len(P) - 3
    _, _, other, spread = weights(n, 1.0, 0.0, 0.0)  # those of the centre are zero
    points, shifted = empty_points(n), np.empty(p)
    moved, moves = np.zeros((2 * n + 1, 3)), empty_moments(n, 3)
    z, of_points = np.zeros((2 * n + 1, 6)), empty_moments(n, 6)
    r, f, L, x = np.empty(6), np.empty(3), np.empty((6, 6)), np.empty(n)
    history, cosine = len(out.u) > 0, 1.0
    for k in range(len(intervals)):
        dt, w = intervals[k], (rate[k, 0], rate[k, 1], rate[k, 2])
        draw(P, factor, spread, points)
        _predict(th, c, layout.based, GimbalStep(w, dt, euler), world, points.columns, shifted, moved)
        moments(moved, points.columns, other, moves)
        for i in range(3):
            th[i] += moves.mean[i]
            for j in range(3):
                P[i, j] = moves.covariance[i, j]
            for j in range(3, n):
                P[i, j], P[j, i] = moves.cross[j, i], moves.cross[j, i]
        _add_walk(P, th[1], noise.angle_random_walk * noise.angle_random_walk * dt, world)
        if not math.isfinite(th[0] + th[1] + th[2]):
            # or else innovations that are no numbers would count as not measured, and coefficients stay as they were
            c.fill(math.nan)
            P.fill(math.nan)
        cosine = _lesser(abs(math.cos(th[1])), cosine)
        seen = not (math.isnan(th_m[k, 0]) or math.isnan(th_m[k, 1]) or math.isnan(th_m[k, 2]))
        if seen:
            for i in range(3):
                read[i] = nearest_turn(th_m[k, i], read[i])
            cosine = _lesser(abs(math.cos(read[1])), cosine)
            of_encoders = attitude(read, world.axes, world.signs)
            watch(specific_force(of_encoders, on_the_base(world.up, c, layout.based)), gate, level)
        take = updating(gate, level)
        for i in range(3):
            r[i] = acc[k, i] if take and admitted(i, gate, level) else math.nan
            r[3 + i] = read[i] - th[i] if take and seen else math.nan
        draw(P, factor, spread, points)
        _read(th, c, layout.based, world, points.columns, shifted, f, z)
        moments(z, points.columns, other, of_points)
        for i in range(6):
            sigma = noise.accelerometer if i < 3 else noise.encoder
            of_points.covariance[i, i] += sigma * sigma
            r[i] -= of_points.mean[i]
            if history:
                out.innovations[k, i] = r[i] / math.sqrt(of_points.covariance[i, i])
        out.nis[k], out.dims[k] = update(r, of_points.cross, of_points.covariance, L, P, x)
        for i in range(3):
            th[i] += x[i]
        for j in range(p):
            c[j] += x[3 + j]
        if history:
            remember(out, k, attitude(th, world.axes, world.signs), c, layout.chosen, P)
    return points.health[0], int(points.health[1]), cosine


@kernel
def _lesser(new: float, old: float) -> float:
    """The lesser of two numbers, the first of which may not be one."""
    return new if new < old else old
