"""Responses of the filter to errors of readings: of its innovations, its angle and its coefficients; compiled.

A reading that is larger by d moves the state by S (n, m), as the filter's own gains K have it,

    S := F S        s = d - h S        S := S + K s

and its innovation by s. Over the root of its variance that is a column beside the white innovations
(`inercal.foundation.inference.scores`): the coefficients are states, so the column has what they take of it already.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from inercal.foundation._jit import allocating
from inercal.systems.aoa.fusion.loop import Memory

Array: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.int64]


_NOTHING = 1e-10
"""Response of which a rounding is nothing: its square is no subnormal number yet."""


def respond(
    S: Array, memory: Memory, moving: Indices, low: Indices, courses: Array, group: Indices, z: Array, X: Array,
    angle: Array,
) -> None:  # fmt: skip
    """Take the response ``S`` (n, m) of the state, in place, through the rows of a filter's ``memory``.

    Columns ``low[i]`` to ``low[i + 1]`` are errors of channel i, accelerometers first, then the gyro, as large as
    ``courses`` (b, m) in each of b rows. Whitened innovations are summed into ``z`` (g, N + 1) by the ``group`` (b,)
    of each row, 0 where nothing is read, and their columns into ``X`` (g, N + 1, m); ``angle`` (g, m) receives the
    response of theta after the last row of each group.
    """
    _respond(S, memory.steps, memory.scalars, moving, low, courses, group, z, X, angle)


@allocating
def _respond(
    S: Array, steps: Array, scalars: Array, moving: Indices, low: Indices, courses: Array, group: Indices,
    z: Array, X: Array, angle: Array,
) -> None:  # fmt: skip
    """The loop of `respond`, in single precision: seven digits of a response are enough, and it takes half the time."""
    n, m, d, channels = S.shape[0], S.shape[1], len(moving), len(low) - 1
    one, nothing = np.float32(1.0), np.float32(_NOTHING)
    R, s, top = np.empty((n, m), np.float32), np.empty(m, np.float32), np.empty((d, m), np.float32)
    summed = np.zeros((channels, m), np.float32)
    for a in range(n):
        for e in range(m):
            R[a, e] = S[a, e]
    for k in range(len(group)):
        g = group[k]
        for i in range(d):
            for e in range(m):
                top[i, e] = 0.0
            for j in range(d):
                f = np.float32(steps[k, j, i])
                if f != 0.0:
                    a = moving[j]
                    for e in range(m):
                        top[i, e] += f * R[a, e]
        for i in range(d):
            a = moving[i]
            for e in range(m):
                R[a, e] = top[i, e]
        for i in range(channels + 1):
            variance = scalars[k, i, 2 * n + 1]
            if not variance > 0.0:
                continue
            for e in range(m):
                s[e] = 0.0
            if i < channels:
                for e in range(low[i], low[i + 1]):
                    s[e] = courses[k, e]
            for a in range(n):
                h = np.float32(scalars[k, i, a])
                if h != 0.0:
                    for e in range(m):
                        s[e] -= h * R[a, e]
            for a in range(n):
                gain = np.float32(scalars[k, i, n + a] / variance)
                if gain != 0.0:
                    for e in range(m):
                        R[a, e] += gain * s[e]
            if i < channels:
                by_root = one / np.float32(np.sqrt(variance))
                z[g, i] += scalars[k, i, 2 * n] / np.sqrt(variance)
                for e in range(m):
                    summed[i, e] += by_root * s[e]
        if k + 1 == len(group) or group[k + 1] != g:
            for a in range(n):
                for e in range(
                    m
                ):  # what has died away is 0, and no subnormal number, which takes a hundred times as long
                    R[a, e] = (R[a, e] + nothing) - nothing
            for e in range(m):
                angle[g, e] = R[0, e]
            for i in range(channels):
                for e in range(m):
                    X[g, i, e] = (summed[i, e] + nothing) - nothing
                    summed[i, e] = 0.0
    for a in range(n):
        for e in range(m):
            S[a, e] = R[a, e]
