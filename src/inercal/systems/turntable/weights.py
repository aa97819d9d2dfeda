"""Covariance of the readings of a test: the part redrawn at each position, and the part constant over the test.

Noise of the readings of each channel beside what the table explains, by restricted likelihood.

The readings have the covariance ``V = V_table + sum_c s_c^2 E_c``, E_c picking those of channel c. Their likelihood
(`inercal.foundation.inference.variances`) is greatest where, for each channel that nobody states,

    r^T P E_c P r = tr(P E_c) ,   P = V^-1 - V^-1 A (A^T V^-1 A)^-1 A^T V^-1

All channels are taken together: what the table does to several of them at once (gravity turns, its size stays) tells
their noise apart from it. With B the first rows of the orthonormal factor of the whitened regression and L the roots
of the covariances of each position, ``P = L^-T (1 - B B^T) L^-1``.

Second order of the table's errors: what their squares and products do to the readings (GUM 5.1.2 note, F.2.4.4). The
errors chi move a reading by ``J_k chi_k + H_kl chi_k chi_l / 2``. The squares have the mean ``H_kk s_k^2 / 2``, by
which readings are corrected; about it, squares and products are uncorrelated with each other and, for symmetric
distributions, with the errors themselves. Each is therefore one more error of the readings, with the standard deviation
``s_k s_l``, or ``s_k^2 sqrt(kurtosis - 1)`` for a square, and takes a new value where either of its two does. (A
latitude multiplies what is fitted, and needs a fit on either side: `positions.shifts.of_latitude`.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.inference.variances import Score, Solved, highest
from inercal.foundation.rigs.chain import Chain, Error, Scope
from inercal.systems.turntable.model import TableModel

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
    known = 2.0 * np.square(size) / np.diag(np.linalg.pinv(of_log / np.outer(size, size)))
    # a noise of 0 beside the table: rounding alone makes its degrees of freedom negative or infinite
    dof[free] = np.where(np.isfinite(known) & (known > 0.0), known, 1.0)
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


Samples: TypeAlias = NDArray[np.int64]
"""Rows behind each reading (n,)."""


@dataclass(frozen=True, eq=False)
class Weights:
    """Covariance of the readings.

    ``within`` (n, c, c) covariance redrawn at each position, noise and table; ``common`` (n, c, q) derivatives
    with respect to the constants, in their standard deviations: errors of the table, then inputs beside it, then
    values that the positions of one angle share.
    """

    within: Array
    common: Array

    @property
    def std(self) -> Array:
        """Standard deviation (n, c) of each reading by all of it."""
        return np.asarray(np.sqrt(np.einsum("ncc->nc", self.within) + np.square(self.common).sum(axis=-1)))

    def with_common(self, more: Array) -> Weights:
        """With ``more`` (n, c, q) constants, each in its standard deviation."""
        return Weights(self.within, np.concatenate([self.common, more], axis=-1)) if more.shape[-1] else self


@dataclass(frozen=True, eq=False)
class Whitened:
    """A regression in readings of unit covariance, with the prior of the constants as rows of its own.

    ``inverse`` (n, c, c) of the roots of ``within``, by which the readings are multiplied; ``right`` (n c,) the
    readings; ``rows`` (n c + q, p + q) the regressors and columns of ``common``, each over its ``length`` (p + q,).
    """

    inverse: Array
    right: Array
    rows: Array
    length: Array


def whitened(rows: Array, y: Array, weight: Weights) -> Whitened:
    """Whiten regressors ``rows`` (n, c, p) and readings ``y`` (n, c); raises LinAlgError where ``within`` of a
    position is not positive definite."""
    n, c, p = rows.shape
    inverse = np.linalg.inv(np.linalg.cholesky(weight.within))
    left = (inverse @ np.concatenate([rows, weight.common], axis=-1)).reshape(n * c, -1)
    q = left.shape[1] - p
    whole = np.vstack([left, np.hstack([np.zeros((q, p)), np.eye(q)])])
    length = np.linalg.norm(whole, axis=0)
    length[length == 0.0] = 1.0
    return Whitened(inverse, (inverse @ y[..., None]).reshape(n * c), whole / length, length)


def weights(
    model: TableModel,
    angles: Array,
    c: Array,
    noise: Array,
    std: Array | None = None,
    samples: Samples | None = None,
) -> Weights:
    """Covariance of the readings for coefficients ``c``, noise (c,) and errors of the table.

    ``std`` (k,) stands in for the standard deviations of the chain's errors; ``samples`` (n,) as in
    `inercal.systems.turntable.regression.fit`.
    """
    slopes = model.by_errors(angles, c)
    rows = np.ones(len(slopes), dtype=np.int64) if samples is None else samples
    return weights_of(model.chain, slopes, angles, beside_inputs(model, angles, c), noise, rows, std)


def least_noise(within: Array) -> Array:
    """Standard deviation (c,) of noise without which covariances (n, c, c) by errors of the table alone may have no
    inverse, as these move several channels at once."""
    return np.asarray(1e-6 * np.sqrt(np.mean(np.diagonal(within, axis1=1, axis2=2), axis=0)))


def beside_inputs(model: TableModel, angles: Array, c: Array) -> Array:
    """Change (n, c, b) of the readings by one standard uncertainty of each input beside the table."""
    inputs, columns = model.beside(angles, c)
    return np.asarray(columns * np.array([each.u for each in inputs]))


def weights_of(
    chain: Chain,
    slopes: Array,
    angles: Array,
    beside: Array,
    noise: Array,
    samples: Samples,
    std: Array | None = None,
) -> Weights:
    """As `weights`, for derivatives (n, c, k) of the readings with respect to the errors of the ``chain``, and their
    changes (n, c, b) by inputs beside it."""
    scaled = averaged(chain, slopes, samples) * (chain.std if std is None else std)
    constant = np.array([error.scope.constant for error in chain.errors], dtype=bool)
    redrawn, by_angle = _by_value(chain, scaled, angles)
    return Weights(
        np.einsum("nck,ndk->ncd", redrawn, redrawn) + np.diag(np.square(noise)),
        np.concatenate([scaled[..., constant], beside, by_angle], axis=-1),
    )


def _by_value(chain: Chain, scaled: Array, angles: Array) -> tuple[Array, Array]:
    """Of changes (n, c, k) of the readings by the errors, those that are redrawn from value to value.

    Returns
    -------
    redrawn : (n, c, k)
        By values of one position alone; zero elsewhere.
    by_angle : (n, c, q)
        By values that several positions of one angle share, a column for each.
    """
    redrawn, columns = scaled.copy(), [np.zeros((*scaled.shape[:2], 0))]
    for k, (error, numbers) in enumerate(zip(chain.errors, chain.groups(angles), strict=True)):
        if error.scope.constant:
            redrawn[..., k] = 0.0
        elif error.scope is Scope.ANGLE:
            shared = np.flatnonzero(np.bincount(numbers) > 1)
            here = numbers[:, None] == shared
            columns.append(scaled[..., k, None] * here[:, None, :])
            redrawn[here.any(axis=1), :, k] = 0.0
    return redrawn, np.concatenate(columns, axis=-1)


def averaged(chain: Chain, slopes: Array, samples: Samples) -> Array:
    """Derivatives (n, c, k) as one standard deviation of an error moves a mean over so many samples.

    Errors of scope ``sample`` average out with the root of their number, the others do not.
    """
    each = np.array([error.scope is Scope.SAMPLE for error in chain.errors], dtype=bool)
    return np.where(each, slopes / np.sqrt(samples)[:, None, None], slopes)


@dataclass(frozen=True, eq=False)
class SecondOrder:
    """Second order of the readings.

    Attributes
    ----------
    squares : (n, c, k) mean shift of the readings by the square of each error of the table
    mean : (n, c) mean shift by all
    redrawn : (n, c, q) standard deviations of the products that are new at a position
    shared : (n, c, r) changes by one standard deviation of those that several positions share
    """

    squares: Array
    mean: Array
    redrawn: Array
    shared: Array

    def added(self, weight: Weights) -> Weights:
        """The weights of the first order with those of the second."""
        return Weights(
            weight.within + np.einsum("nck,ndk->ncd", self.redrawn, self.redrawn),
            np.concatenate([weight.common, self.shared], axis=-1),
        )

    def shifts(self, gain: Array) -> tuple[Array, Array]:
        """Shift of coefficients with ``gain`` (p, n, c): the mean (p,), and columns (p, s) of unit variance."""
        mean = np.einsum("pnc,nc->p", gain, self.mean)
        redrawn = np.einsum("pnc,ncq->pnq", gain, self.redrawn).reshape(len(gain), -1)
        return mean, np.hstack([redrawn, np.einsum("pnc,ncr->pr", gain, self.shared)])


def second_order(model: TableModel, angles: Array, c: Array, samples: Samples) -> SecondOrder:
    """Second order of the readings for linear coefficients ``c`` (p,); ``samples`` (n,) rows behind each reading."""
    chain = model.chain
    std, errors, groups = chain.std, chain.errors, chain.groups(angles)
    H = _second_derivatives(model, angles, c)
    squares = 0.5 * np.einsum("nckk,k->nck", H, np.square(std))
    mean = squares.sum(axis=-1)
    redrawn, shared = [np.zeros((*mean.shape, 0))], [np.zeros((*mean.shape, 0))]
    for k, first in enumerate(errors):
        for m, other in enumerate(errors[: k + 1]):
            size = 0.5 * _spread_of_square(first) if k == m else 1.0
            column = size * std[k] * std[m] * H[..., k, m]
            if Scope.SAMPLE in (first.scope, other.scope):
                column = column / np.sqrt(samples)[:, None]
            if not column.any():
                continue
            numbers = np.unique(groups[k] * len(angles) + groups[m], return_inverse=True)[1].reshape(-1)
            several = np.flatnonzero(np.bincount(numbers) > 1)
            here = numbers[:, None] == several
            redrawn.append(np.where(here.any(axis=1)[:, None], 0.0, column)[..., None])
            shared.append(column[..., None] * here[:, None, :])
    return SecondOrder(squares, mean, np.concatenate(redrawn, axis=-1), np.concatenate(shared, axis=-1))


def _spread_of_square(error: Error) -> float:
    """Standard deviation of the square, in units of the variance."""
    distribution = error.distribution
    fourth = float(distribution.weights @ np.square(np.square(distribution.nodes - distribution.mean)))
    return float(np.sqrt(max(fourth / distribution.std**4 - 1.0, 0.0)))


def _second_derivatives(model: TableModel, angles: Array, c: Array) -> Array:
    """Second derivatives (n, c, k, k) of the readings by the errors of the table."""
    C_nb, slopes = model.chain.attitude(angles), model.chain.slopes(angles)
    turns = slopes @ np.swapaxes(C_nb, -1, -2)[:, None]  # dC/dchi = turn C, the turn in n
    k = slopes.shape[1]
    first, second = np.zeros((len(angles), k, 6)), np.zeros((len(angles), k, k, 6))
    for at, u_n in ((slice(0, 3), model.a_n), (slice(3, 6), model.w_n)):
        first[..., at] = u_n @ slopes
        # an error nearer the base stands on the left, whichever is which
        products = np.einsum("nki,nmij->nkmj", u_n @ turns, slopes)
        upper = np.triu(np.ones((k, k), dtype=bool))[..., None]
        second[..., at] = np.where(upper, products, np.swapaxes(products, 1, 2))
    H = np.einsum("nci,nkmi->nckm", model.by_inputs(angles, c), second)
    bend = model.bend_by_inputs(angles, c)
    if bend is not None:
        H = H + np.einsum("ncij,nki,nmj->nckm", bend, first, first)
    return np.asarray(H)
