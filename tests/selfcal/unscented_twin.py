"""The plain NumPy twin of the gimbal-angle unscented filter, written from its equations."""

from itertools import product

import numpy as np

from inercal.foundation.geometry.rotations import conjugate, exp, multiply, rotate


def points(P):
    """Deviations (2 n, n) of all points but the centre, which weighs nothing."""
    n = len(P)
    S = np.sqrt(n) * np.linalg.cholesky(P).T
    return np.concatenate([S, -S])


def moments(a, b):
    """Covariance of deviations (2 n, i) and (2 n, j)."""
    return a.T @ b / len(a)


def gyro(c, w):
    """Rates (m, 3) of the platform, coefficients (m, p)."""
    M = np.zeros((len(c), 3, 3))
    M[:, 0, 1], M[:, 1, 2], M[:, 2, 0] = c[:, 6], c[:, 7], c[:, 8]
    M[:, 0, 2], M[:, 1, 0], M[:, 2, 1] = -c[:, 9], -c[:, 10], -c[:, 11]
    if c.shape[1] > 18:
        for i in range(3):
            M[:, i, i] = c[:, 18 + i]
    return w + M @ w + c[:, :3]


def based(v, c):
    """A vector of the base (m, 3) in the frame of the encoders."""
    return rotate(exp(c[:, 21:]), v) if c.shape[1] > 18 else np.tile(v, (len(c), 1))


def accelerometers(q, c, up):
    """Outputs (m, 3)."""
    f = rotate(conjugate(q), based(up, c))
    K = np.zeros((len(c), 3, 3))
    for i in range(3):
        K[:, i, i] = 1.0 + c[:, 15 + i]
    K[:, 1, 0], K[:, 2, 0], K[:, 2, 1] = -c[:, 4], c[:, 3], -c[:, 5]
    return c[:, 12:15] + (K @ f[..., None])[..., 0]


def joints(th, world):
    """Attitudes (m, 4) and J (m, 3, 3) at gimbal angles (m, 3)."""
    along = world.signs[:, None] * np.eye(3)[world.axes]
    x, y, z = (exp(th[:, i, None] * along[i]) for i in range(3))
    yz = multiply(y, z)
    columns = [
        rotate(conjugate(yz), along[0]),
        rotate(conjugate(z), along[1]),
        np.tile(along[2], (len(th), 1)),
    ]
    return multiply(x, yz), np.stack(columns, axis=-1)


def kalman(P, Pxz, Pzz, r):
    """Correction, covariance and normalised innovation squared."""
    gain = np.linalg.solve(Pzz, Pxz.T).T
    P = P - gain @ Pzz @ gain.T
    return gain @ r, 0.5 * (P + P.T), r @ np.linalg.solve(Pzz, r)


def angle_rates(th, w, earth, world):
    """th' (m, 3) = J^-1 (w - C_pb earth)."""
    q, J = joints(th, world)
    return np.linalg.solve(J, (w - rotate(conjugate(q), earth))[..., None])[..., 0]


def gimbal(recording, problem, th, sigma):
    """Gimbal angles, coefficients, covariance and NIS (n - 1,) of the gimbal-angle filter; ``th`` continuous."""
    world, noise, p = problem.world, problem.noise, len(problem.prior)
    c, P = np.zeros(p), np.diag(np.append(np.full(3, sigma), problem.prior) ** 2)
    nis = []
    for dt, w, acc, measured in zip(
        recording.dt, recording.rate, recording.acc[1:], recording.th[1:], strict=True
    ):
        D = points(P)
        rate, earth = gyro(c + D[:, 3:], w), based(world.earth, c + D[:, 3:])
        start = th + D[:, :3]
        r1 = angle_rates(start, rate, earth, world)
        if problem.filter.integration == "euler":
            end = start + dt * r1
        else:
            r2 = angle_rates(start + 0.5 * dt * r1, rate, earth, world)
            r3 = angle_rates(start + 0.5 * dt * r2, rate, earth, world)
            r4 = angle_rates(start + dt * r3, rate, earth, world)
            end = start + dt / 6.0 * (r1 + 2.0 * r2 + 2.0 * r3 + r4)
        th = end.mean(axis=0)
        D[:, :3] = end - th
        P = moments(D, D)
        T = np.linalg.inv(joints(th[None], world)[1][0])
        P[:3, :3] += noise.angle_random_walk**2 * dt * T @ T.T
        z = np.append(acc, measured if np.isfinite(measured).all() else np.full(3, np.nan))
        kept = np.isfinite(z)
        if not kept.any():
            nis.append(np.nan)
            continue
        D = points(P)
        read = np.hstack(
            [
                accelerometers(joints(th + D[:, :3], world)[0], c + D[:, 3:], world.up),
                th + D[:, :3],
            ]
        )[:, kept]
        deviation = read - read.mean(axis=0)
        R = np.diag(np.repeat([noise.accelerometer, noise.encoder], 3)[kept] ** 2)
        x, P, part = kalman(
            P, moments(D, deviation), moments(deviation, deviation) + R, z[kept] - read.mean(axis=0)
        )
        th, c = th + x[:3], c + x[3:]
        nis.append(part)
    return th, c, P, np.array(nis)


RIGS = tuple(
    product((("z", "x", "y"), ("x", "y", "z"), ("y", "x", "z")), ((1, 1, 1), (-1, 1, -1), (1, -1, 1)))
)
"""Orders of gimbals, cyclic and not, and signs."""
