"""Exact Sobol indices, Shapley effects and bias of what an instrument on a rig reads, at every position.

An output u_n C_nb v_b is linear in each rotation of the chain, and the errors are independent. The component of
the ANOVA decomposition (Sobol 1993; Efron and Stein 1981) that belongs to a set of errors is therefore the chain
with the mean rotation of every error outside the set, and the deviation from it inside. Means and covariances of
a row carried forward and of a column carried backward give the variance caused by an error alone (V_i), by it in
company (VT_i - V_i) and by all (V): each a sum of non-negative terms, of which none is subtracted, at a cost that
is linear in the length of the chain.

Not covered: correlated errors, one variable at two places of the chain, outputs that are no polynomials of the
attitude. Offsets, and outputs quadratic in a reference, are in `inercal.foundation.sensitivities.dense`.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.rigs.chain import Chain, Error, Fixed, Joint
from inercal.foundation.rigs.outputs import Output
from inercal.foundation.rigs.patterns import Distribution, Known
from inercal.foundation.sensitivities.indices import Indices, VarianceParts, by_position, shapley_effects

if TYPE_CHECKING:
    from inercal.foundation.sensitivities import kernels


ODD = np.array([True, False, True, False])
"""Which of s, e, s e, e^2 change sign with the angle."""


@dataclass(frozen=True, eq=False)
class Moments:
    """Moments of a random angle d: of the first f functions of s = sin d, e = 1 - cos d = 2 sin^2(d/2), s e, e^2.

    With K = skew(axis) and C = -K^2 (1 in the plane, 0 along the axis) the rotation matrix is R(d) = I + s K - e C;
    R(d) x R(d), which carries outputs quadratic in a reference, needs s e and e^2 besides. The four functions are of
    order d, d^2, d^3, d^4. In this order each is split into its regression on those before it and the rest,
    f - E f = L xi: the parts xi are uncorrelated, their variances are sums of squares, and nothing cancels however
    small the angle.

    ``mean`` (f,) their expectations; ``variance`` (f,) of the uncorrelated parts xi; ``lower`` (f, f), unit lower
    triangular, with functions - mean = lower @ xi.
    """

    mean: Array
    variance: Array
    lower: Array


def moments(distribution: Distribution, degree: int = 1) -> Moments:
    """Moments of an angle [rad]: of s and e for ``degree`` 1, of s e and e^2 too for ``degree`` 2.

    Of a symmetric distribution the odd means and the covariances of odd with even functions are exactly zero.
    """
    nodes, weights = distribution.nodes, distribution.weights
    s, e = np.sin(nodes), 2.0 * np.sin(0.5 * nodes) ** 2
    functions = np.stack([s, e, s * e, e * e][: 2 * degree])
    symmetric = np.array_equal(nodes, -nodes[::-1]) and np.array_equal(weights, weights[::-1])
    odd = ODD[: len(functions)]
    mean = functions @ weights
    if symmetric:
        mean[odd] = 0.0
    parts, lower, variance = functions - mean[:, None], np.eye(len(functions)), np.zeros(len(functions))
    for i in range(len(functions)):
        for j in range(i):
            if variance[j] > 0.0 and not (symmetric and odd[i] != odd[j]):
                lower[i, j] = weights @ (parts[i] * parts[j]) / variance[j]
                parts[i] -= lower[i, j] * parts[j]
        variance[i] = weights @ np.square(parts[i])
    return Moments(mean, variance, lower)


Integers = NDArray[np.int64]

CHUNK = 128
"""Positions below which a thread of its own is not worth while."""

# An output whose standard deviation is that of so many roundings of its terms does not vary.
_ROUNDING = 8.0 * np.finfo(float).eps


def analyse(
    chain: Chain,
    outputs: Sequence[Output],
    angles: ArrayLike,
    shapley: bool = False,
    second: bool = False,
    threads: int | None = None,
) -> Indices:
    """Exact parts of variance of outputs of a chain at ``angles`` (n, joints) [rad].

    The chain's offsets move the instrument without turning it, so they have no part. ``shapley`` effects and
    ``second``-order parts are given if asked for; ``threads`` are as many as processors if absent, and the digits do
    not depend on them. Raises ValueError for angles that do not fit the joints, or no threads.
    """
    return by_position(
        lambda standing, at: _analyse(standing, outputs, at, shapley, second, threads),
        chain,
        positions(chain, angles),
    )


def _analyse(
    chain: Chain, outputs: Sequence[Output], angles: Array, shapley: bool, second: bool, threads: int | None
) -> Indices:
    """The parts where no error follows an angle."""
    passes = _Passes.of(chain, outputs, angles)
    variance, bias, first, interaction = passes.parts(threads)
    return Indices(
        factors=chain.factors,
        outputs=tuple(output.name for output in outputs),
        units=tuple(output.unit for output in outputs),
        scales=np.array([output.scale for output in outputs]),
        angles=passes.rig.angles,
        variance=variance,
        bias=bias,
        first_variance=first,
        interaction_variance=interaction,
        method={"name": "exact"},
        shapley=shapley_effects(partial(passes.totals, threads), len(chain.factors)) if shapley else None,
        second_variance=passes.second(threads) if second else None,
    )


def closed_variance(
    chain: Chain, outputs: Sequence[Output], angles: ArrayLike, factors: Sequence[str]
) -> Array:
    """Variance (o, n) that a set of errors causes, alone and among themselves: Var E[Y | these errors].

    Raises `KeyError`: a factor that the chain does not have; `ValueError`: as `analyse`; a chain in which errors are
    known or follow an angle (see `Chain.standing`).
    """
    for name in factors:
        if name not in chain.factors:
            raise KeyError(name)
    passes = _Passes.of(chain, outputs, angles)
    inside = np.array([[name in factors] for name in chain.factors], dtype=float).reshape(-1, 1)
    return passes.scaled(inside).parts(None)[0]


def positions(chain: Chain, angles: ArrayLike) -> Array:
    """Angles (n, joints) [rad] that fit the joints of a chain; raises ValueError for others."""
    given = np.ascontiguousarray(angles, dtype=float)
    if given.ndim != 2 or given.shape[1] != len(chain.joints):
        raise ValueError(
            f"found angles of shape {given.shape}, expected (n, {len(chain.joints)}) for the joints "
            f"{', '.join(chain.joints) or 'none'}"
        )
    if not np.all(np.isfinite(given)):
        raise ValueError("found an angle that is not finite")
    return given


def drop_rounding(parts: VarianceParts, outputs: Sequence[Output], spread: float) -> VarianceParts:
    """Variance components, set to zero where they are rounding errors.

    ``spread`` is the variance of all matrices together, to which a row of unit length is exposed.
    """
    lengths = [np.dot(o.reference, o.reference) * np.dot(o.axis, o.axis) for o in outputs]
    null = parts.variance <= _ROUNDING**2 * spread * np.array(lengths)[:, None]
    for part in (parts.variance, parts.first, parts.interaction):
        part[null] = 0.0
    return parts


@dataclass(frozen=True, eq=False)
class _Passes:
    """Passes of the kernels over a chain at its positions, and the outputs."""

    rig: kernels.Rig
    outputs: tuple[Output, ...]

    @classmethod
    def of(cls, chain: Chain, outputs: Sequence[Output], angles: ArrayLike) -> _Passes:
        """Put into arrays; raises ValueError for angles that do not fit."""
        from inercal.foundation.sensitivities import kernels

        given = positions(chain, angles)
        elements: list[tuple[int, int, int]] = []
        fixed: list[Array] = []
        errors = np.zeros((len(chain.errors), len(kernels.ERROR_ROW)))
        for element in chain.elements:
            if isinstance(element, Fixed):
                elements.append((kernels.FIXED, 0, len(fixed)))
                fixed.append(element.rotation)
                continue
            if isinstance(element, Known):
                raise ValueError("found a known error, expected the chain of one position")
            axis = "xyz".index(element.axis)
            if isinstance(element, Joint):
                elements.append((kernels.JOINT, axis, chain.joints.index(element.name)))
            elif not element.is_offset:
                place = chain.factors.index(element.name)
                elements.append((kernels.ERROR, axis, place))
                errors[place] = _error_row(element)
        matrices = np.array(fixed).reshape(-1, 3, 3)
        u, row = _distinct([output.reference for output in outputs])
        v, column = _distinct([output.axis for output in outputs])
        rig = kernels.Rig(
            np.array(elements, dtype=np.int64).reshape(-1, 3),
            np.ascontiguousarray([matrices, matrices.transpose(0, 2, 1)]),
            errors,
            given,
            u,
            v,
            np.stack([row, column], axis=1),
        )
        return cls(rig, tuple(outputs))

    def scaled(self, factor: Array | float) -> _Passes:
        """The same with the variances of the errors multiplied by a factor, (k, 1) or a number, means kept."""
        errors = self.rig.errors.copy()
        errors[:, 2:4] *= factor
        return replace(self, rig=self.rig._replace(errors=errors))

    def parts(self, threads: int | None) -> VarianceParts:
        """The parts of the variance at all positions."""
        from inercal.foundation.sensitivities import kernels

        shape = (len(self.outputs), len(self.rig.angles))
        of_each = (*shape, len(self.rig.errors))
        parts = VarianceParts(np.zeros(shape), np.zeros(shape), np.zeros(of_each), np.zeros(of_each))
        self._run(kernels.analyse, threads, parts)
        return drop_rounding(parts, self.outputs, float(np.sum(self.rig.errors[:, 2:4])))

    def second(self, threads: int | None) -> Array:
        """V_ij (o, n, k, k)."""
        from inercal.foundation.sensitivities import kernels

        k = len(self.rig.errors)
        second = np.zeros((len(self.outputs), len(self.rig.angles), k, k))
        self._run(kernels.second_order, threads, second)
        return second

    def totals(self, threads: int | None, z: float) -> Array:
        """VT_i (o, n, k) with all variances multiplied by z."""
        _, _, first, interaction = self.scaled(z).parts(threads)
        return first + interaction

    def _run(self, passes: Callable[..., None], threads: int | None, results: Array | VarianceParts) -> None:
        """Run a kernel over all positions, in chunks on several threads where there are many."""
        if threads is not None and threads < 1:
            raise ValueError(f"found {threads} threads, expected 1 or more")
        n, workers = len(self.rig.angles), threads or os.cpu_count() or 1
        if workers == 1 or n <= CHUNK:
            passes(0, n, self.rig, results)
            return
        edges = np.linspace(0, n, min(4 * workers, -(-n // CHUNK)) + 1).astype(int).tolist()
        with ThreadPoolExecutor(workers) as pool:
            running = [pool.submit(passes, *chunk, self.rig, results) for chunk in pairwise(edges)]
            for done in running:
                done.result()


def _error_row(error: Error) -> Array:
    """Numbers of an error as in `inercal.foundation.sensitivities.kernels.ERROR_ROW`."""
    moment = moments(error.distribution)
    return np.array([-moment.mean[1], moment.mean[0], *moment.variance, -moment.lower[1, 0]])


def _distinct(vectors: Sequence[Array]) -> tuple[Array, Integers]:
    """Distinct rows (r, 3), and the place of each vector among them."""
    rows = np.array(vectors, dtype=float).reshape(-1, 3)
    distinct, places = np.unique(rows, axis=0, return_inverse=True)
    return np.ascontiguousarray(distinct), places.reshape(-1).astype(np.int64)
