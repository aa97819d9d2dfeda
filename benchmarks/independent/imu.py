"""Recordings of an IMU in the hand or on a table, with the faults of laboratories: numpy alone, no code of inercal.

Attitudes are rotation matrices in steps of a sample, made by the exponential series of the mean rate, in place of the
quaternions of `inercal.systems.imu.simulate`; numbers are in m/s^2 and rad/s, time in s.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

EARTH = 7.292115e-5
G = 9.81
LATITUDE = 0.8


def rotation(v):
    """Matrices (..., 3, 3) of rotation vectors (..., 3)."""
    v = np.asarray(v, float)
    angle = np.linalg.norm(v, axis=-1)[..., None, None]
    K = np.zeros((*v.shape, 3))
    K[..., 2, 1], K[..., 0, 2], K[..., 1, 0] = v[..., 0], v[..., 1], v[..., 2]
    K = K - np.swapaxes(K, -1, -2)
    small = angle < 1e-9
    a = np.where(small, 1.0, angle)
    return (
        np.eye(3)
        + np.where(small, 1.0, np.sin(a) / a) * K
        + np.where(small, 0.5, (1 - np.cos(a)) / a**2) * (K @ K)
    )


@dataclass
class Unit:
    """A true instrument: 1 + errors of scale and axes, biases, quadratic terms K2 [1/(m/s^2)], noise densities."""

    A: np.ndarray
    a0: np.ndarray
    W: np.ndarray
    w0: np.ndarray
    k2: np.ndarray = field(default_factory=lambda: np.zeros(3))
    acc_noise: float = 8e-4
    gyro_noise: float = 5.6e-4

    def truth(self):
        """Coefficients by name, for outputs in SI units."""
        out = {}
        for letters, M, b, upper in (
            (("K0", "K1", "M"), self.A, self.a0, True),
            (("D_F", "S", "T"), self.W, self.w0, False),
        ):
            for i, x in enumerate("xyz"):
                out[f"{letters[0]}_{x}"], out[f"{letters[1]}_{x}"] = b[i], M[i, i]
                for j, y in enumerate("xyz"):
                    if j > i or (j < i and not upper):
                        out[f"{letters[2]}_{x}{y}"] = M[i, j] / M[i, i]
            if upper:
                out |= {f"K2_{x}": self.k2[i] for i, x in enumerate("xyz")}
        return out


def unit(rng, **options):
    """A unit drawn at random: scale 0.5 %, axes 10 mrad, biases 0.05 m/s^2 and 5 mrad/s."""
    A = np.diag(1 + rng.normal(0, 5e-3, 3))
    A = A @ (np.eye(3) + np.triu(rng.normal(0, 1e-2, (3, 3)), 1))
    W = np.diag(1 + rng.normal(0, 5e-3, 3))
    off = rng.normal(0, 1e-2, (3, 3))
    W = W @ (np.eye(3) + off - np.diag(np.diag(off)))
    return Unit(A, rng.normal(0, 0.05, 3), W, rng.normal(0, 5e-3, 3), **options)


def random_ups(rng, n):
    """Up directions (n, 3) in the body, even over the sphere: the first one is z."""
    k = np.arange(n) + 0.5
    z, az = 1 - 2 * k / n, np.pi * (3 - np.sqrt(5)) * k
    ups = np.stack([np.sqrt(1 - z**2) * np.cos(az), np.sqrt(1 - z**2) * np.sin(az), z], 1)
    ups = ups[rng.permutation(n)] + rng.normal(0, 0.08, (n, 3))
    ups[0] = [0, 0, 1]
    return ups / np.linalg.norm(ups, axis=1, keepdims=True)


def square_ups(rng, n=19):
    """The six faces and twelve edges of a cube in turn, held square within 2 mrad."""
    grid = np.array([[i, j, k] for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1)], float)
    faces, edges = (grid[np.abs(grid).sum(axis=1) == size] for size in (1, 2))
    ups = np.concatenate([faces, edges / np.sqrt(2)])[np.arange(n) % 18] + rng.normal(0, 2e-3, (n, 3))
    return ups / np.linalg.norm(ups, axis=1, keepdims=True)


@dataclass
class Faults:
    """What goes wrong; zero is nothing.

    ``tremor`` [s] the unit is held in the hand at the start, by ``tremor_force`` [m/s^2] and ``tremor_rate`` [rad/s]
    rms; ``turn`` a rotation [rad] that the gyro misses in turn ``turn_at``; ``pose`` a constant acceleration [m/s^2]
    along the vertical in pose ``pose_at``; ``clip`` [rad/s] the gyro's range, not stated; ``clock`` relative error;
    ``arm`` [m] by which the accelerometers lie beside the point that is turned about, in each direction; ``delay`` [s]
    by which the gyro comes late.
    """

    tremor: float = 0.0
    tremor_force: float = 0.05
    tremor_rate: float = 0.02
    turn: float = 0.0
    turn_at: int = 7
    pose: float = 0.0
    pose_at: int = 9
    clip: float = 0.0
    clock: float = 0.0
    arm: float = 0.0
    delay: float = 0.0


def record(rng, made, ups, faults=None, rate=50.0, start=20.0, hold=3.0, turn=2.5):
    """Time (n,), accelerometers (n, 3), gyro (n, 3) of a unit held with ``ups`` (m, 3) upward one after the other.

    A turn is the shortest that takes one up to the next, after a turn about the vertical at random, at a speed of the
    form sin^2; earth rate is there, heading at random.
    """
    faults = faults or Faults()
    own = rng.spawn(1)[0]  # of the faults, so that the noise is the same without them
    dt = 1 / rate
    start_attitude = rotation([0, 0, rng.uniform(-np.pi, np.pi)]) @ _level(ups[0])
    rates, missed, kicks = [], [], []
    for k, up in enumerate(ups):
        m = round((start if k == 0 else hold) * rate)
        rates.append(np.zeros((m, 3)))
        missed.append(np.zeros((m, 3)))
        kicks.append(np.tile(faults.pose * up if k == faults.pose_at else np.zeros(3), (m, 1)))
        if k + 1 < len(ups):
            m = round(turn * rate)
            rates.append(_turn(rng, up, ups[k + 1], m, dt))
            lost = np.zeros((m, 3))
            if k == faults.turn_at and faults.turn:
                across = np.cross(ups[k + 1], own.normal(size=3))
                lost = _hump(m, dt)[:, None] * faults.turn * across / np.linalg.norm(across)
            missed.append(lost)
            kicks.append(np.sin(2 * np.pi * np.arange(1, m + 1) / m)[:, None] * rng.uniform(-1, 1, 3))
    w, lost, kick = np.concatenate(rates), np.concatenate(missed), np.concatenate(kicks)
    attitudes = _attitudes(start_attitude, w, dt)
    shake = np.zeros((len(w), 3))
    m = round(faults.tremor * rate)
    for _ in range(6 if m else 0):
        frequency, phase = own.uniform(1, 6), own.uniform(0, 2 * np.pi, 3)
        shake[:m] += np.sin(2 * np.pi * frequency * np.arange(m)[:, None] * dt + phase) / np.sqrt(3)
    earth = EARTH * np.array([np.cos(LATITUDE), 0, np.sin(LATITUDE)])
    seen = w + np.einsum("nji,j->ni", attitudes, earth) + lost + shake[:, ::-1] * faults.tremor_rate
    if faults.delay:
        t = np.arange(len(w)) * dt
        seen = np.stack([np.interp(t - faults.delay, t, column) for column in seen.T], 1)
    seen = seen + rng.normal(0, made.gyro_noise * np.sqrt(rate), seen.shape)
    f = attitudes[:, 2, :] * G + kick + shake * faults.tremor_force
    if faults.arm:
        arm = np.full(3, faults.arm)
        f = f + np.cross(np.gradient(w, dt, axis=0), arm) + np.cross(w, np.cross(w, arm))
    f = f + rng.normal(0, made.acc_noise * np.sqrt(rate), f.shape)
    along = f @ (made.A / np.diag(made.A)[:, None]).T
    acc = np.diag(made.A) * (along + made.k2 * along**2) + made.a0
    gyro = seen @ made.W.T + made.w0
    if faults.clip:
        gyro = np.clip(gyro, -faults.clip, faults.clip)
    return np.arange(len(w)) * dt * (1 + faults.clock), acc, gyro


def _hump(m, dt):
    """A rate (m,) [1/s] of the form sin^2 that integrates to one."""
    return 2 * np.sin(np.pi * (np.arange(m) + 0.5) / m) ** 2 / (m * dt)


def _turn(rng, up, there, m, dt):
    """Rates (m, 3) of a turn about the vertical at random, and of the shortest one that takes ``up`` to ``there``."""
    axis = np.cross(there, up)
    if np.linalg.norm(axis) < 1e-6:
        axis = np.cross(up, [1.0, 0.3, 0.2])
    axis = axis / np.linalg.norm(axis)
    angle = np.arctan2(np.linalg.norm(np.cross(there, up)), there @ up)
    about = rng.uniform(-1.5, 1.5) * up
    return np.concatenate(
        [_hump(m // 2, dt)[:, None] * about, _hump(m - m // 2, dt)[:, None] * (axis * angle)]
    )


def _attitudes(C, w, dt, fine=4):
    """Matrices n from b (n, 3, 3) at the samples of rates ``w`` (n, 3), in ``fine`` steps of each."""
    x = np.arange(len(w) * fine + 1) / fine
    dense = np.stack([np.interp(x, np.arange(len(w)), w[:, i]) for i in range(3)], 1)
    steps = rotation(0.5 * (dense[:-1] + dense[1:]) * dt / fine)
    out = np.empty((len(w), 3, 3))
    for i in range(len(w)):
        out[i] = C
        for j in range(fine):
            C = C @ steps[i * fine + j]
    return out


def _level(up):
    """A matrix n from b that takes ``up`` (3,) of b to z of n."""
    z = np.array([0, 0, 1.0])
    axis = np.cross(up, z)
    size = np.linalg.norm(axis)
    if size < 1e-12:
        return np.eye(3) if up[2] > 0 else np.diag([1.0, -1, -1])
    return rotation(axis / size * np.arctan2(size, up @ z))
