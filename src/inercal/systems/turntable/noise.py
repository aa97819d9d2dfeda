"""Noise of the readings of each channel beside what the table explains, by restricted likelihood.

The readings have the covariance ``V = V_table + sum_c s_c^2 E_c``, E_c picking those of channel c. Their likelihood
(`inercal.foundation.inference.variances`) is greatest where, for each channel that nobody states,

    r^T P E_c P r = tr(P E_c) ,   P = V^-1 - V^-1 A (A^T V^-1 A)^-1 A^T V^-1

All channels are taken together: what the table does to several of them at once (gravity turns, its size stays) tells
their noise apart from it. With B the first rows of the orthonormal factor of the whitened regression and L the roots
of the covariances of each position, ``P = L^-T (1 - B B^T) L^-1``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.inference.variances import Score, Solved, highest
from inercal.systems.turntable.weights import Weights, whitened

_TINY = 1e-100
"""Least information about the logarithm of a variance."""


@dataclass(frozen=True)
class ReadingNoise:
    """Noise of a reading: standard deviations ``std`` (c,), their degrees of freedom ``dof``, inf where stated, and the
    logarithm of the restricted ``likelihood``."""

    std: Array
    dof: Array
    likelihood: float


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
    free = np.array([sigma is None for sigma in noise])
    std = np.array([1.0 if sigma is None else sigma for sigma in noise])
    variance = np.square(np.maximum(np.where(free, _spread(rows, y), std), floor))
    dof = np.full(len(free), np.inf)

    def score(of_free: Array) -> Score:
        every = variance.copy()
        every[free] = of_free
        value, slope, information = _score(rows, y, table, every)
        return Score(value, slope[free], information[np.ix_(free, free)])

    found = highest(score, variance[free], np.square(floor[free]))
    variance[free] = s2 = found.variances
    of_log = found.score.information * np.outer(s2, s2)
    # of a variance that is estimated as none the readings know next to nothing
    size = np.sqrt(np.maximum(np.diag(of_log), _TINY))
    dof[free] = 2.0 * np.square(size) / np.diag(np.linalg.pinv(of_log / np.outer(size, size)))
    return ReadingNoise(np.sqrt(variance), dof, found.score.value)


def _spread(rows: Array, y: Array) -> Array:
    """Rms residuals (c,) of the channels, each by itself, somewhat enlarged: where the search begins."""
    rest = [
        y[:, k] - rows[:, k] @ np.linalg.lstsq(rows[:, k], y[:, k], rcond=None)[0] for k in range(y.shape[1])
    ]
    return np.asarray(1.2 * np.sqrt(np.mean(np.square(rest), axis=1)))


def _score(rows: Array, y: Array, table: Weights, variance: Array) -> Score:
    """Restricted likelihood of the readings, for variances (c,) of the noise."""
    n, c, _ = rows.shape
    white = whitened(rows, y, Weights(table.within + np.diag(variance), table.common))
    whole = np.zeros(
        (len(white.rows) + 1, white.rows.shape[1] + 1)
    )  # a row more, for readings that leave none over
    whole[:-1, :-1], whole[: n * c, -1] = white.rows, white.right
    Q, R = np.linalg.qr(whole)
    B, misfit = Q[: n * c, :-1], Q[: n * c, -1] * R[-1, -1]
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
    size = 2.0 * (np.log(white.length).sum() - np.log(np.einsum("ncc->nc", white.inverse)).sum())
    return Score(float(Solved(R).likelihood(size)), 0.5 * slope, 0.5 * information)
