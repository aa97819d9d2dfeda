"""The exact analysis for chains of matrices of any size: offsets, and outputs polynomial in the references.

`inercal.foundation.sensitivities.exact` in plain NumPy, all positions at once. A point carried through a rig with
offsets is u^T T v with homogeneous 4 x 4 transforms (`homogeneous`). An output quadratic in a reference u is linear in
R x R, u_i u_j Q_ij -> (u x u) (R x R) vec(Q); a sum of such terms is one output of block-diagonal matrices (`blocks`).
With degrees (1, 1, 2), for instance, earth rate w, gravity a and a gyro that reads k w + D a + a^T Q a::

    Output("drift", np.concatenate([w, a, np.kron(a, a)]), np.concatenate([k, D, Q.ravel()]), "rad/s", 1.0)

The blocks share their errors, as they must.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.rotations import elementary, skew
from inercal.foundation.rigs.chain import Chain, Error, Fixed, Joint
from inercal.foundation.rigs.outputs import Output
from inercal.foundation.rigs.patterns import Known
from inercal.foundation.sensitivities.exact import drop_rounding, moments, positions
from inercal.foundation.sensitivities.indices import Indices, VarianceParts, shapley_effects


@dataclass(frozen=True, eq=False)
class Random:
    """The matrix I + shift + sum of xi_p parts[p] of an error, xi_p uncorrelated with the given ``variances`` (p,).

    ``factor`` its place among the factors, ``shift`` (m, m), ``parts`` (p, m, m).
    """

    factor: int
    shift: Array
    variances: Array
    parts: Array


Element: TypeAlias = Array | Random
"""A known matrix (m, m), or (n, m, m) one for each position; or a random one."""


@dataclass(frozen=True, eq=False)
class Dense:
    """A chain of matrices at given ``angles`` (n, joints) [rad], base first."""

    factors: tuple[str, ...]
    angles: Array
    elements: tuple[Element, ...]

    def scaled(self, factor: Array | float) -> Dense:
        """The same with the variances of the errors multiplied by a factor, (k,) or a number, means kept."""
        by = np.broadcast_to(factor, len(self.factors))
        return replace(
            self,
            elements=tuple(
                replace(e, variances=e.variances * by[e.factor]) if isinstance(e, Random) else e
                for e in self.elements
            ),
        )


def blocks(chain: Chain, angles: ArrayLike, degrees: Sequence[int]) -> Dense:
    """Block-diagonal matrices of the rotations R of a chain: 1, R or R x R for each degree 0, 1 or 2.

    Offsets turn nothing and are left out; they keep their place among the factors.
    """
    given = positions(chain, angles)
    elements: list[Element] = []
    for element in chain.elements:
        if isinstance(element, Error):
            if not element.is_offset:
                elements.append(_random_rotation(element, chain.factors.index(element.name), degrees))
        elif isinstance(element, Joint):
            rotation = elementary(element.axis, given[:, chain.joints.index(element.name)])
            elements.append(_diagonal([_power(rotation, degree) for degree in degrees]))
        elif isinstance(element, Known):
            raise ValueError("found a known error, expected the chain of one position")
        else:
            elements.append(_diagonal([_power(element.rotation, degree) for degree in degrees]))
    return Dense(chain.factors, given, tuple(elements))


def homogeneous(chain: Chain, angles: ArrayLike) -> Dense:
    """Homogeneous transforms (4, 4) of a chain, as in `Chain.pose`, offsets [m] and their errors included."""
    elements = iter(blocks(chain, angles, (1, 0)).elements)
    transforms: list[Element] = []
    for element in chain.elements:
        if isinstance(element, Error) and element.is_offset:
            along = np.zeros((4, 4))
            along["xyz".index(element.axis), 3] = 1.0
            distribution = element.distribution
            transforms.append(
                Random(
                    chain.factors.index(element.name),
                    distribution.mean * along,
                    np.array([distribution.std**2]),
                    along[None],
                )
            )
            continue
        transform = next(elements)
        if isinstance(element, Fixed) and not isinstance(transform, Random):
            transform[:3, 3] = element.offset
        transforms.append(transform)
    return Dense(chain.factors, positions(chain, angles), tuple(transforms))


def analyse(dense: Dense, outputs: Sequence[Output], shapley: bool = False, second: bool = False) -> Indices:
    """Exact parts of variance of outputs at the positions of a chain of matrices (m, m).

    Reference and axis of each output are (m,), else ValueError is raised. ``shapley`` effects and ``second``-order
    parts are given if asked for.
    """
    variance, bias, first, interaction = _parts(dense, outputs)

    def totals(z: float) -> Array:
        _, _, alone, company = _parts(dense.scaled(z), outputs)
        return alone + company

    return Indices(
        factors=dense.factors,
        outputs=tuple(output.name for output in outputs),
        units=tuple(output.unit for output in outputs),
        scales=np.array([output.scale for output in outputs]),
        angles=dense.angles,
        variance=variance,
        bias=bias,
        first_variance=first,
        interaction_variance=interaction,
        method={"name": "exact"},
        shapley=shapley_effects(totals, len(dense.factors)) if shapley else None,
        second_variance=_second(dense, outputs) if second else None,
    )


def closed_variance(dense: Dense, outputs: Sequence[Output], factors: Sequence[str]) -> Array:
    """Variance (o, n) that a set of errors causes, alone and among themselves; raises as `analyse`."""
    inside = np.array([name in factors for name in dense.factors], dtype=float)
    return _parts(dense.scaled(inside), outputs)[0]


def _parts(dense: Dense, outputs: Sequence[Output]) -> VarianceParts:
    """The parts of the variance at all positions."""
    q, t = _ends(dense, outputs)
    W = np.zeros((*q.shape, q.shape[-1]))
    ideal, before = q, []
    for element in dense.elements:
        before.append((q, W, ideal))
        if isinstance(element, Random):
            W = _congruent(W, _mean(element)) + _scatter(W + _outer(q), element)
        else:
            ideal, W = _times(ideal, element), _congruent(W, element)
        q = _times(q, _mean(element))

    shape = q.shape[:-1]
    variance, bias = np.zeros(shape), np.zeros(shape)
    first, interaction = np.zeros((*shape, len(dense.factors))), np.zeros((*shape, len(dense.factors)))
    Z = np.zeros_like(W)
    for element, (q, W, ideal) in zip(dense.elements[::-1], before[::-1], strict=True):
        if isinstance(element, Random):
            added = _scatter(Z, _transposed(element))
            alone = sum(
                var * np.square(np.sum(_times(q, A) * t, axis=-1))
                for var, A in zip(element.variances, element.parts, strict=True)
            )
            later = np.einsum("...i,...ij,...j", q, added, q)
            added = added + _scatter(_outer(t), _transposed(element))
            first[..., element.factor] = alone
            interaction[..., element.factor] = later + np.einsum("...ij,...ij", W, added)
            # sets of errors by their first member: accurate where the leading order of all vanishes
            variance += alone + later
            bias += np.sum(_times(ideal, element.shift) * t, axis=-1)
            Z = _congruent(Z, _mean(element).T) + added
        else:
            Z = _congruent(Z, np.swapaxes(element, -1, -2))
        t = _times(t, np.swapaxes(_mean(element), -1, -2))
    spread = sum(
        float(e.variances @ np.sum(np.square(e.parts), axis=(-1, -2)))
        for e in dense.elements
        if isinstance(e, Random)
    )
    return drop_rounding(VarianceParts(variance, bias, first, interaction), outputs, spread)


def _second(dense: Dense, outputs: Sequence[Output]) -> Array:
    """V_ij (o, n, k, k)."""
    q, t = _ends(dense, outputs)
    columns: list[Array] = []
    for element in dense.elements[::-1]:
        columns.insert(0, t)
        t = _times(t, np.swapaxes(_mean(element), -1, -2))
    k = len(dense.factors)
    second = np.zeros((*q.shape[:-1], k, k))
    for e, element in enumerate(dense.elements):
        if isinstance(element, Random):
            for var, A in zip(element.variances, element.parts, strict=True):
                ray = _times(q, A)
                for later, column in zip(dense.elements[e + 1 :], columns[e + 1 :], strict=True):
                    if isinstance(later, Random):
                        pair = sum(
                            var * other * np.square(np.sum(_times(ray, B) * column, axis=-1))
                            for other, B in zip(later.variances, later.parts, strict=True)
                        )
                        second[..., element.factor, later.factor] += pair
                        second[..., later.factor, element.factor] += pair
                    ray = _times(ray, _mean(later))
        q = _times(q, _mean(element))
    return second


def _ends(dense: Dense, outputs: Sequence[Output]) -> tuple[Array, Array]:
    """References and axes (o, n, m) of the outputs at all positions."""
    m = _mean(dense.elements[0]).shape[-1] if dense.elements else 3
    for output in outputs:
        if np.shape(output.reference) != (m,) or np.shape(output.axis) != (m,):
            raise ValueError(
                f"found a reference {np.shape(output.reference)} and an axis {np.shape(output.axis)} of "
                f"{output.name}, expected ({m},) of both"
            )
    shape = (len(outputs), len(dense.angles), m)
    u = np.array([output.reference for output in outputs], dtype=float).reshape(-1, 1, m)
    v = np.array([output.axis for output in outputs], dtype=float).reshape(-1, 1, m)
    return np.broadcast_to(u, shape), np.broadcast_to(v, shape)


def _mean(element: Element) -> Array:
    """Mean matrix (m, m) or (n, m, m)."""
    return np.eye(len(element.shift)) + element.shift if isinstance(element, Random) else element


def _transposed(element: Random) -> Random:
    """The random matrix transposed."""
    return replace(element, shift=element.shift.T, parts=np.swapaxes(element.parts, -1, -2))


def _outer(x: Array) -> Array:
    """x x^T (..., m, m)."""
    return np.asarray(x[..., :, None] * x[..., None, :])


def _times(x: Array, M: Array) -> Array:
    """Rows (..., m) times a matrix."""
    return np.asarray((x[..., None, :] @ M)[..., 0, :])


def _congruent(W: Array, M: Array) -> Array:
    """M^T W M."""
    return np.asarray(np.swapaxes(M, -1, -2) @ W @ M)


def _scatter(F: Array, element: Random) -> Array:
    """Second moments F carried through the parts of an error: sum of var A^T F A."""
    total = np.zeros_like(F)
    for variance, A in zip(element.variances, element.parts, strict=True):
        total += variance * _congruent(F, A)
    return total


def _power(R: Array, degree: int) -> Array:
    """1, R or R x R (..., 1 or 3 or 9, the same)."""
    if degree == 0:
        return np.ones((*R.shape[:-2], 1, 1))
    return R if degree == 1 else _kron(R, R)


def _kron(A: Array, B: Array) -> Array:
    """Kronecker product (..., 9, 9) of matrices (..., 3, 3)."""
    return np.asarray(np.einsum("...ij,...kl->...ikjl", A, B).reshape(*A.shape[:-2], 9, 9))


def _diagonal(parts: Sequence[Array]) -> Array:
    """Block-diagonal matrix (..., m, m)."""
    sizes = [part.shape[-1] for part in parts]
    whole, at = np.zeros((*parts[0].shape[:-2], sum(sizes), sum(sizes))), 0
    for part, size in zip(parts, sizes, strict=True):
        whole[..., at : at + size, at : at + size] = part
        at += size
    return whole


def _random_rotation(error: Error, factor: int, degrees: Sequence[int]) -> Random:
    """Blocks of a random rotation, from the functions s, e, s e, e^2 of `inercal.foundation.sensitivities.exact`.

    R = I + s K - e C, and with s^2 = 2 e - e^2
    R x R = I + s (K x I + I x K) + e (2 K x K - C x I - I x C) - s e (K x C + C x K) + e^2 (C x C - K x K).
    """
    K = skew(np.eye(3)["xyz".index(error.axis)])
    C, one, none = -K @ K, np.eye(3), np.zeros((3, 3))
    of_degree = {
        0: [np.zeros((1, 1))] * 4,
        1: [K, -C, none, none],
        2: [
            _kron(K, one) + _kron(one, K),
            2.0 * _kron(K, K) - _kron(C, one) - _kron(one, C),
            -_kron(K, C) - _kron(C, K),
            _kron(C, C) - _kron(K, K),
        ],
    }
    moment = moments(error.distribution, max(1, *degrees))
    basis = np.stack([_diagonal([of_degree[d][f] for d in degrees]) for f in range(len(moment.mean))])
    shift = np.einsum("f,fij->ij", moment.mean, basis)
    return Random(factor, shift, moment.variance, np.einsum("fp,fij->pij", moment.lower, basis))
