"""A plan in figures, to be set beside others."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.designs.candidates import Candidates
from inercal.foundation.designs.criteria import Criterion, information_svd
from inercal.foundation.inference.identifiability import identify, in_words

_PART = 1e-6
"""Part of a coefficient in a null vector of unit length that is more than rounding."""


@dataclass(frozen=True, eq=False)
class PlanFigures:
    """Worth of a plan of positions.

    Attributes
    ----------
    name : of the plan
    positions : their number
    rank : number of coefficients it identifies, of p
    unidentified : the combinations of coefficients it does not identify, in words
    condition : of the design matrix in the orthonormal basis; inf where that has not its full rank
    d_efficiency : det(X^T X / N)^(1/b) of that matrix X (N, b); 1 is a perfect design
    u : (p,) standard uncertainties of the coefficients; inf where one is not identified
    rms_prediction : root of the mean prediction variance over the region; inf where part of it is not
        identified
    """

    name: str
    positions: int
    rank: int
    unidentified: tuple[str, ...]
    condition: float
    d_efficiency: float
    u: Array
    rms_prediction: float


def judge(name: str, plan: Candidates, basis: Array, prediction: Criterion) -> PlanFigures:
    """Figures of a plan.

    Parameters
    ----------
    name : str
    plan : Candidates
        The positions taken: coefficients, noise and constant errors.
    basis : (N, b)
        Functions at the positions that are orthonormal over all attitudes, for condition and D-efficiency.
    prediction : Criterion
        Its weights say where the prediction counts (`inercal.foundation.designs.criteria.i_criterion`).

    Raises
    ------
    ValueError
        A criterion without weights.
    """
    if prediction.weights is None:
        raise ValueError("found the D-criterion, expected one of prediction")
    p = len(plan.names)
    information = information_svd(plan)
    null = information.null_vectors[:, :p]
    u = np.sqrt(np.diag(information.unit_covariance)[:p])
    u[np.any(np.abs(null) > _PART, axis=0)] = np.inf
    unseen = null / information.scale[:p]  # in the coefficients' own units
    size = np.square(unseen) @ np.diag(prediction.weights)
    lost = np.einsum("ki,ij,kj->k", unseen, prediction.weights, unseen) > _PART**2 * size
    rms = math.inf if np.any(lost) else math.sqrt(prediction.value(information.unit_covariance[:p, :p]))
    condition, efficiency = in_basis(basis)
    return PlanFigures(
        name=name,
        positions=len(plan),
        rank=p - len(null),
        unidentified=tuple(in_words(v, plan.names) for v in null),
        condition=condition,
        d_efficiency=efficiency,
        u=u,
        rms_prediction=rms,
    )


def in_basis(basis: Array) -> tuple[float, float]:
    """Condition number and D-efficiency of positions from orthonormal functions (N, b) there; inf and 0 where the
    rank is not b."""
    terms = [str(k) for k in range(basis.shape[1])]
    information = identify(basis, terms, sizes=np.ones(len(terms)))
    if information.rank < len(terms):
        return math.inf, 0.0
    return information.condition, float(
        np.exp(np.mean(np.log(np.square(information.singular_values) / len(basis))))
    )
