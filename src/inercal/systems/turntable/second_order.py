"""Second order of a table's errors: what their squares and products do to the readings (GUM 5.1.2 note, F.2.4.4).

To second order the errors chi move a reading by ``J_k chi_k + H_kl chi_k chi_l / 2``. The squares have the mean
``H_kk s_k^2 / 2``, by which readings are corrected; about it, squares and products are uncorrelated with each other
and, for symmetric distributions, with the errors themselves. Each is therefore one more error of the readings, with the
standard deviation ``s_k s_l``, or ``s_k^2 sqrt(kurtosis - 1)`` for a square, and takes a new value where either of its
two does. (A latitude multiplies what is fitted, and needs a fit on either side: `positions.latitude`.)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.rigs.chain import Error, Scope
from inercal.systems.turntable.model import TableModel
from inercal.systems.turntable.weights import Samples, Weights


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
