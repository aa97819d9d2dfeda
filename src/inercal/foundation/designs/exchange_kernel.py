"""The best exchange of one position, compiled: the formulas of `inercal.foundation.designs.exchange`.

Candidates are the last axis of all arrays, so that the processor takes several at a time.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from inercal.foundation._jit import allocating, kernel

Array: TypeAlias = NDArray[np.float64]
Mask: TypeAlias = NDArray[np.bool_]

TIE = 1e-9
"""Relative difference below which values are equal but for rounding."""
_SINGULAR = 1e-9
"""Factor of the determinant below which a design is singular to working precision."""


class Update(NamedTuple):
    """All that an exchange needs of one information matrix: W and G = W P (c, d, m), F = (I + S_jj)^-1 (c, c, m) and
    ``added`` = det(I + S_jj) (m,)."""

    W: Array
    G: Array
    F: Array
    added: Array


class DesignState(NamedTuple):
    """A design on its way: of the ``whole`` information and, where ``errors`` are common to positions, of those alone
    (``common``); for the trace H = G weights (c, d, m) and K = H_j G_j^T (c, c, m), empty for the determinant,
    and the ``trace`` itself."""

    whole: Update
    common: Update
    errors: bool
    H: Array
    K: Array
    trace: float


@allocating
def update(W: Array, P: Array, G: Array, F: Array, added: Array) -> None:
    """Fill ``G``, ``F`` and ``added`` of the `Update` about an information matrix whose inverse is P (d, d)."""
    c, _, m = W.shape
    along(W, P, G)
    S = np.empty((c, c, m))
    own_products(G, W, S)
    for a in range(c):
        S[a, a] += 1.0
    _inverses(S, F, added)


@allocating
def along(W: Array, P: Array, product: Array) -> None:
    """``product`` = ``W P`` (c, d, m) for P (d, d), symmetric."""
    for a in range(len(W)):
        np.dot(P, W[a], product[a])


@kernel
def own_products(left: Array, right: Array, products: Array) -> None:
    """``products`` = ``left``_j ``right``_j^T (c, c, m) of rows (c, d, m), where that is symmetric."""
    c, d, m = left.shape
    products.fill(0.0)
    for a in range(c):
        for b in range(a, c):
            for k in range(d):
                for j in range(m):
                    products[a, b, j] += left[a, k, j] * right[b, k, j]
            for j in range(m):
                products[b, a, j] = products[a, b, j]


@allocating
def best_exchange(state: DesignState, i: int, taken: Mask) -> tuple[int, float]:
    """The candidate, not one ``taken`` (m,), that lessens the criterion most in the place of i, the first of equals,
    and its factor of the determinant or trace of the covariance."""
    whole, common, errors, H, K_own, trace = state
    A, inverse, ratio = _removed(whole, i)
    m = len(ratio)
    factors = np.full(m, np.inf)
    if H.shape[2]:
        more = _more(whole.F, _products(H, whole.G, i), K_own, i, A, inverse)
        for j in range(m):
            if ratio[j] > _SINGULAR and not taken[j]:
                factors[j] = 1.0 + more[j] / trace
    else:
        less = np.ones(m)
        if errors:
            less = _removed(common, i)[2]
        for j in range(m):
            if ratio[j] > _SINGULAR and not taken[j]:
                factors[j] = less[j] / ratio[j]
    least = factors.min()
    for j in range(m):
        if factors[j] <= least + TIE * abs(least):
            return j, factors[j]
    return 0, np.inf


@allocating
def next_exchange(state: DesignState, chosen: NDArray[np.intp], k: int, taken: Mask) -> tuple[int, int]:
    """The first place of a design ``chosen`` (n,), from k on and then from 0, in which an exchange improves it by more
    than rounding, and the candidate for it; -1 where none does."""
    n = len(chosen)
    for step in range(n):
        place = (k + step) % n
        best, factor = best_exchange(state, chosen[place], taken)
        if factor < 1.0 - TIE:
            return place, best
    return k, -1


@allocating
def _products(rows: Array, others: Array, i: int) -> Array:
    """``rows``_j ``others``_i^T (c, c, m) of rows (c, d, m)."""
    c, _, m = rows.shape
    products = np.empty((c, c, m))
    one = np.ascontiguousarray(others[:, :, i])
    for a in range(c):
        np.dot(one, rows[a], products[a])
    return products


@allocating
def _removed(of: Update, i: int) -> tuple[Array, Array, Array]:
    """After adding each j and removing i: A = F S_ji (c, c, m), the inverse of E, and the factor (m,) of the
    determinant."""
    S = _products(of.G, of.W, i)
    F = of.F
    c, _, m = S.shape
    A, E = np.zeros((c, c, m)), np.empty((c, c, m))
    for a in range(c):
        for b in range(c):
            for e in range(c):
                for j in range(m):
                    A[a, b, j] += F[a, e, j] * S[e, b, j]
    for a in range(c):
        for b in range(c):
            E[a, b] = (1.0 if a == b else 0.0) - S[a, b, i]
            for e in range(c):
                for j in range(m):
                    E[a, b, j] += S[e, a, j] * A[e, b, j]
    inverse, factor = np.empty((c, c, m)), np.empty(m)
    _inverses(E, inverse, factor)
    factor *= of.added
    return A, inverse, factor


@allocating
def _more(F: Array, K: Array, K_own: Array, i: int, A: Array, inverse: Array) -> Array:
    """Growth of the trace (m,) when each j takes the place of i; products ``K`` with i, ``K_own`` with itself."""
    c, _, m = F.shape
    more, value = np.zeros(m), np.empty(m)
    for a in range(c):
        for b in range(c):
            value[:] = K[a, b, i]
            for e in range(c):
                for j in range(m):
                    value[j] -= K[e, a, j] * A[e, b, j] + K[e, b, j] * A[e, a, j]
                for f in range(c):
                    for j in range(m):
                        value[j] += A[e, a, j] * K_own[e, f, j] * A[f, b, j]
            for j in range(m):
                more[j] += inverse[a, b, j] * value[j] - F[a, b, j] * K_own[a, b, j]
    return more


@kernel
def _inverses(S: Array, inverse: Array, det: Array) -> None:
    """Determinants (m,) and inverses of small matrices S (c, c, m), which are changed; a singular one has the inverse
    zero. Gauss and Jordan, with pivots beyond two rows."""
    c, _, m = S.shape
    if c == 1:
        for j in range(m):
            det[j] = S[0, 0, j]
            inverse[0, 0, j] = 1.0 / det[j] if det[j] != 0.0 else 0.0
    elif c == 2:
        for j in range(m):
            det[j] = S[0, 0, j] * S[1, 1, j] - S[0, 1, j] * S[1, 0, j]
            scale = 1.0 / det[j] if det[j] != 0.0 else 0.0
            inverse[0, 0, j], inverse[1, 1, j] = S[1, 1, j] * scale, S[0, 0, j] * scale
            inverse[0, 1, j], inverse[1, 0, j] = -S[0, 1, j] * scale, -S[1, 0, j] * scale
    else:
        for j in range(m):
            det[j] = _inverse(S, inverse, j)


@kernel
def _inverse(S: Array, inverse: Array, j: int) -> float:
    """As `_inverses`, of one."""
    c, det = len(S), 1.0
    for a in range(c):
        for b in range(c):
            inverse[a, b, j] = 1.0 if a == b else 0.0
    for k in range(c):
        pivot = k
        for a in range(k + 1, c):
            if abs(S[a, k, j]) > abs(S[pivot, k, j]):
                pivot = a
        if S[pivot, k, j] == 0.0:
            inverse[:, :, j] = 0.0
            return 0.0
        if pivot != k:
            det = -det
            for b in range(c):
                S[k, b, j], S[pivot, b, j] = S[pivot, b, j], S[k, b, j]
                inverse[k, b, j], inverse[pivot, b, j] = inverse[pivot, b, j], inverse[k, b, j]
        own = S[k, k, j]
        det *= own
        for b in range(c):
            S[k, b, j] /= own
            inverse[k, b, j] /= own
        for a in range(c):
            if a != k:
                part = S[a, k, j]
                for b in range(c):
                    S[a, b, j] -= part * S[k, b, j]
                    inverse[a, b, j] -= part * inverse[k, b, j]
    return det
