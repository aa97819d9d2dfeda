"""Compiled parts of sigma-point (unscented) filters: weights, moments of points, Kalman's update.

A filter draws 2 L + 1 points, the centre first: the mean, then mean + spread times each column of a root of its
covariance (`inercal.estimate.factor`), then mean - spread times each. How points are put on a manifold, and whether
noise is drawn with the state (augmented) or added to a covariance, is up to the filter: moments here are of
deviations, (points, size), that the filter took in its own way. Julier and Uhlmann, Proc. IEEE 92 (2004), 401;
Wan and van der Merwe (2000) for alpha and beta.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from inercal._jit import kernel
from inercal.estimate.factor import cholesky, forward, root

Array: TypeAlias = NDArray[np.float64]


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


@kernel
def draw(P: Array, kind: int, spread: float, A: Array, work: Array, columns: Array, told: Array) -> None:
    """Draw the points of a state whose noise is added to covariances.

    Parameters
    ----------
    P, kind, A, work
        As of `inercal.estimate.factor.root`, ``A`` for the root.
    columns : (n, n) receives, row by row, the columns of the root times ``spread``
    told : (2,) lowest eigenvalue so far, number of steps so far at which Cholesky failed; brought up to date
    """
    fell, lowest = root(P, kind, A, work)
    if fell:
        told[1] += 1.0
    if not lowest >= told[0] and not math.isnan(lowest):
        told[0] = lowest
    for i in range(len(A)):
        for j in range(len(A)):
            columns[j, i] = spread * A[i, j]


@kernel
def moments(
    z: Array, columns: Array, other: float, middle: Array, odd: Array, Pzz: Array, Pxz: Array
) -> None:
    """Mean, covariance and covariance with the state of what all points read, where the centre weighs nothing.

    Parameters
    ----------
    z : (2 n + 1, m) read at the centre, which is not used, at + and at - of each column; becomes deviations
    columns : (n, n) of `draw`
    other : weight
    middle : (m,) receives the mean
    odd : (n, m) overwritten
    Pzz, Pxz : (m, m), (n, m) receive the covariances
    """
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
    exactly symmetric.

    Parameters
    ----------
    r : (m,) innovations; becomes ``L^-1 r``, 0 where missing
    Pxz : (n, m) covariance of state and measurements; becomes W
    Pzz : (m, m) covariance of the innovations; rows and columns that are missing become those of the identity
    L : (m, m) work array
    P : (n, n) covariance of the state; updated
    dx : (n,) receives the correction ``K r`` of the state, which is the caller's to apply

    Returns
    -------
    float
        Normalised innovation squared, NaN without any measurement.
    int
        Number of measurements that took part.

    ``Pzz`` that is not positive definite leaves NaN in ``dx`` and ``P``: a filter that failed.
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
