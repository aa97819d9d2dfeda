"""Samples of both triads, freed of the errors that an array of coefficients states.

A rate sample is the mean over the interval before its stamp, for both triads alike, so that the half sample cancels.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from inercal.arrays import Array, short_repr
from inercal.strapdown.coefficients import K0, K2, KA, KG, TAU, A, D, G, R
from inercal.strapdown.delay import delayed
from inercal.strapdown.kernels import Gains, Motion, force_at_origin, increments, true_force, true_rate


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


def freed(samples: Samples, c: Array) -> Motion:
    """Motion of b at the times of which the accelerometers tell: stamps less the delay."""
    n, ts, by = len(samples.rate), samples.ts, gains(c)
    rate = samples.rate if c[TAU] == 0.0 else delayed(samples.rate, c[TAU] / ts)
    w, wd, fs, f, turn, gain = (np.zeros((n, 3)) for _ in range(6))
    true_force(samples.force, by, fs)
    true_rate(rate, fs, by, w)
    force_at_origin(w, fs, by, ts, wd, f)
    if c[G].any():
        true_rate(rate, f, by, w)
        force_at_origin(w, fs, by, ts, wd, f)
    increments(w, f, PAIRS, ts, turn, gain)
    return Motion(w, wd, fs, f, turn, gain)
