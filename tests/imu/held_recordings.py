"""Simulated recordings of an instrument that is held, turned and held again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

GRAVITY = 9.81


@dataclass(frozen=True)
class Handling:
    """How an instrument is handled, and how it reads; SI, lengths of rests and moves as (least, most)."""

    rests: int = 54
    rate: float = 100.0
    rest: tuple[float, float] = (0.7, 2.5)
    move: tuple[float, float] = (0.8, 1.6)
    first: float = 0.0
    tremor: float = 0.02
    tremor_rate: float = 0.01
    jolt: float = 0.8
    noise: float = 0.03
    gyro_noise: float = 2e-3
    arm: float = 0.1


def held(seed, how=Handling(), axes=None):
    """Time (n,), accelerometers and gyros (n, 3), and the true rests (begin, end) [s].

    ``axes``: rotation vectors of the moves; drawn at random if absent.
    """
    rng = np.random.default_rng(seed)
    step = 1.0 / how.rate
    attitude = (
        Rotation.random(random_state=int(rng.integers(1 << 30))) if axes is None else Rotation.identity()
    )
    force, rate, still, truth, count = [], [], [], [], 0
    for k in range(how.rests):
        n = round((how.first if how.first and k == 0 else rng.uniform(*how.rest)) / step)
        truth.append((count * step, (count + n) * step))
        force.append(np.tile(attitude.inv().apply([0.0, 0.0, GRAVITY]), (n, 1)))
        rate.append(np.zeros((n, 3)))
        still.append(np.ones(n))
        count += n
        if k < how.rests - 1:
            n = round(rng.uniform(*how.move) / step)
            vector = rng.normal(size=3)
            vector *= rng.uniform(0.6, 2.5) / np.linalg.norm(vector)
            vector = vector if axes is None else np.asarray(axes[k % len(axes)])
            s = (np.arange(n) + 0.5) / n
            angle = s - np.sin(2.0 * np.pi * s) / (2.0 * np.pi)  # rest to rest, smooth
            turned = attitude * Rotation.from_rotvec(angle[:, None] * vector)
            force.append(turned.inv().apply([0.0, 0.0, GRAVITY]))
            rate.append((1.0 - np.cos(2.0 * np.pi * s))[:, None] * vector / (n * step))
            still.append(np.zeros(n))
            count += n
            attitude = attitude * Rotation.from_rotvec(vector)
    f, w = np.concatenate(force), np.concatenate(rate)
    shake = band(rng, count, step, 6.0, 2.5)
    w = w + how.tremor_rate * shake
    f = f + np.cross(f, how.tremor_rate * np.cumsum(shake, axis=0) * step)
    window = np.hanning(max(round(0.15 / step) | 1, 3))
    resting = np.concatenate(still)
    moving = (np.convolve(1.0 - resting, window / window.sum(), "same") * (1.0 - resting))[:, None]
    f = (
        f
        + how.tremor * band(rng, count, step, 6.0, 2.5)
        + how.jolt * moving * band(rng, count, step, 0.0, 2.0)
    )
    arm = np.array([how.arm, 0.03, -0.02])
    f = f + np.cross(np.gradient(w, step, axis=0), arm) + np.cross(w, np.cross(w, arm))
    acc = 1.01 * f + [0.1, -0.2, 0.05] + how.noise * rng.normal(size=f.shape)
    gyro = w + [0.01, -0.02, 0.015] + how.gyro_noise * rng.normal(size=w.shape)
    return np.arange(count) * step, acc, gyro, truth


def band(rng, count, step, centre, width):
    """Noise (n, 3) of unit size about a frequency [Hz]."""
    shape = np.exp(-0.5 * ((np.fft.rfftfreq(count, step) - centre) / width) ** 2)[:, None]
    out = np.fft.irfft(np.fft.rfft(rng.normal(size=(count, 3)), axis=0) * shape, n=count, axis=0)
    return out / out.std()
