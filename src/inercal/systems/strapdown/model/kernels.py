"""Compiled parts of the model: from samples to rate and force, and a solution carried from node to node.

Array of coefficients: `inercal.systems.strapdown.model.coefficients`. n is east-north-up, C_nb takes b to n, and errors
of a solution are C_true = exp(phi x) C, v_true = v + dv:

    phi' = -w_ie x phi + C dw        dv' = phi x (C f) + C df - 2 w_ie x dv

(Titterton and Weston 2004, "Strapdown inertial navigation technology", chapters 11 and 12; Savage, J. Guid. Control
Dyn. 21 (1998) 19 and 208 for increments over one sample).
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from inercal.foundation._jit import inlined, kernel
from inercal.foundation.arrays import Array
from inercal.foundation.geometry.kernels import Quaternion, Vector, exp, multiply, normalize, rotate
from inercal.systems.strapdown.model.coefficients import SIZE

_SUMS = 27
"""Sums over a block: w (3), |w| (3), f (3), fs (3), fs^2 (3), W (9), w x f (3), each times the interval."""

Whole: TypeAlias = NDArray[np.int64]

Nine: TypeAlias = tuple[float, float, float, float, float, float, float, float, float]


class Gains(NamedTuple):
    """Coefficients as kernels take them: inverse gains (3, 3) of ``gyro`` and ``accelerometer``, and vectors (3,) or
    matrices (3, 3) named as in the model."""

    gyro: Array
    accelerometer: Array
    d: Array
    a: Array
    g: Array
    k0: Array
    k2: Array
    r: Array


class BodyMotion(NamedTuple):
    """Samples (n, 3) freed of the errors: rate ``w`` [rad/s] and its derivative ``wd``, force ``fs`` at the
    accelerometers and ``f`` at the origin [m/s^2], ``turn`` [rad] and ``gain`` of velocity [m/s] over each sample, in
    b at its beginning."""

    w: Array
    wd: Array
    fs: Array
    f: Array
    turn: Array
    gain: Array


class UnitWorld(NamedTuple):
    """Earth rate ``earth`` (3,) [rad/s] in n, ``gravity`` [m/s^2], the sample interval ``ts`` [s]."""

    earth: Array
    gravity: float
    ts: float


@kernel
def cross(a: Vector, b: Vector) -> Vector:
    """Cross product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def applied(M: Array, x: Array) -> Array:
    """M (3, 3) times vectors (n, 3)."""
    return np.asarray(M[:, 0] * x[:, :1] + M[:, 1] * x[:, 1:2] + M[:, 2] * x[:, 2:])


def mean_lever(w: Vector | Array, wd: Vector | Array, ts: float) -> Nine:
    """Mean W over a sample, by rows, of the mean rate and its derivative; or of many samples, by components."""
    s = ts * ts / 12.0  # the rate changes within a sample
    xx, yy, zz = (
        w[0] * w[0] + s * wd[0] * wd[0],
        w[1] * w[1] + s * wd[1] * wd[1],
        w[2] * w[2] + s * wd[2] * wd[2],
    )
    xy, xz, yz = (
        w[0] * w[1] + s * wd[0] * wd[1],
        w[0] * w[2] + s * wd[0] * wd[2],
        w[1] * w[2] + s * wd[1] * wd[2],
    )
    return (
        -yy - zz, xy - wd[2], xz + wd[1],
        xy + wd[2], -xx - zz, yz - wd[0],
        xz - wd[1], yz + wd[0], -xx - yy,
    )  # fmt: skip


lever = kernel(mean_lever)


