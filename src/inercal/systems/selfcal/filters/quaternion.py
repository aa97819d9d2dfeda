"""The filter of the paper: sigma points of a quaternion as it is, with a factor of the covariance.

The factor is that of the eigenvalues, which for a covariance is the paper's singular value decomposition at two thirds
of its cost; a study may ask for ``svd`` itself, or for ``cholesky``.

The state is q_bp (4) and the coefficients (p,), augmented with a noise of the process (4) and of the encoders'
quaternion (4): 2 (12 + p) + 1 points, drawn once a step, alpha 1, beta 0, kappa 0. The four components are taken
for a vector: their mean is an ordinary one, brought back to unit length after the update; points never are.
Both noises have exact roots, ``1/2 ARW sqrt(dt) Xi`` and ``[sigma G, (sigma/2) q]``, with the columns of Xi ``q e_i``
and of G ``1/2 q (J e_i)``; that of the encoders is filled along q, where it has no variance.

Points are worked out as far as they differ. Coefficients stand still, so that their own covariance does too; the
points of the encoders' noise are the centre but for their quaternion, and add its covariance.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

import numpy as np

from inercal.foundation._jit import allocating, kernel
from inercal.foundation.arrays import Array
from inercal.foundation.geometry.kernels import Quaternion, Vector, exp, multiply, normalize, rotate
from inercal.foundation.inference.sigma_point import (
    FACTORS,
    covariance,
    cross,
    draw,
    empty_points,
    mean,
    update,
    weights,
)
from inercal.systems.selfcal.estimators import FACTOR_OF
from inercal.systems.selfcal.filters.filter_result import Estimates, FilterState, Trace, empty_estimates
from inercal.systems.selfcal.filters.plain import accelerometers, on_the_base, platform_rate
from inercal.systems.selfcal.filters.problem import (
    AttitudeStart,
    FilterModel,
    FilterProblem,
    admitted,
    updating,
    watch,
)
from inercal.systems.selfcal.platform.kinematics import attitude, joint_axes, nearest_turn
from inercal.systems.selfcal.platform.model import specific_force
from inercal.systems.selfcal.platform.recording import Steps
from inercal.systems.selfcal.platform.rig import World

Columns: TypeAlias = tuple[Quaternion, Quaternion, Quaternion]


def initial(problem: FilterProblem, th: Array, start: AttitudeStart | None = None) -> FilterState:
    """The state before the first step: coefficients 0 with the prior, the attitude of angles ``th`` (3,) or ``start``.

    The quaternion is uncertain by sigma / 2 across, and by 1e-4 of that along itself, lest a factor fails at once.
    """
    world, p = problem.world, len(problem.prior)
    sigma = problem.noise.encoder if start is None else start.sigma
    q = np.array(attitude(th, world.axes, world.signs)) if start is None else start.attitude.copy()
    P = np.zeros((4 + p, 4 + p))
    # Xi Xi^T = 1 - q q^T
    P[:4, :4] = (0.5 * sigma) ** 2 * (np.eye(4) - (1.0 - 1e-8) * np.outer(q, q))
    P[4:, 4:] = np.diag(problem.prior**2)
    return FilterState(q, np.zeros(p), P, np.zeros(3, dtype=np.int64), np.array(th, dtype=float))


def advance(
    state: FilterState, problem: FilterProblem, steps: Steps, history: bool = True
) -> tuple[FilterState, Trace]:
    """Take the filter through m steps, as `inercal.systems.selfcal.filters.error_state.advance` does."""
    out = empty_estimates(len(steps.dt), len(problem.prior), history)
    factor = FACTORS[problem.filter.factor or FACTOR_OF["svd-qukf"]]
    health = _advance(state, problem.model, factor, steps, out)
    return state, Trace(out, *health)


@kernel
def _across(q: Quaternion) -> Columns:
    """Columns of Xi: ``q e_i``, unit quaternions at right angles to ``q`` and each other."""
    return (-q[1], q[0], q[3], -q[2]), (-q[2], -q[3], q[0], q[1]), (-q[3], q[2], -q[1], q[0])


@kernel
def _about_axes(xi: Quaternion, A: Array) -> float:
    """Standard deviation [rad] about an axis of p, from the covariance of q in the first rows of ``A``."""
    total = 0.0
    for i in range(4):
        for j in range(4):
            total += xi[i] * A[i, j] * xi[j]
    return 2.0 * math.sqrt(total)


@kernel
def _force(q: Quaternion, up: Vector) -> Vector:
    """Specific force (3,) in p by the quadratic form ``q* up q``, of a quaternion that is not of unit length."""
    f = rotate((q[0], -q[1], -q[2], -q[3]), up)
    excess = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] - 1.0
    return f[0] + excess * up[0], f[1] + excess * up[1], f[2] + excess * up[2]


@kernel
def _put(z: Array, q: Quaternion, read: Vector, centre: Array) -> None:
    """Write attitude and accelerometers (7,) of a point, less those of the centre."""
    for i in range(4):
        z[i] = q[i] - centre[i]
    for i in range(3):
        z[4 + i] = read[i] - centre[4 + i]


@kernel
def _noise_of_encoders(q: Quaternion, th: Array, world: World, sigma: float, S: Array) -> None:
    """Add ``[sigma G, (sigma/2) q]`` times its transpose to the upper left (4, 4) of ``S``, at gimbal angles (3,)."""
    jx, jy, jz = joint_axes(th, world.axes, world.signs)
    half = 0.25 * sigma * sigma
    for j in (
        multiply(q, (0.0, jx[0], jx[1], jx[2])),
        multiply(q, (0.0, jy[0], jy[1], jy[2])),
        multiply(q, (0.0, jz[0], jz[1], jz[2])),
        q,
    ):
        for i in range(4):
            for k in range(4):
                S[i, k] += half * j[i] * j[k]


class QuaternionStep(NamedTuple):
    """A step of the platform: its ``commanded`` rate (3,) [rad/s], ``dt`` [s], and ``walk``, the deviation of the
    points of the process noise, half of an angle [rad]."""

    commanded: Vector
    dt: float
    walk: float


class PointReadings(NamedTuple):
    """Attitudes and accelerometers of all points: ``centre`` (7,) those of the centre; ``z`` (1 + 2 n + 6, 7) those of
    all less those of the centre: centre, + and - by turns, noise; ``odd`` (n, 7) + less - of each pair."""

    centre: Array
    z: Array
    odd: Array


@kernel
def _propagate(
    q: Quaternion,
    c: Array,
    extended: bool,
    columns: Array,
    turn: QuaternionStep,
    world: World,
    ck: Array,
    out: PointReadings,
) -> None:
    """Take all points through a step and read the accelerometers there.

    ``q`` (4,) and ``c`` (p,), ``extended`` or not, are the mean before, ``columns`` (n, n) the deviations of the
    points, row by row, n = 4 + p; ``ck`` (p,) is used up.
    """
    n, p = len(columns), len(columns) - 4
    w, dt, walk = turn
    centre, z, odd = out
    earth, up = world.earth, world.up
    earth_e, up_e = on_the_base(earth, c, extended), on_the_base(up, c, extended)
    by_earth = exp((-earth_e[0] * dt, -earth_e[1] * dt, -earth_e[2] * dt))
    rate = platform_rate(w, c, extended)
    at = multiply(multiply(by_earth, q), exp((rate[0] * dt, rate[1] * dt, rate[2] * dt)))
    centre.fill(0.0)
    _put(centre, at, accelerometers(_force(at, up_e), c), centre)
    z[0].fill(0.0)
    up_k, by_earth_k = up_e, by_earth
    for j in range(n):
        d = columns[j]
        for side in range(2):
            s = 1.0 if side == 0 else -1.0
            for i in range(p):
                ck[i] = c[i] + s * d[4 + i]
            qk = (q[0] + s * d[0], q[1] + s * d[1], q[2] + s * d[2], q[3] + s * d[3])
            if extended:
                earth_e, up_k = on_the_base(earth, ck, extended), on_the_base(up, ck, extended)
                by_earth_k = exp((-earth_e[0] * dt, -earth_e[1] * dt, -earth_e[2] * dt))
            rate = platform_rate(w, ck, extended)
            qk = multiply(multiply(by_earth_k, qk), exp((rate[0] * dt, rate[1] * dt, rate[2] * dt)))
            _put(z[1 + 2 * j + side], qk, accelerometers(_force(qk, up_k), ck), centre)
        for i in range(7):
            odd[j, i] = z[1 + 2 * j, i] - z[2 + 2 * j, i]
    row = 1 + 2 * n
    for xi in _across(at):
        for side in range(2):
            s = walk if side == 0 else -walk
            qk = (at[0] + s * xi[0], at[1] + s * xi[1], at[2] + s * xi[2], at[3] + s * xi[3])
            _put(z[row], qk, accelerometers(_force(qk, up_e), c), centre)
            row += 1


@allocating
def _advance(
    state: FilterState, model: FilterModel, factor: int, steps: Steps, out: Estimates
) -> tuple[float, int, float]:
    """The loop; returns the lowest eigenvalue, the number of fallbacks, the least |cos thy|."""
    c, P, near, angles = state.coefficients, state.covariance, state.near, state.th
    world, noise, gate, layout = model
    intervals, rates, acc, th, _, _ = steps
    n, p = len(P), len(P) - 4
    _, _, other, spread = weights(n + 8, 1.0, 0.0, 0.0)
    points, ck = empty_points(n), np.empty(p)
    z, odd, centre, shift = np.empty((1 + 2 * n + 6, 7)), np.empty((n, 7)), np.empty(7), np.empty(7)
    S, L, r = np.empty((7, 7)), np.empty((7, 7)), np.empty(7)
    Pxz, dx = np.empty((n, 7)), np.empty(n)
    history = len(out.u) > 0
    cosine = 1.0
    q = (state.attitude[0], state.attitude[1], state.attitude[2], state.attitude[3])
    for k in range(len(intervals)):
        dt, w = intervals[k], (rates[k, 0], rates[k, 1], rates[k, 2])
        draw(P, factor, spread, points)
        walk = spread * 0.5 * noise.angle_random_walk * math.sqrt(dt)
        _propagate(
            q,
            c,
            layout.based,
            points.columns,
            QuaternionStep(w, dt, walk),
            world,
            ck,
            PointReadings(centre, z, odd),
        )

        # moments: the centre has no weight, and all points that were not written lie there
        mean(z, 0.0, other, shift)
        covariance(z, 0.0, other, S)
        cross(points.columns, odd, other, other, Pxz)
        for i in range(7):
            for j in range(7):
                S[i, j] -= shift[i] * shift[j]
        for j in range(7):
            for i in range(4):
                Pxz[i, j] = S[i, j]
        for j in range(4):
            for i in range(n):
                P[i, j] = Pxz[i, j]
                P[j, i] = Pxz[i, j]
        q = (centre[0] + shift[0], centre[1] + shift[1], centre[2] + shift[2], centre[3] + shift[3])

        # innovations: quaternion (4), accelerometers (3)
        r.fill(math.nan)
        seen = not (math.isnan(th[k, 0]) or math.isnan(th[k, 1]) or math.isnan(th[k, 2]))
        if seen:
            for i in range(3):
                angles[i] = nearest_turn(th[k, i], angles[i])
            cosine = min(cosine, abs(math.cos(angles[1])))
            of_encoders = attitude(angles, world.axes, world.signs)
            watch(specific_force(of_encoders, on_the_base(world.up, c, layout.based)), gate, near)
        take = updating(gate, near)
        count = 0
        if take and seen:
            count = 3
            along = (
                q[0] * of_encoders[0] + q[1] * of_encoders[1] + q[2] * of_encoders[2] + q[3] * of_encoders[3]
            )
            for i in range(4):
                r[i] = (of_encoders[i] if along >= 0.0 else -of_encoders[i]) - q[i]
            _noise_of_encoders(of_encoders, angles, world, noise.encoder, S)
        if take:
            for i in range(3):
                if admitted(i, gate, near) and not math.isnan(acc[k, i]):
                    r[4 + i] = acc[k, i] - centre[4 + i] - shift[4 + i]
                    count += 1
        for i in range(4, 7):
            S[i, i] += noise.accelerometer * noise.accelerometer
        if history:
            across = _across(q)
            for i in range(3):
                xi = across[i]
                miss = 2.0 * (xi[0] * r[0] + xi[1] * r[1] + xi[2] * r[2] + xi[3] * r[3])
                out.innovations[k, i] = r[4 + i] / math.sqrt(S[4 + i, 4 + i])
                out.innovations[k, 3 + i] = miss / _about_axes(xi, S)

        out.nis[k], _ = update(r, Pxz, S, L, P, dx)
        out.dims[k] = count
        q = normalize((q[0] + dx[0], q[1] + dx[1], q[2] + dx[2], q[3] + dx[3]))
        for i in range(p):
            c[i] += dx[4 + i]
        if history:
            across = _across(q)
            for i in range(4):
                out.attitude[k, i] = q[i]
            for i in range(3):
                out.attitude_u[k, i] = _about_axes(across[i], P)
            for i in range(p):
                out.coefficients[k, i] = c[i]
                out.u[k, i] = math.sqrt(P[4 + i, 4 + i])
    for i in range(4):
        state.attitude[i] = q[i]
    return points.health[0], int(points.health[1]), cosine
