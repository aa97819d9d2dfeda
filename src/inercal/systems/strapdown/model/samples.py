"""Samples of both triads, freed of the errors that an array of coefficients states.

A rate sample is the mean over the interval before its stamp, for both triads alike, so that the half sample cancels.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from inercal.foundation.arrays import Array, short_repr
from inercal.systems.strapdown.model.coefficients import K0, K2, KA, KG, TAU, A, D, G, R
from inercal.systems.strapdown.model.delay import delayed
from inercal.systems.strapdown.model.kernels import BodyMotion, Gains, applied, increments, mean_lever


@short_repr
@dataclass(frozen=True, eq=False)
class Samples:
    """Outputs of the triads in SI, ``rate`` (n, 3) [rad/s] and ``force`` (n, 3) [m/s^2], every ``ts`` [s]."""

    rate: Array
    force: Array
    ts: float


def _pairs() -> Array:
    """Weights (5, 5), above the diagonal, of the products of five increments in the coning of the middle one.

    The integral of (integral of w) x w / 2 over the middle interval, w the polynomial of fourth order that has the five
    increments (Ignagni, J. Guid. Control Dyn. 13 (1990) 363, as an interpolation that looks both ways).
    """
    ends = np.arange(-2.5, 3.0)
    powers = np.arange(1, 6)
    of_increments = np.linalg.inv((ends[1:, None] ** powers - ends[:-1, None] ** powers) / powers)

    def integral(power: int) -> float:
        return float((0.5 ** (power + 1) - (-0.5) ** (power + 1)) / (power + 1))

    products = np.array(
        [
            [(integral(m + n + 1) - (-0.5) ** (m + 1) * integral(n)) / (m + 1) for n in range(5)]
            for m in range(5)
        ]
    )
    weights = 0.5 * of_increments.T @ products @ of_increments
    return np.asarray(np.triu(weights - weights.T, 1))


PAIRS: Final = _pairs()


def gains(c: Array) -> Gains:
    """An array of coefficients (51,) as kernels take it."""
    return Gains(
        np.asarray(np.linalg.inv(np.eye(3) + c[KG].reshape(3, 3)), dtype=float),
        np.asarray(np.linalg.inv(np.eye(3) + c[KA].reshape(3, 3)), dtype=float),
        c[D].copy(),
        c[A].copy(),
        np.ascontiguousarray(c[G].reshape(3, 3)),
        c[K0].copy(),
        c[K2].copy(),
        np.ascontiguousarray(c[R].reshape(3, 3)),
    )


def freed(samples: Samples, c: Array) -> BodyMotion:
    """Motion of b at the times of which the accelerometers tell: stamps less the delay."""
    ts, by = samples.ts, gains(c)
    rate = samples.rate if c[TAU] == 0.0 else delayed(samples.rate, c[TAU] / ts)
    fs = _true_force(samples.force, by)
    w = _true_rate(rate, fs, by, np.zeros_like(fs))
    wd = _derivative(w, ts)
    f = _at_origin(w, wd, fs, by, ts)
    if by.g.any():
        w = _true_rate(rate, f, by, w)
        wd = _derivative(w, ts)
        f = _at_origin(w, wd, fs, by, ts)
    turn, gain = np.empty_like(w), np.empty_like(w)
    increments(w, f, PAIRS, ts, turn, gain)
    return BodyMotion(w, wd, fs, f, turn, gain)


def _true_force(y: Array, c: Gains) -> Array:
    """Specific force (n, 3) at the accelerometers, of their outputs, by fixed-point steps for K2."""
    left = y - c.k0
    fs = applied(c.accelerometer, left)
    for _ in range(3 if c.k2.any() else 0):
        fs = applied(c.accelerometer, left - c.k2 * fs * fs)
    return fs


def _true_rate(y: Array, f: Array, c: Gains, w: Array) -> Array:
    """Rate (n, 3) of the outputs of the gyros, by fixed-point steps for the asymmetry, from ``w`` on."""
    left = y - c.d
    if c.g.any():
        left -= applied(c.g, f)
    for _ in range(3 if c.a.any() else 1):
        w = applied(c.gyro, left - c.a * np.abs(w))
    return w


def _derivative(w: Array, ts: float) -> Array:
    """Derivative of the rate over each sample, of four neighbours; at the ends the last stands for those beyond."""
    padded = np.pad(w, ((2, 2), (0, 0)), mode="edge")
    return np.asarray((8.0 * (padded[3:-1] - padded[1:-3]) - (padded[4:] - padded[:-4])) / (12.0 * ts))


def _at_origin(w: Array, wd: Array, fs: Array, c: Gains, ts: float) -> Array:
    """Force (n, 3) without what turning does at the lever arms."""
    m = mean_lever(w.T, wd.T, ts)
    f = np.empty_like(fs)
    for i in range(3):
        f[:, i] = fs[:, i] - (m[3 * i] * c.r[i, 0] + m[3 * i + 1] * c.r[i, 1] + m[3 * i + 2] * c.r[i, 2])
    return f