@kernel
def increments(w: Array, f: Array, pairs: Array, ts: float, turn: Array, gain: Array) -> None:
    """Rotation vector and gain of velocity over each sample: coning and sculling of five samples, with the weights
    ``pairs`` (5, 5) of their products."""
    n = len(w)
    for k in range(n):
        a = (w[k, 0] * ts, w[k, 1] * ts, w[k, 2] * ts)
        v = (f[k, 0] * ts, f[k, 1] * ts, f[k, 2] * ts)
        half = cross(a, v)
        third = cross(a, half)
        for i in range(3):
            turn[k, i] = a[i]
            gain[k, i] = v[i] + 0.5 * half[i] + third[i] / 6.0
        for q in range(1, 5):
            j = min(max(k + q - 2, 0), n - 1)
            s0 = s1 = s2 = t0 = t1 = t2 = 0.0
            for p in range(q):
                i = min(max(k + p - 2, 0), n - 1)
                weight = pairs[p, q] * ts * ts
                s0 += weight * w[i, 0]
                s1 += weight * w[i, 1]
                s2 += weight * w[i, 2]
                t0 += weight * f[i, 0]
                t1 += weight * f[i, 1]
                t2 += weight * f[i, 2]
            right, force = (w[j, 0], w[j, 1], w[j, 2]), (f[j, 0], f[j, 1], f[j, 2])
            coning = cross((s0, s1, s2), right)
            one, two = cross((s0, s1, s2), force), cross((t0, t1, t2), right)
            for i in range(3):
                turn[k, i] += coning[i]
                gain[k, i] += one[i] + two[i]


@inlined
def matrix(q: Quaternion, C: Array) -> None:
    """The rotation matrix ``C`` (3, 3) of a quaternion."""
    for j in range(3):
        v = rotate(q, (1.0 if j == 0 else 0.0, 1.0 if j == 1 else 0.0, 1.0 if j == 2 else 0.0))
        for i in range(3):
            C[i, j] = v[i]


@inlined
def without(x: Array, bias: Vector, ts: float) -> Vector:
    """An increment without what a bias adds to it."""
    return x[0] - bias[0] * ts, x[1] - bias[1] * ts, x[2] - bias[2] * ts


@kernel
def carried(
    q: Quaternion, v: Vector, turn: Vector, gain: Vector, world: UnitWorld
) -> tuple[Quaternion, Vector]:
    """Attitude and velocity after a sample."""
    ts = world.ts
    e = (world.earth[0] * ts, world.earth[1] * ts, world.earth[2] * ts)
    r = rotate(q, gain)
    s = cross(e, (0.5 * r[0] + 2.0 * v[0], 0.5 * r[1] + 2.0 * v[1], 0.5 * r[2] + 2.0 * v[2]))
    after = (v[0] + r[0] - s[0], v[1] + r[1] - s[1], v[2] + r[2] - s[2] - world.gravity * ts)
    return normalize(multiply(exp((-e[0], -e[1], -e[2])), multiply(q, exp(turn)))), after


@kernel
def turned(turn: Array, sample: Whole, q: Array) -> None:
    """Rotations ``q`` (k, 4) from each node to the next, of the rotation vectors ``turn`` (n, 3) of samples."""
    for node in range(len(sample) - 1):
        of = (1.0, 0.0, 0.0, 0.0)
        for k in range(sample[node], sample[node + 1]):
            of = normalize(multiply(of, exp((turn[k, 0], turn[k, 1], turn[k, 2]))))
        q[node, 0], q[node, 1], q[node, 2], q[node, 3] = of


@inlined
def _add_sample(motion: BodyMotion, k: int, ts: float, sums: Array) -> None:
    """Add a sample to the sums of a block."""
    w, fs = motion.w[k], motion.fs[k]
    f = (motion.f[k, 0], motion.f[k, 1], motion.f[k, 2])
    m = lever(w, motion.wd[k], ts)
    wf = cross((w[0], w[1], w[2]), f)
    for i in range(3):
        sums[i] += w[i] * ts
        sums[6 + i] += f[i] * ts
        sums[9 + i] += fs[i] * ts
        sums[12 + i] += fs[i] * fs[i] * ts
        sums[24 + i] += wf[i] * ts
    for i in range(9):
        sums[15 + i] += m[i] * ts


