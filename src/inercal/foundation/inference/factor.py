"""Compiled square roots of a covariance matrix, for sigma points and updates.

`root` gives a matrix whose columns add up to the covariance, P = A A^T: Cholesky's lower factor, or by way of the
correlation matrix R, P = d R d with d the standard deviations, R = U S U^T and A = d U sqrt(S). Scaled so, states of
very different units do not drown each other. The singular value decomposition of a covariance is its eigenvalue
decomposition; of a matrix that is none any more it is that of |R|, so a negative eigenvalue is looked for and told.
"""

from __future__ import annotations

import math
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from inercal.foundation._jit import allocating, kernel

Array: TypeAlias = NDArray[np.float64]

CHOLESKY, EIGEN, SVD = 0, 1, 2
"""Kinds of `root`."""

FACTORS: Final[dict[str, int]] = {"cholesky": CHOLESKY, "eigen": EIGEN, "svd": SVD}
"""Name -> kind."""

NEGATIVE: Final = -1e-9
"""Eigenvalues of a correlation matrix below this are not of rounding: the matrix is no covariance any more."""


@kernel
def cholesky(A: Array, out: Array) -> bool:
    """Lower factor ``out`` (n, n), zero above the diagonal, of a symmetric ``A`` (n, n) whose lower part is read.

    False where a pivot is not positive (or not a number); ``out`` is then of no use.
    """
    n = len(A)
    for i in range(n):
        for j in range(i + 1):
            total = A[i, j]
            for k in range(j):
                total -= out[i, k] * out[j, k]
            if j < i:
                out[i, j] = total / out[j, j]
            elif total > 0.0:
                out[i, i] = math.sqrt(total)
            else:
                return False
        for j in range(i + 1, n):
            out[i, j] = 0.0
    return True


@kernel
def forward(L: Array, b: Array) -> None:
    """Solve ``L x = b`` in place, ``L`` (n, n) lower triangular, ``b`` (n,)."""
    for i in range(len(b)):
        total = b[i]
        for k in range(i):
            total -= L[i, k] * b[k]
        b[i] = total / L[i, i]


@allocating
def _eigen(R: Array) -> tuple[Array, Array]:
    """Eigenvalues in ascending order and eigenvectors (columns) of a symmetric matrix."""
    return np.linalg.eigh(R)


@allocating
def _singular(R: Array) -> tuple[Array, Array]:
    """The same by singular values: s u.v, and left singular vectors.

    Where eigenvalues of both signs have one size, u and v need not be parallel; that singular values then add up to
    more than the trace shows it, and half of the difference takes the place of the first.
    """
    u, s, vt = np.linalg.svd(R)
    short = 0.0
    for i in range(len(s)):
        short += 0.5 * (R[i, i] - s[i])
    for i in range(len(s)):
        along = 0.0
        for j in range(len(s)):
            along += u[j, i] * vt[i, j]
        s[i] *= along
    if short < NEGATIVE:
        s[0] = min(s[0], short)
    return s, u


@allocating
def root(P: Array, kind: int, out: Array, work: Array) -> tuple[bool, float]:
    """Write a root of a covariance ``P`` (n, n) to ``out`` (n, n): its columns add up to it, ``P = out out^T``.

    ``kind`` is CHOLESKY (eigen where that fails), EIGEN or SVD, which take variances of zero too; ``work`` (n, n) is
    overwritten. ``out`` is NaN where ``P`` is not finite.

    Returned is true where Cholesky's factor failed and the eigen factor was taken, and the lowest eigenvalue of the
    correlation matrix, NaN where none was computed. Negative ones, and eigenvectors with them, are left out of the
    root; below `NEGATIVE` the caller has to say so.
    """
    if kind == CHOLESKY and cholesky(P, out):
        return False, math.nan
    n = len(P)
    finite = True
    for i in range(n):
        # for now its diagonal holds d; a negative variance keeps its sign in R, so that an eigenvalue shows it
        out[i, i] = math.sqrt(abs(P[i, i])) if P[i, i] != 0.0 else 1.0
        for j in range(i + 1):
            work[i, j] = P[i, j] / (out[i, i] * out[j, j])
            work[j, i] = work[i, j]
            finite = finite and math.isfinite(work[i, j])
    if not finite:
        out.fill(math.nan)
        return kind == CHOLESKY, math.nan
    values, vectors = _singular(work) if kind == SVD else _eigen(work)
    lowest = values[0]
    for j in range(n):
        lowest = min(lowest, values[j])
        values[j] = math.sqrt(max(values[j], 0.0))
    for i in range(n):
        d = out[i, i]
        for j in range(n):
            out[i, j] = d * vectors[i, j] * values[j]
    return kind == CHOLESKY, lowest
