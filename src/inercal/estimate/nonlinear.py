"""Nonlinear least squares: Levenberg-Marquardt (SciPy) on analytic Jacobians."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from inercal.arrays import Array
from inercal.estimate.identifiability import Identifiability, identify

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
    """Minimise ``|residuals(x)|^2`` from ``start``.

    Parameters
    ----------
    residuals : callable, (p,) -> (n,)
        Whitened residuals, n >= p.
    jacobian : callable, (p,) -> (n, p)
        Their derivative.
    start : (p,)
        First guess.
    names : sequence of str
        Terms, for the words about conditioning.
    scale : (p,)
        Typical size of each parameter, for the solver and for the condition number.

    Raises
    ------
    ValueError
        Fewer residuals than parameters, or a scale that is not positive.

    Notes
    -----
    SciPy's `least_squares` with MINPACK's Levenberg-Marquardt (More 1978) does the iteration.
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