@inlined
def sources(
    C: Array, sums: Array, dt: float, of_gyros: Array, of_accs: Array, north: float, up: float, out: Array
) -> None:
    """Errors (6, 51) of attitude and velocity gained in a block of ``dt`` [s] per error of each coefficient, with the
    inverse gains (3, 3) of both triads, where they are not 0; ``north`` and ``up`` are the earth rate in n."""
    for a in range(3):
        for i in range(3):
            of_gyro = of_acc = 0.0
            for b in range(3):
                of_gyro -= C[a, b] * of_gyros[b, i]
                of_acc -= C[a, b] * of_accs[b, i]
            out[a, i] = of_gyro * dt
            out[a, 37 + i] = of_gyro * abs(sums[i])
            out[3 + a, 12 + i] = of_acc * dt
            out[3 + a, 24 + i] = of_acc * sums[12 + i]
            for j in range(3):
                out[a, 3 + 3 * i + j] = of_gyro * sums[j]
                out[a, 40 + 3 * i + j] = of_gyro * sums[6 + j]
                out[3 + a, 15 + 3 * i + j] = of_acc * sums[9 + j]
                out[3 + a, 27 + 3 * i + j] = -C[a, i] * sums[15 + 3 * i + j]
        out[3 + a, 36] = -C[a, 0] * sums[24] - C[a, 1] * sums[25] - C[a, 2] * sums[26]
    out[5, 49] = -dt
    out[1, 50], out[2, 50] = up * dt, -north * dt


@inlined
def transition(force: Vector, earth: Array, dt: float, F: Array) -> None:
    """Transition ``F`` (m, m) of errors through a block with a gain of velocity ``force`` (3,) in n, where it is not 1;
    nothing of biases that walk."""
    for k in range(2):
        s = (k + 1.0) * dt
        F[3 * k, 3 * k + 1], F[3 * k, 3 * k + 2] = s * earth[2], -s * earth[1]
        F[3 * k + 1, 3 * k], F[3 * k + 1, 3 * k + 2] = -s * earth[2], s * earth[0]
        F[3 * k + 2, 3 * k], F[3 * k + 2, 3 * k + 1] = s * earth[1], -s * earth[0]
    F[3, 1], F[3, 2] = force[2], -force[1]
    F[4, 0], F[4, 2] = -force[2], force[0]
    F[5, 0], F[5, 1] = force[1], -force[0]


@kernel
def product(F: Array, X: Array, out: Array) -> None:
    """``X`` becomes F X; ``out``, as large, is used up. F differs from 1 in its first six rows alone."""
    for i in range(6):
        for j in range(X.shape[1]):
            total = 0.0
            for k in range(F.shape[1]):
                total += F[i, k] * X[k, j]
            out[i, j] = total
    for i in range(6):
        for j in range(X.shape[1]):
            X[i, j] = out[i, j]


@inlined
def _gathered(F: Array, S: Array, G: Array, out: Array) -> None:
    """``G`` (6, 51) becomes F G + S, S acting through the block: its errors of attitude by half on velocity."""
    for j in range(G.shape[1]):
        for i in range(6):
            total = S[i, j]
            for k in range(6):
                total += F[i, k] * G[k, j]
            out[i, j] = total
        for i in range(3, 6):
            out[i, j] += 0.5 * (F[i, 0] * S[0, j] + F[i, 1] * S[1, j] + F[i, 2] * S[2, j])
    for i in range(6):
        for j in range(G.shape[1]):
            G[i, j] = out[i, j]


@inlined
def _noise_added(F: Array, variances: Array, dt: float, Q: Array) -> None:
    """Add to ``Q`` (m, m) what white noise and walks of ``variances`` (4,) [per s] gain in a block."""
    for i in range(3):
        Q[i, i] += variances[0] * dt
        Q[3 + i, 3 + i] += variances[1] * dt
        for j in range(3):
            half = 0.5 * variances[0] * dt * F[3 + i, j]
            Q[3 + i, j] += half
            Q[j, 3 + i] += half
            total = 0.0
            for k in range(3):
                total += F[3 + i, k] * F[3 + j, k]
            Q[3 + i, 3 + j] += variances[0] * dt * total / 3.0
    for i in range(6, len(Q)):
        Q[i, i] += variances[2 if i < 9 else 3] * dt


@kernel
def spread(F: Array, Q: Array, out: Array) -> None:
    """``Q`` (m, m), symmetric, becomes F Q F^T."""
    m = len(Q)
    for _ in range(2):
        product(F, Q, out)
        for i in range(m):
            for j in range(i):
                Q[i, j], Q[j, i] = Q[j, i], Q[i, j]


class NodeState(NamedTuple):
    """A solution at the nodes: attitude ``q`` (k, 4) C_nb, velocity ``v`` (k, 3), and ``bias`` (k, 6), the deviation of
    the biases of gyros and accelerometers [output] from those of the coefficients."""

    q: Array
    v: Array
    bias: Array


