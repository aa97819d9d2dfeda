"""The linear problem of sections, solved in a time that grows linearly with their number.

Unknowns of sections meet only in few rows: those of a section, of a setup, of a move from one rest to the next. Put in
the order of Cuthill and McKee, their part of the normal matrix is a narrow band; it is eliminated first, and what is
left is a small problem of the shared unknowns.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import cho_factor, cho_solve, cho_solve_banded, cholesky_banded
from scipy.sparse.csgraph import reverse_cuthill_mckee

from inercal.foundation.arrays import Array
from inercal.systems.imu.sections.problem import Problem, RowBlock
from inercal.systems.imu.sections.readings import Places


@dataclass(frozen=True, eq=False)
class _Gathered:
    """Rows of a block by the free unknowns: ``A`` (c k, s) and ``L`` (c, k, q); ``gather`` adds up cells by unknowns of
    sections; ``band`` says where in the band their products go."""

    r: Array
    A: Array
    L: Array
    used: Array
    variance: Array
    scatter: Array
    gather: sparse.csr_array
    band: Places
    low: NDArray[np.bool_]
    at: Places


@dataclass(frozen=True, eq=False)
class ArrowSolution:
    """The solution for some variances: changes ``shared`` (s,) and ``local`` (l,) of the free unknowns, restricted log
    likelihood ``value`` without the prior of variances, the sum of squares ``chi2`` at the solution, and the largest
    ``gain`` of it that a step brings."""

    shared: Array
    local: Array
    value: float
    chi2: float
    gain: float
    covariance: Array
    """Covariance (s, s) of the shared unknowns."""
    carried: Array
    """Change (l, s) of the unknowns of sections with the shared ones, its sign reversed."""
    _band: Array
    _scale: Array

    @cached_property
    def given(self) -> Array:
        """Covariance (l, l) of the unknowns of sections where the shared ones are known."""
        return np.asarray(cho_solve_banded((self._band, True), np.diag(self._scale)) * self._scale[:, None])

    @property
    def local_variance(self) -> Array:
        """Variances (l,) of the unknowns of sections."""
        by_shared = np.einsum("ls,st,lt->l", self.carried, self.covariance, self.carried)
        return np.asarray(np.diag(self.given) + by_shared)


class Linear:
    """The linear problem of a point, for any variances that nobody states.

    ``shared`` and ``local`` are the places in x of the free unknowns, the latter in the order of the band.
    """

    def __init__(self, problem: Problem, x: Array, blocks: Sequence[RowBlock]) -> None:
        free, count = problem.free, problem.shared
        self.shared = np.flatnonzero(free[:count])
        self.names = list(problem.sizes)
        inside = count + np.flatnonzero(free[count:])
        self.local, self.width = _order(inside, [b.at for b in blocks if b.seen.any()], len(free))
        place = np.full(len(free), -1)
        place[self.local] = np.arange(len(self.local))
        self.sources = [b.sources for b in blocks if b.seen.any()]
        self._blocks = [self._gathered(b, place) for b in blocks if b.seen.any()]
        at = np.concatenate([self.shared, self.local])
        self._sd, self._off, self._ruled = problem.sd[at], (problem.mean - x)[at], problem.ruled[at]
        self.sizes = np.array(
            [[np.log(size.median), size.spread] for size in problem.sizes.values()]
        ).reshape(-1, 2)

    def without(self, cell: int, block: int = 0) -> Linear:
        """The problem without a cell of a block: the means of a section, which are the first block, or a move."""
        blocks = list(self._blocks)
        used = blocks[block].used.copy()
        used[cell] = 0.0
        blocks[block] = replace(blocks[block], used=used)
        out = copy(self)
        out._blocks = blocks
        return out

    def _gathered(self, block: RowBlock, place: Places) -> _Gathered:
        """A block by the free unknowns."""
        c, k, q = block.local.shape
        inside, at = len(self.local), place[block.at]
        L = np.where((at >= 0)[:, None, :], block.local, 0.0)
        there = np.flatnonzero(at.ravel() >= 0)
        gather = sparse.csr_array((np.ones(len(there)), (at.ravel()[there], there)), shape=(inside, c * q))
        i, j = np.broadcast_arrays(at[:, :, None], at[:, None, :])
        low = (i >= j) & (j >= 0)
        scatter = np.array([block.scatter.get(name, np.zeros((c, k))) for name in self.names]).reshape(
            -1, c, k
        )
        A = block.shared[:, :, self.shared].reshape(c * k, -1)
        used = block.seen.astype(float)
        return _Gathered(
            block.residual, A, L, used, np.where(block.seen, block.variance, 1.0), scatter * used, gather,
            ((i - j) * inside + j)[low], low, at,
        )  # fmt: skip

    def variances(self, z: Array) -> list[Array]:
        """Variances (c, k) of the rows of each block by the logarithms ``z`` of the components."""
        return [
            cells.variance + np.tensordot(np.exp(2.0 * z), cells.scatter, axes=1) for cells in self._blocks
        ]

    def sd(self, z: Array) -> Array:
        """Standard deviations beforehand of the free unknowns, the shared ones first."""
        return np.where(self._ruled >= 0, np.exp(z)[self._ruled] if len(z) else 1.0, self._sd)

    def cost(self, z: Array) -> float:
        """Sum of squares at the point itself."""
        sums = [np.sum(c.used * c.r**2 / v) for c, v in zip(self._blocks, self.variances(z), strict=True)]
        return float(sum(sums) + np.sum((self._off / self.sd(z)) ** 2))

    def at(self, z: Array, damping: float = 0.0) -> ArrowSolution:
        """The solution by the logarithms ``z`` of the components; with ``damping`` a step of Levenberg and
        Marquardt."""
        s, inside = len(self.shared), len(self.local)
        sd = self.sd(z)
        weight, prior = 1.0 / sd**2, self._off / sd**2
        H, b, phi, size = np.diag(weight[:s]), prior[:s].copy(), float(self._off @ prior), 0.0
        B, g, flat = np.zeros((inside, s)), prior[s:].copy(), np.zeros((self.width + 1) * inside)
        for cells, v in zip(self._blocks, self.variances(z), strict=True):
            w = cells.used / v
            size += float(np.sum(np.log(v[cells.used > 0.0])))
            WA, wr = cells.A * w.reshape(-1, 1), w * cells.r
            H += cells.A.T @ WA
            b += cells.A.T @ wr.ravel()
            phi += float(np.sum(wr * cells.r))
            if inside:
                LT = cells.L.transpose(0, 2, 1)
                B += cells.gather @ (LT @ WA.reshape(*w.shape, s)).reshape(-1, s)
                g += cells.gather @ (LT @ wr[..., None]).ravel()
                products = (LT @ (w[..., None] * cells.L))[cells.low]
                flat += np.bincount(cells.band, products, minlength=len(flat))
        band = flat.reshape(self.width + 1, inside)
        if inside:
            band[0] += weight[s:]
            band[0] = np.where(band[0] > 0.0, band[0], 1.0)  # tilts of a section that is left out
            scale = 1.0 / np.sqrt(band[0])
            for k in range(self.width + 1):
                band[k, : inside - k] *= scale[: inside - k] * scale[k:]
            band[0] = 1.0 + damping
            factor = cholesky_banded(band, lower=True, check_finite=False)
            both = cho_solve_banded(
                (factor, True), np.column_stack([B, g]) * scale[:, None], check_finite=False
            )
            both *= scale[:, None]
        else:
            factor, scale, both = band, np.ones(0), np.zeros((0, s + 1))
        carried, own = both[:, :s], both[:, s]
        left = H + damping * np.diag(np.diag(H)) - B.T @ carried
        half = 1.0 / np.sqrt(np.diag(H))
        left = 0.5 * (left + left.T) * np.outer(half, half)
        root = cho_factor(left + 1e-14 * np.eye(s), lower=True, check_finite=False)
        covariance = cho_solve(root, np.eye(s), check_finite=False) * np.outer(half, half)
        shared = half * cho_solve(root, half * (b - B.T @ own), check_finite=False)
        local = own - carried @ shared
        gain = float(b @ shared + g @ local)
        volume = 2.0 * float(np.sum(np.log(np.diag(root[0]) / half)) + np.sum(np.log(factor[0] / scale)))
        known = float(np.sum(np.log(sd[np.isfinite(sd)])))
        value = -0.5 * (size + 2.0 * known + volume + phi - gain)
        return ArrowSolution(shared, local, value, phi - gain, gain, covariance, carried, factor, scale)

    def weighed_misfits(self, z: Array, misses: Array) -> Array:
        """Lengths (k,) of residuals (k, c, 9) of the means, in their standard deviations."""
        weighed = self._blocks[0].used / self.variances(z)[0] * misses**2
        return np.asarray(np.sqrt(np.sum(weighed, axis=(1, 2))))

    def displaced(self, z: Array, solution: ArrowSolution, misses: Array) -> Array:
        """Changes (k, s) of the shared unknowns by residuals (k, c, 9) of the means alone."""
        cells, count = self._blocks[0], len(misses)
        weighed = cells.used / self.variances(z)[0] * misses
        by_shared = weighed.reshape(count, -1) @ cells.A
        by_local = cells.gather @ np.einsum("ckq,mck->cqm", cells.L, weighed).reshape(-1, count)
        return np.asarray((by_shared - by_local.T @ solution.carried) @ solution.covariance)

    def second_order(self, ahead: Sequence[RowBlock], step: ArrowSolution, part: float) -> Linear:
        """The problem whose residuals are the second derivatives of those along a step, by the rows ``ahead``, a part
        of it on."""
        blocks = []
        for cells, there in zip(self._blocks, (b for b in ahead if b.seen.any()), strict=True):
            inside = np.append(step.local, 0.0)[cells.at]
            along = (cells.A @ step.shared).reshape(cells.r.shape) + (cells.L @ inside[..., None])[..., 0]
            change = there.residual - cells.r + part * along
            blocks.append(replace(cells, r=2.0 / part**2 * change * cells.used))
        out = copy(self)
        out._blocks, out._off = blocks, np.zeros_like(self._off)
        return out

    def size(self, z: Array) -> Array:
        """Standard deviations of the free unknowns if all others were known."""
        weight = 1.0 / self.sd(z) ** 2
        s = len(self.shared)
        for cells, v in zip(self._blocks, self.variances(z), strict=True):
            w = cells.used / v
            weight[:s] += np.sum(w.reshape(-1, 1) * cells.A**2, axis=0)
            weight[s:] += cells.gather @ np.sum(w[..., None] * cells.L**2, axis=1).ravel()
        return 1.0 / np.sqrt(np.maximum(weight, 1e-300))

    def scores(self, z: Array, solution: ArrowSolution, effects: Array) -> tuple[Array, Array]:
        """Scores (k,) and information (k, k) of ``effects`` (k, c, 9) on the means that are no unknowns.

        Their sizes would be information^-1 times scores; the sum of squares would fall by scores times sizes.
        """
        cells, count = self._blocks[0], len(effects)
        weighed = cells.used / self.variances(z)[0] * effects
        by_local = cells.gather @ np.einsum("ckq,mck->cqm", cells.L, weighed).reshape(-1, count)
        shared = self.displaced(z, solution, effects)
        local = (solution.given @ by_local).T - shared @ solution.carried.T
        inside = np.pad(local, ((0, 0), (0, 1)))[:, cells.at]
        left = effects - (shared @ cells.A.T).reshape(effects.shape)
        left -= np.einsum("ckq,mcq->mck", cells.L, inside)
        rest = self.left(z, solution)[0][0]
        scores = np.einsum("mck,ck->m", weighed, rest)
        return scores, np.asarray(np.einsum("mck,nck->mn", weighed, left))

    def likelihood(self, z: Array) -> float:
        """Restricted log likelihood with the prior of the components."""
        return self.at(z).value - 0.5 * float(np.sum(((z - self.sizes[:, 0]) / self.sizes[:, 1]) ** 2))

    def left(self, z: Array, solution: ArrowSolution) -> list[tuple[Array, Array]]:
        """Of each block what the solution leaves of the residuals (c, k), and the covariance (c, k, k) of that; both 0
        for rows that do not count."""
        out = []
        for cells, v in zip(self._blocks, self.variances(z), strict=True):
            A, L, given = self._by_shared(cells, solution), cells.L, self._given(cells, solution)
            inside = np.append(solution.local, 0.0)[cells.at]
            rest = cells.r - (cells.A @ solution.shared).reshape(v.shape) - (L @ inside[..., None])[..., 0]
            covariance = -L @ given @ L.transpose(0, 2, 1) - A @ solution.covariance @ A.transpose(0, 2, 1)
            covariance[:, range(v.shape[1]), range(v.shape[1])] += v
            both = cells.used[:, :, None] * cells.used[:, None, :]
            out.append((cells.used * rest, both * covariance))
        return out

    def shares(self, z: Array, solution: ArrowSolution, J: Array) -> tuple[list[Array], Array]:
        """Variances (c, k, p) of p numbers, whose derivatives by the first p shared unknowns are ``J`` (p, p), by the
        noise of each row; and (s + l, p) by what is known beforehand of each unknown."""
        C, of_rows = solution.covariance[:, : len(J)] @ J.T, []
        for cells, v in zip(self._blocks, self.variances(z), strict=True):
            of_rows.append((cells.used / v)[..., None] * (self._by_shared(cells, solution) @ C) ** 2)
        return of_rows, (np.vstack([C, -solution.carried @ C]) / self.sd(z)[:, None]) ** 2

    def _by_shared(self, cells: _Gathered, solution: ArrowSolution) -> Array:
        """Derivatives (c, k, s) by the shared unknowns, those of sections carried along."""
        carried = np.vstack([solution.carried, np.zeros((1, len(self.shared)))])[cells.at]
        return np.asarray(cells.A.reshape(*cells.r.shape, -1) - cells.L @ carried)

    def _given(self, cells: _Gathered, solution: ArrowSolution) -> Array:
        """Covariances (c, q, q) of the unknowns of sections where the shared ones are known."""
        there = cells.at >= 0
        given = solution.given[cells.at[:, :, None], cells.at[:, None, :]] if len(self.local) else 0.0
        return np.where(there[:, :, None] & there[:, None, :], given, 0.0)


def _order(inside: Places, groups: list[Places], p: int) -> tuple[Places, int]:
    """Free unknowns of sections in an order in which those that meet in a cell lie close, and how close."""
    if not len(inside):
        return inside, 0
    place = np.full(p, -1)
    place[inside] = np.arange(len(inside))
    pairs = [np.broadcast_arrays(place[at][:, :, None], place[at][:, None, :]) for at in groups]
    i, j = (np.concatenate([pair[k].ravel() for pair in pairs]) for k in (0, 1))
    both = (i >= 0) & (j >= 0)
    graph = sparse.csr_array((np.ones(both.sum()), (i[both], j[both])), shape=(len(inside),) * 2)
    graph.sum_duplicates()
    order = reverse_cuthill_mckee(graph, symmetric_mode=True)
    where = np.empty(len(inside), dtype=int)
    where[order] = np.arange(len(inside))
    return inside[order], int(np.max(np.abs(where[i[both]] - where[j[both]]), initial=0))
