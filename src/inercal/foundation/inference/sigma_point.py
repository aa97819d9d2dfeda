"""Compiled parts of sigma-point (unscented) filters: square roots of a covariance, weights, moments of points, update.

`root` gives a matrix whose columns add up to the covariance, P = A A^T: Cholesky's lower factor, or by way of the
correlation matrix R, P = d R d with d the standard deviations, R = U S U^T and A = d U sqrt(S). Scaled so, states of
very different units do not drown each other. The singular value decomposition of a covariance is its eigenvalue
decomposition; of a matrix that is none any more it is that of |R|, so a negative eigenvalue is looked for and told.

A filter draws 2 L + 1 points, the centre first: the mean, then mean + spread times each column of such a root, then
mean - spread times each. The filter puts points on its manifold, and draws noise with the state (augmented) or adds it
to a covariance: moments here are of deviations, (points, size), that the filter took in its own way. Julier and
Uhlmann, Proc. IEEE 92 (2004), 401; Wan and van der Merwe (2000) for alpha and beta.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple, TypeAlias

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


@kernel
def weights(size: int, alpha: float, beta: float, kappa: float) -> tuple[float, float, float, float]:
    """Weights of 2 ``size`` + 1 points: of the centre in the mean, in the covariance, of each other; the spread."""
    total = alpha * alpha * (size + kappa)
    centre = 1.0 - size / total
    return centre, centre + 1.0 - alpha * alpha + beta, 0.5 / total, math.sqrt(total)


@kernel
def mean(x: Array, centre: float, other: float, out: Array) -> None:
    """Weighted sum ``out`` (n,) of the rows of ``x`` (points, n): the first by ``centre``, all others by ``other``."""
    for i in range(len(out)):
        out[i] = centre * x[0, i]
    for k in range(1, len(x)):
        for i in range(len(out)):
            out[i] += other * x[k, i]


@kernel
def cross(a: Array, b: Array, centre: float, other: float, out: Array) -> None:
    """Cross-covariance ``out`` (n, m) of deviations ``a`` (points, n) and ``b`` (points, m), weighted as in `mean`."""
    n, m = out.shape
    for i in range(n):
        for j in range(m):
            out[i, j] = centre * a[0, i] * b[0, j]
    for k in range(1, len(a)):
        for i in range(n):
            weighted = other * a[k, i]
            for j in range(m):
                out[i, j] += weighted * b[k, j]


@kernel
def covariance(a: Array, centre: float, other: float, out: Array) -> None:
    """Covariance ``out`` (n, n) of deviations ``a`` (points, n), weighted as in `mean`; exactly symmetric."""
    n = len(out)
    for i in range(n):
        for j in range(i + 1):
            out[i, j] = centre * a[0, i] * a[0, j]
    for k in range(1, len(a)):
        for i in range(n):
            weighted = other * a[k, i]
            for j in range(i + 1):
                out[i, j] += weighted * a[k, j]
    for i in range(n):
        for j in range(i):
            out[j, i] = out[i, j]


class Points(NamedTuple):
    """Sigma points of n states, whose noise is added to covariances.

    ``columns`` (n, n) holds, row by row, the columns of the root times the spread; ``root`` and ``work`` (n, n) are
    used up; ``health`` (2,) is the lowest eigenvalue of all draws (NaN while there is none), and the number of draws at
    which Cholesky's factor failed.
    """

    columns: Array
    root: Array
    work: Array
    health: Array


@allocating
def empty_points(n: int) -> Points:
    """Room for the points of ``n`` states."""
    return Points(np.empty((n, n)), np.empty((n, n)), np.empty((n, n)), np.array([math.nan, 0.0]))


@kernel
def draw(P: Array, factor: int, spread: float, points: Points) -> None:
    """Draw the points of a state of covariance ``P`` (n, n), by a ``factor`` of
    `inercal.foundation.inference.sigma_point.root`."""
    fell, lowest = root(P, factor, points.root, points.work)
    if fell:
        points.health[1] += 1.0
    if not lowest >= points.health[0] and not math.isnan(lowest):
        points.health[0] = lowest
    A, columns = points.root, points.columns
    for i in range(len(P)):
        for j in range(len(P)):
            columns[j, i] = spread * A[i, j]


class ReadingMoments(NamedTuple):
    """Moments of m readings at all points of n states: their ``mean`` (m,) and ``covariance`` (m, m), the ``cross``
    covariance (n, m) with the state; ``odd`` (n, m), the half of each pair that a change of sign turns, is used up."""

    mean: Array
    covariance: Array
    cross: Array
    odd: Array


@allocating
def empty_moments(n: int, m: int) -> ReadingMoments:
    """Room for the moments of ``m`` readings and ``n`` states."""
    return ReadingMoments(np.empty(m), np.empty((m, m)), np.empty((n, m)), np.empty((n, m)))


@kernel
def moments(z: Array, columns: Array, other: float, out: ReadingMoments) -> None:
    """Moments of the readings at all points, where the centre weighs nothing.

    Parameters
    ----------
    z : (2 n + 1, m) read at the centre, which is not used, at + and at - of each column; becomes deviations
    columns : (n, n) of `draw`
    other : weight
    out : receives the moments
    """
    middle, Pzz, Pxz, odd = out
    n, m = odd.shape
    mean(z, 0.0, other, middle)
    for k in range(n):
        for i in range(m):
            odd[k, i] = z[1 + k, i] - z[1 + n + k, i]
            z[1 + k, i] -= middle[i]
            z[1 + n + k, i] -= middle[i]
    covariance(z, 0.0, other, Pzz)
    cross(columns, odd, other, other, Pxz)


@kernel
def update(r: Array, Pxz: Array, Pzz: Array, L: Array, P: Array, dx: Array) -> tuple[float, int]:
    """Kalman's update by m measurements, of which those with innovation NaN are left out.

    With ``Pzz = L L^T`` and ``W = Pxz L^-T``: ``K Pzz K^T = W W^T``, which is taken from the covariance and leaves it
    exactly symmetric. Returned are the normalised innovation squared, NaN without any measurement, and the number of
    measurements that took part. ``Pzz`` that is not positive definite leaves NaN in ``dx`` and ``P``: a filter that
    failed.

    Parameters
    ----------
    r : (m,) innovations; becomes ``L^-1 r``, 0 where missing
    Pxz : (n, m) covariance of state and measurements; becomes W
    Pzz : (m, m) covariance of the innovations; rows and columns that are missing become those of the identity
    L : (m, m) work array
    P : (n, n) covariance of the state; updated
    dx : (n,) receives the correction ``K r`` of the state, which is the caller's to apply
    """
    n, m = Pxz.shape
    dims = m
    for i in range(m):
        if math.isnan(r[i]):
            dims -= 1
            r[i] = 0.0
            for j in range(m):
                Pzz[i, j] = 0.0
                Pzz[j, i] = 0.0
            Pzz[i, i] = 1.0
            for j in range(n):
                Pxz[j, i] = 0.0
    if dims == 0:
        dx.fill(0.0)
        return math.nan, 0
    if not cholesky(Pzz, L):
        dx.fill(math.nan)
        P.fill(math.nan)
        return math.nan, dims
    forward(L, r)
    nis = 0.0
    for j in range(m):
        nis += r[j] * r[j]
    for i in range(n):
        forward(L, Pxz[i])
        total = 0.0
        for j in range(m):
            total += Pxz[i, j] * r[j]
        dx[i] = total
        for h in range(i + 1):
            taken = P[i, h]
            for j in range(m):
                taken -= Pxz[i, j] * Pxz[h, j]
            P[i, h] = taken
            P[h, i] = taken
    return nis, dims
