"""Least squares: linear by singular value decomposition, nonlinear by Levenberg-Marquardt (SciPy)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.inference.identifiability import Identifiability, identify


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
    """Solve ``y = A beta + e``, A (n, p), y (n,), in the (generalised) least-squares sense.

    ``names`` (p,) are terms for the words about rank and null vectors; ``covariance`` the variances (n,) or the matrix
    (n, n) of the observations, unit variance if absent. Columns are scaled to unit length before the decomposition, so
    that rank and condition do not depend on units, as long as these leave the columns within some 12 decades of each
    other (Golub and Van Loan, Matrix Computations, 5.3.7 and 5.5). Raises ValueError for shapes that do not fit, or a
    covariance that is not positive definite.
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


Function = Callable[[Array], Array]


@dataclass(frozen=True)
class NonlinearFit:
    """A minimum of the sum of squares of whitened residuals.

    ``x`` (p,), ``residuals`` (n,) and ``jacobian`` (n, p) at the minimum, ``converged`` with the solver's
    words in ``message``, ``identifiability`` of the Jacobian. Where a residual or derivative was not finite,
    ``x`` is the start, the Jacobian 0 and the rank 0.
    """

    x: Array
    residuals: Array
    jacobian: Array
    converged: bool
    message: str
    identifiability: Identifiability

    @property
    def chi2(self) -> float:
        """Sum of squared residuals."""
        return float(self.residuals @ self.residuals)

    @property
    def dof(self) -> int:
        """Number of residuals less the rank."""
        return len(self.residuals) - self.identifiability.rank

    @property
    def unit_covariance(self) -> Array:
        """(p, p) covariance for residuals of unit variance (Gauss-Newton)."""
        return self.identifiability.unit_covariance

    def gain(self) -> Array:
        """(p, n): shift of the parameters per unit of each residual, ``-(J^T J)^-1 J^T``."""
        return -self.unit_covariance @ self.jacobian.T


class _NotFiniteError(ArithmeticError):
    """A residual or derivative that is not a number; MINPACK would take it for a minimum."""


def solve(
    residuals: Function, jacobian: Function, start: Array, names: Sequence[str], scale: Array
) -> NonlinearFit:
    """Minimise ``|residuals(x)|^2`` from ``start`` (p,) by SciPy's `least_squares`, MINPACK's Levenberg-Marquardt (More
    1978).

    ``residuals``, (p,) -> (n,), are whitened, n >= p; ``jacobian``, (p,) -> (n, p), is their derivative; ``names`` are
    terms for the words about conditioning; ``scale`` (p,) is the typical size of each parameter, for the solver and the
    condition number. Raises ValueError for fewer residuals than parameters, or a scale that is not positive.
    """
    from scipy.optimize import least_squares

    try:
        solution = least_squares(
            _finite(residuals), _finite(np.positive)(start), jac=_finite(jacobian), method="lm",
            x_scale=scale, xtol=1e-12, ftol=1e-12,
        )  # fmt: skip
    except (_NotFiniteError, np.linalg.LinAlgError) as error:
        r = np.asarray(residuals(start), dtype=float)
        J = np.zeros((len(r), len(start)))
        return NonlinearFit(start, r, J, False, str(error), identify(J, names, scale))
    J = np.asarray(solution.jac, dtype=float)
    return NonlinearFit(
        solution.x, solution.fun, J, solution.status > 0, str(solution.message), identify(J, names, scale)
    )


def _finite(function: Function) -> Function:
    """The function, made to raise where a value is not finite."""

    def checked(x: Array) -> Array:
        value = np.asarray(function(x), dtype=float)
        if not np.all(np.isfinite(value)):
            raise _NotFiniteError("The residuals or their derivatives are not finite.")
        return value

    return checked
