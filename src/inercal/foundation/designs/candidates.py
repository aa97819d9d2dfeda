"""Candidate positions, each by what it tells: rows linear in the coefficients, their noise, and the errors common to
all."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from inercal.foundation.arrays import Array


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
