"""Which poses or turns lie off all others, and whether half of them foretells the other half: by leaving out rows.

Both questions are about a fit made linear at its minimum. Its rows belong to items (a pose, a turn); leaving out an
item leaves out its rows. The variance is a known part plus one of unknown size, which grows as stated and is found from
the scatter of the rows that are kept.

Outlying items: the F statistic of each when it alone is left out (externally studentised), the largest at Bonferroni's
bound over all, again after each removal, and in the end as many as the last significant step counts: Rosner's
generalised many-outlier procedure (Technometrics 25 (1983) 165), so that two outliers do not hide each other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.systems.imu.limits import LIMITS


class Added(NamedTuple):
    """The answer of a fit about q parameters that it lacks: likeliest sizes ``estimate`` (q,) with ``u`` (q,), the
    ``probability`` of so much by chance, and what they do to those it has, ``shifts`` (P, q)."""

    estimate: Array
    u: Array
    probability: float
    shifts: Array


@dataclass(frozen=True)
class LinearisedFit:
    """A fit made linear: n items of d rows each.

    ``residuals`` (n, d) where no other data pull the parameters, and their ``jacobian`` (n, d, P); ``known`` (n d, n d)
    the known part of their covariance, and ``growth`` (n,) how the unknown part is shared; ``information`` (P, P) that
    of all other data, with ``fixed`` its rank.
    """

    residuals: Array
    jacobian: Array
    known: Array
    growth: Array
    information: Array
    fixed: int = 0

    @classmethod
    def beside(
        cls, residuals: Array, jacobian: Array, known: Array, growth: Array, other: Array, left: Array
    ) -> LinearisedFit:
        """A fit to ``residuals`` (n, d) at the minimum, beside others ``left`` (k,) of jacobian ``other``."""
        information = other.T @ other
        size = np.where(np.diag(information) > 0.0, np.sqrt(np.diag(information)), 1.0)
        pull, _, fixed, _ = np.linalg.lstsq(other / size, left, rcond=1e-9)
        return cls(residuals - jacobian @ (pull / size), jacobian, known, growth, information, int(fixed))

    def __len__(self) -> int:
        """Number of items."""
        return len(self.residuals)

    def only(self, kept: NDArray[np.bool_]) -> LinearisedFit:
        """The fit to a part of the items, a mask (n,)."""
        rows = np.repeat(kept, self.residuals.shape[1])
        return replace(
            self,
            residuals=self.residuals[kept],
            jacobian=self.jacobian[kept],
            known=self.known[np.ix_(rows, rows)],
            growth=self.growth[kept],
        )

    @property
    def dof(self) -> int:
        """Degrees of freedom: rows, less the parameters that the other data do not fix."""
        return int(self.residuals.size - self.jacobian.shape[2] + self.fixed)

    def _whitened(self, variance: float) -> tuple[Array, Array, Array]:
        """Factor L (n d, n d) of the covariance of that ``variance``, and Jacobian and residuals by L^-1."""
        from scipy.linalg import solve_triangular

        V = self.known + np.diag(np.repeat(variance * self.growth, self.residuals.shape[1]))
        L = np.asarray(np.linalg.cholesky(V), dtype=np.float64)
        rows = np.column_stack([self.jacobian.reshape(len(V), -1), self.residuals.ravel()])
        white = np.asarray(solve_triangular(L, rows, lower=True), dtype=np.float64)
        return L, white[:, :-1], white[:, -1]

    def _inverse(self, J: Array) -> Array:
        """(P, P) ``(J^T J + information)^-1``, zero where nothing tells."""
        H = J.T @ J + self.information
        size = np.sqrt(np.maximum(np.diag(H), 1e-300))
        scales = np.outer(size, size)
        return np.asarray(np.linalg.pinv(H / scales, rcond=1e-12, hermitian=True) / scales)

    def weights(self, variance: float) -> Array:
        """(n d, n d) ``V^-1 - V^-1 J (J^T V^-1 J + information)^-1 J^T V^-1``, V of that ``variance``."""
        from scipy.linalg import cho_solve, solve_triangular

        L, J, _ = self._whitened(variance)
        K = solve_triangular(L, J, lower=True, trans="T")
        return np.asarray(cho_solve((L, True), np.eye(len(L))) - K @ self._inverse(J) @ K.T)

    def chi2(self, variance: float) -> float:
        """Sum of squares left, weighted for that ``variance`` of what grows."""
        _, J, r = self._whitened(variance)
        pull = J.T @ r
        return float(r @ r - pull @ self._inverse(J) @ pull)

    def added(self, columns: Array) -> Added | None:
        """The answer of the rows, by an F test, about q more parameters of the Jacobian ``columns`` (n, d, q).

        None where the rows do not tell them.
        """
        from scipy.special import fdtrc

        X, r, q = columns.reshape(self.residuals.size, -1), self.residuals.ravel(), columns.shape[2]
        variance = self.variance()
        Q = self.weights(variance)
        _, J, _ = self._whitened(variance)
        white = replace(self, jacobian=columns)._whitened(variance)[1]
        inverse = self._inverse(J)
        # the variance is known by what these rows say of it, however weakly the others fix the parameters
        dof = float(r.size - np.sum((J @ inverse) * J)) - q
        K, size = X.T @ Q @ X, np.linalg.norm(white, axis=0)
        if dof < LIMITS.outlier_dof or not np.all(size > 0.0):
            return None
        if np.linalg.eigvalsh(K / np.outer(size, size)).min() < 1e-9:
            return None
        pull = X.T @ Q @ r
        unit = np.linalg.inv(K)
        gained = float(pull @ unit @ pull)
        left = max(float(r @ Q @ r) - gained, 1e-300) / (self.dof - q)
        return Added(
            np.asarray(-unit @ pull),
            np.sqrt(np.diag(unit) * left),
            float(fdtrc(q, dof, gained / q / left)),
            np.asarray(inverse @ J.T @ white),
        )

    def variance(self) -> float:
        """Size of the growing part by which the sum of squares is its degrees of freedom; hardly anything at least."""
        if not self.known.any():
            return max(self.chi2(1.0) / max(self.dof, 1), 1e-300)
        from scipy.optimize import brentq

        top = float(np.sum(self.residuals**2)) / max(float(np.sum(self.growth)), 1e-300) + 1e-300
        most = 10.0 * top * self.residuals.size / max(self.dof, 1)
        least = 1e-9 * most

        def surplus(size: float) -> float:
            return self.chi2(math.exp(size)) - self.dof

        if surplus(math.log(least)) <= 0.0:
            return least
        if surplus(math.log(most)) >= 0.0:
            return most
        return math.exp(float(brentq(surplus, math.log(least), math.log(most), xtol=1e-4)))


def outlying(fit: LinearisedFit, risk: float) -> list[int]:
    """Items that do not belong to the others, at that ``risk`` that any is named falsely."""
    from scipy.special import fdtrc

    d = fit.residuals.shape[1]
    alive = np.ones(len(fit), dtype=bool)
    removed: list[int] = []
    named = 0
    for step in range(1, max(1, int(LIMITS.outlier_share * len(fit))) + 1):
        part = fit.only(alive)
        left = part.dof - d
        if left < LIMITS.outlier_dof:
            break
        Q, r = part.weights(part.variance()), part.residuals.ravel()
        e, total = Q @ r, float(r @ Q @ r)
        of_items = Q.reshape(len(part), d, len(part), d)[np.arange(len(part)), :, np.arange(len(part))]
        e = e.reshape(-1, d)
        gain = np.einsum("ki,kij,kj->k", e, np.linalg.pinv(of_items, hermitian=True), e)
        p = fdtrc(d, left, (gain / d) / np.maximum((total - gain) / left, 1e-300))
        worst = int(np.argmin(p))
        removed.append(int(np.flatnonzero(alive)[worst]))
        if p[worst] * len(part) < risk:
            named = step
        alive[removed[-1]] = False
    return sorted(removed[:named])


@dataclass(frozen=True)
class HeldOut:
    """Half of the items foretold by the other half: rms error over its u, of ``count`` errors, and the 99 % range."""

    rms: float
    count: int
    low: float
    high: float


def held_out(fit: LinearisedFit, variance: float) -> HeldOut | None:
    """Every second item foretold by the rest, for that ``variance`` of the growing part; None if these are too few."""
    from scipy.special import chdtri

    first = np.arange(len(fit)) % 2 == 0
    half = fit.only(first)
    if half.dof < 1:
        return None
    count = int(fit.residuals[~first].size)
    gained = fit.chi2(variance) - half.chi2(variance)
    low, high = (math.sqrt(float(chdtri(count, 1.0 - p)) / count) for p in (0.005, 0.995))
    return HeldOut(math.sqrt(max(gained, 0.0) / count), count, low, high)
