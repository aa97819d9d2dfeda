"""Sensors whose bias wanders: means over blocks with white noise, on a bias that takes a random walk.

The local-level model (Harvey 1989, Forecasting, structural time series models and the Kalman filter, section 4.1),
by the Kalman filter with a start of which nothing is known:

    y_k = x_k + b_k + e_k ,  e_k ~ N(0, white_k) ;  b_k+1 = b_k + w_k ,  w_k ~ N(0, K^2 (t_k+1 - t_k))

K is one number for the test, unless the data say that outputs shift when the table turns and stay when it rests.

Filtered columns are whitened ones: least squares on them is generalised least squares on the blocks. The integral of
the bias is a second state, so that its mean over the test is estimated with its covariance. The disturbance smoother
(Koopman 1993, Biometrika 80, 117) runs backward and tells what each error does to an estimate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from inercal.foundation._jit import allocating, kernel
from inercal.foundation.arrays import Array


@allocating
def _forward(
    columns: Array,
    gaps: Array,
    white: Array,
    squares: Array,
    out: Array,
    size: Array,
    gain: Array,
    integral: Array,
) -> None:
    """Whiten ``columns`` (n, c) into ``out``; ``size`` and ``gain`` (n,) receive variance and gain of each step,
    ``integral`` (c + 1,) the integral of the bias that each column makes, and its variance."""
    n, c = columns.shape
    level = columns[0].copy()
    integral.fill(0.0)
    p, p_mixed, p_integral = white[0], 0.0, 0.0
    size[0], gain[0] = math.inf, 1.0
    out[0] = 0.0
    for k in range(1, n):
        g, k2 = gaps[k], squares[k]
        p_integral += 2.0 * g * p_mixed + g * g * p + k2 * g * g * g / 3.0
        p_mixed += g * p + k2 * g * g / 2.0
        p += k2 * g
        s = p + white[k]
        root, a, b = 1.0 / math.sqrt(s), p / s, p_mixed / s
        for j in range(c):
            integral[j] += g * level[j]
            v = columns[k, j] - level[j]
            out[k, j] = v * root
            level[j] += a * v
            integral[j] += b * v
        p_integral -= b * b * s
        p_mixed -= a * b * s
        p -= a * a * s
        size[k], gain[k] = s, a
    integral[c] = p_integral


@kernel
def _backward(out: Array, size: Array, gain: Array, noise: Array, steps: Array) -> None:
    """Weights of the white errors ``noise`` (n, c) and of the ``steps`` (n, c) of the bias after each block."""
    n, c = out.shape
    for j in range(c):
        r = 0.0
        for k in range(n - 1, 0, -1):
            steps[k, j] = r
            u = out[k, j] / math.sqrt(size[k]) - gain[k] * r
            noise[k, j] = u
            r += u
        steps[0, j] = r
        noise[0, j] = -r


@dataclass(frozen=True, eq=False)
class WhitenedColumns:
    """Columns after whitening.

    ``rows`` (n, c); ``size`` (n,) the variances, the first infinite; ``mean`` (c,) the mean of the bias over the test
    that each column makes; ``mean_variance`` that of the bias; ``gain`` (n,), ``steps`` (n,) [output^2] the variances
    of the bias after each block.
    """

    rows: Array
    size: Array
    mean: Array
    mean_variance: float
    gain: Array
    white: Array
    steps: Array

    def information(self) -> tuple[Array, Array]:
        """(c, c) twice: what white noise and the wander of the bias add to the variance of rows^T rows."""
        noise, steps = np.empty_like(self.rows), np.empty_like(self.rows)
        _backward(self.rows, self.size, self.gain, noise, steps)
        return (noise * self.white[:, None]).T @ noise, (steps * self.steps[:, None]).T @ steps


def whiten(columns: Array, t: Array, white: Array, walk: float | Array) -> WhitenedColumns:
    """Whiten columns (n, c) at times ``t`` (n,) [s], for variances ``white`` (n,) and ``walk`` K [output/sqrt(s)].

    ``walk`` may be (n,): that of the time before each block.
    """
    columns = np.ascontiguousarray(columns, dtype=float)
    gaps = np.diff(t, prepend=t[0])
    rows, size, gain = np.empty_like(columns), np.empty(len(t)), np.empty(len(t))
    squares = np.square(np.broadcast_to(np.asarray(walk, dtype=float), len(t)))
    integral = np.empty(columns.shape[1] + 1)
    _forward(columns, gaps, white, squares, rows, size, gain, integral)
    span = t[-1] - t[0]
    steps = np.append((squares * gaps)[1:], 0.0)
    return WhitenedColumns(
        rows, size, integral[:-1] / span, float(integral[-1]) / span**2, gain, white, steps
    )
