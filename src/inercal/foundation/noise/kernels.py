"""Compiled loops of Allan analysis: squares of second differences, and their covariances by kind of noise."""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from inercal.foundation._jit import allocating, kernel

Array: TypeAlias = NDArray[np.float64]
Integers: TypeAlias = NDArray[np.int64]
Counts: TypeAlias = NDArray[np.int32]

KINDS = 4
"""Kinds of noise in `curvature` and `covariance_sums`: N, B, K and Q."""


@kernel
def mean_square(sums: Array, m: int) -> float:
    """Mean square of S[i+2m] - 2 S[i+m] + S[i] over all i; ``sums`` (n+1,) are running sums of samples.

    Four sums side by side, so that an addition need not wait for the one before.
    """
    count = len(sums) - 2 * m
    a = b = c = d = 0.0
    for j in range(count // 4):
        i = 4 * j
        p = sums[i + 2 * m] - 2.0 * sums[i + m] + sums[i]
        q = sums[i + 1 + 2 * m] - 2.0 * sums[i + 1 + m] + sums[i + 1]
        r = sums[i + 2 + 2 * m] - 2.0 * sums[i + 2 + m] + sums[i + 2]
        s = sums[i + 3 + 2 * m] - 2.0 * sums[i + 3 + m] + sums[i + 3]
        a += p * p
        b += q * q
        c += r * r
        d += s * s
    for i in range(count - count % 4, count):
        p = sums[i + 2 * m] - 2.0 * sums[i + m] + sums[i]
        a += p * p
    return ((a + b) + (c + d)) / count


@allocating
def mean_square_with_gaps(
    sums: Array, present: Counts, runs: Counts, m: int, least: int
) -> tuple[float, int, float, float]:
    """The same of D, m times the difference of adjacent means over the samples present, and how many there are.

    Also its expectations for white samples of variance 1 and for their differences (quantisation): each run
    of present samples within a mean has two ends that no neighbour cancels, of weight 1 in m over those present; where
    a run goes on into the other mean, its ends there add up.

    ``sums``, ``present`` and ``runs`` (n+1,) are running sums of samples (missing ones as 0), of their number and of
    the number of runs begun; both means need ``least`` samples. All 0 where there is none.
    """
    total = white = steps = 0.0
    one = two = 0.0
    pairs = i = 0
    count = len(sums) - 2 * m
    parts = m / np.arange(max(least, 1), m + 1)
    while i < count:
        k = i + m
        # eight in a row between gaps: as many samples in each mean, and as many runs
        even = (
            i + 8 <= count
            and present[i + 8] - present[i] == 8
            and present[k + 8] - present[k - 1] == 9
            and present[k + m + 7] - present[k + m - 1] == 8
        )
        alike = 8 if even else 1
        before = present[k] - present[i]
        after = present[k + m] - present[k]
        if before >= least and after >= least:
            a = parts[before - least]
            b = parts[after - least]
            if even:
                for h in range(i, i + 8, 2):
                    p = b * (sums[h + 2 * m] - sums[h + m]) - a * (sums[h + m] - sums[h])
                    q = b * (sums[h + 1 + 2 * m] - sums[h + 1 + m]) - a * (sums[h + 1 + m] - sums[h + 1])
                    one += p * p
                    two += q * q
            else:
                d = b * (sums[k + m] - sums[k]) - a * (sums[k] - sums[i])
                total += d * d
            pairs += alike
            white += alike * (m * (a + b))
            # runs begun after a mean's first sample, and one that this belongs to
            here = runs[k] - runs[i + 1] + present[i + 1] - present[i]
            there = runs[k + m] - runs[k + 1] + present[k + 1] - present[k]
            goes_on = (present[k] - present[k - 1]) * (present[k + 1] - present[k])
            steps += alike * (2.0 * (a * a * here + b * b * there + a * b * goes_on))
        i += alike
    if pairs == 0:
        return 0.0, 0, 0.0, 0.0
    return (total + (one + two)) / pairs, pairs, white / pairs, steps / pairs


@kernel
def flicker(t: float) -> float:
    """t^2 ln|t|."""
    return t * t * math.log(abs(t)) if t != 0.0 else 0.0


@kernel
def curvature(lag: int, m: int, out: Array) -> None:
    """R(l - m) - 2 R(l) + R(l + m) of the generalised autocovariances R of phase (4,), each kind of unit size.

    Beyond ``m`` in closed form, lest its digits cancel: R grows as l^3 and this as l.
    """
    t = float(abs(lag))
    a = float(m)
    if t >= a and lag:
        e = a / t
        part = (1.0 + e) * (1.0 + e) * math.log1p(e)
        if t > a:
            part += (1.0 - e) * (1.0 - e) * math.log1p(-e)
        out[0] = 0.0
        out[1] = (2.0 * a * a * math.log(t) + t * t * part) / (2.0 * math.pi)
        out[2] = 0.5 * t * a * a
    else:
        out[0] = t - a
        out[1] = (flicker(t + a) + flicker(t - a) - 2.0 * flicker(t)) / (2.0 * math.pi)
        out[2] = ((a + t) ** 3 + (a - t) ** 3 - 2.0 * t**3) / 12.0
    out[3] = (1.0 if t == a else 0.0) - (2.0 if lag == 0 else 0.0)


@allocating
def covariance_sums(
    lags: Integers, weights: Array, m: int, other: int, products: Array, singles: Array
) -> None:
    """Add up C_k(l) C_h(l) (4, 4) and C_k(l) (4,) over weighted lags.

    C_k(l) is the covariance of second differences over ``m`` and ``other`` samples with centres ``l`` apart, for
    one kind of noise of unit size.
    """
    before = np.empty(KINDS)
    at = np.empty(KINDS)
    after = np.empty(KINDS)
    for n in range(len(lags)):
        curvature(lags[n] - other, m, before)
        curvature(lags[n], m, at)
        curvature(lags[n] + other, m, after)
        for k in range(KINDS):
            at[k] = before[k] - 2.0 * at[k] + after[k]
        for k in range(KINDS):
            singles[k] += weights[n] * at[k]
            for h in range(KINDS):
                products[k, h] += weights[n] * at[k] * at[h]
