"""Normal equations of a chain of nodes, solved from the first to the last and back (block elimination).

Each node has m errors of its state, nodes of one rest share three angles of its reference attitude, and all share the p
coefficients: an arrow. Of each interval four blocks are at hand, [x_k (m), angles (3), x_k+1 (m), coefficients (p)];
when the rows of interval and node are in, the first is eliminated, with the angles where the rest ends.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inercal.foundation._jit import inlined, kernel
from inercal.foundation.arrays import Array


class NodeChain(NamedTuple):
    """The rows of a chain, linearised: x_k+1 - F x_k - G c = e + noise of information W, and at the nodes.

    ``F`` (k, m, m), ``G`` (k, m, p), ``e`` (k, m), ``W`` (k, m, m) of intervals; ``rest`` (k + 1,) number of the rest
    of each node; velocity ``v`` (k + 1, 3), which is 0 with information ``velocity``; ``angles`` (k + 1, 3) [rad] of
    the attitude against the reference of its rest with information ``attitude``, 0 for none; ``start`` (m,) information
    and ``begin`` (m,) deviation of the first node; ``prior`` (p,) information and ``c`` (p,) deviation of coefficients.
    """

    F: Array
    G: Array
    e: Array
    W: Array
    rest: NDArray[np.int64]
    v: Array
    velocity: float
    angles: Array
    attitude: float
    start: Array
    begin: Array
    prior: Array
    c: Array


@inlined
def _eliminate(H: Array, g: Array, count: int, gone: Array) -> None:
    """Eliminate the first ``count`` unknowns from H x = g, in place; ``gone`` is used up. Of H only the upper triangle
    is used."""
    n = len(g)
    for i in range(count):
        gone[i] = 1.0
        for j in range(n):
            if gone[j] == 0.0 and H[i, j] != 0.0:
                by = H[i, j] / H[i, i]
                g[j] -= by * g[i]
                for k in range(j, n):
                    H[j, k] -= by * H[i, k]


@inlined
def _add_interval(
    F: Array, G: Array, e: Array, W: Array, H: Array, g: Array, row: Array, weighted: Array
) -> None:
    """Add the rows of an interval, ``F`` (m, m), ``G`` (m, p), ``e`` (m,), ``W`` (m, m), to H and g."""
    m, n = len(F), len(g)
    for a in range(m):
        for j in range(n):
            row[a, j] = 0.0
        for b in range(m):
            row[a, b] = -F[a, b]
        row[a, m + 3 + a] = 1.0
        for b in range(n - 2 * m - 3):
            row[a, 2 * m + 3 + b] = -G[a, b]
    for a in range(m):
        for j in range(n):
            total = 0.0
            for b in range(m):
                total += W[a, b] * row[b, j]
            weighted[a, j] = total
    for j in range(n):
        for a in range(m):
            g[j] += weighted[a, j] * e[a]
            if row[a, j] != 0.0:
                for i in range(n):
                    H[j, i] += row[a, j] * weighted[a, i]


@inlined
def _add_node(v: Array, velocity: float, angles: Array, attitude: float, m: int, H: Array, g: Array) -> None:
    """Add the rows of a node to H and g, of its velocity ``v`` (3,) and its ``angles`` (3,), each with its
    information."""
    for i in range(3):
        H[3 + i, 3 + i] += velocity
        g[3 + i] -= velocity * v[i]
        b = m + i
        H[i, i] += attitude
        H[b, b] += attitude
        H[i, b] -= attitude
        g[i] -= attitude * angles[i]
        g[b] += attitude * angles[i]


@inlined
def _cleared(H: Array, g: Array, begin: int, end: int) -> None:
    """Forget what H and g say of the unknowns from ``begin`` to below ``end``."""
    for i in range(begin, end):
        g[i] = 0.0
        for j in range(len(g)):
            H[i, j] = H[j, i] = 0.0


@inlined
def _moved_on(H: Array, g: Array, m: int, ends: bool) -> None:
    """Put the next node in the place of the one that was eliminated, with its angles where the rest ``ends``."""
    n, by = len(g), m + 3
    if ends:
        _cleared(H, g, m, by)
    for i in range(m):
        for j in range(i, m):
            H[i, j] = H[by + i, by + j]
        for j in range(m, by):
            H[i, j] = H[j, by + i]
        for j in range(2 * m + 3, n):
            H[i, j] = H[by + i, j]
        g[i] = g[by + i]
    _cleared(H, g, by, by + m)


@inlined
def begun(start: Array, begin: Array, prior: Array, c: Array, H: Array, g: Array) -> None:
    """Set H and g to what is known beforehand of the first node and of the coefficients, as in `NodeChain`."""
    n, p = len(g), len(c)
    for i in range(n):
        g[i] = 0.0
        for j in range(n):
            H[i, j] = 0.0
    for i in range(len(start)):
        H[i, i], g[i] = start[i], -start[i] * begin[i]
    for i in range(p):
        at = n - p + i
        H[at, at], g[at] = prior[i], -prior[i] * c[i]


@inlined
def kept(H: Array, g: Array, rows: Array, right: Array) -> None:
    """Copy the first rows of H and g to ``rows`` and ``right``."""
    for i in range(len(right)):
        right[i] = g[i]
        for j in range(len(g)):
            rows[i, j] = H[i, j]


def forward(chain: NodeChain, H: Array, g: Array, rows: Array, right: Array) -> None:
    """Eliminate all nodes: ``H`` (n, n) and ``g`` (n,), n = 2 m + 3 + p, end with the coefficients alone; ``rows``
    (k + 1, m + 3, n) and ``right`` (k + 1, m + 3) keep what `backward` needs. Of H the upper triangle counts.

    Raises `numpy.linalg.LinAlgError` where a matrix is singular.
    """
    m, n = chain.F.shape[1], len(g)
    try:
        _eliminate_all(chain, H, g, rows, right, np.empty(n), np.empty((m, n)), np.empty((m, n)))
    except ZeroDivisionError as error:
        raise np.linalg.LinAlgError("a pivot of the elimination is zero") from error


@kernel
def _eliminate_all(
    chain: NodeChain, H: Array, g: Array, rows: Array, right: Array, gone: Array, row: Array, weighted: Array
) -> None:
    """Eliminate all nodes as in `forward`; ``gone`` (n,), ``row`` and ``weighted`` (m, n) are used up."""
    m, n, count = chain.F.shape[1], len(g), len(chain.rest)
    begun(chain.start, chain.begin, chain.prior, chain.c, H, g)
    for k in range(count):
        ends = k == count - 1 or chain.rest[k + 1] != chain.rest[k]
        _add_node(chain.v[k], chain.velocity, chain.angles[k], chain.attitude, m, H, g)
        for i in range(n):
            gone[i] = 0.0
        if k < count - 1:
            _add_interval(chain.F[k], chain.G[k], chain.e[k], chain.W[k], H, g, row, weighted)
        _eliminate(H, g, m + 3 if ends and chain.attitude > 0.0 else m, gone)
        kept(H, g, rows[k], right[k])
        _moved_on(H, g, m, ends)


def backward(rest: NDArray[np.int64], rows: Array, right: Array, c: Array, x: Array, angles: Array) -> None:
    """Errors ``x`` (k + 1, m) of the nodes, and ``angles`` (k + 1, 3) of the references, of those of the coefficients
    ``c`` (p,)."""
    _put_back(rest, rows, right, c, x, angles, np.empty(rows.shape[2]))


@kernel
def _put_back(
    rest: NDArray[np.int64], rows: Array, right: Array, c: Array, x: Array, angles: Array, z: Array
) -> None:
    """Put errors back into the rows as in `backward`; ``z`` (n,) is used up."""
    m = x.shape[1]
    n = rows.shape[2]
    for k in range(len(rest) - 1, -1, -1):
        last = k == len(rest) - 1
        ends = last or rest[k + 1] != rest[k]
        for i in range(m):
            z[m + 3 + i] = 0.0 if last else x[k + 1, i]
        for i in range(3):
            z[m + i] = 0.0 if ends else angles[k + 1, i]
        for i in range(n - 2 * m - 3):
            z[2 * m + 3 + i] = c[i]
        for i in range(m + 2, -1, -1):
            if i >= m and not (ends and rows[k, i, i] > 0.0):
                continue
            total = right[k, i]
            for j in range(i + 1, n):
                total -= rows[k, i, j] * z[j]
            z[i] = total / rows[k, i, i]
        for i in range(m):
            x[k, i] = z[i]
        for i in range(3):
            angles[k, i] = z[m + i]


@inlined
def _completed(row: Array, i: int, Z: Array) -> None:
    """Covariances ``Z`` (n, n) of unknown i with those behind it, of its ``row`` (n,) at elimination."""
    n = len(row)
    for j in range(i + 1, n):
        total = 0.0
        for k in range(i + 1, n):
            total -= row[k] * Z[k, j]
        Z[i, j] = Z[j, i] = total / row[i]
    total = 1.0
    for k in range(i + 1, n):
        total -= row[k] * Z[i, k]
    Z[i, i] = total / row[i]


@inlined
def explained(F: Array, G: Array, Z: Array, row: Array, out: Array, coupled: Array) -> None:
    """Covariance ``out`` (m, m) of what the unknowns of covariance ``Z`` (n, n) say of an interval of ``F`` (m, m) and
    ``G`` (m, p), A Z A^T, and that ``coupled`` (m, p) with the coefficients, A Z."""
    m, n = len(F), len(Z)
    for b in range(m):
        for j in range(n):
            # column j of A Z, row b
            value = Z[m + 3 + b, j]
            for i in range(m):
                value -= F[b, i] * Z[i, j]
            for i in range(n - 2 * m - 3):
                value -= G[b, i] * Z[2 * m + 3 + i, j]
            row[j] = value
        for a in range(m):
            value = row[m + 3 + a]
            for i in range(m):
                value -= F[a, i] * row[i]
            for i in range(n - 2 * m - 3):
                value -= G[a, i] * row[2 * m + 3 + i]
            out[a, b] = value
        for i in range(n - 2 * m - 3):
            coupled[b, i] = row[2 * m + 3 + i]


def followed(chain: NodeChain, rows: Array, Z: Array, out: Array, coupled: Array, nodes: Array) -> None:
    """Covariance ``out`` (k, m, m) of what the solution says of each interval, and with the coefficients that of each
    interval ``coupled`` (k, m, p) and of each node and the reference of its rest ``nodes`` (k + 1, m + 3, p); ``Z``
    (n, n) begins with the covariance (p, p) of the coefficients at its end and zeros before."""
    follow(chain.F, chain.G, chain.rest, chain.attitude > 0.0, rows, Z, out, coupled, nodes, np.empty(len(Z)))


@kernel
def follow(
    F: Array, G: Array, rest: NDArray[np.int64], held: bool, rows: Array, Z: Array, out: Array, coupled: Array,
    nodes: Array, row: Array,
) -> None:  # fmt: skip
    """Follow the covariance as in `followed`, of a chain whose attitude is ``held`` or not; ``row`` (n,) is used up."""
    m, n = F.shape[1], len(Z)
    for k in range(len(rest) - 1, -1, -1):
        last = k == len(rest) - 1
        ends = last or rest[k + 1] != rest[k]
        first = m + 2 if ends and held else m - 1
        for i in range(first, -1, -1):
            _completed(rows[k, i], i, Z)
        if not last:
            explained(F[k], G[k], Z, row, out[k], coupled[k])
        for i in range(m + 3):
            for j in range(2 * m + 3, n):
                nodes[k, i, j - 2 * m - 3] = Z[i, j]
        for i in range(m):
            for j in range(m, n):
                if j < m + 3 or j >= 2 * m + 3:
                    Z[m + 3 + i, j] = Z[j, m + 3 + i] = Z[i, j]
            for j in range(m):
                Z[m + 3 + i, m + 3 + j] = Z[i, j]
