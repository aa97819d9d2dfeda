"""Compiled passes of the exact analysis of a chain of rotations, 3 x 3, position by position.

An output is u_n M_1 ... M_m v_b. A forward pass carries the row u_n through the chain, a backward pass the column
v_b; both carry the state (12,) of a random vector, for one is the transpose of the other::

    state[0:3]    its mean
    state[3:6]    variances of its components
    state[6:9]    covariances, each at the place of the component that is not in it
    state[9:12]   the same vector on the rig without errors

An error about axis a acts in the plane (b, c) of the two axes that follow a cyclically. With
J = [[0, -1], [1, 0]] its rotation there is, in terms of `inercal.foundation.sensitivities.dense`,
(1 - mean e) + (mean s) J + xi_1 (J + slope) + xi_2, with slope = cov(cos, sin) / var(sin). `ERROR_ROW` is the order
of the five numbers in an array ``errors`` (k, 5).
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from inercal.foundation._jit import allocating, kernel
from inercal.foundation.arrays import Array
from inercal.foundation.sensitivities.indices import VarianceParts

Integers: TypeAlias = NDArray[np.int64]

ERROR_ROW = ("mean of cos - 1", "mean of sin", "variance of xi_1", "variance of xi_2", "slope")

FIXED, JOINT, ERROR = 0, 1, 2
"""First column of ``elements`` (m, 3): what it is. Then its axis (0, 1, 2), then its row or column in ``fixed``,
``angles`` or ``errors``."""


class Rig(NamedTuple):
    """A chain, its positions and outputs.

    ``elements`` (m, 3): for each its kind (`FIXED`, `JOINT`, `ERROR`) and its places; ``fixed`` (2, f, 3, 3) known
    rotations, and their transposes; ``errors`` (k, 5), a row for each error, packed as `ERROR_ROW` says: error i gives
    column i of the results; ``angles`` (n, joints) [rad]; ``u`` (r, 3) and ``v`` (c, 3) distinct references in the base
    frame and distinct axes of the instrument; ``outputs`` (o, 2) rows of u and v of each output.
    """

    elements: Integers
    fixed: Array
    errors: Array
    angles: Array
    u: Array
    v: Array
    outputs: Integers


class Rays(NamedTuple):
    """States of all rows (r, m + 1, 12) and columns (c, m + 1, 12) at one position, and the cosine and sine of each
    joint (joints, 2) there."""

    rows: Array
    columns: Array
    cosines: Array


@kernel
def spread(
    f_bb: float, f_cc: float, f_bc: float, v1: float, v2: float, slope: float
) -> tuple[float, float, float]:
    """Second moments F in the plane of an error, carried through its parts: sum of var A^T F A (bb, cc, bc).

    A^T of J + slope is -(J - slope): for A F A^T give -slope.
    """
    return (
        v1 * (slope * (slope * f_bb + 2.0 * f_bc) + f_cc) + v2 * f_bb,
        v1 * (slope * (slope * f_cc - 2.0 * f_bc) + f_bb) + v2 * f_cc,
        v1 * (slope * (slope * f_bc + f_cc - f_bb) - f_bc) + v2 * f_bc,
    )


@kernel
def turn(
    states: Array, ray: int, before: int, after: int, axis: int, c: float, s: float, is_error: bool
) -> None:
    """One state to the next through the mean c + s J of a rotation; an error leaves the ideal vector alone."""
    x = states[ray, before]
    y = states[ray, after]
    b = axis + 1 if axis < 2 else 0
    d = axis - 1 if axis > 0 else 2
    w_bb, w_cc, w_bc = x[3 + b], x[3 + d], x[6 + axis]
    y[axis] = x[axis]
    y[b] = c * x[b] + s * x[d]
    y[d] = c * x[d] - s * x[b]
    y[3 + axis] = x[3 + axis]
    y[3 + b] = c * c * w_bb + s * s * w_cc + 2.0 * c * s * w_bc
    y[3 + d] = s * s * w_bb + c * c * w_cc - 2.0 * c * s * w_bc
    y[6 + axis] = (c * c - s * s) * w_bc + c * s * (w_cc - w_bb)
    y[6 + d] = c * x[6 + d] + s * x[6 + b]
    y[6 + b] = c * x[6 + b] - s * x[6 + d]
    if is_error:
        y[9], y[10], y[11] = x[9], x[10], x[11]
    else:
        y[9 + axis] = x[9 + axis]
        y[9 + b] = c * x[9 + b] + s * x[9 + d]
        y[9 + d] = c * x[9 + d] - s * x[9 + b]


@kernel
def scatter(
    states: Array, ray: int, before: int, after: int, axis: int, v1: float, v2: float, slope: float
) -> None:
    """Add what the parts of an error scatter."""
    x = states[ray, before]
    y = states[ray, after]
    b = axis + 1 if axis < 2 else 0
    d = axis - 1 if axis > 0 else 2
    g_bb, g_cc, g_bc = spread(
        x[3 + b] + x[b] * x[b], x[3 + d] + x[d] * x[d], x[6 + axis] + x[b] * x[d], v1, v2, slope
    )
    y[3 + b] += g_bb
    y[3 + d] += g_cc
    y[6 + axis] += g_bc


@kernel
def transform(states: Array, ray: int, before: int, after: int, M: Array) -> None:
    """One state to the next through a known matrix (3, 3): mean M, M^T covariance M."""
    x = states[ray, before]
    y = states[ray, after]
    for i in range(3):
        y[i] = x[0] * M[0, i] + x[1] * M[1, i] + x[2] * M[2, i]
        y[9 + i] = x[9] * M[0, i] + x[10] * M[1, i] + x[11] * M[2, i]
        for j in range(i, 3):
            total = 0.0
            for k in range(3):
                total += x[3 + k] * M[k, i] * M[k, j]
                b, d = (k + 1) % 3, (k + 2) % 3
                total += x[6 + k] * (M[b, i] * M[d, j] + M[d, i] * M[b, j])
            y[3 + i if i == j else 9 - i - j] = total


@kernel
def advance(
    states: Array, ray: int, e: int, element: Array, fixed: Array, errors: Array, cosines: Array, sign: float
) -> None:
    """Through element ``e``: forward (sign +1) from state e to e + 1, backward (sign -1) from e + 1 to e.

    ``cosines`` (joints, 2) cosine and sine of each joint; ``fixed`` (2, f, 3, 3) the matrices and their transposes.
    """
    what, axis, place = element[0], element[1], element[2]
    before, after = (e, e + 1) if sign > 0.0 else (e + 1, e)
    if what == FIXED:
        transform(states, ray, before, after, fixed[0 if sign > 0.0 else 1, place])
    elif what == JOINT:
        turn(states, ray, before, after, axis, cosines[place, 0], sign * cosines[place, 1], False)
    else:
        turn(states, ray, before, after, axis, 1.0 + errors[place, 0], sign * errors[place, 1], True)
        scatter(states, ray, before, after, axis, errors[place, 2], errors[place, 3], sign * errors[place, 4])


@kernel
def parts(
    rows: Array, columns: Array, r: int, c: int, e: int, axis: int, error: Array
) -> tuple[float, float, float, float]:
    """Contribution of the error at element ``e`` to an output with forward row r and backward column c.

    Returns
    -------
    first : V_i
    interaction : VT_i - V_i
    variance : of all subsets of factors in which this one is the first of the chain; summed over the factors it is
        the variance of the output, and stays accurate where the leading order of all factors vanishes
    bias : summed over the factors, the expectation of the error of the output
    """
    x = rows[r, e]
    y = columns[c, e + 1]
    b = axis + 1 if axis < 2 else 0
    d = axis - 1 if axis > 0 else 2
    v1, v2, slope = error[2], error[3], error[4]
    q_b, q_c, t_b, t_c = x[b], x[d], y[b], y[d]
    along = q_b * t_b + q_c * t_c
    across = q_c * t_b - q_b * t_c + slope * along
    first = v1 * across * across + v2 * along * along
    h_bb, h_cc, h_bc = spread(y[3 + b], y[3 + d], y[6 + axis], v1, v2, -slope)
    later = q_b * q_b * h_bb + q_c * q_c * h_cc + 2.0 * q_b * q_c * h_bc
    g_bb, g_cc, g_bc = spread(t_b * t_b, t_c * t_c, t_b * t_c, v1, v2, -slope)
    w_bb, w_cc, w_bc = x[3 + b], x[3 + d], x[6 + axis]
    earlier = w_bb * (g_bb + h_bb) + w_cc * (g_cc + h_cc) + 2.0 * w_bc * (g_bc + h_bc)
    p_b, p_c = x[9 + b], x[9 + d]
    bias = error[0] * (p_b * t_b + p_c * t_c) + error[1] * (p_c * t_b - p_b * t_c)
    return first, later + earlier, first + later, bias


@kernel
def carry(n: int, begin: int, rig: Rig, rays: Rays) -> None:
    """States of all rows and columns at position ``n``, going on from position ``n - 1`` unless that is before begin.

    What lies before the first joint that moved, and after the last one, is as it was.
    """
    elements, fixed, errors, angles, _, _, _ = rig
    rows, columns, cosines = rays
    m = len(elements)
    low, high = m, -1
    for e in range(m):
        place = elements[e, 2]
        if n == begin or (elements[e, 0] == JOINT and angles[n, place] != angles[n - 1, place]):
            low, high = min(low, e), e
            if elements[e, 0] == JOINT:
                cosines[place, 0], cosines[place, 1] = math.cos(angles[n, place]), math.sin(angles[n, place])
    for e in range(low, m):
        for r in range(len(rows)):
            advance(rows, r, e, elements[e], fixed, errors, cosines, 1.0)
    for e in range(high, -1, -1):
        for c in range(len(columns)):
            advance(columns, c, e, elements[e], fixed, errors, cosines, -1.0)


@allocating
def start(vectors: Array, at: int, length: int) -> Array:
    """States (r, length, 12) with the vectors (r, 3) at one end, without scatter."""
    states = np.zeros((len(vectors), length, 12))
    for r in range(len(vectors)):
        for i in range(3):
            states[r, at, i] = states[r, at, 9 + i] = vectors[r, i]
    return states


@allocating
def begun(rig: Rig) -> Rays:
    """The rows at the first element and the columns after the last one."""
    m = len(rig.elements)
    return Rays(start(rig.u, 0, m + 1), start(rig.v, m, m + 1), np.zeros((rig.angles.shape[1], 2)))


@allocating
def analyse(begin: int, end: int, rig: Rig, results: VarianceParts) -> None:
    """Parts of the variance at the positions ``begin`` to ``end``; columns without an element are left alone."""
    elements, errors, outputs = rig.elements, rig.errors, rig.outputs
    variance, bias, first, interaction = results
    rays = begun(rig)
    rows, columns, _ = rays
    for n in range(begin, end):
        carry(n, begin, rig, rays)
        for o in range(len(outputs)):
            r, c = outputs[o, 0], outputs[o, 1]
            all_variance, all_bias = 0.0, 0.0
            for e in range(len(elements)):
                if elements[e, 0] == ERROR:
                    k = elements[e, 2]
                    variances = parts(rows, columns, r, c, e, elements[e, 1], errors[k])
                    first[o, n, k], interaction[o, n, k] = variances[0], variances[1]
                    all_variance += variances[2]
                    all_bias += variances[3]
            variance[o, n], bias[o, n] = all_variance, all_bias


@allocating
def second_order(begin: int, end: int, rig: Rig, second: Array) -> None:
    """Parts V_ij of the variance caused by pairs of errors, into ``second`` (o, n, k, k).

    Each part of the earlier error, met by the mean row, is carried on by means to the later error.
    """
    elements, fixed, errors, outputs = rig.elements, rig.fixed, rig.errors, rig.outputs
    m = len(elements)
    rays = begun(rig)
    rows, columns, cosines = rays
    ray = np.zeros((1, m + 1, 12))
    for n in range(begin, end):
        carry(n, begin, rig, rays)
        for r in range(len(rows)):
            for e in range(m):
                if elements[e, 0] != ERROR:
                    continue
                axis, i = elements[e, 1], elements[e, 2]
                b, d = (axis + 1) % 3, (axis + 2) % 3
                for part in range(2):
                    slope, across = (errors[i, 4], 1.0) if part == 0 else (1.0, 0.0)
                    for i_state in range(12):
                        ray[0, e + 1, i_state] = 0.0
                    ray[0, e + 1, b] = slope * rows[r, e, b] + across * rows[r, e, d]
                    ray[0, e + 1, d] = slope * rows[r, e, d] - across * rows[r, e, b]
                    for later in range(e + 1, m):
                        if elements[later, 0] == ERROR:
                            j = elements[later, 2]
                            for o in range(len(outputs)):
                                if outputs[o, 0] == r:
                                    variances = parts(
                                        ray, columns, 0, outputs[o, 1], later, elements[later, 1], errors[j]
                                    )
                                    second[o, n, i, j] += errors[i, 2 + part] * variances[0]
                                    second[o, n, j, i] = second[o, n, i, j]
                        advance(ray, 0, later, elements[later], fixed, errors, cosines, 1.0)
