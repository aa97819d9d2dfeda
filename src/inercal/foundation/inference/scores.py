"""Evidence of a filter on errors outside its model, by sums over one pass.

A filter whose states are what moves and constants is two (B. Friedland, Treatment of bias in recursive filtering, IEEE
Transactions on Automatic Control 14 (1969) 359): one of what moves, at fixed constants, and a linear fit. The
innovations of the first, each scalar after the other over its standard deviation, are white,

    z = A dc + X b + e,   e of variance 1,

A what one unit of each constant does to them, X what one unit of each error does. With the prior Pi about c0, and
``H = A^T A + Pi^-1``, a record says

    c + H^-1 (A^T z + Pi^-1 (c0 - c))                 the values, with covariance H^-1
    I = X^T X - X^T A H^-1 A^T X                      information of errors
    s = X^T z - X^T A H^-1 (A^T z + Pi^-1 (c0 - c))   their score

which is a direct fit with columns beside a Jacobian (`inercal.foundation.inference.evidence`). Sums of A by blocks of
time ask whether any value changes with time, X = A f(t), at no cost.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.inference.evidence import SEEN


@dataclass(frozen=True, eq=False)
class ErrorColumns:
    """Columns of one error: the columns ``at`` (q,) of the pass, combined ``by`` (q, k) if that is given; or, with a
    ``course`` (blocks, k) of time, the constants ``at``, each times each course."""

    at: NDArray[np.int64]
    course: Array | None = None
    by: Array | None = None


class ErrorScore(NamedTuple):
    """Answer of a pass about an error: ``degrees``, combinations that show; ``chance`` that a sound record explains as
    much, ``explained`` sum of squares, sizes ``b`` (k,) with ``u`` (k,), and the ``shift`` (p,) of the values by it;
    ``ways`` (k, degrees) the combinations, each of information 1."""

    degrees: int
    chance: float
    explained: float
    b: Array
    u: Array
    shift: Array
    ways: Array


@dataclass(frozen=True, eq=False)
class PassSums:
    """Sums over the whitened innovations z of a pass of a filter at p constants, with m columns of errors.

    Attributes
    ----------
    prior, off : (p,)
        Standard deviations of the constants before the record, and their mean less the constants of the pass.
    fitted : (blocks, 1 + p, 1 + p)
        Sums of squares and products of z and A, by blocks of time.
    across : (blocks, 1 + p, m)
        Of these and X.
    errors : (m, m)
        Of X.
    squares : float
        Sum of squares of all z.
    dof : int
        Number of z: the prior gives as many as there are constants.
    """

    prior: Array
    off: Array
    fitted: Array
    across: Array
    errors: Array
    squares: float
    dof: int

    @cached_property
    def _whole(self) -> Array:
        """(1 + p, 1 + p), over all blocks."""
        return np.asarray(self.fitted.sum(axis=0))

    @cached_property
    def _pull(self) -> Array:
        """(p,) ``A^T z`` with that of the prior."""
        return np.asarray(self._whole[1:, 0] + self.off / self.prior**2)

    @cached_property
    def covariance(self) -> Array:
        """(p, p) of the constants."""
        d = self.prior  # in units of the prior, so that no digits are lost
        inverse = np.linalg.inv(d[:, None] * self._whole[1:, 1:] * d + np.eye(len(d)))
        return np.asarray(d[:, None] * inverse * d)

    @cached_property
    def change(self) -> Array:
        """(p,) of the constants, to where the record has them."""
        return np.asarray(self.covariance @ self._pull)

    @cached_property
    def u(self) -> Array:
        """(p,) standard uncertainties of the constants."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def chi2(self) -> float:
        """Sum of squares at the changed constants, that of the prior with it: chi-square of `dof` in a sound record."""
        return float(self.squares + np.sum(np.square(self.off / self.prior)) - self._pull @ self.change)

    def with_stated(self, a: ErrorColumns, u: Array) -> PassSums:
        """The sums of a pass that has the columns of an error as constants too, 0 with standard uncertainties ``u``
        (k,); they come behind the others, and no course of time is asked of them."""
        if a.course is not None:
            return self._with_course(a.at, a.course, u)
        across, p = self.across[:, :, a.at], len(self.prior)
        across = across if a.by is None else across @ a.by
        k = across.shape[2]
        fitted = np.zeros((len(self.fitted), 1 + p + k, 1 + p + k))
        fitted[:, : 1 + p, : 1 + p] = self.fitted
        fitted[:, : 1 + p, 1 + p :], fitted[:, 1 + p :, : 1 + p] = across, np.swapaxes(across, 1, 2)
        fitted[0, 1 + p :, 1 + p :] = self._products(a, a)
        more = np.zeros((len(self.across), 1 + p + k, len(self.errors)))
        more[:, : 1 + p] = self.across
        more[0, 1 + p :] = self.errors[a.at] if a.by is None else a.by.T @ self.errors[a.at]
        prior, off = np.append(self.prior, u), np.append(self.off, np.zeros(k))
        return PassSums(prior, off, fitted, more, self.errors, self.squares, self.dof)

    def _with_course(self, at: NDArray[np.int64], course: Array, u: Array) -> PassSums:
        """`with_stated` of constants ``at`` (q,), each times each column of a ``course`` (blocks, k)."""
        blocks, p, k = len(course), len(self.prior), course.shape[1] * len(at)
        fitted, own = np.zeros((blocks, 1 + p + k, 1 + p + k)), self.fitted[:, 1 + at]
        fitted[:, : 1 + p, : 1 + p] = self.fitted
        fitted[:, 1 + p :, : 1 + p] = np.einsum("bk,bij->bkij", course, own).reshape(blocks, k, -1)
        fitted[:, : 1 + p, 1 + p :] = np.swapaxes(fitted[:, 1 + p :, : 1 + p], 1, 2)
        both = np.einsum("bk,bl,bij->bkilj", course, course, own[:, :, 1 + at], optimize=True)
        fitted[:, 1 + p :, 1 + p :] = both.reshape(blocks, k, k)
        more = np.einsum("bk,bim->bkim", course, self.across[:, 1 + at]).reshape(blocks, k, -1)
        prior, off = np.append(self.prior, u), np.append(self.off, np.zeros(k))
        across = np.concatenate([self.across, more], axis=1)
        return PassSums(prior, off, fitted, across, self.errors, self.squares, self.dof)

    def _across(self, a: ErrorColumns) -> Array:
        """(1 + p, k) products of z and A with columns."""
        if a.course is not None:
            made = np.einsum("bk,bij->ikj", a.course, self.fitted[:, :, 1 + a.at])
            return np.asarray(made.reshape(self.fitted.shape[1], -1))
        made = self.across[:, :, a.at].sum(axis=0)
        return np.asarray(made if a.by is None else made @ a.by)

    def _products(self, a: ErrorColumns, b: ErrorColumns) -> Array:
        """(k, l) products of the columns of two errors."""
        if a.course is None and b.course is None:
            made = self.errors[np.ix_(a.at, b.at)]
            made = made if a.by is None else a.by.T @ made
            return np.asarray(made if b.by is None else made @ b.by)
        if a.course is None:
            return self._products(b, a).T
        if b.course is None:
            made = np.einsum("bk,bij->kij", a.course, self.across[:, 1 + a.at][:, :, b.at])
            made = made.reshape(-1, len(b.at))
            return np.asarray(made if b.by is None else made @ b.by)
        made = self.fitted[:, 1 + a.at][:, :, 1 + b.at]
        made = np.einsum("bk,bl,bij->kilj", a.course, b.course, made, optimize=True)
        return np.asarray(made.reshape(a.course.shape[1] * len(a.at), -1))

    def reach(self, a: ErrorColumns) -> Array:
        """Shift (p, k) of the values by one unit of each column."""
        return np.asarray(self.covariance @ self._across(a)[1:])

    def score(self, a: ErrorColumns) -> Array:
        """(k,) of the columns of an error."""
        across = self._across(a)
        return np.asarray(across[0] - across[1:].T @ self.change)

    def information(self, a: ErrorColumns, b: ErrorColumns | None = None) -> Array:
        """(k, l) of the columns of two errors, or of one, beside the constants."""
        b = a if b is None else b
        by = self._across(b)[1:]
        return np.asarray(self._products(a, b) - self._across(a)[1:].T @ (self.covariance @ by))

    def ask(self, a: ErrorColumns, beside: ErrorColumns | None = None) -> ErrorScore | None:
        """The score test of an error, fitted together with the one ``beside`` it; None where it does not show.

        Where more is left than noise explains, the chance is that by what is left.
        """
        from scipy.special import chdtrc

        size = np.sqrt(np.maximum(np.diag(self._products(a, a)), 1e-300))
        information, score, reach = self.information(a), self.score(a), self.reach(a)
        left = self.chi2
        if beside is not None:
            between = self.information(beside, a)
            units = np.sqrt(np.maximum(np.diag(self._products(beside, beside)), 1e-300))
            scaled = self.information(beside) / units[:, None] / units
            inverse = np.linalg.pinv(scaled, rcond=SEEN**2, hermitian=True) / units[:, None] / units
            information = information - between.T @ inverse @ between
            of_beside = self.score(beside)
            score = score - between.T @ inverse @ of_beside
            left -= float(of_beside @ inverse @ of_beside)
            reach = reach - self.reach(beside) @ inverse @ between
        strength, ways = np.linalg.eigh(information / size[:, None] / size)
        shown = strength > SEEN**2
        if not shown.any():
            return None
        ways, strength = ways[:, shown] / size[:, None], strength[shown]
        along = ways.T @ score
        explained = float(along @ (along / strength))
        b, count = ways @ (along / strength), int(shown.sum())
        u = np.sqrt(np.square(ways) @ (1.0 / strength))
        noise = max(1.0, (left - explained) / max(self.dof - count, 1))
        chance = float(chdtrc(count, explained / noise))
        return ErrorScore(count, chance, explained, b, u, reach @ b, ways / np.sqrt(strength))


def joined(errors: Sequence[ErrorColumns]) -> ErrorColumns:
    """Errors without courses as one."""
    at = np.concatenate([error.at for error in errors])
    sizes = [len(error.at) if error.by is None else error.by.shape[1] for error in errors]
    by, row, column = np.zeros((len(at), sum(sizes))), 0, 0
    for error, size in zip(errors, sizes, strict=True):
        own = np.eye(len(error.at)) if error.by is None else error.by
        by[row : row + len(error.at), column : column + size] = own
        row, column = row + len(error.at), column + size
    return ErrorColumns(at, by=by)
