"""Worth of a plan: the covariance of the coefficients, and one number made of it.

With the errors chi that stay constant over a test taken as unknowns of unit prior variance, the information is a
sum over positions, ``M = blockdiag(0, I) + sum Z_j^T V_j^-1 Z_j`` with ``Z_j = [rows_j, common_j]``, and the
covariance of the coefficients is a block of its inverse. It equals that of generalised least squares,
``(X^T (V + C C^T)^-1 X)^-1``. The criteria are those of optimal design (Atkinson, Donev and Tobias, Optimum
Experimental Designs, with SAS, chapter 10).

A plan in figures, to be set beside others.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.designs.candidates import Candidates
from inercal.foundation.inference.identifiability import Identifiability, identify, in_words

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


@dataclass(frozen=True, eq=False)
class Criterion:
    """Criterion that a design makes small: the determinant of the covariance, or ``trace(weights cov)``.

    ``weights`` (p, p) symmetric and not negative; None for the determinant.
    """

    name: str
    weights: Array | None = None

    def value(self, covariance: Array) -> float:
        """Logarithm of the determinant, or the trace, of a covariance (p, p); small is good."""
        if self.weights is None:
            # coefficients of different units: scaled first, so that nothing underflows
            std = np.sqrt(np.diag(covariance))
            return float(np.linalg.slogdet(covariance / np.outer(std, std))[1] + 2.0 * np.sum(np.log(std)))
        return float(np.sum(self.weights * covariance))


D = Criterion("D")
"""Determinant: the volume of the confidence ellipsoid; does not depend on the basis."""


def a_criterion(T: Array) -> Criterion:
    """A: the sum of the variances of ``T beta``, T (k, p)."""
    return Criterion("A", T.T @ T)


def i_criterion(region: Array) -> Criterion:
    """I: the mean variance of the prediction over a region.

    ``region`` (r, p), or (r, c, p) where c outputs, whose variances are added, are predicted at each place.
    """
    flat = region.reshape(-1, region.shape[-1])
    return Criterion("I", flat.T @ flat / len(region))


def information_svd(plan: Candidates) -> Identifiability:
    """Information of a plan on coefficients and constant errors together, the latter with unit prior.

    Its null vectors, if any, have no part in the constant errors.
    """
    p = len(plan.names)
    rows = plan.whitened.reshape(-1, plan.whitened.shape[-1])
    q = rows.shape[1] - p
    prior = np.hstack([np.zeros((q, p)), np.eye(q)])
    return identify(np.vstack([rows, prior]), (*plan.names, *(f"chi_{k}" for k in range(q))))


def covariance(plan: Candidates) -> Array:
    """Covariance (p, p) of the coefficients estimated by generalised least squares from a plan.

    Raises
    ------
    ValueError
        The plan leaves a combination of coefficients unidentified; the message names it.
    """
    information, p = information_svd(plan), len(plan.names)
    if information.rank < len(information.names):
        unknown = "; ".join(in_words(v[:p], plan.names) for v in information.null_vectors)
        raise ValueError(f"the {len(plan)} positions do not identify {unknown}")
    return information.unit_covariance[:p, :p]
