"""A unit that a hand swings and never rests, and rows in many directions: outputs by SciPy's rotations.

Nothing here is shared with the program.
"""

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

GRAVITY = 9.81


def coefficients(rng):
    """K0, K1 and M of accelerometers that define the frame, (9,)."""
    return np.concatenate([rng.normal(0, 0.2, 3), 1 + rng.normal(0, 0.01, 3), rng.normal(0, 0.01, 3)])


def outputs(x, f):
    """Outputs (n, 3) of accelerometers for specific force f (n, 3)."""
    M = np.array([[1, x[6], x[7]], [0, 1, x[8]], [0, 0, 1]])
    return x[:3] + x[3:6] * (f @ M.T)


def wander(rng, n, samples, sd):
    """Smooth noise (n, 3) that forgets itself within so many samples."""
    y = gaussian_filter1d(rng.normal(size=(n + 8 * int(samples), 3)), samples, axis=0)[4 * int(samples) :][:n]
    return sd * y / y.std()


def hand(rng, seconds=120.0, push=0.15, arm=0.1, speed=0.6, noise=0.03, axis=None):
    """Outputs at 100 Hz of accelerometers with white noise, rate of turn, and the coefficients."""
    n, x = int(100 * seconds), coefficients(rng)
    w = wander(rng, n, 120, speed)
    if axis is not None:
        w = w[:, :1] * axis
    first = Rotation.identity() if axis is not None else Rotation.from_rotvec(rng.normal(0, 2, 3))
    attitude = Rotation.concatenate([first, Rotation.from_rotvec(0.005 * (w[1:] + w[:-1]))])
    shift = 1
    while shift < n:  # all products from the first on, in log2 n rounds
        attitude = Rotation.concatenate([attitude[:shift], attitude[:-shift] * attitude[shift:]])
        shift *= 2
    down = attitude.inv().apply([0, 0, GRAVITY])
    r = np.full(3, arm / np.sqrt(3))
    f = (
        down
        + wander(rng, n, 8, push)
        + np.cross(w, np.cross(w, r))
        + np.cross(np.gradient(w, 0.01, axis=0), r)
    )
    return outputs(x, f) + rng.normal(0, noise, (n, 3)), w, x


def rows(rng, n=60, pushed=6, cone=180.0, noise=0.01):
    """Outputs of rows in directions within ``cone`` degrees of z up, of which the first few were pushed by 1 to 5 m/s²,
    and the coefficients."""
    x, z, a = coefficients(rng), rng.uniform(np.cos(np.radians(cone)), 1, n), rng.uniform(0, 2 * np.pi, n)
    size = np.full(n, GRAVITY)
    size[:pushed] += rng.choice([-1, 1], pushed) * rng.uniform(1, 5, pushed)
    f = size[:, None] * np.column_stack([np.sqrt(1 - z**2) * np.cos(a), np.sqrt(1 - z**2) * np.sin(a), z])
    return outputs(x, f) + rng.normal(0, noise, (n, 3)), x


def turn_sensor(rng, w, order=(0, 1, 2), signs=(1, 1, 1)):
    """Outputs (n, 3) of a gyro for the rate w (n, 3), and its D_F, S and T."""
    pairs = [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)]
    bias, scale, off = rng.normal(0, 0.02, 3), 1 + rng.normal(0, 0.01, 3), rng.normal(0, 0.01, 6)
    T = np.eye(3)
    for (i, j), value in zip(pairs, off, strict=True):
        T[i, j] = value
    y = bias + scale * (w @ T.T) + rng.normal(0, 3e-3, w.shape)
    return (y * signs)[:, list(order)], np.concatenate([bias, scale, off])
