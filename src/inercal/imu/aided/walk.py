"""Sensors whose bias wanders: means over blocks with white noise, on a bias that takes a random walk.

The local-level model (Harvey 1989, Forecasting, structural time series models and the Kalman filter, section 4.1),
by the Kalman filter with a start of which nothing is known:

    y_k = x_k + b_k + e_k ,  e_k ~ N(0, white_k) ;  b_k+1 = b_k + w_k ,  w_k ~ N(0, K^2 (t_k+1 - t_k))

Filtered columns are whitened ones: least squares on them is generalised least squares on the blocks. The integral of
the bias is a second state, so that its mean over the test is estimated with its covariance. The disturbance smoother
(Koopman 1993, Biometrika 80, 117) runs backward and tells what each error does to an estimate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inercal._jit import kernel

Array = NDArray[np.float64]


@kernel
def _forward(
    columns: Array, gaps: Array, white: Array, k2: float, out: Array, size: Array, gain: Array
) -> Array:
    """Whiten ``columns`` (n, c) into ``out``; ``size`` and ``gain`` (n,) receive variance and gain of each step.

    Returns (c + 1,): the integral of the bias that each column makes, and its variance.
    """
    n, c = columns.shape
    level = columns[0].copy()
    integral = np.zeros(c + 1)
    p, p_mixed, p_integral = white[0], 0.0, 0.0
    size[0], gain[0] = math.inf, 1.0
    out[0] = 0.0
    for k in range(1, n):
        g = gaps[k]
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
    return integral


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
class Whitened:
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


def whiten(columns: Array, t: Array, white: Array, walk: float) -> Whitened:
    """Whiten columns (n, c) at times ``t`` (n,) [s], for variances ``white`` (n,) and ``walk`` K [output/sqrt(s)]."""
    columns = np.ascontiguousarray(columns, dtype=float)
    gaps = np.diff(t, prepend=t[0])
    rows, size, gain = np.empty_like(columns), np.empty(len(t)), np.empty(len(t))
    integral = _forward(columns, gaps, white, walk**2, rows, size, gain)
    span = t[-1] - t[0]
    steps = walk**2 * np.append(gaps[1:], 0.0)
    return Whitened(rows, size, integral[:-1] / span, float(integral[-1]) / span**2, gain, white, steps)


@dataclass(frozen=True)
class Levels:
    """Noise of one sensor.

    ``resting`` and ``moving`` N [output sqrt(s)] of the white noise, ``walk`` K [output/sqrt(s)]; degrees of freedom
    of both; ``drift`` twice the gain of the log likelihood by a bias that wanders.
    """

    resting: float
    moving: float
    walk: float
    dof: float
    walk_dof: float
    drift: float

    def white(self, length: Array, resting: NDArray[np.bool_]) -> Array:
        """Variances (n,) of means over blocks of those lengths [s]."""
        return np.where(resting, self.resting, self.moving) ** 2 / length


def levels(
    residual: Array,
    columns: Array,
    prior: Array,
    t: Array,
    length: Array,
    resting: NDArray[np.bool_],
    floor: float,
) -> Levels:
    """Noise of a sensor by its residuals.

    White noise from differences of neighbouring blocks, at rest and in motion apart (a table shakes when it turns).
    The walk by the restricted likelihood of all blocks: the mean of K over its likelihood, which is never zero as the
    most likely value often is.

    Parameters
    ----------
    residual : (n,)
        Of a preliminary fit.
    columns : (n, p)
        What the residuals may still change by, for unknowns of unit prior variance.
    prior : (p,)
        Prior means of these unknowns, beside the preliminary fit.
    t, length : (n,) s
        Middles and lengths of the blocks.
    resting : (n,)
    floor : float
        Least standard deviation of a block that is told from none [output].
    """
    near = np.diff(t) < 1.5 * length[1:]
    each = np.square(np.diff(residual)) / (1.0 / length[1:] + 1.0 / length[:-1])
    both, none = resting[1:] & resting[:-1], ~(resting[1:] | resting[:-1])
    parts = [each[near & kind] for kind in (both, none)]
    fallback = each[near] if near.any() else each
    least = floor**2 * float(np.median(length))
    still, moving = (max(float(np.mean(part if len(part) >= 10 else fallback)), least) for part in parts)
    level = Levels(math.sqrt(still), math.sqrt(moving), 0.0, 2.0 * np.count_nonzero(near) / 3.0, np.inf, 0.0)
    white = level.white(length, resting)
    span, typical = float(t[-1] - t[0]), math.sqrt(still)
    grid = np.r_[0.0, typical * np.geomspace(0.03 / span, 3.0 / float(np.median(length)), 24)]
    likelihood = np.array([_restricted(residual, columns, prior, t, white, k) for k in grid])
    weight = np.exp(likelihood - likelihood.max()) * np.gradient(grid)
    weight /= weight.sum()
    walk = float(weight @ grid)
    spread = float(weight @ (grid - walk) ** 2)
    return Levels(
        level.resting,
        level.moving,
        walk,
        level.dof,
        max(0.5 * walk**2 / spread, 1.0) if spread > 0.0 else np.inf,
        2.0 * float(likelihood.max() - likelihood[0]),
    )


def _restricted(residual: Array, columns: Array, prior: Array, t: Array, white: Array, walk: float) -> float:
    """Log of the restricted likelihood (Patterson and Thompson 1971) of one walk."""
    done = whiten(np.column_stack([columns, residual]), t, white, walk)
    A, e = np.vstack([done.rows[:, :-1], np.eye(len(prior))]), np.append(done.rows[:, -1], prior)
    length = np.linalg.norm(A, axis=0)
    length[length == 0.0] = 1.0
    gram = A.T @ A / np.outer(length, length) + 1e-12 * np.eye(A.shape[1])
    factor = np.linalg.cholesky(gram)
    told = np.linalg.solve(factor, (A / length).T @ e)
    volume = 2.0 * np.log(np.diag(factor)).sum() + 2.0 * np.log(length).sum()
    return -0.5 * float(np.log(done.size[1:]).sum() + volume + e @ e - told @ told)
