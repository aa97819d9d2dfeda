"""One channel's Allan variances and their fits by generalised least squares, in samples.

Squared coefficients (5,) are in the order of `inercal.foundation.instruments.noise.SYMBOLS`: N, B, K, R, Q.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.instruments.noise import SYMBOLS
from inercal.foundation.noise.covariance import Sums

RAMP = SYMBOLS.index("R")

_ROUNDS, _CLOSE = 40, 1e-5

_WIDEST = 1000.0  # of an upper limit, in standard deviations of a term that is not there


@dataclass(frozen=True, eq=False)
class TermsFit:
    """Terms fitted together: indices ``seen`` of those above zero, and their ``squares`` (5,).

    ``covariance`` (p, p) of the squares of ``seen`` and the ``weights`` (p, k) by which they follow from the variances.
    """

    seen: tuple[int, ...]
    squares: Array
    covariance: Array
    weights: Array


@dataclass(frozen=True, eq=False)
class AllanCurve:
    """Allan ``variances`` (k,) over ``sums.lengths`` samples, and ``terms`` (k, 5): those of unit coefficients.

    Gaps left the ``share`` (k,) of the differences of adjacent means.
    """

    variances: Array
    terms: Array
    share: Array
    sums: Sums

    def without_first(self) -> AllanCurve:
        """The curve without its shortest averaging time."""
        return AllanCurve(self.variances[1:], self.terms[1:], self.share[1:], self.sums.without_first())

    def covariance(self, squares: Array) -> Array:
        """Covariance (k, k) of the variances under noise of these squared coefficients."""
        kinds = np.delete(squares, RAMP)  # N, B, K, Q
        covariance = self.sums.covariance(kinds, float(squares[RAMP]))
        return covariance / np.sqrt(np.outer(self.share, self.share))

    def whitened(self, squares: Array) -> tuple[Array, Array, Array]:
        """Terms (k, 5) and variances (k,) where that covariance is the identity, and its lower factor."""
        L = np.linalg.cholesky(self.covariance(squares))
        both = np.linalg.solve(L, np.column_stack([self.terms, self.variances]))
        return both[:, :-1], both[:, -1], np.asarray(L)

    def squares(self, columns: list[int]) -> Array | None:
        """Squared coefficients (5,), none below zero and 0 outside ``columns``; None for a ramp without noise."""
        from scipy.optimize import nnls

        # at first as if every variance were known in proportion to its size and its number of means
        weight = 1.0 / (self.variances * np.sqrt(self.sums.lengths))
        A, y = self.terms * weight[:, None], self.variances * weight
        squares = np.zeros(len(SYMBOLS))
        for count in range(_ROUNDS):
            size = np.linalg.norm(A[:, columns], axis=0)
            fitted = np.zeros(len(SYMBOLS))
            fitted[columns] = nnls(A[:, columns] / size, y)[0] / size
            new = fitted if count < 5 else 0.5 * (squares + fitted)  # lest it go to and fro
            if not np.any(np.delete(new, RAMP)):
                return None
            moved = np.max(np.abs(self.terms @ (new - squares)) / (self.terms @ new))
            squares = np.where(fitted > 0.0, new, 0.0)
            if moved < _CLOSE:
                break
            A, y, _ = self.whitened(squares)
        return squares

    def misfit(self, squares: Array) -> tuple[float, int]:
        """Sum of squared residuals in units of their covariance, and its degrees of freedom.

        Of cube roots of the variances, which are near normal also where these have few degrees of freedom (Wilson
        and Hilferty), so that the sum is near chi-square.
        """
        C, expected = self.covariance(squares), self.terms @ squares
        short = np.diag(C) / (9.0 * expected**2)  # 2 / (9 dof)
        residuals = 3.0 * expected * (np.cbrt(self.variances / expected) - 1.0 + short)
        chi2 = float(np.sum(np.linalg.solve(np.linalg.cholesky(C), residuals) ** 2))
        return chi2, len(self.variances) - int(np.count_nonzero(squares))

    def eliminated(self, squares: Array, significant: float) -> Array:
        """Leave terms out, the least significant first, while that one is below ``significant``."""
        while True:
            seen = np.flatnonzero(squares).tolist()
            without = [self.squares([j for j in seen if j != i]) if len(seen) > 1 else None for i in seen]
            remaining = [
                np.inf if rest is None else self.asked_for(i, rest)
                for i, rest in zip(seen, without, strict=True)
            ]
            least = int(np.argmin(remaining))
            rest = without[least]
            if rest is None or remaining[least] >= significant:
                return squares
            squares = rest

    def asked_for(self, i: int, squares: Array) -> float:
        """Standard deviations by which a fit without term ``i`` asks for it, under the noise of that fit."""
        apart, y, _ = self._apart(i, squares)
        return float(apart @ y / np.linalg.norm(apart))

    def _apart(self, i: int, squares: Array, under: Array | None = None) -> tuple[Array, Array, Array]:
        """The part of term ``i`` that the others do not have, whitened, the variances, and that which they have.

        Whitened by the noise of ``under``, by default that of ``squares``.
        """
        W, y, _ = self.whitened(squares if under is None else under)
        seen = [j for j in np.flatnonzero(squares) if j != i]
        size = np.linalg.norm(W[:, seen], axis=0)
        shared = np.linalg.lstsq(W[:, seen] / size, W[:, i], rcond=None)[0] / size
        return W[:, i] - W[:, seen] @ shared, y, shared

    def fitted(self, squares: Array) -> TermsFit:
        """A fit with its covariance."""
        seen = np.flatnonzero(squares)
        W, _, L = self.whitened(squares)
        size = np.linalg.norm(W[:, seen], axis=0)
        normal = np.linalg.inv((W[:, seen] / size).T @ (W[:, seen] / size)) / np.outer(size, size)
        weights = np.linalg.solve(L.T, W[:, seen])
        return TermsFit(tuple(seen.tolist()), squares, normal, (weights @ normal).T)

    def moves(self, fit: TermsFit, i: int) -> Array:
        """Decrease of the squares (p,) of ``fit.seen`` if term ``i`` were fitted too; 0 for a negative term."""
        apart, y, shared = self._apart(i, fit.squares)
        return max(float(apart @ y / (apart @ apart)), 0.0) * shared

    def dof(self, fit: TermsFit, which: int) -> float:
        """Degrees of freedom of Student's t for the coefficient ``fit.seen[which]``.

        See `inercal.foundation.noise.coefficients.noise_coefficients`.
        """
        i, w, variance = fit.seen[which], fit.weights[which], fit.covariance[which, which]
        if i != RAMP:
            alone = np.where(np.arange(len(SYMBOLS)) == i, fit.squares, 0.0)
            return float(fit.squares[i] ** 2 / (w @ self.covariance(alone) @ w))
        # u^2 of R is that of R^2 over 4 R^2, and a function of all the squares
        gradient = np.zeros(len(fit.seen))
        for k, j in enumerate(fit.seen):
            step = np.where(np.arange(len(SYMBOLS)) == j, 1e-4 * fit.squares, 0.0)
            more = w @ self.covariance(fit.squares + step) @ w / (1.0001 if j == RAMP else 1.0)
            gradient[k] = (more - variance) / step[j]
        return float(2.0 * variance**2 / (gradient @ fit.covariance @ gradient))

    def upper_limit(self, fit: TermsFit, i: int) -> float:
        """One-sided 95 % limit of the square of a term that is not in the fit, to about 1 %.

        The smallest value under whose own noise an estimate as small as the one found has a probability below 5 %.
        The estimate is taken for gamma distributed (Pearson III), as skew as the term's own scatter makes it.
        """
        from scipy.special import chdtri

        apart, _, _ = self._apart(i, fit.squares)
        u0 = 1.0 / float(np.linalg.norm(apart))

        def excluded(square: float) -> bool:
            under = fit.squares.copy()
            under[i] = square
            apart, y, _ = self._apart(i, fit.squares, under)
            u = 1.0 / float(np.linalg.norm(apart))
            chi2 = max(float(apart @ y) * u**2, 0.0)
            own = 0.0 if i == RAMP else max(u**2 - u0**2, 0.0)
            # that of chi-square with 2 square^2 / own degrees of freedom, diluted by the rest of the scatter
            skewness = 2.0 * own**2 / (square * u**3)
            nu = 8.0 / max(skewness, 1e-3) ** 2
            return bool(square - (1.0 - chdtri(nu, 0.95) / nu) * np.sqrt(nu / 2.0) * u >= chi2)

        low, high = u0, _WIDEST * u0
        while high > 1.01 * low:
            middle = np.sqrt(low * high)
            low, high = (low, middle) if excluded(middle) else (middle, high)
        return float(high)