class Shot(NamedTuple):
    """A solution carried from each node to the next: attitude ``q`` (k, 4) and velocity ``v`` (k, 3) there, transition
    ``F`` (k, m, m) of errors, their derivatives ``G`` (k, 6, 51) by coefficients, and the covariance ``Q`` (k, m, m) of
    noise."""

    q: Array
    v: Array
    F: Array
    G: Array
    Q: Array


class WorkRoom(NamedTuple):
    """Room to work in: the attitude ``C`` of a block, its transition ``F`` (m, m), 1 at first, its sources ``S`` (6,
    51), 0 at first, its ``sums`` (27,), and what products need, ``square`` (6, m) and ``wide`` (6, 51)."""

    C: Array
    F: Array
    S: Array
    sums: Array
    square: Array
    wide: Array


def shoot(
    motion: BodyMotion,
    cuts: Whole,
    first: Whole,
    state: NodeState,
    c: Gains,
    world: UnitWorld,
    noise: Array,
    shot: Shot,
) -> None:
    """Carry the solution from the ``state`` at each node to the next.

    ``cuts`` are the samples at which blocks begin, and ``first`` (k + 1,) the block that begins at each node.
    """
    m, bias = shot.F.shape[1], state.bias
    shot.F[:], shot.G[:], shot.Q[:] = np.eye(m), 0.0, 0.0
    off = np.hstack([applied(c.gyro, bias[:, :3]), applied(c.accelerometer, bias[:, 3:])])
    room = WorkRoom(
        np.empty((3, 3)),
        np.eye(m),
        np.zeros((6, SIZE)),
        np.empty(_SUMS),
        np.empty((6, m)),
        np.empty((6, SIZE)),
    )
    _shots(motion, cuts, first, state._replace(bias=off), c.gyro, c.accelerometer, world, noise, shot, room)


@kernel
def _shots(
    motion: BodyMotion, cuts: Whole, first: Whole, state: NodeState, of_gyros: Array, of_accs: Array, world: UnitWorld,
    noise: Array, shot: Shot, room: WorkRoom,
) -> None:  # fmt: skip
    """Carry the solution on, with inverse gains (3, 3) of both triads; biases are as they act on rate and force."""
    C, F, S, sums = room.C, room.F, room.S, room.sums
    for node in range(len(first) - 1):
        q = (state.q[node, 0], state.q[node, 1], state.q[node, 2], state.q[node, 3])
        v = (state.v[node, 0], state.v[node, 1], state.v[node, 2])
        drift = (state.bias[node, 0], state.bias[node, 1], state.bias[node, 2])
        bias = (state.bias[node, 3], state.bias[node, 4], state.bias[node, 5])
        for block in range(first[node], first[node + 1]):
            for i in range(_SUMS):
                sums[i] = 0.0
            before, dt = q, (cuts[block + 1] - cuts[block]) * world.ts
            for k in range(cuts[block], cuts[block + 1]):
                _add_sample(motion, k, world.ts, sums)
                turn, gain = without(motion.turn[k], drift, world.ts), without(motion.gain[k], bias, world.ts)
                q, v = carried(q, v, turn, gain, world)
            middle = normalize((before[0] + q[0], before[1] + q[1], before[2] + q[2], before[3] + q[3]))
            matrix(middle, C)
            sources(C, sums, dt, of_gyros, of_accs, world.earth[1], world.earth[2], S)
            transition(rotate(middle, (sums[6], sums[7], sums[8])), world.earth, dt, F)
            if len(F) == 12:
                for i in range(3):
                    for j in range(3):
                        F[i, 6 + j], F[3 + i, 9 + j] = S[i, j], S[3 + i, 12 + j]
                        F[3 + i, 6 + j] = 0.5 * (
                            F[3 + i, 0] * S[0, j] + F[3 + i, 1] * S[1, j] + F[3 + i, 2] * S[2, j]
                        )
            product(F, shot.F[node], room.square)
            _gathered(F, S, shot.G[node], room.wide)
            spread(F, shot.Q[node], room.square)
            _noise_added(F, noise, dt, shot.Q[node])
        shot.q[node, 0], shot.q[node, 1], shot.q[node, 2], shot.q[node, 3] = q
        shot.v[node, 0], shot.v[node, 1], shot.v[node, 2] = v
