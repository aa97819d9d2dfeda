"""The method of Tedaldi, Pretto and Menegatti as a careful user of SciPy would write it: the peer in the benchmark.

Windowed variance, least squares of |f| = g over the pose means with numerical derivatives, then the gyro's nine
parameters from pose to pose with SciPy's Rotation: one turn after the other, as the equations are written, or all turns
together by a tree of products, as who knows that Rotation multiplies arrays writes it. No uncertainties.
"""

import itertools

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation


def windowed_variance(x: np.ndarray, window: int) -> np.ndarray:
    views = np.lib.stride_tricks.sliding_window_view(x, window, axis=0)
    size = np.full(len(x), np.inf)
    size[window // 2 : window // 2 + len(views)] = np.linalg.norm(views.var(axis=-1), axis=1)
    return size


def intervals(still: np.ndarray, shortest: int) -> list[tuple[int, int]]:
    edges = np.diff(np.concatenate([[0], still.astype(int), [0]]))
    pairs = zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True)
    return [(a, b) for a, b in pairs if b - a >= shortest]


def correct(p: np.ndarray, y: np.ndarray) -> np.ndarray:
    T = np.array([[1, p[3], p[4]], [0, 1, p[5]], [0, 0, 1]])
    return ((y - p[6:9]) / p[:3]) @ T.T


def in_sequence(steps: list[np.ndarray]) -> Rotation:
    """Product of the small rotations of each turn, one after the other."""
    turns = []
    for each in steps:
        turn = Rotation.identity()
        for step in Rotation.from_rotvec(each):
            turn = turn * step
        turns.append(turn)
    return Rotation.concatenate(turns)


def together(steps: list[np.ndarray]) -> Rotation:
    """The same of all turns at once: filled up with rests to a power of two, then neighbours are multiplied."""
    length = 1 << (max(map(len, steps)) - 1).bit_length()
    filled = np.zeros((len(steps), length, 3))
    for k, each in enumerate(steps):
        filled[k, : len(each)] = each
    turns = Rotation.from_rotvec(filled.reshape(-1, 3))
    for _ in range(length.bit_length() - 1):
        turns = turns[0::2] * turns[1::2]
    return turns


def calibrate(
    t: np.ndarray, acc: np.ndarray, gyro: np.ndarray, gravity: float, start: float, product=in_sequence
) -> tuple[np.ndarray, ...]:
    """Nine parameters of the accelerometers, and nine of the gyro; ``product`` of the two above."""
    rest = t < t[0] + start
    variance = windowed_variance(acc, 101)
    reference = np.linalg.norm(acc[rest].var(axis=0))
    low, high = acc[rest].min(axis=0), acc.max(axis=0)
    best = None
    for multiple in range(2, 11):
        found = intervals(variance < multiple * reference, 101)
        if len(found) < 12:
            continue
        means = np.array([acc[a:b].mean(axis=0) for a, b in found])
        low, high = means.min(axis=0), means.max(axis=0)
        first = np.concatenate([(high - low) / 2 / gravity, np.zeros(3), (high + low) / 2])
        fit = least_squares(
            lambda p, means=means: np.linalg.norm(correct(p, means), axis=1) - gravity,
            first,
            x_scale=np.abs(first) + 1,
        )
        if best is None or fit.cost / (len(found) - 9) < best[0]:
            best = (fit.cost / (len(found) - 9), fit.x, found, means)
    assert best is not None
    _, p, found, means = best
    up = correct(p, means)
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    bias = gyro[rest].mean(axis=0)

    def misses(q: np.ndarray) -> np.ndarray:
        T = np.array([[1, q[3], q[4]], [q[5], 1, q[6]], [q[7], q[8], 1]])
        steps = []
        for (_, end), (begin, _) in itertools.pairwise(found):
            a, b = end - 1, begin
            omega = ((gyro[a : b + 1] - bias) / q[:3]) @ T.T
            steps.append(0.5 * (omega[1:] + omega[:-1]) * np.diff(t[a : b + 1])[:, None])
        return (product(steps).inv().apply(up[:-1]) - up[1:]).ravel()

    first = np.concatenate([np.full(3, 4770.0), np.zeros(6)])
    gyro_fit = least_squares(misses, first, x_scale=np.concatenate([np.full(3, 4770.0), np.ones(6)]))
    return p, gyro_fit.x
