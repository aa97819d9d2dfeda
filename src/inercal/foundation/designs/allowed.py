"""Which candidates may be taken: limits of the axes, limits of sensitivity."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from inercal.foundation.designs.candidates import Candidates
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
