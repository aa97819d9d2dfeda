"""Evidence of a fit on errors outside its model: is one seen, and what does it do to the values?

A fit leaves residuals r of covariance ``V = L L^T``; A are its whitened columns. An error with columns X would change
r by ``X b``. What a fit cannot take up of X is ``(1 - A A^+) L^-1 X``; Q is its orthonormal basis, and
``S = |Q^T z|^2`` with ``z = (1 - A A^+) L^-1 r`` is the score test: chi-square where V is known, F where residuals
tell its scale (Breusch and Pagan, Review of Economic Studies 47 (1980) 239).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array

SEEN = 0.02
"""Length of a unit column outside the fit from which it shows."""

_RANK = 1e-10
"""Singular value of the fitted columns, or eigenvalue of what they leave of others, over the largest, below which it is
rounding."""


@dataclass(frozen=True, eq=False)
class AskedError:
    """One error beside a fit of n residuals, of which m combinations show.

    ``basis`` (n, m) orthonormal; ``size`` (k, m) parameters of the error that make each; ``reach`` (p, m) shift of the
    p values by each.
    """

    basis: Array
    size: Array
    reach: Array

    @property
    def count(self) -> int:
        """Combinations that show."""
        return int(self.basis.shape[1])


@dataclass(frozen=True, eq=False)
class FitEvidence:
    """Residuals of a fit, white, and all that it takes to ask them.

    Attributes
    ----------
    z : (n,)
        White residuals, orthogonal to the fitted columns.
    inverse : (n, n) or None
        Of the root of the covariance, by which residuals are whitened. None: columns are white, and rows behind those
        of ``z`` act on the values alone.
    fitted : (n, r)
        Orthonormal basis of the fitted columns, whitened.
    gain : (p, n)
        Change of the values by each residual.
    noise_dof : float
        Degrees of freedom of the noise in the covariance beside the residuals: inf where the noise is stated, 0 where
        the residuals alone tell it.
    more : (squares, dof)
        Sum of squares, and degrees of freedom, of residuals that no question reaches and that are left out of ``z``.
    """

    z: Array
    inverse: Array | None
    fitted: Array
    gain: Array
    noise_dof: float
    more: tuple[float, float] = (0.0, 0.0)

    @property
    def dof(self) -> float:
        """Degrees of freedom of the residuals."""
        return float(self.fitted.shape[0] - self.fitted.shape[1] + self.more[1])

    @property
    def squares(self) -> float:
        """Sum of squares of the white residuals."""
        return float(self.z @ self.z) + self.more[0]

    def white(self, columns: Array) -> Array:
        """Columns, whitened."""
        return columns[: len(self.z)] if self.inverse is None else np.asarray(self.inverse @ columns)

    def beside(self, columns: Array) -> Array:
        """Columns (n, k) or (n,) less all that the fit takes up, whitened."""
        white = self.white(columns)
        return np.asarray(white - self.fitted @ (self.fitted.T @ white))

    def ask(self, columns: Array) -> AskedError:
        """The combinations of an error's ``columns`` (n, k) that show."""
        return self.ask_all([columns])[0]

    def ask_all(self, errors: Sequence[Array]) -> list[AskedError]:
        """The combinations that show of several errors, each of columns (n, k)."""
        if not errors:
            return []
        columns = np.hstack(errors)
        white = self.white(columns)
        length = np.linalg.norm(white, axis=0)
        length = np.where(length > 0.0, length, 1.0)
        left = white / length
        left -= self.fitted @ (self.fitted.T @ left)
        moved = self.gain @ columns
        ends = np.cumsum([error.shape[1] for error in errors]).tolist()
        made = []
        for begin, end in zip([0, *ends[:-1]], ends, strict=True):
            own = left[:, begin:end]
            squares, vectors = np.linalg.eigh(own.T @ own)
            shown = squares > SEEN**2
            by = vectors[:, shown] / np.sqrt(squares[shown])
            size = by / length[begin:end, None]
            made.append(AskedError(own @ by, size, moved[:, begin:end] @ size))
        return made

    def explained(self, asked: AskedError) -> float:
        """Sum of squares that the error takes away."""
        return float(np.sum(np.square(asked.basis.T @ self.z)))

    def chance(self, asked: AskedError, by_residuals: bool = False) -> float:
        """Probability that a sound fit explains as much by this error; ``by_residuals``: as if these alone told the
        noise, which ranks errors where all doubt has gone."""
        from scipy.special import chdtrc, fdtrc

        m, S = asked.count, self.explained(asked)
        nu = 0.0 if by_residuals else self.noise_dof
        if m == 0:
            return 1.0
        if math.isinf(nu):
            return float(chdtrc(m, S))
        left = max(self.squares - S, 1e-12 * self.squares) + nu
        free = max(self.dof - m, 1) + nu
        return float(fdtrc(m, free, S / m * free / left)) if left > 0.0 else 1.0

    def shift(self, asked: AskedError) -> Array:
        """Shift (p,) of the values by the error of the size that the residuals show."""
        return np.asarray(asked.reach @ (asked.basis.T @ self.z))

    def without(self, asked: AskedError) -> FitEvidence:
        """The evidence with this error fitted as well."""
        left = self.z - asked.basis @ (asked.basis.T @ self.z)
        return FitEvidence(
            left, self.inverse, np.hstack([self.fitted, asked.basis]), self.gain, self.noise_dof, self.more
        )


