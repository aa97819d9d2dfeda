"""Candidate positions, each by what it tells: rows linear in the coefficients, their noise, and the errors common to
all.

Drift on the unit sphere: the orthonormal basis of the constant, linear and quadratic functions.

In it a change of the coefficients has the size of the change of drift, so that condition numbers and
efficiencies say something of the plan and nothing of the way the model is written.

Which candidates may be taken: limits of the axes, limits of sensitivity.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.errors import InputError
from inercal.foundation.inference.identifiability import few_terms, identify, in_words

Mask = NDArray[np.bool_]

_ROUNDING = 1e-9
"""Angles [rad] this far outside a limit count as on it."""


def within(angles: ArrayLike, limits: Sequence[tuple[float, float] | None]) -> Mask:
    """Which positions lie within the limits of the axes.

    Parameters
    ----------
    angles : (m, joints) rad
        Whole turns do not matter: 350° lies within -20° to 20°.
    limits : sequence, one per joint
        Lower and upper end [rad]; None for an axis that turns freely.

    Returns
    -------
    (m,) bool

    Raises
    ------
    ValueError
        Another number of limits than of joints, or ends out of order.
    """
    positions = np.asarray(angles, dtype=float)
    if positions.ndim != 2 or positions.shape[1] != len(limits):
        raise ValueError(f"found angles {positions.shape}, expected (m, {len(limits)})")
    inside = np.ones(len(positions), dtype=bool)
    for angle, limit in zip(positions.T, limits, strict=True):
        if limit is None:
            continue
        low, high = limit
        if not low <= high:
            raise ValueError(f"found the limits {low:g} to {high:g}, expected two numbers in order")
        inside &= np.mod(angle - low + _ROUNDING, 2.0 * np.pi) <= high - low + 2.0 * _ROUNDING
    return inside


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
