"""Choosing positions: the exchange algorithm of Fedorov over a grid of candidates, from several random starts.

Each position of a design is replaced in turn by the candidate that improves the criterion most (Cook and
Nachtsheim 1980, "A comparison of algorithms for constructing exact D-optimal designs", Technometrics 22), until
no exchange improves it. The gain of all candidates comes from low-rank updates: with ``P = M^-1``, ``S_jk = W_j P
W_k^T`` and W the whitened rows, taking j and leaving i changes

    det M   by the factor   det(I + S_jj) det(E),   E = I - S_ii + S_ij (I + S_jj)^-1 S_ji

and the trace likewise by the matrix inversion lemma: add first, then remove, so that a design with as few
positions as coefficients is no special case.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inercal.arrays import Array
from inercal.designs.allowed import Mask, require
from inercal.designs.candidates import Candidates
from inercal.designs.criteria import Criterion, covariance
from inercal.errors import InputError

Indices = NDArray[np.intp]

_GAIN = 1e-9
"""Relative improvement below which an exchange is rounding."""
_SINGULAR = 1e-9
"""Factor of the determinant below which a design is singular to working precision."""


@dataclass(frozen=True, eq=False)
class Design:
    """Positions chosen among candidates.

    ``chosen`` (n,) indices in rising order; ``value`` of the criterion; ``values`` (starts,) that each random
    start ended with, which show how sure the optimum is.
    """

    chosen: Indices
    value: float
    values: Array


def exchange(
    candidates: Candidates,
    n: int,
    criterion: Criterion,
    rng: np.random.Generator,
    starts: int = 40,
    allowed: Mask | None = None,
    repeats: bool = False,
) -> Design:
    """The best design of ``n`` positions that exchanges find.

    Parameters
    ----------
    candidates : Candidates
    n : int
        Number of positions.
    criterion : Criterion
    rng : numpy Generator
        For the random starts; each has its own stream.
    starts : int
        Number of random starts. On a 10° grid one in five finds 12 positions for the nine functions of
        `inercal.designs.spherical` with a D-efficiency of 0.995.
    allowed : (m,) bool, optional
        Candidates that may be taken; all if absent.
    repeats : bool
        Whether a candidate may be taken more than once.

    Raises
    ------
    InputError
        ``n`` positions among the allowed ones cannot identify the coefficients.
    """
    open_ = np.ones(len(candidates), dtype=bool) if allowed is None else np.asarray(allowed, dtype=bool)
    where = f"design of {n} positions"
    require(candidates, open_, n, repeats, where)
    indices = np.flatnonzero(open_)
    W, weights = _scaled(candidates.take(indices), criterion)
    p = len(candidates.names)
    designs = []
    for stream in rng.spawn(starts):
        first = _start(W[..., :p], n, repeats, stream)
        if first is None:
            raise InputError(
                where, f"found none that identifies all of {p} coefficients, expected more positions"
            )
        designs.append(np.sort(indices[_improved(W, p, weights, first, repeats)]))
    values = np.array([_value(candidates.take(chosen), criterion) for chosen in designs])
    if not np.isfinite(values).any():
        raise InputError(
            where,
            f"found none that tells all of {p} coefficients to working precision, expected more positions",
        )
    # of determinants as such, whose logarithms may be near zero
    best = _first_least(np.exp(values - values.min()) if criterion.weights is None else values)
    return Design(designs[best], float(values[best]), values)


def _value(plan: Candidates, criterion: Criterion) -> float:
    """The criterion of a design; inf where a coefficient is lost to rounding."""
    try:
        return criterion.value(covariance(plan))
    except ValueError:
        return float("inf")


def _scaled(candidates: Candidates, criterion: Criterion) -> tuple[Array, Array | None]:
    """Whitened rows (m, c, d) and weights (d, d) for coefficients that are orthonormal over the candidates."""
    W = candidates.whitened.copy()
    m, c, d = W.shape
    p = len(candidates.names)
    flat = W[..., :p].reshape(-1, p)
    length = np.linalg.norm(flat, axis=0)
    R = np.linalg.qr(flat / length, mode="r") * length / np.sqrt(m)  # R beta are the new coefficients
    W[..., :p] = np.linalg.solve(R.T, flat.T).T.reshape(m, c, p)
    if criterion.weights is None:
        return W, None
    weights = np.zeros((d, d))
    half = np.linalg.solve(R.T, criterion.weights)
    weights[:p, :p] = np.linalg.solve(R.T, half.T)
    return W, weights


def _start(rows: Array, n: int, repeats: bool, rng: np.random.Generator) -> Indices | None:
    """Random positions (n,) that identify the coefficients; None if none were found.

    First those that see most of a random combination not seen so far, then any.
    """
    m, _, p = rows.shape
    unseen, chosen = np.eye(p), np.zeros(0, dtype=np.intp)
    while len(unseen) and len(chosen) < n:
        direction = rng.standard_normal(p) @ unseen.T @ unseen
        seen = np.sum(np.square(rows @ direction), axis=1)
        seen[chosen] = -1.0  # nothing new
        chosen = np.append(chosen, _first_least(-seen))
        _, s, vt = np.linalg.svd(rows[chosen].reshape(-1, p))
        unseen = vt[int(np.sum(s > _SINGULAR * s[0])) :]
    if len(unseen):
        return None
    others = np.arange(m) if repeats else np.setdiff1d(np.arange(m), chosen)
    more = rng.choice(others, n - len(chosen), replace=repeats)
    return np.concatenate([chosen, more])


def _improved(W: Array, p: int, weights: Array | None, first: Indices, repeats: bool) -> Indices:
    """The design (n,) at the end of all exchanges that improve it."""
    chosen, n = first.copy(), len(first)
    state = _state(W, p, weights, chosen)
    k, unchanged = 0, 0
    while unchanged < n:
        factor = _factors(state, int(chosen[k]))
        if not repeats:
            factor[chosen] = np.inf
        best = _first_least(factor)
        unchanged += 1
        if factor[best] < 1.0 - _GAIN:
            chosen[k], unchanged = best, 0
            state = _state(W, p, weights, chosen)
        k = (k + 1) % n
    return chosen


def _first_least(values: Array) -> int:
    """Index of the first value that is least but for rounding, so that ties end alike on every machine."""
    least = float(values.min())
    return int(np.argmax(values <= least + _GAIN * abs(least)))


@dataclass(frozen=True, eq=False)
class _Update:
    """All that an exchange needs of one information matrix: P (d, d), W and G = W P (m, c, d), F = (I + S_jj)^-1."""

    P: Array
    W: Array
    G: Array
    F: Array
    added: Array  # det(I + S_jj) (m,)

    def removed(self, i: int) -> tuple[Array, Array, Array]:
        """After adding each j: A = F S_ji (m, c, c), the inverse of E, and the factor of the determinant (m,)."""
        S_ji = _times(self.G, self.W[i].T)
        A = self.F @ S_ji
        E = np.eye(len(self.W[i])) - self.G[i] @ self.W[i].T + np.swapaxes(S_ji, 1, 2) @ A
        inverse, det = _inverse(E)
        return A, inverse, self.added * det


@dataclass(frozen=True, eq=False)
class _State:
    """A design on its way: of the whole information, of the constant errors alone, and for the trace."""

    whole: _Update
    common: _Update | None
    H: Array | None  # G weights (m, c, d)
    K: Array | None  # G_j weights G_j^T (m, c, c)
    trace: float


def _state(W: Array, p: int, weights: Array | None, chosen: Indices) -> _State:
    """Quantities that the exchanges of a design use."""
    d = W.shape[-1]
    taken = W[chosen].reshape(-1, d)
    M = taken.T @ taken + np.diag(np.repeat([0.0, 1.0], [p, d - p]))
    whole = _update(W, M)
    if weights is not None:
        H = _times(whole.G, weights)
        return _State(whole, None, H, H @ np.swapaxes(whole.G, 1, 2), float(np.sum(whole.P * weights)))
    common = _update(W[..., p:], M[p:, p:]) if d > p else None
    return _State(whole, common, None, None, 0.0)


def _factors(state: _State, i: int) -> Array:
    """Factor (m,) of the determinant or trace of the covariance when each candidate takes the place of i."""
    A, inverse, ratio = state.whole.removed(i)
    safe = ratio > _SINGULAR
    if state.H is None or state.K is None:
        common = 1.0 if state.common is None else state.common.removed(i)[2]
        return np.asarray(np.where(safe, common / np.where(safe, ratio, 1.0), np.inf))
    K_ji = _times(state.H, state.whole.G[i].T)
    cross = np.swapaxes(K_ji, 1, 2) @ A
    K_ii = state.H[i] @ state.whole.G[i].T - cross - np.swapaxes(cross, 1, 2)
    K_ii = K_ii + np.swapaxes(A, 1, 2) @ state.K @ A
    less, more = np.sum(state.whole.F * state.K, axis=(1, 2)), np.sum(inverse * K_ii, axis=(1, 2))
    return np.asarray(np.where(safe, 1.0 + (more - less) / state.trace, np.inf))


def _update(W: Array, M: Array) -> _Update:
    """The update about an information matrix M (d, d)."""
    P = np.asarray(np.linalg.inv(M), dtype=float)
    G = _times(W, P)
    F, added = _inverse(np.eye(W.shape[1]) + G @ np.swapaxes(W, 1, 2))
    return _Update(P, W, G, F, added)


def _times(stack: Array, matrix: Array) -> Array:
    """``stack @ matrix``, (m, c, d) times (d, e), in one product."""
    flat = stack.reshape(-1, stack.shape[-1]) @ matrix
    return np.asarray(flat.reshape(*stack.shape[:-1], matrix.shape[1]))


def _inverse(S: Array) -> tuple[Array, Array]:
    """Inverses (m, c, c) and determinants (m,) of small symmetric matrices; a singular one has the inverse zero."""
    if S.shape[-1] == 1:
        det, adjugate = S[:, 0, 0], np.ones_like(S)
    elif S.shape[-1] == 2:
        det = S[:, 0, 0] * S[:, 1, 1] - S[:, 0, 1] * S[:, 1, 0]
        adjugate = np.eye(2) * np.trace(S, axis1=1, axis2=2)[:, None, None] - S
    else:
        det = np.linalg.det(S)
        regular = np.where((det != 0.0)[:, None, None], S, np.eye(S.shape[-1]))
        return np.linalg.inv(regular), det
    return np.asarray(adjugate / np.where(det == 0.0, 1.0, det)[:, None, None]), det
