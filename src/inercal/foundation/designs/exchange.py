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
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.computing.executors import Executor
from inercal.foundation.designs.criteria import Candidates, Criterion, Mask, covariance, require
from inercal.foundation.designs.search import from_starts
from inercal.foundation.errors import InputError

if TYPE_CHECKING:
    from inercal.foundation.designs.exchange_kernel import DesignState, Update

Indices = NDArray[np.intp]

_SINGULAR = 1e-9
"""Smallest singular value, over the largest, of a direction that a start has seen."""


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
    executor: Executor | None = None,
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
        `inercal.foundation.designs.criteria` with a D-efficiency of 0.995.
    allowed : (m,) bool, optional
        Candidates that may be taken; all if absent.
    repeats : bool
        Whether a candidate may be taken more than once.
    executor : Executor, optional
        Place in which the starts are computed; the digits are the same in any.

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
    for best in from_starts(partial(_from_start, W, p, weights, n, repeats), rng.spawn(starts), executor):
        if best is None:
            raise InputError(
                where, f"found none that identifies all of {p} coefficients, expected more positions"
            )
        designs.append(np.sort(indices[best]))
    values = np.array([_value(candidates.take(chosen), criterion) for chosen in designs])
    if not np.isfinite(values).any():
        raise InputError(
            where,
            f"found none that tells all of {p} coefficients to working precision, expected more positions",
        )
    # of determinants as such, whose logarithms may be near zero
    least = _first_least(np.exp(values - values.min()) if criterion.weights is None else values)
    return Design(designs[least], float(values[least]), values)


def _from_start(
    W: Array, p: int, weights: Array | None, n: int, repeats: bool, rng: np.random.Generator
) -> Indices | None:
    """A random design of ``n`` rows of W (m, c, d) after all exchanges; None where none identifies the coefficients."""
    first = _start(W[..., :p], n, repeats, rng)
    return None if first is None else _improved(W, p, weights, first, repeats)


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
    from inercal.foundation.designs.exchange_kernel import next_exchange

    rows = np.ascontiguousarray(np.moveaxis(W, 0, 2))
    chosen, n = first.copy(), len(first)
    d = W.shape[2]
    all_rows = W[chosen].reshape(-1, d)
    M = all_rows.T @ all_rows + np.diag(np.repeat([0.0, 1.0], [p, d - p]))
    state = _state(rows, p, weights, M)
    taken = np.zeros(len(W), dtype=bool)
    taken[chosen] = not repeats
    k = 0
    while True:
        k, best = next_exchange(state, chosen, k, taken)
        if best < 0:
            return chosen
        taken[chosen[k]], taken[best] = False, not repeats
        M += W[best].T @ W[best] - W[chosen[k]].T @ W[chosen[k]]
        chosen[k] = best
        state = _state(rows, p, weights, M)
        k = (k + 1) % n


def _first_least(values: Array) -> int:
    """Index of the first value that is least but for rounding, so that ties end alike on every machine."""
    from inercal.foundation.designs.exchange_kernel import TIE

    least = float(values.min())
    return int(np.argmax(values <= least + TIE * abs(least)))


def _state(rows: Array, p: int, weights: Array | None, M: Array) -> DesignState:
    """Quantities that the exchanges of a design of information ``M`` use; ``rows`` (c, d, m) of the candidates."""
    from inercal.foundation.designs.exchange_kernel import DesignState, along, own_products

    c, d, _ = rows.shape
    P = np.asarray(np.linalg.inv(M), dtype=float)
    whole = _update(rows, P)
    common = whole
    if d > p:
        common = _update(np.ascontiguousarray(rows[:, p:]), np.asarray(np.linalg.inv(M[p:, p:]), dtype=float))
    if weights is None:
        none = np.empty((c, d, 0))
        return DesignState(whole, common, d > p, none, none, 0.0)
    H, K = np.empty_like(whole.G), np.empty_like(whole.F)
    along(whole.G, weights, H)
    own_products(H, whole.G, K)
    return DesignState(whole, common, d > p, H, K, float(np.sum(P * weights)))


def _update(W: Array, P: Array) -> Update:
    """The update of rows W (c, d, m) about an information matrix whose inverse is P (d, d)."""
    from inercal.foundation.designs.exchange_kernel import Update, update

    c, _, m = W.shape
    G, F, added = np.empty(W.shape), np.empty((c, c, m)), np.empty(m)
    update(W, P, G, F, added)
    return Update(W, G, F, added)
