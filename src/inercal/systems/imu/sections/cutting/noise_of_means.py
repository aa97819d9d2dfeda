"""Noise of means by the scatter of samples at rest, whatever its correlation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.noise.dwell_means import equivalent_dof, overlapping_variance, running_sums
from inercal.systems.imu.recording import coarse_steps
from inercal.systems.imu.sections.cutting.limits import LIMITS as FINDING


def variances_of_means(stretches: Sequence[Array], counts: Sequence[int]) -> list[Array]:
    """Variances (3,) of means over so many samples, by the scatter in ``stretches`` (n, 3) at rest, pooled.

    Means over m samples scatter by the Allan variance v(m); m v(m) is constant where noise is white over m samples and
    more. It is averaged from the shortest m on from which no longer one contradicts it: of noise that is white from
    the first sample on all lengths count, of noise that is correlated, or wanders, the long ones alone.
    """
    if not any(len(x) > 2 for x in stretches):
        return [np.full(3, np.nan) for _ in counts]
    dof = sum(len(x) - 1 for x in stretches)
    deviation = np.sqrt(sum(((x - x.mean(axis=0)) ** 2).sum(axis=0) for x in stretches) / dof)
    steps = np.max([coarse_steps(x, deviation) for x in stretches if len(x) > 2], axis=0)
    densities, weights = _densities(stretches)
    first = next(k for k in range(len(weights)) if _constant(densities[k:], weights[k:]))
    first += 0 < first < len(weights) - 1  # the first that is not contradicted still is somewhat low
    density = np.average(densities[first:], axis=0, weights=weights[first:])
    return [np.asarray(density / count + steps**2 / 12.0) for count in counts]


def _densities(stretches: Sequence[Array]) -> tuple[Array, Array]:
    """m v(m) (k, 3) at octaves of m up to half the median length, and their degrees of freedom (k,)."""
    longest = max(int(np.median([len(x) for x in stretches])) // 2, 1)
    sums = [running_sums(x) for x in stretches]
    densities, weights = [], []
    for m in sorted({max(longest // 2**k, 1) for k in range(longest.bit_length())}):
        told = [x for x in sums if len(x) > 2 * m]
        pairs = [len(x) - 2 * m for x in told]
        densities.append(m * np.average([overlapping_variance(x, m) for x in told], axis=0, weights=pairs))
        weights.append(sum(equivalent_dof(len(x) - 1, m) for x in told))
    kept = np.maximum.accumulate(np.array(weights)[::-1])[::-1] >= FINDING.noise_dof
    kept[0] = True
    return np.array(densities)[kept], np.array(weights)[kept]


def _constant(densities: Array, weights: Array) -> bool:
    """True where no later density (k, 3) contradicts the first, by their degrees of freedom (k,)."""
    from scipy.special import digamma, polygamma

    live = (densities > 0.0).all(axis=0)
    if len(densities) == 1 or not live.any():
        return True
    bias, scatter = digamma(0.5 * weights) - np.log(0.5 * weights), polygamma(1, 0.5 * weights)
    logs = np.log(densities[:, live]).mean(axis=1) - bias
    chance = np.sqrt((scatter[1:] + scatter[0]) / np.count_nonzero(live))
    return bool(np.all(np.abs(logs[1:] - logs[0]) < FINDING.noise_change * chance))
