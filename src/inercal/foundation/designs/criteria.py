"""Worth of a plan of positions: candidates, the covariance of the coefficients, and one number made of it.

A candidate is a position: its rows are linear in the coefficients, with their noise, and with the errors that all
positions have in common. The limits of the axes and of sensitivity say which candidates a plan may take.

With the errors chi that stay constant over a test taken as unknowns of unit prior variance, the information is a sum
over positions, ``M = blockdiag(0, I) + sum Z_j^T V_j^-1 Z_j`` with ``Z_j = [rows_j, common_j]``, and the covariance of
the coefficients is a block of its inverse. It equals that of generalised least squares,
``(X^T (V + C C^T)^-1 X)^-1``. The criteria are those of optimal design (Atkinson, Donev and Tobias, Optimum
Experimental Designs, with SAS, chapter 10).

Plans are compared by figures that do not depend on the way the model is written: drift is a function on the unit
sphere, of constant, linear and quadratic terms. In their orthonormal basis a change of the coefficients has the size of
the change of drift, so that condition numbers and efficiencies are those of the plan alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.errors import InputError
from inercal.foundation.inference.identifiability import Identifiability, few_terms, identify, in_words

Mask = NDArray[np.bool_]


def insensitive(candidates: Candidates, indices: ArrayLike, limit: float, n: int) -> Mask:
    """Which candidates have sensitivity indices below a limit: the constraint of Zhao et al. 2023.

    Parameters
    ----------
    candidates : Candidates
    indices : (m,)
        Of each candidate the largest first-order index of the factors and outputs in question. A position
        without an index (NaN) is left out.
    limit : float
    n : int
        Number of positions that are to be chosen.

    Returns
    -------
    (m,) bool

    Raises
    ------
    InputError
        The remaining candidates are too few for ``n`` positions, or do not identify the coefficients.

    Notes
    -----
    An index is a share of a variance and not its size: a position may pass because all its errors are large.
    """
    mask = np.asarray(np.asarray(indices, dtype=float) < limit)
    require(candidates, mask, n, repeats=False, where=f"sensitivity limit {limit:g}")
    return mask


def require(candidates: Candidates, allowed: Mask, n: int, repeats: bool, where: str) -> None:
    """Make sure that ``n`` of the ``allowed`` (m,) candidates can identify the coefficients.

    Raises
    ------
    InputError
        They are too few, with the number that remain; or no choice among them identifies the coefficients, with
        the combination that stays unknown.
    """
    m, remain = len(candidates), int(np.sum(allowed))
    observations, p = candidates.rows.shape[1:]
    least = -(-p // observations)
    if n < least:
        raise InputError(where, f"found {n} positions, expected {least} or more for {p} coefficients")
    if remain < (1 if repeats else n):
        raise InputError(where, f"found {remain} of {m} candidates that remain, expected {n} or more")
    information = identify(candidates.whitened[allowed, :, :p].reshape(-1, p), candidates.names)
    if information.rank < p:
        unknown = "; ".join(in_words(v, candidates.names) for v in few_terms(information.null_vectors))
        raise InputError(
            where,
            f"found that the {remain} of {m} candidates that remain identify {information.rank} of {p} coefficients, "
            f"not {unknown}",
        )


#: the functions of `basis`, in their order
NAMES = ("1", "x", "y", "z", "xy", "xz", "yz", "xx-yy", "zz")


def basis(a: ArrayLike) -> Array:
    """The nine functions 1, √3 a, √15 axay, √15 axaz, √15 ayaz, √15/2 (ax²-ay²), √5/2 (3az²-1).

    Parameters
    ----------
    a : (*batch, 3)
        Unit vectors, for example gravity on the instrument's axes in units of the site's.

    Returns
    -------
    (*batch, 9) orthonormal over the sphere: the mean of f_i f_k is one for i = k and zero otherwise
    """
    x, y, z = np.moveaxis(np.asarray(a, dtype=float), -1, 0)
    r3, r5, r15 = math.sqrt(3.0), math.sqrt(5.0), math.sqrt(15.0)
    linear = [np.ones_like(x), r3 * x, r3 * y, r3 * z]
    mixed = [r15 * x * y, r15 * x * z, r15 * y * z]
    return np.stack([*linear, *mixed, 0.5 * r15 * (x * x - y * y), 0.5 * r5 * (3.0 * z * z - 1.0)], axis=-1)


@dataclass(frozen=True, eq=False)
class Candidates:
    """Positions that may be taken, or that are taken.

    The observations of position j are ``y_j = rows_j beta + common_j chi + e_j``: chi has unit variance and one
    value throughout the test, e_j is drawn anew at each position. A set of positions then has the covariance
    ``blockdiag(variance) + C C^T`` with C the stacked ``common``.

    Attributes
    ----------
    names : (p,) coefficients
    rows : (m, c, p) c observations of each position, linear in the coefficients
    variance : (m, c, c), or (m, c) where they are independent: noise and the errors redrawn at each position
    common : (m, c, q) effect of one standard deviation of each constant error; None where there are none

    Raises
    ------
    ValueError
        Shapes that do not fit, or a variance that is not positive definite.
    """

    names: tuple[str, ...]
    rows: Array
    variance: Array
    common: Array | None = None

    def __post_init__(self) -> None:
        """Refuse shapes that do not fit."""
        if self.rows.ndim != 3 or self.rows.shape[-1] != len(self.names):
            raise ValueError(f"found rows {self.rows.shape}, expected (m, c, {len(self.names)})")
        m, c, _ = self.rows.shape
        if self.variance.shape not in ((m, c), (m, c, c)):
            raise ValueError(f"found variance {self.variance.shape}, expected {(m, c)} or {(m, c, c)}")
        if self.common is not None and self.common.shape[:-1] != (m, c):
            raise ValueError(f"found common {self.common.shape}, expected ({m}, {c}, q)")

    def __len__(self) -> int:
        """Number of positions m."""
        return len(self.rows)

    @cached_property
    def whitened(self) -> Array:
        """(m, c, p + q) rows and common columns for noise of unit covariance at each position."""
        both = self.rows if self.common is None else np.concatenate([self.rows, self.common], axis=-1)
        variance = self.variance
        if variance.ndim == 2:
            if not np.all(variance > 0.0):
                raise ValueError("found a variance that is not positive")
            return np.asarray(both / np.sqrt(variance)[..., None])
        try:
            factor = np.linalg.cholesky(variance)
        except np.linalg.LinAlgError as error:
            raise ValueError("found a covariance of a position that is not positive definite") from error
        return np.linalg.solve(factor, both)

    def take(self, chosen: ArrayLike) -> Candidates:
        """The positions of these indices, or of this mask, in that order."""
        at = np.asarray(chosen)
        common = None if self.common is None else self.common[at]
        return replace(self, rows=self.rows[at], variance=self.variance[at], common=common)


def plain(names: tuple[str, ...], rows: Array) -> Candidates:
    """Candidates with readings of unit variance and a perfect rig: the classical design problem.

    ``rows`` (m, p), or (m, c, p) for several observations at each position.
    """
    stacked = rows[:, None] if rows.ndim == 2 else rows
    return Candidates(names, stacked, np.ones(stacked.shape[:2]))


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