def evidence(
    residuals: Array, covariance: Array, fitted: Array, gain: Array, noise_dof: float
) -> FitEvidence:
    """The evidence of a fit.

    Parameters
    ----------
    residuals : (n,)
    covariance : (n, n)
        Of the residuals' readings.
    fitted : (n, k)
        Columns of all that was fitted, nuisances last.
    gain : (p, n)
        Change of the values by each reading.
    noise_dof : float
        As in `FitEvidence`.

    Raises
    ------
    LinAlgError
        The covariance is not positive definite.
    """
    inverse = np.linalg.inv(np.linalg.cholesky(covariance))
    white = inverse @ fitted
    length = np.linalg.norm(white, axis=0)
    basis, s, _ = np.linalg.svd(white / np.where(length > 0.0, length, 1.0), full_matrices=False)
    basis = basis[:, s > _RANK * s.max(initial=0.0)]
    z = inverse @ residuals
    return FitEvidence(z - basis @ (basis.T @ z), inverse, basis, gain, noise_dof)


def of_normal_equations(
    H: Array, g: Array, slope: Array, squares: float, dof: float, noise_dof: float
) -> tuple[FitEvidence, Array]:
    """The evidence of a fit whose nuisances are eliminated, and the columns (n, q) of what is asked in it.

    Parameters
    ----------
    H, g : (p + q, p + q), (p + q,)
        Normal equations of the p coefficients, at their solution, and behind them of q columns that are asked.
    slope : (v, p)
        Derivatives of the values by the coefficients.
    squares, dof : float
        Of all residuals of the fit.
    noise_dof : float
        As in `FitEvidence`.
    """
    p = slope.shape[1]
    size = 1.0 / np.sqrt(np.where(np.diag(H) > 0.0, np.diag(H), 1.0))
    scaled = H * np.outer(size, size)
    root = np.linalg.cholesky(scaled[:p, :p])
    by = np.linalg.solve(root, scaled[:p, p:])
    rest = scaled[p:, p:] - by.T @ by
    values, vectors = np.linalg.eigh(0.5 * (rest + rest.T))
    kept = values > _RANK * max(float(values[-1]), _RANK)
    length = np.sqrt(values[kept])
    score = size[p:] * g[p:] - by.T @ np.linalg.solve(root, size[:p] * g[:p])
    z = np.concatenate([np.zeros(p), vectors[:, kept].T @ score / length])
    columns = np.vstack([by, length[:, None] * vectors[:, kept].T]) / size[p:]
    n = len(z)
    gain = np.hstack([slope * size[:p] @ np.linalg.inv(root).T, np.zeros((len(slope), n - p))])
    more = max(squares - float(z @ z), 0.0), dof - (n - p)
    return FitEvidence(z, None, np.eye(n)[:, :p], gain, noise_dof, more), columns
