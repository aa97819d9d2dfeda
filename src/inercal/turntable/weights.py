"""What the readings of a test are uncertain by: covariance redrawn at each position, and what is constant."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from inercal.rigs.chain import Chain, Scope
from inercal.turntable.model import TableModel

Array = NDArray[np.float64]
Samples: TypeAlias = NDArray[np.int64]
"""Rows behind each reading (n,)."""


@dataclass(frozen=True, eq=False)
class Weights:
    """What the readings are uncertain by.

    ``within`` (n, c, c) covariance redrawn at each position, noise and table; ``common`` (n, c, q) derivatives
    with respect to what is constant, in its standard deviations: errors of the table, then inputs beside it.
    """

    within: Array
    common: Array


def weights(
    model: TableModel,
    angles: Array,
    c: Array,
    noise: Array,
    std: Array | None = None,
    samples: Samples | None = None,
) -> Weights:
    """Covariance of the readings for coefficients ``c``, noise (c,) and errors of the table.

    ``std`` (k,) stands in for the standard deviations of the chain's errors; ``samples`` (n,) as in `fit`.
    """
    slopes = model.by_errors(angles, c)
    rows = np.ones(len(slopes), dtype=np.int64) if samples is None else samples
    return weights_of(model.chain, slopes, beside_inputs(model, angles, c), noise, rows, std)


def beside_inputs(model: TableModel, angles: Array, c: Array) -> Array:
    """Change (n, c, b) of the readings by one standard uncertainty of each input beside the table."""
    found, columns = model.beside(angles, c)
    return np.asarray(columns * np.array([each.u for each in found]))


def weights_of(
    chain: Chain, slopes: Array, beside: Array, noise: Array, samples: Samples, std: Array | None = None
) -> Weights:
    """As `weights`, for derivatives (n, c, k) of the readings with respect to the errors of the ``chain``, and their
    changes (n, c, b) by inputs beside it."""
    scaled = averaged(chain, slopes, samples) * (chain.std if std is None else std)
    constant = np.array([error.scope.constant for error in chain.errors], dtype=bool)
    redrawn = scaled[..., ~constant]
    return Weights(
        np.einsum("nck,ndk->ncd", redrawn, redrawn) + np.diag(np.square(noise)),
        np.concatenate([scaled[..., constant], beside], axis=-1),
    )


def averaged(chain: Chain, slopes: Array, samples: Samples) -> Array:
    """Derivatives (n, c, k) as one standard deviation of an error moves a mean over so many samples.

    Errors of scope ``sample`` average out with the root of their number, the others do not.
    """
    each = np.array([error.scope is Scope.SAMPLE for error in chain.errors], dtype=bool)
    return np.where(each, slopes / np.sqrt(samples)[:, None, None], slopes)
