"""Noise of the readings of each channel beside what the table explains, by restricted likelihood.

The readings have the covariance ``V = V_table + sum_c s_c^2 E_c``, E_c picking those of channel c. Their likelihood
outside the space of the terms (Patterson and Thompson 1971) is greatest where, for each channel that nobody states,

    r^T P E_c P r = tr(P E_c) ,   P = V^-1 - V^-1 A (A^T V^-1 A)^-1 A^T V^-1

found by Fisher scoring in log s^2. All channels are taken together: what the table does to several of them at
once (gravity turns, its size stays) tells their noise apart from it. With B the first rows of the orthonormal factor
of the whitened regression and L the roots of the covariances of each position, ``P = L^-T (1 - B B^T) L^-1``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inercal.arrays import Array
from inercal.turntable.weights import Weights, whitened

_STEPS = 60
"""Scoring steps at most; a dozen do unless a channel has no noise at all."""

_TINY = 1e-100
"""Least information about the logarithm of a variance."""

_LONGEST = 3.0
"""Change of log s^2 in a step at most."""


@dataclass(frozen=True)
class ReadingNoise:
    """Noise of a reading: standard deviations ``std`` (c,), their degrees of freedom ``dof``, inf where stated, and the
    logarithm of the restricted ``likelihood``."""

    std: Array
    dof: Array
    likelihood: float


@dataclass(frozen=True, eq=False)
class _Likelihood:
    """Likelihood of the variances of the noise: ``value`` its logarithm, ``slope`` (c,) and ``information`` (c, c)."""

    value: float
    slope: Array
    information: Array


def scatter(
    rows: Array, y: Array, table: Weights, noise: Sequence[float | None], floor: Array
) -> ReadingNoise:
    """Noise of each channel.

    Parameters
    ----------
    rows : (n, c, p) regressors
    y : (n, c) readings
    table : Weights without noise
    noise : (c,) standard deviations that are stated, None where they are not
    floor : (c,)
        Least standard deviation; a smaller one, stated or estimated, counts as this.
    """
    free = np.array([each is None for each in noise])
    low = 2.0 * np.log(floor)
    std = np.array([1.0 if each is None else each for each in noise])
    start = 2.0 * np.log(np.maximum(np.where(free, _spread(rows, y), std), floor))
    dof = np.full(len(free), np.inf)
    if not free.any():
        return ReadingNoise(np.exp(0.5 * start), dof, _likelihood(rows, y, table, np.exp(start)).value)
    log, now = start, _likelihood(rows, y, table, np.exp(start))
    for _ in range(_STEPS):
        s2 = np.exp(log)
        slope, information = now.slope * s2, now.information * s2 * s2[:, None]
        moving = free & ~((log <= low) & (slope < 0.0))
        if not moving.any():
            break
        step = np.zeros(len(log))
        step[moving] = np.linalg.lstsq(information[np.ix_(moving, moving)], slope[moving], rcond=None)[0]
        step = np.clip(step, -_LONGEST, _LONGEST)
        before = log
        while np.abs(step).max() > 1e-6:
            log = np.maximum(before + step, low)
            trial = _likelihood(rows, y, table, np.exp(log))
            if trial.value >= now.value:
                now = trial
                break
            log, step = before, 0.25 * step
        if np.abs(log - before).max() < 1e-4:
            break
    s2 = np.exp(log)[free]
    of_log = now.information[np.ix_(free, free)] * s2 * s2[:, None]
    # of a variance that is estimated as none the readings know next to nothing
    size = np.sqrt(np.maximum(np.diag(of_log), _TINY))
    dof[free] = 2.0 * np.square(size) / np.diag(np.linalg.pinv(of_log / np.outer(size, size)))
    return ReadingNoise(np.exp(0.5 * log), dof, now.value)


def _spread(rows: Array, y: Array) -> Array:
    """Rms residuals (c,) of the channels, each by itself, somewhat enlarged: where the search begins."""
    rest = [
        y[:, k] - rows[:, k] @ np.linalg.lstsq(rows[:, k], y[:, k], rcond=None)[0] for k in range(y.shape[1])
    ]
    return np.asarray(1.2 * np.sqrt(np.mean(np.square(rest), axis=1)))


def _likelihood(rows: Array, y: Array, table: Weights, variance: Array) -> _Likelihood:
    """Restricted likelihood of the readings, for variances (c,) of the noise."""
    n, c, _ = rows.shape
    white = whitened(rows, y, Weights(table.within + np.diag(variance), table.common))
    Q, R = np.linalg.qr(white.rows)
    B = Q[: n * c]
    misfit = white.right - B @ (B.T @ white.right)
    back = np.swapaxes(white.inverse, 1, 2)
    W = back @ white.inverse
    B_back = back @ B.reshape(n, c, -1)
    residual = (back @ misfit.reshape(n, c, 1))[..., 0]
    squares = np.einsum("nck,ncl->ckl", B_back, B_back)
    slope = np.square(residual).sum(axis=0) - np.einsum("ncc->c", W) + np.einsum("ckk->c", squares)
    information = (
        np.square(W).sum(axis=0)
        - 2.0 * np.einsum("ncd,nck,ndk->cd", W, B_back, B_back)
        + np.einsum("ckl,dkl->cd", squares, squares)
    )
    size = np.log(np.abs(np.diag(R)) * white.length).sum() - np.log(np.einsum("ncc->nc", white.inverse)).sum()
    return _Likelihood(-float(size) - 0.5 * float(white.right @ misfit), 0.5 * slope, 0.5 * information)
