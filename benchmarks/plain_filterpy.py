"""The paper's quaternion filter as one writes it with filterpy: its `UnscentedKalmanFilter` and plain functions.

Two of its habits are turned off, so that it is the same filter: points are drawn once a step (its `predict` draws a
second set), and the roots of the two noises, which have no Cholesky factor, are given exactly. Functions of a single
point are in plain floats, which is faster for so few numbers than small arrays are. 18 coefficients.
"""

import math

import numpy as np
import scipy.linalg
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter, unscented_transform

#: states: quaternion, coefficients, noise of the process, noise of the encoders' quaternion
N, L = 22, 30


def product(a, b):
    """Hamilton product."""
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )


def turn(x, y, z):
    """Quaternion of a rotation vector [rad]."""
    angle = math.sqrt(x * x + y * y + z * z)
    s = math.sin(0.5 * angle) / angle if angle > 0.0 else 0.5
    return math.cos(0.5 * angle), s * x, s * y, s * z


def platform(s, dt, w, by_earth):
    """A point after a step, at the commanded rate ``w`` [rad/s]; ``by_earth`` the turn of the earth in it."""
    q0, q1, q2, q3, gx, gy, gz, _, _, _, sx, sy, sz, ox, oy, oz = s[:16].tolist()
    wx, wy, wz = w
    by_platform = turn(
        (wx + gx + sx * wy - ox * wz) * dt,
        (wy + gy - oy * wx + sy * wz) * dt,
        (wz + gz + sz * wx - oz * wy) * dt,
    )
    out = s.copy()
    out[:4] = product(product(by_earth, (q0, q1, q2, q3)), by_platform)
    out[:4] += s[22:26]
    return out


def outputs(s, up):
    """Quaternion of the encoders and accelerometers [m/s^2] of a point; ``up`` (3,) specific force at rest."""
    q0, q1, q2, q3 = s[:4].tolist()
    pz, oy, oz = s[7:10].tolist()
    bx, by, bz, kx, ky, kz = s[16:22].tolist()
    ux, uy, uz = up
    fx = (
        (q0 * q0 + q1 * q1 - q2 * q2 - q3 * q3) * ux
        + 2 * (q1 * q2 + q0 * q3) * uy
        + 2 * (q1 * q3 - q0 * q2) * uz
    )
    fy = (
        2 * (q1 * q2 - q0 * q3) * ux
        + (q0 * q0 - q1 * q1 + q2 * q2 - q3 * q3) * uy
        + 2 * (q2 * q3 + q0 * q1) * uz
    )
    fz = (
        2 * (q1 * q3 + q0 * q2) * ux
        + 2 * (q2 * q3 - q0 * q1) * uy
        + (q0 * q0 - q1 * q1 - q2 * q2 + q3 * q3) * uz
    )
    out = np.empty(7)
    out[:4] = s[:4] + s[26:30]
    out[4:] = (
        bx + (1.0 + kx) * fx,
        by + (1.0 + ky) * fy - oy * fx,
        bz + (1.0 + kz) * fz + pz * fx - oz * fy,
    )
    return out


def across(q):
    """Xi (4, 3)."""
    return np.array([[-q[1], -q[2], -q[3]], [q[0], -q[3], q[2]], [q[3], q[0], -q[1]], [-q[2], q[1], q[0]]])


def of_angles(x, y, z):
    """Attitude of gimbal angles: about Z, X and Y of the platform."""
    q = product(turn(0.0, 0.0, x), turn(y, 0.0, 0.0))
    return np.array(product(q, turn(0.0, z, 0.0)))


def joints(y, z):
    """J (3, 3), the axes of the joints in the platform."""
    sy, cy, sz, cz = math.sin(y), math.cos(y), math.sin(z), math.cos(z)
    return np.array([[-sz * cy, cz, 0.0], [sy, 0.0, 1.0], [cz * cy, sz, 0.0]])


def cholesky_first(P):
    """Upper factor; the eigen root where there is none."""
    try:
        return scipy.linalg.cholesky(P, check_finite=False)
    except np.linalg.LinAlgError:
        return eigen(P)


def eigen(P):
    """Transpose of d U sqrt(S), by way of the correlations."""
    d = np.sqrt(np.diag(P))
    s, U = np.linalg.eigh(P / np.outer(d, d))
    return (d[:, None] * U * np.sqrt(np.maximum(s, 0.0))).T


def run(problem, recording, steps, factor):
    """State (22,) and its covariance after each of some ``steps``, and the NIS, from the start of `quaternion`.

    ``factor`` is `cholesky_first`, `eigen`, or another that gives the transpose of a root.
    """
    noise, world = problem.noise, problem.world
    noises = np.zeros((L - N, L))

    def roots(P):
        """All rows of the points, P times L: the root of the state's covariance, and those of the noises."""
        U = np.zeros((L, L))
        U[:N, :N] = factor(P[:N, :N])
        U[N:] = noises
        return U

    points = MerweScaledSigmaPoints(L, 1.0, 0.0, 0.0, sqrt_method=roots)
    ukf = UnscentedKalmanFilter(L, 7, dt=0.0, hx=outputs, fx=platform, points=points)
    ukf.Q[:], ukf.R[:] = 0.0, np.diag([0.0] * 4 + [noise.accelerometer**2] * 3)
    q = of_angles(*recording.th[0])
    ukf.x[:], ukf.P[:] = 0.0, 0.0
    ukf.x[:4] = q
    ukf.P[:4, :4] = (0.5 * noise.encoder) ** 2 * (across(q) @ across(q).T + 1e-8 * np.outer(q, q))
    ukf.P[4:N, 4:N] = np.diag(problem.prior**2)
    states, covariances, nis = np.empty((steps, N)), np.empty((steps, N, N)), np.empty(steps)
    up, earth = world.up.tolist(), world.earth.tolist()
    for k, dt in enumerate(recording.dt[:steps].tolist()):
        w = recording.rate[k].tolist()
        by_earth = turn(*(-rate * dt for rate in earth))
        ahead = platform(ukf.x, dt, w, by_earth)
        th = recording.th[k + 1]
        of_encoders = of_angles(*th)
        if of_encoders @ ahead[:4] < 0.0:
            of_encoders = -of_encoders
        noises[:3, N : N + 4] = math.sqrt(L * dt) * 0.5 * noise.angle_random_walk * across(ahead).T
        noises[4:7, N + 4 :] = math.sqrt(L) * 0.5 * noise.encoder * (across(of_encoders) @ joints(*th[1:])).T
        noises[7, N + 4 :] = math.sqrt(L) * 0.5 * noise.encoder * of_encoders
        # predict, without the second draw
        ukf.compute_process_sigmas(dt, w=w, by_earth=by_earth)
        ukf.x, ukf.P = unscented_transform(ukf.sigmas_f, ukf.Wm, ukf.Wc, ukf.Q)
        ukf.update(np.concatenate([of_encoders, recording.acc[k + 1]]), up=up)
        ukf.x[:4] /= math.sqrt(ukf.x[:4] @ ukf.x[:4])
        ukf.x[N:] = 0.0
        ukf.P = 0.5 * (ukf.P + ukf.P.T)
        ukf.P[N:], ukf.P[:, N:] = 0.0, 0.0
        states[k], covariances[k], nis[k] = ukf.x[:N], ukf.P[:N, :N], ukf.y @ ukf.SI @ ukf.y
    return states, covariances, nis
