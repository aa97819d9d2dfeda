"""Covariance of the readings of a test: the part redrawn at each position, and the part constant over the test."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.rigs.chain import Chain, Scope
from inercal.systems.turntable.model import TableModel

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
