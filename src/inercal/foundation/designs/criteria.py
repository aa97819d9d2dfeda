"""Worth of a plan: the covariance of the coefficients, and one number made of it.

With the errors chi that stay constant over a test taken as unknowns of unit prior variance, the information is a
sum over positions, ``M = blockdiag(0, I) + sum Z_j^T V_j^-1 Z_j`` with ``Z_j = [rows_j, common_j]``, and the
covariance of the coefficients is a block of its inverse. It equals that of generalised least squares,
``(X^T (V + C C^T)^-1 X)^-1``. The criteria are those of optimal design (Atkinson, Donev and Tobias, Optimum
Experimental Designs, with SAS, chapter 10).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.designs.candidates import Candidates
from inercal.foundation.inference.identifiability import Identifiability, identify, in_words


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
