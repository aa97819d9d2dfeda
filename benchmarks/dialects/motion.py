"""Motions of an instrument whose readings are known: at rest, in four poses, in a rough hand, swung slowly."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

G = 9.80665
FIELD = np.array([19.0, 2.0, -45.0])  # uT, in axes of the ground


@dataclass(frozen=True)
class Truth:
    """What an instrument read: t (n,) [s], acc (n, 3) [m/s^2], gyro (n, 3) [rad/s], mag (n, 3) [uT], temperature (n,)
    [degC], attitude (n, 4) as w x y z, position (n, 3) [m]."""

    t: np.ndarray
    acc: np.ndarray
    gyro: np.ndarray
    mag: np.ndarray
    temperature: np.ndarray
    attitude: np.ndarray
    position: np.ndarray

    @property
    def rate(self):
        return 1.0 / np.median(np.diff(self.t))


def truth(kind, rate, seconds, rng, noise=(2e-2, 2e-3)):
    """A record of one ``kind`` of motion: rest, poses, hand or swing; ``noise`` of a sample of both triads."""
    n = int(rate * seconds)
    t = np.arange(n) / rate
    attitude, shaken = ATTITUDES[kind](t, rng), np.zeros((n, 3))
    if kind == "hand":
        shaken = 0.6 * np.column_stack(
            [
                np.sin(2 * np.pi * f * t + p)
                for f, p in zip((1.3, 0.9, 1.7), rng.uniform(0, 6, 3), strict=True)
            ]
        )
    step = 1e-4
    later = ATTITUDES[kind](t + step, np.random.default_rng(0), again=attitude)
    rates = (attitude[0].inv() * later[0]).as_rotvec() / step
    body = attitude[0].inv()
    acc = body.apply(np.tile([0.0, 0.0, G], (n, 1)) + shaken)
    bias_a, bias_g = rng.normal(0.0, 0.05, 3), rng.normal(0.0, 0.01, 3)
    q = attitude[0].as_quat()[:, [3, 0, 1, 2]]
    return Truth(
        t,
        acc + bias_a + rng.normal(0.0, noise[0], (n, 3)),
        rates + bias_g + rng.normal(0.0, noise[1], (n, 3)),
        body.apply(np.tile(FIELD, (n, 1))) + rng.normal(0.0, 0.3, (n, 3)),
        25.0 + 3.0 * (1.0 - np.exp(-t / 40.0)) + rng.normal(0.0, 0.01, n),
        q,
        np.cumsum(rng.normal(0.0, 0.01, (n, 3)), axis=0),
    )


def _rest(t, rng, again=None):
    turned = again[1] if again else Rotation.from_rotvec(rng.normal(0.0, 0.3, 3))
    return Rotation.concatenate([turned] * len(t)), turned


def _through(knots, times):
    """A smooth path that rests at each attitude for 60 % of the time to the next."""
    slerp = Slerp(np.arange(len(knots)), Rotation.concatenate(knots))

    def at(t):
        k = np.clip(np.searchsorted(times, t, "right") - 1, 0, len(knots) - 2)
        share = np.clip((t - times[k]) / (times[k + 1] - times[k]), 0.0, 1.0)
        share = np.clip((share - 0.6) / 0.4, 0.0, 1.0)
        return slerp(np.clip(k + share * share * (3.0 - 2.0 * share), 0.0, len(knots) - 1.0))

    return at


def _poses(t, rng, again=None):
    if again:
        return again[1](t), again[1]
    axes = np.eye(3)[rng.permutation(3)]
    knots = [Rotation.from_rotvec(rng.normal(0.0, 0.2, 3))]
    for k in range(4):
        knots.append(knots[-1] * Rotation.from_rotvec(axes[k % 3] * np.pi / 2 * rng.choice([-1.0, 1.0])))
    path = _through(knots, np.linspace(0.0, t[-1], 5))
    return path(t), path


def _wave(t, size, rng, again):
    """Angles about three axes as sums of sines."""
    waves = (
        again[1] if again else (rng.uniform(0.6, 1.4, 3), rng.uniform(0.15, 0.4, 3), rng.uniform(0.0, 6.0, 3))
    )
    angles = size * np.column_stack(
        [a * np.sin(2 * np.pi * f * t + p) for a, f, p in zip(*waves, strict=True)]
    )
    return Rotation.from_euler("ZYX", angles), waves


def _hand(t, rng, again=None):
    return _wave(t, 1.3, rng, again)


def _swing(t, rng, again=None):
    return _wave(t, 2.2, rng, again)


ATTITUDES = {"rest": _rest, "poses": _poses, "hand": _hand, "swing": _swing}
