"""Linear least squares by singular value decomposition, with rank and null vectors in terms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inercal.arrays import Array
from inercal.estimate.identifiability import Identifiability, identify


@dataclass(frozen=True)
class LinearFit:
    """Solution of ``y = A beta + e``.

    ``beta`` (p,), ``unit_covariance`` (p, p) for e of unit variance (of the weighted problem),
    ``residuals`` (n,) = y - A beta, ``chi2`` the weighted sum of their squares, ``dof`` = n - rank,
    ``identifiability`` rank, condition and null vectors. With a rank below p, ``beta`` is the solution of
    minimum length in the scaled parameters and the null vectors name what it cannot say.
    """

    beta: Array
    unit_covariance: Array
    residuals: Array
    chi2: float
    dof: int
    identifiability: Identifiability

    @property
    def s2(self) -> float:
        """Residual variance chi2/dof of an observation of unit weight; NaN without degrees of freedom."""
        return self.chi2 / self.dof if self.dof > 0 else float("nan")


def least_squares(A: Array, y: Array, names: Sequence[str], covariance: Array | None = None) -> LinearFit:
    """Solve ``y = A beta + e`` in the (generalised) least-squares sense.

    Parameters
    ----------
    A : (n, p)
        Design matrix.
    y : (n,)
        Observations.
    names : sequence of str, length p
        Terms, for the words about rank and null vectors.
    covariance : (n,) or (n, n), optional
        Variances, or the full covariance matrix, of the observations; unit variance if absent.

    Raises
    ------
    ValueError
        Shapes that do not fit, or a covariance that is not positive definite.

    Notes
    -----
    Columns are scaled to unit length before the decomposition, so that rank and condition do not depend on
    units, as long as these leave the columns within some 12 decades of each other (Golub and Van Loan,
    Matrix Computations, 5.3.7 and 5.5).
    """
    n, p = A.shape
    if y.shape != (n,) or len(names) != p:
        raise ValueError(f"A is {A.shape}, expected y of ({n},) and {p} names")
    Aw, yw = whiten(A, covariance), whiten(y, covariance)
    identified = identify(Aw, names)
    beta = identified.solution(yw)
    chi2 = float(np.sum((yw - Aw @ beta) ** 2))
    return LinearFit(beta, identified.unit_covariance, y - A @ beta, chi2, n - identified.rank, identified)


def whiten(a: Array, covariance: Array | None) -> Array:
    """``L^-1 a`` with L L^T the covariance of the rows of ``a`` ((n,) or (n, k)); variances may be (n,)."""
    if covariance is None:
        return a
    if covariance.ndim == 1:
        if not np.all(covariance > 0):
            raise ValueError("found a variance that is not positive")
        root = np.sqrt(covariance)
        return a / (root if a.ndim == 1 else root[:, None])
    try:
        factor = np.linalg.cholesky(covariance)
        if not np.all(np.isfinite(factor)):  # LAPACK lets NaN pass
            raise np.linalg.LinAlgError
    except np.linalg.LinAlgError as error:
        raise ValueError("the covariance of the observations is not positive definite") from error
    return np.linalg.solve(factor, a)
